//! defmt log into a ring, which the control loop sends over the link. Lines that do not fit are dropped as a whole, and
//! a frame number is skipped. Encoding takes some hundred instructions with interrupts off, so motor handlers never
//! log. Output is copied in short pieces: a received byte may wait 5 us, a motor step less.

use core::cell::{RefCell, UnsafeCell};

use critical_section::{Mutex, RestoreState};
use defmt::Encoder;
use farnear_protocol::Log;
use heapless::Deque;

/// Some twenty lines.
const RING: usize = 1024;
/// Bytes copied with interrupts off: below 2 us.
const PIECE: usize = 16;

struct Ring {
    bytes: Deque<u8, RING>,
    line: usize,
    dropping: bool,
    number: u32,
}

impl Ring {
    fn push(&mut self, bytes: &[u8]) {
        for byte in bytes {
            if !self.dropping && self.bytes.push_back(*byte).is_err() {
                self.dropping = true;
                while self.bytes.len() > self.line {
                    self.bytes.pop_back();
                }
                self.number = self.number.wrapping_add(1);
            }
        }
    }
}

static LOG: Mutex<RefCell<Ring>> =
    Mutex::new(RefCell::new(Ring { bytes: Deque::new(), line: 0, dropping: false, number: 0 }));

struct State {
    encoder: Encoder,
    restore: RestoreState,
}

struct Shared(UnsafeCell<State>);

// SAFETY: only used between `acquire` and `release` of the logger, which is one critical section.
unsafe impl Sync for Shared {}

static STATE: Shared =
    Shared(UnsafeCell::new(State { encoder: Encoder::new(), restore: RestoreState::invalid() }));

fn append(bytes: &[u8]) {
    critical_section::with(|cs| LOG.borrow_ref_mut(cs).push(bytes));
}

/// Logged bytes, at most a frame, with the frame's number.
pub fn take_log() -> Option<(u32, Log)> {
    let mut log = Log::default();
    let mut number = None;
    while critical_section::with(|cs| {
        let mut ring = LOG.borrow_ref_mut(cs);
        let before = log.bytes.len();
        while log.bytes.len() < before + PIECE
            && !log.bytes.is_full()
            && let Some(byte) = ring.bytes.pop_front()
        {
            // There is room, as checked above.
            let _ = log.bytes.push(byte);
        }
        // A line dropped between two pieces belongs after this frame.
        if number.is_none() && !log.bytes.is_empty() {
            number = Some(ring.number);
            ring.number = ring.number.wrapping_add(1);
        }
        log.bytes.len() == before + PIECE
    }) {}
    number.map(|number| (number, log))
}

#[defmt::global_logger]
struct Logger;

// SAFETY: `acquire` enters a critical section that `release` leaves, so nothing else logs in between; no code in
// between logs itself.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: `release` leaves it.
        let restore = unsafe { critical_section::acquire() };
        critical_section::with(|cs| {
            let mut ring = LOG.borrow_ref_mut(cs);
            ring.line = ring.bytes.len();
            ring.dropping = false;
        });
        // SAFETY: inside the critical section just entered.
        let state = unsafe { &mut *STATE.0.get() };
        state.restore = restore;
        state.encoder.start_frame(append);
    }

    unsafe fn flush() {}

    unsafe fn write(bytes: &[u8]) {
        // SAFETY: between `acquire` and `release`.
        let state = unsafe { &mut *STATE.0.get() };
        state.encoder.write(bytes, append);
    }

    unsafe fn release() {
        // SAFETY: as in `write`.
        let state = unsafe { &mut *STATE.0.get() };
        state.encoder.end_frame(append);
        // SAFETY: entered in `acquire`.
        unsafe { critical_section::release(state.restore) };
    }
}
