//! The log: defmt's frames into a ring, from which the control loop takes them for the link.
//!
//! A line that does not fit is dropped as a whole, and the log's frames then skip a number, so that its reader knows.
//! Logging costs the encoding (some hundred instructions) with interrupts off, so handlers of the motors log nothing. What is
//! taken for the link is copied in short pieces: a byte on the line may wait for 5 us, and a step of the motors for less.

use core::cell::{RefCell, UnsafeCell};

use critical_section::{Mutex, RestoreState};
use defmt::Encoder;
use farnear_protocol::Log;
use heapless::Deque;

/// Bytes that can wait: some twenty lines.
const RING: usize = 1024;
/// Bytes that are copied with interrupts off: below 2 us.
const PIECE: usize = 16;

struct Ring {
    bytes: Deque<u8, RING>,
    /// Where the line that is being written begins.
    line: usize,
    dropping: bool,
    /// Number of the next frame.
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

/// What has been logged, at most a frame's worth, with the frame's number.
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
            // There is room, as was just seen.
            let _ = log.bytes.push(byte);
        }
        // A line that is dropped between two pieces belongs behind this frame.
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
