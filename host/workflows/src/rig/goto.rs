//! Moves the sensor to the far or near focus, to view that image of a pair.

use std::path::PathBuf;

use farnear_capture::{
    describe::um,
    plan::{SensorPair, coarse_for, fine_for},
    ready::{base_nm, base_when_homed_nm, ensure_homed},
};
use farnear_protocol::message::Axis;
use serde::Serialize;

use super::{Rig, RigAddress};
use crate::{context::Context, error::Result, optics::GivenOptics};

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Focus {
    /// Sharp at the far end of the working range.
    Far,
    Near,
}

#[derive(Clone, PartialEq, Debug)]
pub struct GotoSettings {
    pub rig: RigAddress,
    pub optics: PathBuf,
    pub focus: Focus,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct GotoFigures {
    pub sensor_mm: f64,
    pub coarse_um: f64,
    pub fine_um: f64,
}

/// Homes if needed. Moves the coarse stage so that the piezo reaches both foci, then the piezo.
pub fn goto(settings: &GotoSettings, context: &Context<'_>) -> Result<GotoFigures> {
    let optics = GivenOptics::read(&settings.optics)?;
    let range = optics.optics.working_range();
    let pair = SensorPair { far_mm: range.sensor_far_mm, near_mm: range.sensor_near_mm };
    let rig = Rig::connect(&settings.rig, Some(optics.for_emulation()), context)?;
    let client = &rig.client;
    let limits = client.hello().limits;
    // Refuse unreachable distances before anything moves.
    coarse_for(&pair, base_when_homed_nm(client, &client.status()?), &limits)?;
    ensure_homed(client, &mut |what| context.info(what))?;
    let base = base_nm(client, &client.status()?);
    let target = coarse_for(&pair, base, &limits)?;
    context.info(&format!("moving the coarse stage to {:.3} um", um(target)));
    let coarse = client.move_to(Axis::SensorCoarse, target)?;
    let sensor_mm = match settings.focus {
        Focus::Far => pair.far_mm,
        Focus::Near => pair.near_mm,
    };
    let fine = fine_for(sensor_mm, base, coarse.measured, &limits)?;
    let fine = client.move_to(Axis::SensorFine, fine)?;
    Ok(GotoFigures { sensor_mm, coarse_um: um(coarse.measured), fine_um: um(fine.measured) })
}
