//! Calibration routines of the board.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::Axis;
use crate::units::Nanometres;

#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Routine {
    /// Travel between home and far switch; homes the axis.
    Travel { axis: Axis },
    /// Backlash of the screw: motor travel at a reversal until the stage follows, at its home switch.
    Backlash { axis: Axis },
    /// Gain and hysteresis of the piezo: open-loop sweep.
    Piezo,
    /// Gain and zero of the strain gauge, compared with stage A's encoder at its home switch; homes the axis.
    Gauge,
}

/// Result of a routine. All but travel is stored as settings.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Calibration {
    /// Distance between the switches.
    Travel { axis: Axis, length: Nanometres },
    /// Backlash of the screw.
    Backlash {
        axis: Axis,
        /// Mean over the reversals.
        backlash: Nanometres,
        /// Largest deviation from the mean.
        spread: Nanometres,
    },
    /// Result of the piezo sweep.
    Piezo {
        gain_pm_per_code: u32,
        /// Loop width relative to the sweep.
        hysteresis_ppm: u32,
        /// Creep per decade of time, relative to a step.
        creep_ppm_per_decade: u32,
    },
    /// Result of the gauge calibration.
    Gauge {
        /// Position relative to the reading.
        gain_ppm: i32,
        /// Reading at the relaxed piezo.
        offset: Nanometres,
    },
}
