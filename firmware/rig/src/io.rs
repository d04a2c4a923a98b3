//! The seam between behaviour and board: what the rig is told and what it orders, once per control tick.
//!
//! The board binary moves bytes and registers; everything with a decision in it is on this side. The loop that joins the
//! two is [`crate::control`]: hardware into [`Inputs`], [`crate::Rig::tick`], [`Outputs`] to the hardware at once.
//!
//! The inputs of a tick already reflect the outputs of the tick before: segments handed over count as queued,
//! so [`StepperState::idle`] is false, and an ordered abort has emptied the queue.
//!
//! Ticks that make up for lost time (a long calculation) may follow each other at once;
//! the piezo's loop leaves those out.
//!
//! # Step pulses
//! A [`Segment`] is some pulses of equal spacing. An advanced timer plays one from its repetition counter (8 bit:
//! 256 pulses) while the next waits in the preload registers; one-pulse mode is on whenever no next one waits.
//! No segment lasts more than [`SEGMENT_MAX_TICKS`] (1 ms), so that clearing the queue and letting the running
//! segment end stops the motor within a millisecond, with an exact count.
//!
//! # Memory
//! At the start the binary reads the first [`MEMORY_BYTES`] of the FRAM and hands them to [`crate::Rig::new`];
//! later it writes what [`Outputs::memory`] orders, at most [`MEMORY_CHUNK`] bytes a tick, before the next tick.
//! The rig relies on it: the mark that an axis moves lies in the memory before the first STEP pulse.
//! [`crate::Rig::boot`] is then the number of this boot; the binary keeps it in its retained RAM.

use farnear_protocol::message::{LightLevels, ShotLight};
use farnear_protocol::{BoardMicros, Micros};
use heapless::Vec;

/// Control ticks per second. 5 kHz = 25 samples per period of the piezo's 200 Hz resonance.
pub const TICK_HZ: u32 = 5_000;
/// Microseconds between control ticks.
pub const TICK_US: u32 = 1_000_000 / TICK_HZ;
/// Of a rig at rest only every tenth tick is carried out: 2 ms, in which the link brings less than half of what a board's ring holds.
pub const REST_TICKS: u32 = 10;

/// Clock of the step timer: the advanced timer's 168 MHz divided by 4, so that a period of 1 ms fits 16 bits and
/// 40 kHz is exactly 1050 ticks.
pub const STEP_TIMER_HZ: u32 = 42_000_000;
/// Longest segment, in step timer ticks: 1 ms, which bounds the time a stop takes.
pub const SEGMENT_MAX_TICKS: u32 = STEP_TIMER_HZ / 1_000;
/// Most pulses in a segment: what the 8-bit repetition counter holds.
pub const SEGMENT_MAX_PULSES: u16 = 256;
/// Most segments handed over in one tick.
pub const SEGMENTS_PER_TICK: usize = 4;

/// Encoders of both steppers: nanometres per count (0.5 mm screw, 4000 counts per turn).
pub const ENCODER_NM_PER_COUNT: i32 = 125;

/// Largest code of the piezo's DAC (16 bit). Code 0 = 0 V.
pub const DAC_CODE_MAX: u16 = u16::MAX;
/// Free stroke of the piezo at [`DAC_CODE_MAX`] in nanometres; code / 65535 * 200 um, 3.05 nm per code.
pub const DAC_FULL_SCALE_NM: i32 = 200_000;

/// Largest code of the strain gauge's converter (18 bit).
pub const GAUGE_CODE_MAX: u32 = (1 << 18) - 1;
/// Code of the strain gauge at the relaxed piezo (0 nm). One code is 1 nm, so the converter covers -10.000 to
/// +252.143 um and sees both ends of the stroke with room for drift; codes 0 and [`GAUGE_CODE_MAX`] mean that it
/// is saturated or not connected.
pub const GAUGE_CODE_ZERO: u32 = 10_000;

/// Bytes of the memory that the rig uses, from address 0.
pub const MEMORY_BYTES: usize = 8 * 1024;
/// Most bytes written to the memory in a tick: 30 us of SPI.
pub const MEMORY_CHUNK: usize = 64;

/// What the step timer reports.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct StepperState {
    /// STEP pulses emitted since the reset, wrapping. Exact whenever `idle`; while a segment runs it counts at
    /// least the finished segments and at most the pulses that left the pin.
    pub pulses: u32,
    /// No segment runs and none waits.
    pub idle: bool,
    /// The timer ran dry after a segment without [`Segment::last`]. Stays set until [`MotorOutputs::abort_steps`].
    pub underrun: bool,
    /// Segments that can be handed over in this tick.
    pub room: u8,
}

impl StepperState {
    /// A timer that has given no pulse and has room for everything.
    pub const IDLE: Self = Self { pulses: 0, idle: true, underrun: false, room: u8::MAX };
}

/// The edges of one exposure, in board time.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ExposureEdges {
    /// Rising edge of the trigger output.
    pub trigger: BoardMicros,
    /// Rising edge of the camera's exposure-active signal.
    pub strobe_start: BoardMicros,
    pub strobe_end: BoardMicros,
    /// Start and end of the flash, where the order had one.
    pub flash: Option<[BoardMicros; 2]>,
}

/// An exposure that came without a trigger of the board.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct StrobeEdges {
    /// Rising edge of the camera's exposure-active signal.
    pub start: BoardMicros,
    pub end: BoardMicros,
}

/// What the board saw of a stepper axis.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct MotorInputs {
    /// Encoder since the reset, [`ENCODER_NM_PER_COUNT`] each, extended beyond the counter's 16 bits; counts up when
    /// sensor and lens move away from each other.
    pub encoder_counts: i32,
    /// The home switch is closed.
    pub home_switch: bool,
    /// The far switch is closed.
    pub far_switch: bool,
    /// The driver pulls its DIAG line.
    pub driver_fault: bool,
    pub stepper: StepperState,
}

impl MotorInputs {
    /// A motor at rest, in the middle of its travel, where the encoder began to count.
    pub const IDLE: Self = Self {
        encoder_counts: 0,
        home_switch: false,
        far_switch: false,
        driver_fault: false,
        stepper: StepperState::IDLE,
    };
}

/// What the board saw; read at the start of a control tick.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Inputs {
    /// Board time of this tick.
    pub now: BoardMicros,
    /// Stage A's stepper.
    pub coarse: MotorInputs,
    /// Stage B's stepper.
    pub lens: MotorInputs,
    /// Strain gauge, 18 bit, see [`GAUGE_CODE_ZERO`]; `None` where the converter did not answer.
    pub gauge_code: Option<u32>,
    /// The emergency-stop circuit is open (pressed, or a broken wire). The board has cut the STEP outputs already.
    pub emergency_stop: bool,
    /// The supply is below the level at which the board can still stop in order.
    pub supply_low: bool,
    /// The memory did not confirm the last write.
    pub memory_failed: bool,
    /// Bytes from the link were lost since the tick before.
    pub link_overflow: bool,
    /// The edges of the last ordered exposure, given once, in the first tick after all three are known.
    pub exposure: Option<ExposureEdges>,
    /// An exposure that began while [`Outputs::listen`] was set, given once, in the first tick after its end. The
    /// latest one where several ended since the tick before.
    pub strobe: Option<StrobeEdges>,
}

impl Inputs {
    /// A board on which nothing moves and nothing is wrong: what benches and counts begin from.
    pub const fn idle(now: BoardMicros) -> Self {
        Self {
            now,
            coarse: MotorInputs::IDLE,
            lens: MotorInputs::IDLE,
            gauge_code: Some(GAUGE_CODE_ZERO),
            emergency_stop: false,
            supply_low: false,
            memory_failed: false,
            link_overflow: false,
            exposure: None,
            strobe: None,
        }
    }
}

/// STEP pulses of equal spacing. `pulses * period_ticks` is at most [`SEGMENT_MAX_TICKS`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Segment {
    /// Pulses, 1 to [`SEGMENT_MAX_PULSES`].
    pub pulses: u16,
    /// Ticks of the step timer ([`STEP_TIMER_HZ`]) from one STEP edge to the next; the last pulse of a segment
    /// is followed by its full period too, so that segments join without a jump.
    pub period_ticks: u16,
    /// The motor stands after this segment: running dry behind it is no underrun.
    pub last: bool,
}

/// What the board is to do with a stepper now.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct MotorOutputs {
    /// Driver enabled (current in the coils).
    pub enable: bool,
    /// Level of DIR: sensor and lens move away from each other. Changes only while the stepper is idle, at least one
    /// tick before the first segment.
    pub direction_away: bool,
    /// Empty the segment queue and let the motor stop with the running segment; clears
    /// [`StepperState::underrun`]. Never together with new `segments`. Also ordered, of a motor that stands, before
    /// it sets off.
    pub abort_steps: bool,
    /// New segments, to be played in this order behind those that wait; never more than
    /// [`StepperState::room`].
    pub segments: Vec<Segment, SEGMENTS_PER_TICK>,
}

/// Bytes for the memory.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct MemoryWrite {
    /// Where; address and length stay below [`MEMORY_BYTES`].
    pub address: u16,
    /// The bytes that are written there.
    pub bytes: Vec<u8, MEMORY_CHUNK>,
}

/// A trigger pulse for the camera.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Trigger {
    /// Its rising edge, to the microsecond, at most a few ticks ahead; as soon as possible where that is over.
    pub at: BoardMicros,
    pub length: Micros,
    /// Flash within the pulse.
    pub flash: Option<ShotLight>,
}

/// What the board is to do now.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Outputs {
    /// Code for the piezo's DAC; `None` leaves it as it is.
    pub piezo_dac: Option<u16>,
    /// Stage A's stepper.
    pub coarse: MotorOutputs,
    /// Stage B's stepper.
    pub lens: MotorOutputs,
    /// Measure exposures that come without a trigger: report each that begins from now on as [`Inputs::strobe`]. Not
    /// set together with `trigger`, nor while a triggered exposure is awaited.
    pub listen: bool,
    /// Brightness of the light outputs, except during a flash.
    pub lights: LightLevels,
    /// End the flash that is in progress or ordered, now.
    pub cancel_flash: bool,
    /// Give a trigger pulse, and capture its edges.
    pub trigger: Option<Trigger>,
    /// Write this to the memory now.
    pub memory: Option<MemoryWrite>,
    /// Reset the microcontroller now; the answers have left.
    pub reset: bool,
}
