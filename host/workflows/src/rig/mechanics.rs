//! The board measures its own mechanics: travel, backlash, the piezo's and the strain gauge's gain.

use farnear_capture::{describe::um, ready::ensure_homed};
use farnear_protocol::message::{Calibration, Routine};
use serde::Serialize;

use super::{Rig, RigAddress};
use crate::{context::Context, error::Result};

#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(untagged)]
pub enum MechanicsFigures {
    /// The way between a stage's two end switches.
    Travel {
        /// The axis: coarse, lens.
        axis: &'static str,
        travel_um: f64,
    },
    /// A screw's backlash.
    Backlash {
        /// The axis: coarse, lens.
        axis: &'static str,
        /// Mean of the turns that were measured.
        backlash_um: f64,
        /// Largest less smallest.
        spread_um: f64,
    },
    /// The piezo against its strain gauge.
    Piezo {
        /// Picometres for each code of the converter.
        gain_pm_per_code: u32,
        /// Width of the loop, in percent of the travel.
        hysteresis_percent: f64,
        /// Creep after a step, in percent of the step for each decade of time.
        creep_percent_per_decade: f64,
    },
    /// The strain gauge against stage A's encoder.
    Gauge {
        /// True position per gauge reading, 1 = as in its data sheet.
        gauge_gain: f64,
        /// Gauge reading of the relaxed piezo.
        gauge_offset_um: f64,
    },
}

/// Lets the board measure; backlash and the piezo's figures are kept as settings. A stage is homed by having its travel
/// measured, and before its backlash is.
pub fn measure(rig: &RigAddress, routine: Routine, context: &Context<'_>) -> Result<MechanicsFigures> {
    let rig = Rig::connect(rig, None, context)?;
    if matches!(routine, Routine::Backlash { .. }) {
        ensure_homed(&rig.client, &mut |what| context.info(what))?;
    }
    Ok(match rig.client.calibrate(routine)? {
        Calibration::Travel { axis, length } => {
            MechanicsFigures::Travel { axis: axis.name(), travel_um: um(length) }
        }
        Calibration::Backlash { axis, backlash, spread } => {
            MechanicsFigures::Backlash { axis: axis.name(), backlash_um: um(backlash), spread_um: um(spread) }
        }
        Calibration::Piezo { gain_pm_per_code, hysteresis_ppm, creep_ppm_per_decade } => {
            MechanicsFigures::Piezo {
                gain_pm_per_code,
                hysteresis_percent: f64::from(hysteresis_ppm) / 1e4,
                creep_percent_per_decade: f64::from(creep_ppm_per_decade) / 1e4,
            }
        }
        Calibration::Gauge { gain_ppm, offset } => {
            MechanicsFigures::Gauge { gauge_gain: f64::from(gain_ppm) / 1e6, gauge_offset_um: um(offset) }
        }
    })
}
