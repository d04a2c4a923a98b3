//! Calibrates the rig's lens: a stack of a flat target on both sides of its focus, and what the stack tells.

use std::path::PathBuf;

use farnear_capture::{record::begin_folder, sequence::ShotDefaults};
use farnear_depth::optics::Optics;
use farnear_protocol::{Nanometres, message::Axis};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    RigAddress,
    camera::CameraSettings,
    focus::{self, FocusRequest},
    sequence::{self, SequenceRequest},
};
use crate::{
    calibrate::stack::{CalibrateStackRequest, StackFigures, calibrate},
    context::Context,
    error::Result,
    optics::GivenOptics,
    parameters::within,
    request::{PathKind, Request},
};

/// Steps of the sensor from the far to the near image of a pair.
const STEPS_IN_PAIR: f64 = 5.0;
/// Fewest slices: those of a pair on both sides of the focus.
const FEWEST: usize = 11;
/// The lens in its folder.
pub const LENS: &str = "lens.toml";
const PLOT: &str = "lens.svg";

/// Calibrate the rig's lens from a stack of a flat, textured target, tilted or not.
///
/// Finds the focus of the target, takes slices on both sides of it a fifth of the pair's sensor travel apart, and calibrates the lens
/// from them as `farnear calibrate stack` does. Writes the slices, lens.toml and a plot, lens.svg. `farnear rig capture --optics lens.toml`
/// takes pairs for this lens.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear rig calibrate stack --port sim --scene plane:910 --optics optics.toml --out lens/"
    )
)]
#[serde(default)]
pub struct RigStackRequest {
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub rig: RigAddress,
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub camera: CameraSettings,
    /// The optics file: focal length, pixel pitch and far plane are kept; blur and response are measured.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub optics: PathBuf,
    /// Slices, 11 or more.
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", default_value_t = Self::default().slices))]
    pub slices: usize,
    /// The new folder.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub out: PathBuf,
}

impl Default for RigStackRequest {
    fn default() -> Self {
        Self {
            rig: RigAddress::default(),
            camera: CameraSettings::default(),
            optics: PathBuf::new(),
            slices: 21,
            out: PathBuf::new(),
        }
    }
}

impl Request for RigStackRequest {
    const NAME: &'static str = "rig calibrate stack";
    const REQUIRED: &'static [&'static str] = &["optics", "out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("optics", PathKind::Input), ("out", PathKind::OutputFolder)];
    type Figures = StackFigures;

    fn check(&self) -> Result<()> {
        within("slices", self.slices, &(FEWEST..=sequence::STEPS_MAX), "")
    }

    fn run(&self, context: &Context<'_>) -> Result<StackFigures> {
        run(self, context)
    }
}

crate::request::camera_request!(RigStackRequest);

/// The slices stay if the calibration fails.
pub fn run(settings: &RigStackRequest, context: &Context<'_>) -> Result<StackFigures> {
    settings.check()?;
    let given = GivenOptics::read(&settings.optics)?;
    let optics = given.optics;
    let folder = begin_folder(&settings.out)?;
    let mut rig = settings.camera.connect(&settings.rig, Some(&given), context)?;
    let focused = focus::search(
        &mut rig,
        &optics,
        &FocusRequest { camera: settings.camera.clone(), ..FocusRequest::default() },
        context,
    )?;
    let [from, to] = around(focused.coarse, &optics, settings.slices);
    let defaults = ShotDefaults { exposure: settings.camera.exposure, ..ShotDefaults::default() };
    let shots = defaults.stack(Axis::SensorCoarse, from, to, settings.slices);
    let sequence = SequenceRequest {
        camera: settings.camera.clone(),
        out: settings.out.clone(),
        ..SequenceRequest::default()
    };
    sequence::take(&mut rig, &shots, &sequence, Some(given), folder, context)?;
    drop(rig);
    let request = CalibrateStackRequest {
        stack: settings.out.clone(),
        plot: Some(settings.out.join(PLOT)),
        out: settings.out.join(LENS),
        ..CalibrateStackRequest::default()
    };
    calibrate(&request, context)
}

/// First and last position of a stack of `slices` around the focus.
fn around(focus: Nanometres, optics: &Optics, slices: usize) -> [Nanometres; 2] {
    let step_nm = optics.working_range().sensor_travel_mm * 1e6 / STEPS_IN_PAIR;
    let half_nm = (0.5 * step_nm * (slices - 1) as f64).round() as i32;
    [focus.0.saturating_sub(half_nm), focus.0.saturating_add(half_nm)].map(Nanometres)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2 Fe Rmax = 2 x 3.90625 x 2.703 x 7.4 um = 156.27 um; 20 steps of a fifth.
    #[test]
    fn slices_lie_evenly_around_the_focus() {
        let text = "[lens]\nfocal_length_mm = 50\naperture_mm = 12.8\n[sensor]\npixel_um = 7.4\n\
                    [focus]\nfar_mm = 933\nmax_blur_px = 2.703\n";
        let optics = GivenOptics::parse(text, "optics.toml".as_ref()).unwrap().optics;
        let [from, to] = around(Nanometres(400_000), &optics, 21);
        assert_eq!((from.0 + to.0) / 2, 400_000);
        assert!((f64::from(to.0 - from.0) - 4.0 * 156_267.0).abs() < 10.0, "{from:?} {to:?}");
    }
}
