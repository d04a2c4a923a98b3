//! The rig's numbers: every value that depends on the parts, with its unit and its reason.
//!
//! [`Settings::DEFAULT`] describes the rig of `docs/rig.md`. What the host may change, and the memory keeps, are
//! [`Values`]; [`Settings::with`] puts them in. A `Settings` is a plain value that the rig is given, so another rig
//! changes nothing else.

mod table;

use farnear_protocol::message::Axis;
use farnear_protocol::{Micros, Nanometres, Settle};

use crate::gains::{Gains, PiezoModel, Poles};
use crate::io::TICK_US;

pub(crate) use self::table::KEYS;
pub use self::table::Values;

/// All numbers of a rig.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Settings {
    /// Distance from the lens' principal plane to the sensor with all axes at 0.
    pub datum: Nanometres,
    /// Smallest distance between sensor and lens.
    pub distance_min: Nanometres,
    /// The stepper and screw of stage A.
    pub coarse: StepperSettings,
    /// The stepper and screw of stage B.
    pub lens: StepperSettings,
    /// The piezo of stage A.
    pub fine: FineSettings,
    /// The camera's timing.
    pub camera: CameraSettings,
    /// The link's timing.
    pub link: LinkSettings,
    /// The board has a memory without power: without it an alarm says so.
    pub memory: bool,
}

/// Stepper, screw, encoder and switches.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StepperSettings {
    pub min: Nanometres,
    pub max: Nanometres,
    /// Speed of a move, STEP pulses per second.
    pub speed: u32,
    /// Speed of the search for the home switch, STEP pulses per second.
    pub home_search_speed: u32,
    /// Speed of leaving the home switch, STEP pulses per second.
    pub home_leave_speed: u32,
    /// Speed of the second, exact approach to the home switch, STEP pulses per second.
    pub home_approach_speed: u32,
    /// Speed that the motor starts and stops with at once, STEP pulses per second.
    pub start_speed: u32,
    /// Acceleration of a move, STEP pulses per second squared.
    pub acceleration: u32,
    /// Jerk of a move, STEP pulses per second cubed.
    pub jerk: u32,
    /// Acceleration while a switch is sought, STEP pulses per second squared.
    pub home_acceleration: u32,
    /// Jerk while a switch is sought, STEP pulses per second cubed.
    pub home_jerk: u32,
    /// Longest search for the home switch.
    pub home_search: Nanometres,
    /// Longest way out of the closed home switch.
    pub home_leave: Nanometres,
    /// Distance from the opened switch at which the exact approach begins.
    pub home_clearance: Nanometres,
    /// Longest exact approach.
    pub home_approach: Nanometres,
    /// Way from where the home switch closes to where it opens again, of its data sheet.
    pub home_hysteresis: Nanometres,
    /// The home switch may be closed up to this position.
    pub home_zone: Nanometres,
    /// Backlash of the screw, 0 = moves come from both sides.
    pub backlash: Nanometres,
    /// Moves come this much farther than the backlash from below their target.
    pub approach_margin: Nanometres,
    /// Largest difference between counted steps and encoder.
    pub following: Nanometres,
    /// When a plain move has settled.
    pub settle: Settle,
    /// Time to settle after the last pulse, dwell not included.
    pub settle_deadline: Micros,
    /// From switching the driver on to the first pulse.
    pub enable_delay: Micros,
    /// Longest time without a finished segment while segments are out.
    pub pulse_deadline: Micros,
}

/// Piezo and strain gauge.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FineSettings {
    /// Smallest position that the closed loop can hold.
    pub min: Nanometres,
    /// Largest position that the closed loop can hold.
    pub max: Nanometres,
    /// Input shaper and control gains.
    pub gains: Gains,
    /// The same for a flexure with a second mode.
    pub gentle_gains: Gains,
    /// When a plain move has settled.
    pub settle: Settle,
    /// No dwell of this axis is shorter, whatever is asked.
    pub dwell_min: Micros,
    /// Time to settle from the start of the move, dwell not included.
    pub settle_deadline: Micros,
    /// Longest time without a believable gauge reading.
    pub gauge_deadline: Micros,
    /// Stroke per code of the DAC.
    pub gain_pm_per_code: u32,
    /// Width of the hysteresis loop, parts per million of the stroke; 0 = not known.
    pub hysteresis_ppm: u32,
    /// Creep, parts per million of a step per decade of time; 0 = not known.
    pub creep_ppm_per_decade: u32,
    /// Position for what the gauge says, parts per million.
    pub gauge_gain_ppm: u32,
    /// What the gauge says where the piezo is relaxed.
    pub gauge_offset: Nanometres,
}

/// Timing of the camera.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CameraSettings {
    pub exposure_min: Micros,
    pub exposure_max: Micros,
    /// From the end of an exposure until the camera may be triggered again.
    pub readout: Micros,
    /// The strobe's edges must be known this long after the trigger pulse ended.
    pub strobe_deadline: Micros,
    /// An exposure that the board does not trigger must have ended this long after the shot was ready.
    pub patience: Micros,
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LinkSettings {
    /// From the last answer handed to the UART until the reset.
    pub reset_drain: Micros,
    /// A reboot waits no longer than this for motion and answers.
    pub reset_deadline: Micros,
    /// Shortest time that a request may allow the host to say nothing.
    pub silence_min: Micros,
    /// Longest time that a request may allow the host to say nothing.
    pub silence_max: Micros,
}

/// Largest settle window a shot may ask for: beyond half the piezo's stroke it would mean nothing.
pub const SETTLE_WINDOW_MAX: Nanometres = Nanometres(100_000);
/// Longest settle dwell a shot may ask for: a second, 5000 samples of the gauge.
pub const SETTLE_DWELL_MAX: Micros = Micros(1_000_000);

/// Distance of a stepper axis per STEP pulse in picometres: 0.5 mm screw, 200 full steps of 16 microsteps.
pub const STEP_PM: u32 = 156_250;

/// Both steppers of `docs/rig.md`, but for what the settings say.
const STEPPER: StepperSettings = StepperSettings {
    min: Nanometres(0),
    max: Nanometres(0),
    speed: 0,
    acceleration: 0,
    jerk: 0,
    backlash: Nanometres(0),
    following: Nanometres(0),
    // 4 mm/s: stops within 0.25 mm of the switch, inside its over-travel of 0.5 mm.
    home_search_speed: 25_600,
    // 1 mm/s: stops within 0.01 mm, so that the switch opens only just.
    home_leave_speed: 6_400,
    // 0.16 mm/s, a pulse a millisecond: a fifth of a pulse per control tick when the switch is read.
    home_approach_speed: 1_000,
    // 62 full steps per second, far below any motor's pull-in rate; also the slowest segment of 1 ms.
    start_speed: 1_000,
    // Its own, whatever moves are set to: the over-travel behind the switches is what it is.
    home_acceleration: 320_000,
    home_jerk: 10_240_000,
    // Friction differs a little along the screw.
    approach_margin: Nanometres(2_000),
    // The travel, both switches' over-travel and some more.
    home_search: Nanometres(14_500_000),
    // Over-travel 0.5 mm plus the switch's own hysteresis.
    home_leave: Nanometres(1_500_000),
    // More than the switch's hysteresis is not needed, its edge was just crossed: room for the ramp.
    home_clearance: Nanometres(50_000),
    // Clearance, ramp and the switch's hysteresis.
    home_approach: Nanometres(500_000),
    // A precision switch (Baumer My-Com class); a snap-action one has 0.1 mm.
    home_hysteresis: Nanometres(2_000),
    // A micro-switch opens up to 0.2 mm behind where it closes.
    home_zone: Nanometres(300_000),
    settle: Settle::of_move(Axis::SensorCoarse),
    settle_deadline: Micros(500_000),
    // The TMC2209 tunes its current regulator while the motor stands, 130 ms at least, and 10 ms more (its data sheet,
    // section 6.1, AT#1); only once, for the driver then stays on.
    enable_delay: Micros(140_000),
    // A segment lasts 1 ms at most.
    pulse_deadline: Micros(10_000),
};

impl Settings {
    /// The rig of `docs/rig.md`.
    pub const DEFAULT: Self = PARTS.with(&Values::DEFAULT);

    /// Smallest and largest position of an axis.
    pub const fn limits(&self, axis: Axis) -> (Nanometres, Nanometres) {
        match axis {
            Axis::SensorCoarse => (self.coarse.min, self.coarse.max),
            Axis::SensorFine => (self.fine.min, self.fine.max),
            Axis::Lens => (self.lens.min, self.lens.max),
        }
    }

    /// When a plain move of an axis has settled.
    pub const fn settle(&self, axis: Axis) -> Settle {
        match axis {
            Axis::SensorCoarse => self.coarse.settle,
            Axis::SensorFine => self.fine.settle,
            Axis::Lens => self.lens.settle,
        }
    }
}

/// The piezo of the parts list, and the fast loop.
const PIEZO: PiezoModel = PiezoModel {
    resonance_hz: 200.0,
    damping: 0.03,
    tick_s: TICK_US as f64 * 1e-6,
    // The gauge's conversion, the control law and the DAC's frame (40 us), and the amplifier's lag (5 kHz, 32 us). 10 to 80 us
    // besides the amplifier all do.
    latency_s: 80e-6,
    // As fast as the resonance itself, so that the command stays small, and without overshoot.
    feedback: Poles { hz: 200.0, damping: 1.0 },
    // Learns the offset of 12 % hysteresis within 5 ms, lives with 5 % error in the resonance, and turns 3 nm of gauge noise into less than
    // 10 nm of motion. The tests hold all three together.
    observer: Poles { hz: 500.0, damping: 1.0 },
};

/// The parts of `docs/rig.md`; what is 0 here comes from the settings.
const PARTS: Settings = Settings {
    datum: Nanometres(0),
    distance_min: Nanometres(0),
    coarse: STEPPER,
    // The same mechanics as stage A.
    lens: STEPPER,
    fine: FineSettings {
        min: Nanometres(0),
        max: Nanometres(0),
        gain_pm_per_code: 0,
        hysteresis_ppm: 0,
        creep_ppm_per_decade: 0,
        gauge_gain_ppm: 0,
        gauge_offset: Nanometres(0),
        gains: Gains::design(&PIEZO),
        // Fed with what the gauge sees of a second mode, the loop must not answer: by its eigenvalues a mode with a damping of 0.01, from 320 Hz on, may
        // have a share of 0.3 of what a slow drive moves, and 0.05 against it. A calibrated piezo is within 50 nm after 41 ms.
        gentle_gains: Gains::design(&PiezoModel {
            feedback: Poles { hz: 200.0, damping: 0.3 },
            observer: Poles { hz: 80.0, damping: 1.0 },
            ..PIEZO
        }),
        settle: Settle::of_move(Axis::SensorFine),
        dwell_min: Micros(0),
        // A full-stroke step settles within 15 ms; 20 times that is broken.
        settle_deadline: Micros(300_000),
        // Five samples: single lost conversions are bridged by the observer.
        gauge_deadline: Micros(1_000),
    },
    camera: CameraSettings {
        // The camera's trigger latency; shorter pulses are not seen.
        exposure_min: Micros(20),
        exposure_max: Micros(1_000_000),
        readout: Micros(0),
        strobe_deadline: Micros(0),
        // The longest exposure, a slow camera's frame, and a host that has to be told first.
        patience: Micros(5_000_000),
    },
    link: LinkSettings {
        // 256 bytes at 2 Mbaud take 1.3 ms; several may wait.
        reset_drain: Micros(10_000),
        // Longest ramp-down is 0.13 s.
        reset_deadline: Micros(1_000_000),
        // A host on a busy machine answers within some 10 ms.
        silence_min: Micros(100_000),
        silence_max: Micros(60_000_000),
    },
    memory: true,
};
