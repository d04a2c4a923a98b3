//! The control loop: what a board does in a tick, and in which order.
//!
//! A board implements [`Board`], a few small things that only it can do, and calls [`Control::tick`]
//! [`crate::io::TICK_HZ`] times a second. The order is here, once for all boards:
//!
//! 1. The strain gauge is sampled, so that its samples come evenly whatever else a tick has to do. Its converter takes some microseconds;
//!    what it says is read at the end of the second step.
//! 2. Bytes from the link go to the rig, where whole requests wait. Then the rest of the hardware is read. The
//!    emergency stop comes after the step timers: its circuit stops them by itself, and one that opens between the two
//!    readings must not look like a timer that ran dry.
//! 3. A request to stop waits for nothing but what was asked before it. The rig decides, and its outputs are carried out.
//! 4. One thing is done for the host, for a tick has time for one beside two motors and the piezo: a frame is sent where the link
//!    takes one and there is something to say, answers and events first, then the log, which a host that asks without
//!    a pause does not keep waiting for ever; or else an answer is put into its frame; or else a request is carried out. In a tick in
//!    which the memory was written, or a frame came to its end, this waits for the next.
//! 5. The watchdog is fed. It comes last, so that whatever hangs in a tick leaves it not fed.
//!
//! A rig at which nothing moves and to which nobody has spoken for [`QUIET_TICKS`] rests: then only every [`REST_TICKS`]th tick is
//! carried out, for a processor that sleeps warms no optics. The first byte, switch, alarm or step off the piezo's target ends it.
//!
//! A reset that the rig orders waits for the frame under way, at most [`LAST_FRAME`]; nothing else is done meanwhile.

use farnear_protocol::frame::{Header, Kind, delimited, encode};
use farnear_protocol::message::LinkRate;
use farnear_protocol::{BoardMicros, Log, Micros, PROTOCOL_CURRENT};

use crate::Rig;
use crate::io::{ExposureEdges, Inputs, MotorInputs, Outputs, REST_TICKS, StrobeEdges, TICK_HZ};
use crate::motion::since;
pub use crate::notes::Note;

/// Answers and events after which the log has a turn.
const FRAMES_BEFORE_LOG: u8 = 8;
/// Ticks without a byte, a frame or a request after which the rig may rest: 20 ms. A host that asks more often is answered at once.
pub const QUIET_TICKS: u32 = TICK_HZ / 50;
/// A reset waits so long for the last frame: the longest takes 1.3 ms on the wire, and one may wait before it.
pub const LAST_FRAME: Micros = Micros(10_000);

/// The hardware of a board, as the loop sees it. Each method does one thing, at once.
pub trait Board {
    /// The board's time.
    fn now(&mut self) -> BoardMicros;

    /// Hands over the bytes that came in over the link; `true` where some may have been lost.
    fn receive(&mut self, take: impl FnMut(u8)) -> bool;

    /// Samples the strain gauge; its converter is at work from now on.
    fn sample_gauge(&mut self);

    /// What the converter made of the sample, once it is done: [`Inputs::gauge_code`].
    fn gauge(&mut self) -> Option<u32>;

    /// Reads stage A's stepper.
    fn coarse(&mut self) -> MotorInputs;

    /// Reads stage B's stepper.
    fn lens(&mut self) -> MotorInputs;

    /// Whether the emergency stop's circuit is open, or was since the last look.
    fn emergency_stop(&mut self) -> bool;

    /// Whether the supply is below the level at which the board can still stop in order.
    fn supply_low(&mut self) -> bool;

    /// [`Inputs::memory_failed`].
    fn memory_failed(&mut self) -> bool;

    /// [`Inputs::exposure`]; edges are stamped as moments before `now`.
    fn exposure(&mut self, now: BoardMicros) -> Option<ExposureEdges>;

    /// [`Inputs::strobe`]; likewise.
    fn strobe(&mut self, now: BoardMicros) -> Option<StrobeEdges>;

    /// Carries the outputs out in the order of their fields; the reset is the loop's.
    fn apply(&mut self, outputs: &Outputs);

    /// Whether another frame can be sent.
    fn has_room(&self) -> bool;

    /// Sends a frame with its delimiters, [`farnear_protocol::frame::Delimited`]; only where there is room.
    fn send(&mut self, bytes: &[u8]);

    /// Whether the last bit of the last frame has left the board.
    fn all_sent(&self) -> bool;

    /// Gives the link another rate, now.
    fn set_link_rate(&mut self, rate: LinkRate);

    /// The next piece of the board's log and its number.
    fn take_log(&mut self) -> Option<(u32, Log)>;

    /// Writes a line into the log.
    fn note(&mut self, note: Note);

    /// Keeps the watchdog from resetting the board.
    fn feed_watchdog(&mut self);

    fn reset(&mut self);
}

/// The loop's state: the rig, and what was said of the hardware.
#[derive(Debug)]
pub struct Control<'r> {
    rig: &'r mut Rig,
    /// A STEP queue is dry, and it was said.
    dry: bool,
    /// Since when the board is about to be reset.
    reset_pending: Option<BoardMicros>,
    /// Frames since the log had its turn.
    frames_before_log: u8,
    /// What is to be done for the host was put off in the tick before.
    deferred: bool,
    /// Ticks since something was heard, said or done.
    quiet_ticks: u32,
}

impl<'r> Control<'r> {
    /// A loop that has not begun.
    pub const fn new(rig: &'r mut Rig) -> Self {
        Self { rig, dry: false, reset_pending: None, frames_before_log: 0, deferred: false, quiet_ticks: 0 }
    }

    /// One tick; gives after how many ticks' time the next is due.
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
        // Frames without a pause put it off by a tick at most; the memory's writes leave a tick out by themselves.
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

    /// Sends a frame; says whether there was one, and room for it.
    fn speak(&mut self, board: &mut impl Board) -> bool {
        if !board.has_room() {
            return false;
        }
        let log_is_due = self.frames_before_log >= FRAMES_BEFORE_LOG;
        if log_is_due && self.speak_log(board) {
            return true;
        }
        let Some(frame) = self.rig.transmit() else {
            // An answer that is being made comes before the log.
            return !self.rig.has_work() && self.speak_log(board);
        };
        self.frames_before_log = self.frames_before_log.saturating_add(1);
        board.send(&delimited(&frame));
        true
    }

    /// Sends a piece of the log; says whether there was one. What was logged at the start waits for the first session: a host
    /// that connects throws away what came before.
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

/// Reads the hardware; what is read when matters, see the module's documentation.
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
