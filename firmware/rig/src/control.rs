//! The control loop of all boards.
//!
//! A board implements [`Board`] and calls [`Control::tick`] [`crate::io::TICK_HZ`] times a second. Order within a tick:
//! 1. The gauge is sampled first for even spacing; the converter is read at the end of step 2.
//! 2. Bytes from the link go to the rig, then the hardware is read. The emergency stop is read after the step timers:
//!    its circuit stops them in hardware, and opening between both reads must not look like an underrun.
//! 3. The rig decides, and its outputs are applied. A stop request waits only for earlier requests.
//! 4. One task for the host, for which a tick has time besides two motors and the piezo: send a frame (answers and
//!    events, then the log, which continuous requests cannot block forever), encode an answer, or execute a request. It
//!    is deferred in ticks with a memory write or a completed frame.
//! 5. The watchdog is fed last, so that any hang leaves it unfed.
//!
//! An idle rig without requests for [`QUIET_TICKS`] executes only every [`REST_TICKS`]th tick, so that the processor
//! does not warm the optics. A byte, switch, alarm or step off the piezo's target ends this. A reset ordered by the rig
//! waits for the current frame, at most [`LAST_FRAME`]; nothing else is done meanwhile.

use farnear_protocol::frame::{Header, Kind, delimited, encode};
use farnear_protocol::message::LinkRate;
use farnear_protocol::{BoardMicros, Log, Micros, PROTOCOL_CURRENT};

use crate::Rig;
use crate::io::{ExposureEdges, Inputs, MotorInputs, Outputs, REST_TICKS, StrobeEdges, TICK_HZ};
use crate::motion::since;
pub use crate::notes::Note;

const FRAMES_BEFORE_LOG: u8 = 8;
/// Ticks without byte, frame or request before resting: 20 ms. More frequent ones are answered immediately.
pub const QUIET_TICKS: u32 = TICK_HZ / 50;
/// Limit for the last frame before a reset: the longest takes 1.3 ms, and one may wait before it.
pub const LAST_FRAME: Micros = Micros(10_000);

/// Hardware of a board. No method blocks.
pub trait Board {
    fn now(&mut self) -> BoardMicros;

    /// Passes received bytes; returns `true` if some may have been lost.
    fn receive(&mut self, take: impl FnMut(u8)) -> bool;

    fn sample_gauge(&mut self);

    fn gauge(&mut self) -> Option<u32>;

    fn coarse(&mut self) -> MotorInputs;

    fn lens(&mut self) -> MotorInputs;

    /// Whether the circuit is or was open since the last call.
    fn emergency_stop(&mut self) -> bool;

    fn supply_low(&mut self) -> bool;

    fn memory_failed(&mut self) -> bool;

    /// With stamps before `now`, like [`Self::strobe`].
    fn exposure(&mut self, now: BoardMicros) -> Option<ExposureEdges>;

    fn strobe(&mut self, now: BoardMicros) -> Option<StrobeEdges>;

    /// Applies the outputs in order of their fields, except the reset.
    fn apply(&mut self, outputs: &Outputs);

    fn has_room(&self) -> bool;

    /// Sends a frame, delimiters included ([`farnear_protocol::frame::Delimited`]); requires room.
    fn send(&mut self, bytes: &[u8]);

    fn all_sent(&self) -> bool;

    fn set_link_rate(&mut self, rate: LinkRate);

    /// The next part of the log and its number.
    fn take_log(&mut self) -> Option<(u32, Log)>;

    fn note(&mut self, note: Note);

    fn feed_watchdog(&mut self);

    fn reset(&mut self);
}

#[derive(Debug)]
pub struct Control<'r> {
    rig: &'r mut Rig,
    dry: bool,
    reset_pending: Option<BoardMicros>,
    frames_before_log: u8,
    deferred: bool,
    quiet_ticks: u32,
}

impl<'r> Control<'r> {
    pub const fn new(rig: &'r mut Rig) -> Self {
        Self { rig, dry: false, reset_pending: None, frames_before_log: 0, deferred: false, quiet_ticks: 0 }
    }

    /// Executes a tick; returns the interval to the next one, in ticks.
    pub fn tick(&mut self, board: &mut impl Board) -> u32 {
        if let Some(since) = self.reset_pending {
            leave(board, since);
            return 1;
        }
        board.sample_gauge();
        let frames = self.rig.frames_received();
        let mut heard = false;
        let link_overflow = board.receive(|byte| {
            heard = true;
            self.rig.receive(byte);
        });
        let frame_came = self.rig.frames_received() != frames;
        let gauge_code = board.gauge();
        let inputs = read(board, gauge_code, link_overflow);
        self.tell_of_dry_queues(board, &inputs);
        if self.rig.stop_waits() {
            self.rig.serve(inputs.now);
        }
        let outputs = self.rig.tick(&inputs);
        board.apply(&outputs);
        if let Some(note) = self.rig.take_note() {
            board.note(note);
        }
        if let Some(rate) = self.rig.link_rate_due(inputs.now, || board.all_sent()) {
            board.set_link_rate(rate);
        }
        // Continuous frames defer it by one tick at most; memory writes skip a tick on their own.
        let has_time = outputs.memory.is_none() && (!frame_came || self.deferred);
        self.deferred = !has_time;
        let acted = !has_time || self.speak(board) || self.rig.serve(inputs.now);
        if outputs.reset {
            board.note(Note::Reset);
            let now = board.now();
            self.reset_pending = Some(now);
            leave(board, now);
            return 1;
        }
        board.feed_watchdog();
        self.quiet_ticks = if heard || acted { 0 } else { self.quiet_ticks.saturating_add(1) };
        if self.quiet_ticks >= QUIET_TICKS && self.rig.rest() { REST_TICKS } else { 1 }
    }

    fn tell_of_dry_queues(&mut self, board: &mut impl Board, inputs: &Inputs) {
        let dry = inputs.coarse.stepper.underrun || inputs.lens.stepper.underrun;
        if dry && !self.dry {
            board.note(Note::StepQueueDry { time: inputs.now });
        }
        self.dry = dry;
    }

    /// Sends a frame; returns whether there was one with room.
    fn speak(&mut self, board: &mut impl Board) -> bool {
        if !board.has_room() {
            return false;
        }
        let log_is_due = self.frames_before_log >= FRAMES_BEFORE_LOG;
        if log_is_due && self.speak_log(board) {
            return true;
        }
        let Some(frame) = self.rig.transmit() else {
            // A pending answer has priority over the log.
            return !self.rig.has_work() && self.speak_log(board);
        };
        self.frames_before_log = self.frames_before_log.saturating_add(1);
        board.send(&delimited(&frame));
        true
    }

    /// Sends a part of the log, if any; not before the first session, because a connecting host drops older input.
    fn speak_log(&mut self, board: &mut impl Board) -> bool {
        if !self.rig.has_session() {
            return false;
        }
        let Some((id, log)) = board.take_log() else { return false };
        self.frames_before_log = 0;
        let header = Header { version: PROTOCOL_CURRENT, kind: Kind::Log, id, boot: self.rig.boot() };
        if let Some(frame) = encode(header, &log) {
            board.send(&delimited(&frame));
        }
        true
    }
}

/// Reads the hardware in the order of the module's documentation.
fn read(board: &mut impl Board, gauge_code: Option<u32>, link_overflow: bool) -> Inputs {
    let now = board.now();
    let (coarse, lens) = (board.coarse(), board.lens());
    let emergency_stop = board.emergency_stop();
    Inputs {
        now,
        coarse,
        lens,
        gauge_code,
        emergency_stop,
        supply_low: board.supply_low(),
        memory_failed: board.memory_failed(),
        link_overflow,
        exposure: board.exposure(now),
        strobe: board.strobe(now),
    }
}

fn leave(board: &mut impl Board, asked: BoardMicros) {
    if board.all_sent() || since(asked, board.now()) >= LAST_FRAME {
        board.reset();
    }
}
