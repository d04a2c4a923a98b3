//! Interface between behaviour and board: inputs and outputs per control tick.
//!
//! The board binary moves bytes and registers; all decisions are on this side. [`crate::control`] connects both:
//! hardware to [`Inputs`], [`crate::Rig::tick`], [`Outputs`] to the hardware immediately. Inputs reflect the outputs of
//! the previous tick: submitted segments count as queued, so [`StepperState::idle`] is false, and an abort has emptied
//! the queue. Ticks that catch up may follow each other immediately; the piezo's loop skips those.
//!
//! # Step pulses
//! A [`Segment`] is a number of equally spaced pulses. An advanced timer plays one from its repetition counter (8 bit:
//! 256 pulses) while the next waits in the preload registers; one-pulse mode is on when none waits. Segments last at
//! most [`SEGMENT_MAX_TICKS`] (1 ms), so clearing the queue stops the motor within a millisecond with an exact count.
//!
//! # Memory
//! At start the binary reads the first [`MEMORY_BYTES`] of the FRAM for [`crate::Rig::new`]; later it writes
//! [`Outputs::memory`], at most [`MEMORY_CHUNK`] bytes per tick, before the next tick. The rig relies on this: the mark
//! that an axis moves is stored before the first STEP pulse. The binary keeps [`crate::Rig::boot`] in retained RAM.

use farnear_protocol::message::{LightLevels, ShotLight};
use farnear_protocol::{BoardMicros, Micros};
use heapless::Vec;

/// Control rate. 5 kHz gives 25 samples per period of the piezo's 200 Hz resonance.
pub const TICK_HZ: u32 = 5_000;
pub const TICK_US: u32 = 1_000_000 / TICK_HZ;
/// Ticks per executed tick at rest: 2 ms, in which the link fills less than half of a board's ring buffer.
pub const REST_TICKS: u32 = 10;

/// Step timer clock: 168 MHz / 4, so that 1 ms fits 16 bits and 40 kHz is exactly 1050 ticks.
pub const STEP_TIMER_HZ: u32 = 42_000_000;
/// Longest segment: 1 ms, which bounds the time of a stop.
pub const SEGMENT_MAX_TICKS: u32 = STEP_TIMER_HZ / 1_000;
/// Capacity of the 8-bit repetition counter.
pub const SEGMENT_MAX_PULSES: u16 = 256;
pub const SEGMENTS_PER_TICK: usize = 4;

/// Both encoders: 0.5 mm screw, 4000 counts per turn.
pub const ENCODER_NM_PER_COUNT: i32 = 125;

/// Code 0 = 0 V.
pub const DAC_CODE_MAX: u16 = u16::MAX;
/// Free stroke at [`DAC_CODE_MAX`]: 3.05 nm per code.
pub const DAC_FULL_SCALE_NM: i32 = 200_000;

pub const GAUGE_CODE_MAX: u32 = (1 << 18) - 1;
/// Gauge code at the relaxed piezo (0 nm); 1 nm per code. The range of -10.000 to +252.143 um includes the stroke and
/// drift; codes 0 and [`GAUGE_CODE_MAX`] mean saturated or disconnected.
pub const GAUGE_CODE_ZERO: u32 = 10_000;

/// Used bytes of the memory, from address 0.
pub const MEMORY_BYTES: usize = 8 * 1024;
/// Largest write per tick: 30 us of SPI.
pub const MEMORY_CHUNK: usize = 64;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct StepperState {
    /// STEP pulses since the reset, wrapping. Exact when `idle`, else up to the emitted pulses.
    pub pulses: u32,
    pub idle: bool,
    /// Underrun without [`Segment::last`]; cleared by [`MotorOutputs::abort_steps`].
    pub underrun: bool,
    pub room: u8,
}

impl StepperState {
    pub const IDLE: Self = Self { pulses: 0, idle: true, underrun: false, room: u8::MAX };
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ExposureEdges {
    /// Board time; rising edge of the trigger output.
    pub trigger: BoardMicros,
    pub strobe_start: BoardMicros,
    pub strobe_end: BoardMicros,
    /// Start and end, board time.
    pub flash: Option<[BoardMicros; 2]>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct StrobeEdges {
    /// Board time.
    pub start: BoardMicros,
    pub end: BoardMicros,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct MotorInputs {
    /// Since the reset, [`ENCODER_NM_PER_COUNT`] each, beyond 16 bits; rises when sensor and lens move apart.
    pub encoder_counts: i32,
    /// True when closed, like `far_switch`.
    pub home_switch: bool,
    pub far_switch: bool,
    pub driver_fault: bool,
    pub stepper: StepperState,
}

impl MotorInputs {
    /// At rest in mid-travel, at encoder zero.
    pub const IDLE: Self = Self {
        encoder_counts: 0,
        home_switch: false,
        far_switch: false,
        driver_fault: false,
        stepper: StepperState::IDLE,
    };
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Inputs {
    pub now: BoardMicros,
    pub coarse: MotorInputs,
    pub lens: MotorInputs,
    /// 18 bit, see [`GAUGE_CODE_ZERO`]; `None` without answer of the converter.
    pub gauge_code: Option<u32>,
    /// Open circuit (pressed, or a broken wire). STEP outputs are already cut.
    pub emergency_stop: bool,
    pub supply_low: bool,
    pub memory_failed: bool,
    pub link_overflow: bool,
    /// Edges of the last ordered exposure, given once when complete.
    pub exposure: Option<ExposureEdges>,
    /// An exposure begun while [`Outputs::listen`] was set, given once after its end; the latest of several.
    pub strobe: Option<StrobeEdges>,
}

impl Inputs {
    /// A board at rest without faults, for benches and counts.
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

/// Equally spaced STEP pulses. `pulses * period_ticks` is at most [`SEGMENT_MAX_TICKS`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Segment {
    /// 1 to [`SEGMENT_MAX_PULSES`].
    pub pulses: u16,
    /// In ticks of [`STEP_TIMER_HZ`]; the last pulse also has a full period, so that segments join smoothly.
    pub period_ticks: u16,
    pub last: bool,
}

#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct MotorOutputs {
    pub enable: bool,
    /// DIR level: sensor and lens move apart. Changes only while idle, at least one tick before the first segment.
    pub direction_away: bool,
    /// Clear the queue and stop with the running segment; clears [`StepperState::underrun`]. Never with new `segments`.
    /// Also ordered before a resting motor starts.
    pub abort_steps: bool,
    pub segments: Vec<Segment, SEGMENTS_PER_TICK>,
}

#[derive(Clone, PartialEq, Eq, Debug)]
pub struct MemoryWrite {
    /// Address plus length stay below [`MEMORY_BYTES`].
    pub address: u16,
    pub bytes: Vec<u8, MEMORY_CHUNK>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Trigger {
    pub at: BoardMicros,
    pub length: Micros,
    pub flash: Option<ShotLight>,
}

#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Outputs {
    /// `None`: unchanged.
    pub piezo_dac: Option<u16>,
    pub coarse: MotorOutputs,
    pub lens: MotorOutputs,
    /// Report each untriggered exposure that begins from now on as [`Inputs::strobe`]. Never with a triggered one.
    pub listen: bool,
    /// Brightness of the light outputs, except during a flash.
    pub lights: LightLevels,
    /// End the flash that is in progress or ordered, now.
    pub cancel_flash: bool,
    pub trigger: Option<Trigger>,
    pub memory: Option<MemoryWrite>,
    pub reset: bool,
}
