//! Routines by which the board measures its own mechanics.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::Axis;
use crate::units::Nanometres;

/// A routine.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Routine {
    /// From the home switch to the far switch and back. The axis is homed.
    Travel {
        /// A stepper axis.
        axis: Axis,
    },
    /// The screw's backlash: the way that the motor turns at a reversal until the stage follows. Measured at the home
    /// switch, which the stage itself actuates.
    Backlash {
        /// A stepper axis.
        axis: Axis,
    },
    /// The piezo's gain and hysteresis: an open-loop sweep up and down.
    Piezo,
    /// Gain and zero of the strain gauge against stage A's encoder, by way of its home switch. The axis is homed.
    Gauge,
}

/// What a routine found. Travel is only reported; the rest is also stored as settings.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Calibration {
    /// Distance between the switches.
    Travel {
        /// The axis.
        axis: Axis,
        /// How far.
        length: Nanometres,
    },
    /// The screw's backlash.
    Backlash {
        /// The axis.
        axis: Axis,
        /// Mean over the reversals.
        backlash: Nanometres,
        /// Largest deviation from the mean.
        spread: Nanometres,
    },
    /// The piezo.
    Piezo {
        /// Stroke per code of the converter.
        gain_pm_per_code: u32,
        /// Width of the hysteresis loop in parts per million of the sweep.
        hysteresis_ppm: u32,
        /// Creep in parts per million of a step per decade of time.
        creep_ppm_per_decade: u32,
    },
    /// The strain gauge.
    Gauge {
        /// Position for what the gauge says, parts per million.
        gain_ppm: i32,
        /// What it says where the piezo is relaxed.
        offset: Nanometres,
    },
}
