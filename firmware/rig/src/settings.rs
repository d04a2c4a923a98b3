//! The rig's numbers: each value that depends on the parts, with unit and reason. [`Settings::DEFAULT`] is the rig of
//! `docs/rig.md`. [`Values`] are those that the host may change and the memory stores; [`Settings::with`] applies them.

mod table;

use farnear_protocol::message::Axis;
use farnear_protocol::{Micros, Nanometres, Settle};

use crate::gains::{Gains, PiezoModel, Poles};
use crate::io::TICK_US;

pub use self::table::Values;
pub(crate) use self::table::{FINE_MAX_NM, KEYS};

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Settings {
    /// Principal plane to sensor with all axes at 0.
    pub datum: Nanometres,
    /// Sensor to lens.
    pub distance_min: Nanometres,
    pub coarse: StepperSettings,
    pub lens: StepperSettings,
    pub fine: FineSettings,
    pub camera: CameraSettings,
    pub link: LinkSettings,
    /// The board has a memory; its absence is an alarm.
    pub memory: bool,
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StepperSettings {
    pub min: Nanometres,
    pub max: Nanometres,
    /// Speeds are in STEP pulses/s, accelerations in STEP pulses/s2, jerks in STEP pulses/s3.
    pub speed: u32,
    pub home_search_speed: u32,
    pub home_leave_speed: u32,
    /// Exact approach.
    pub home_approach_speed: u32,
    /// Speed without ramp.
    pub start_speed: u32,
    pub acceleration: u32,
    pub jerk: u32,
    pub home_acceleration: u32,
    pub home_jerk: u32,
    pub home_search: Nanometres,
    pub home_leave: Nanometres,
    /// Distance from the opened switch to the start of the exact approach.
    pub home_clearance: Nanometres,
    pub home_approach: Nanometres,
    /// Distance between closing and opening, by data sheet.
    pub home_hysteresis: Nanometres,
    /// The home switch may be closed below this position.
    pub home_zone: Nanometres,
    /// 0 = moves from both sides.
    pub backlash: Nanometres,
    /// Extra distance of the approach from below.
    pub approach_margin: Nanometres,
    /// Largest difference of steps and encoder.
    pub following: Nanometres,
    pub settle: Settle,
    /// Settling time after the last pulse, without dwell.
    pub settle_deadline: Micros,
    /// From enabling the driver to the first pulse.
    pub enable_delay: Micros,
    pub pulse_deadline: Micros,
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FineSettings {
    /// Range of the closed loop.
    pub min: Nanometres,
    pub max: Nanometres,
    pub gains: Gains,
    /// Gains for a flexure with a second mode.
    pub gentle_gains: Gains,
    pub settle: Settle,
    /// Lower limit of this axis' dwell.
    pub dwell_min: Micros,
    /// Settling time from the start of the move, or from the end of the swing that it waits for, without dwell.
    pub settle_deadline: Micros,
    pub gauge_deadline: Micros,
    /// Stroke per DAC code.
    pub gain_pm_per_code: u32,
    /// Loop width / stroke; 0 = unknown.
    pub hysteresis_ppm: u32,
    /// Creep per decade / step; 0 = unknown.
    pub creep_ppm_per_decade: u32,
    /// Position / reading.
    pub gauge_gain_ppm: u32,
    /// Reading at the relaxed piezo.
    pub gauge_offset: Nanometres,
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CameraSettings {
    pub exposure_min: Micros,
    pub exposure_max: Micros,
    /// From the end of an exposure to the next trigger.
    pub readout: Micros,
    /// Strobe edges must be known this long after the trigger pulse.
    pub strobe_deadline: Micros,
    /// Deadline of an untriggered exposure after the shot is ready.
    pub patience: Micros,
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LinkSettings {
    /// From the last answer to the reset.
    pub reset_drain: Micros,
    /// Limit of a reboot's wait for answers and memory, from the end of the motion.
    pub reset_deadline: Micros,
    pub silence_min: Micros,
    pub silence_max: Micros,
}

/// Half the piezo's stroke; larger windows are meaningless.
pub const SETTLE_WINDOW_MAX: Nanometres = Nanometres(100_000);
/// A second, 5000 samples.
pub const SETTLE_DWELL_MAX: Micros = Micros(1_000_000);

/// 0.5 mm screw, 200 full steps of 16 microsteps.
pub const STEP_PM: u32 = 156_250;

/// Both steppers of `docs/rig.md`, apart from the settings.
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
    // 1 mm/s: stops within 0.01 mm, so that the switch just opens.
    home_leave_speed: 6_400,
    // 0.16 mm/s, a pulse a millisecond: a fifth of a pulse per control tick when the switch is read.
    home_approach_speed: 1_000,
    // 62 full steps per second, far below any motor's pull-in rate; also the slowest segment of 1 ms.
    start_speed: 1_000,
    // Independent of the moves' settings: the over-travel is fixed.
    home_acceleration: 320_000,
    home_jerk: 10_240_000,
    // Friction differs a little along the screw.
    approach_margin: Nanometres(2_000),
    // The travel, both switches' over-travel and some more.
    home_search: Nanometres(14_500_000),
    // Over-travel 0.5 mm plus the switch's own hysteresis.
    home_leave: Nanometres(1_500_000),
    // The edge was just crossed, so the ramp's length suffices.
    home_clearance: Nanometres(50_000),
    // Clearance, ramp and the switch's hysteresis.
    home_approach: Nanometres(500_000),
    // A precision switch (Baumer My-Com class); a snap-action one has 0.1 mm.
    home_hysteresis: Nanometres(2_000),
    // A micro-switch opens up to 0.2 mm after its closing position.
    home_zone: Nanometres(300_000),
    settle: Settle::of_move(Axis::SensorCoarse),
    settle_deadline: Micros(500_000),
    // The TMC2209 tunes its current regulator at standstill, at least 130 ms plus 10 ms (data sheet, section
    // 6.1, AT#1); once, because the driver stays on.
    enable_delay: Micros(140_000),
    // A segment lasts 1 ms at most.
    pulse_deadline: Micros(10_000),
};

impl Settings {
    pub const DEFAULT: Self = PARTS.with(&Values::DEFAULT);

    pub const fn limits(&self, axis: Axis) -> (Nanometres, Nanometres) {
        match axis {
            Axis::SensorCoarse => (self.coarse.min, self.coarse.max),
            Axis::SensorFine => (self.fine.min, self.fine.max),
            Axis::Lens => (self.lens.min, self.lens.max),
        }
    }

    pub const fn settle(&self, axis: Axis) -> Settle {
        match axis {
            Axis::SensorCoarse => self.coarse.settle,
            Axis::SensorFine => self.fine.settle,
            Axis::Lens => self.lens.settle,
        }
    }
}

/// The piezo of the parts list with the fast loop.
const PIEZO: PiezoModel = PiezoModel {
    resonance_hz: 200.0,
    damping: 0.03,
    tick_s: TICK_US as f64 * 1e-6,
    // Gauge conversion, control law and DAC frame (40 us) plus the amplifier's lag (5 kHz, 32 us). The first may take
    // 10 to 80 us.
    latency_s: 80e-6,
    // As fast as the resonance, so that the command stays small, without overshoot.
    feedback: Poles { hz: 200.0, damping: 1.0 },
    // Learns the offset of 12 % hysteresis within 5 ms, tolerates 5 % error in the resonance, and turns 3 nm
    // of gauge noise into less than 10 nm of motion; all three are tested.
    observer: Poles { hz: 500.0, damping: 1.0 },
};

/// The parts of `docs/rig.md`; zeros come from the settings.
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
        // The loop must not react to a second mode in the gauge's signal: by its eigenvalues a mode with
        // damping 0.01, from 320 Hz, may have a share of 0.3 of a static deflection, and 0.05 against it. A
        // calibrated piezo is within 50 nm after 41 ms.
        gentle_gains: Gains::design(&PiezoModel {
            feedback: Poles { hz: 200.0, damping: 0.3 },
            observer: Poles { hz: 80.0, damping: 1.0 },
            ..PIEZO
        }),
        settle: Settle::of_move(Axis::SensorFine),
        dwell_min: Micros(0),
        // A full-stroke step settles within 15 ms; 20 times that indicates a fault.
        settle_deadline: Micros(300_000),
        // Five samples: the observer bridges single lost conversions.
        gauge_deadline: Micros(1_000),
    },
    camera: CameraSettings {
        // The camera's trigger latency; shorter pulses are ignored.
        exposure_min: Micros(20),
        exposure_max: Micros(1_000_000),
        readout: Micros(0),
        strobe_deadline: Micros(0),
        // The longest exposure, a slow camera's frame, and the host's notification.
        patience: Micros(5_000_000),
    },
    link: LinkSettings {
        // 256 bytes at 2 Mbaud take 1.3 ms; several may wait.
        reset_drain: Micros(10_000),
        // A host that reads nothing is left after this.
        reset_deadline: Micros(1_000_000),
        // A host on a busy machine answers within some 10 ms.
        silence_min: Micros(100_000),
        silence_max: Micros(60_000_000),
    },
    memory: true,
};
