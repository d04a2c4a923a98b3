//! Mechanics measured by the board: travel, backlash, gain of piezo and strain gauge.

use farnear_capture::{describe::um, ready::ensure_homed};
use farnear_protocol::message::{Calibration, Routine};
use serde::Serialize;

use super::{Rig, RigAddress};
use crate::{context::Context, error::Result};

#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(untagged)]
pub enum MechanicsFigures {
    /// Distance between a stage's end switches.
    Travel { axis: &'static str, travel_um: f64 },
    Backlash {
        axis: &'static str,
        /// Mean over the reversals measured.
        backlash_um: f64,
        /// Largest minus smallest.
        spread_um: f64,
    },
    /// The piezo relative to its strain gauge.
    Piezo {
        /// Per code of the converter.
        gain_pm_per_code: u32,
        /// Width of the loop, as a percentage of the travel.
        hysteresis_percent: f64,
        /// Creep after a step, as a percentage of the step per decade of time.
        creep_percent_per_decade: f64,
    },
    /// The strain gauge relative to stage A's encoder.
    Gauge {
        /// True position / gauge reading; 1 = data sheet.
        gauge_gain: f64,
        /// Gauge reading of the relaxed piezo.
        gauge_offset_um: f64,
    },
}

/// Stores backlash and piezo figures as settings. Measuring travel homes the stage, measuring backlash homes it first.
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
