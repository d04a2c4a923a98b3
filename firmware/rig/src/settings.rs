//! The rig's numbers: every value that depends on the parts, with its unit and its reason.
//!
//! [`Settings::DEFAULT`] describes the rig of `docs/rig.md`. A `Settings` is a plain value that the rig is given,
//! so another rig, or values from memory, change nothing else.

use farnear_protocol::{Micros, Nanometres};

use crate::gains::{Gains, PiezoModel, Poles};
use crate::io::TICK_US;

/// All numbers of a rig.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Settings {
    /// Distance from the lens' principal plane to the sensor at coarse 0 and fine 0.
    pub datum: Nanometres,
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
}

/// Stepper, screw, encoder and switches.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StepperSettings {
    /// Smallest position.
    pub min: Nanometres,
    /// Largest position.
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
    /// Acceleration, STEP pulses per second squared.
    pub acceleration: u32,
    /// Longest search for the home switch.
    pub home_search: Nanometres,
    /// Longest way out of the closed home switch.
    pub home_leave: Nanometres,
    /// Distance from the opened switch at which the exact approach begins.
    pub home_clearance: Nanometres,
    /// Longest exact approach.
    pub home_approach: Nanometres,
    /// The home switch may be closed up to this position.
    pub home_zone: Nanometres,
    /// Largest difference between counted steps and encoder.
    pub following: Nanometres,
    /// Settle window of a plain move.
    pub settle_window: Nanometres,
    /// Settle dwell of a plain move.
    pub settle_dwell: Micros,
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
    /// Settle window of a plain move.
    pub settle_window: Nanometres,
    /// Settle dwell of a plain move.
    pub settle_dwell: Micros,
    /// Time to settle from the start of the move, dwell not included.
    pub settle_deadline: Micros,
    /// Longest time without a believable gauge reading.
    pub gauge_deadline: Micros,
}

/// Timing of the camera.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CameraSettings {
    /// Shortest exposure.
    pub exposure_min: Micros,
    /// Longest exposure.
    pub exposure_max: Micros,
    /// From the end of an exposure until the camera may be triggered again.
    pub readout: Micros,
    /// The strobe's edges must be known this long after the trigger pulse ended.
    pub strobe_deadline: Micros,
}

/// Timing of the link.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LinkSettings {
    /// From the last answer handed to the UART until the reset.
    pub reset_drain: Micros,
    /// A reboot waits no longer than this for motion and answers.
    pub reset_deadline: Micros,
}

/// Largest settle window a shot may ask for: beyond half the piezo's stroke it would mean nothing.
pub const SETTLE_WINDOW_MAX: Nanometres = Nanometres(100_000);
/// Longest settle dwell a shot may ask for: a second, 5000 samples of the gauge.
pub const SETTLE_DWELL_MAX: Micros = Micros(1_000_000);

/// Distance of a stepper axis per STEP pulse in picometres: 0.5 mm screw, 200 full steps of 16 microsteps.
pub const STEP_PM: u32 = 156_250;

/// Both steppers of `docs/rig.md`.
const STEPPER: StepperSettings = StepperSettings {
    min: Nanometres(0),
    // The micrometer's travel; the far switch sits beyond it.
    max: Nanometres(13_000_000),
    // 6.25 mm/s: 13 mm in 2.2 s, and 750 rpm, where such a motor still has torque at 24 V.
    speed: 40_000,
    // 4 mm/s: stops within 0.18 mm of the switch, inside its over-travel of 0.5 mm.
    home_search_speed: 25_600,
    // 1 mm/s: stops within 0.01 mm, so that the switch opens only just.
    home_leave_speed: 6_400,
    // 0.16 mm/s, a pulse a millisecond: a fifth of a pulse per control tick when the switch is read.
    home_approach_speed: 1_000,
    // 62 full steps per second, far below any motor's pull-in rate; also the slowest segment of 1 ms.
    start_speed: 1_000,
    // 50 mm/s2: 0.39 mm of ramp to full speed, a tenth of what the motor's torque allows.
    acceleration: 320_000,
    // The travel, both switches' over-travel and some more.
    home_search: Nanometres(14_500_000),
    // Over-travel 0.5 mm plus the switch's own hysteresis.
    home_leave: Nanometres(1_500_000),
    // More than the switch's hysteresis is not needed, its edge was just crossed: room for the ramp.
    home_clearance: Nanometres(50_000),
    // Clearance, ramp and the switch's hysteresis.
    home_approach: Nanometres(500_000),
    // A micro-switch opens up to 0.2 mm behind where it closes.
    home_zone: Nanometres(300_000),
    // A stalled motor slips by four full steps (10 um) at a time; load angle and latency stay below 4 um.
    following: Nanometres(6_000),
    // Encoder count and microstep leave 0.2 um; 1 um is what the coarse axis promises.
    settle_window: Nanometres(1_000),
    settle_dwell: Micros(2_000),
    settle_deadline: Micros(500_000),
    // The driver's charge pump and current regulation are up after a few milliseconds.
    enable_delay: Micros(10_000),
    // A segment lasts 1 ms at most.
    pulse_deadline: Micros(10_000),
};

impl Settings {
    /// The rig of `docs/rig.md`.
    pub const DEFAULT: Self = Self {
        // The thesis' lens (f = 50 mm) needs 52.8 to 53.0 mm (Li 2014, chapter 4): 5.9 mm into the travel.
        datum: Nanometres(47_000_000),
        coarse: STEPPER,
        // The same mechanics as stage A.
        lens: STEPPER,
        fine: FineSettings {
            // 5 um at each end of the 200 um stroke are kept for the loop: hysteresis and creep move the ends of
            // the free stroke, and a saturated amplifier cannot damp the resonance.
            min: Nanometres(5_000),
            max: Nanometres(195_000),
            gains: Gains::design(&PiezoModel {
                resonance_hz: 200.0,
                damping: 0.03,
                tick_s: TICK_US as f64 * 1e-6,
                // The gauge's conversion, the control law and the DAC's frame (40 us), and the amplifier's lag
                // (5 kHz, 32 us). 10 to 80 us besides the amplifier all do.
                latency_s: 80e-6,
                // As fast as the resonance itself, so that the command stays small, and without overshoot.
                feedback: Poles { hz: 200.0, damping: 1.0 },
                // Learns the offset of 12 % hysteresis within 5 ms, lives with 5 % error in the resonance, and
                // turns 3 nm of gauge noise into less than 10 nm of motion. The tests hold all three together.
                observer: Poles { hz: 500.0, damping: 1.0 },
            }),
            // A quarter of the depth of focus budget; 16 times the gauge's noise.
            settle_window: Nanometres(50),
            settle_dwell: Micros(2_000),
            // A full-stroke step settles within 15 ms; 20 times that is broken.
            settle_deadline: Micros(300_000),
            // Five samples: single lost conversions are bridged by the observer.
            gauge_deadline: Micros(1_000),
        },
        camera: CameraSettings {
            // The camera's trigger latency; shorter pulses are not seen.
            exposure_min: Micros(20),
            exposure_max: Micros(1_000_000),
            // The sensor is read out in 10 ms, which overlaps the next move; 5 % for its clock.
            readout: Micros(10_500),
            // Latency 20 us; a camera that has not answered after 5 ms did not hear.
            strobe_deadline: Micros(5_000),
        },
        link: LinkSettings {
            // 256 bytes at 2 Mbaud take 1.3 ms; several may wait.
            reset_drain: Micros(10_000),
            // Longest ramp-down is 0.13 s.
            reset_deadline: Micros(1_000_000),
        },
    };
}
