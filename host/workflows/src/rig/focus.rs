//! Finds m1, the sensor distance of the best focus, and the resulting working range.

use std::path::PathBuf;

use farnear_capture::{
    Client,
    describe::um,
    focus::{self, Focus, find_focus},
    ready::{base_nm, ensure_homed},
};
use farnear_depth::{
    focus_measure::FocusMeasure,
    optics::{Optics, OpticsFile},
};
use farnear_protocol::{
    Nanometres,
    message::{Axis, AxisStatus},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use super::{
    RigAddress,
    camera::{CameraSettings, EquippedRig},
};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::{rounded, rounded_for},
    measure::Rectangle,
    optics::GivenOptics,
    request::{PathKind, Request},
};

/// Find the sensor distance at which a target is sharpest (m1), and the working range that begins there.
///
/// Put the target at the far end of the working range. The second distance follows from the optics: m2 = m1 + 2 Fe Rmax (Li 2014,
/// eqs. 4.3 and 4.4).
#[serde_as]
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear rig focus --port sim --scene plane:900 --optics optics.toml --json"
    )
)]
#[serde(default)]
pub struct FocusRequest {
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub rig: RigAddress,
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub camera: CameraSettings,
    /// The optics file; the search begins at its far focus.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub optics: PathBuf,
    /// Begin at this sensor distance [default: the place of the stage, or the optics' far focus after homing].
    #[cfg_attr(feature = "clap", arg(long, value_name = "MM"))]
    pub start_mm: Option<f64>,
    /// Largest distance of the focus from the start.
    #[cfg_attr(feature = "clap", arg(long, value_name = "MM", default_value_t = Self::default().range_mm))]
    pub range_mm: f64,
    /// Focus measure: tenengrad, modified-laplacian or fft-sum.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().measure))]
    #[serde_as(as = "DisplayFromStr")]
    pub measure: FocusMeasure,
    /// The part of the image that counts: column, row, width and height in pixels.
    #[cfg_attr(feature = "clap", arg(long, value_name = "X,Y,W,H"))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub region: Option<Rectangle>,
}

impl Default for FocusRequest {
    fn default() -> Self {
        Self {
            rig: RigAddress::default(),
            camera: CameraSettings::default(),
            optics: PathBuf::new(),
            start_mm: None,
            range_mm: 1.0,
            measure: FocusMeasure::Tenengrad,
            region: None,
        }
    }
}

impl Request for FocusRequest {
    const NAME: &'static str = "rig focus";
    const REQUIRED: &'static [&'static str] = &["optics"];
    const PATHS: &'static [(&'static str, PathKind)] = &[("optics", PathKind::Input)];
    type Figures = FocusFigures;

    fn check(&self) -> Result<()> {
        if self.range_mm > 0.0 && self.range_mm.is_finite() {
            return Ok(());
        }
        Err(WorkflowError::parameter("range-mm", self.range_mm, "expected a positive length"))
    }

    fn run(&self, context: &Context<'_>) -> Result<FocusFigures> {
        focus(self, context)
    }
}

crate::request::camera_request!(FocusRequest);

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct FocusFigures {
    pub m1_mm: f64,
    /// m2 = m1 + 2 Fe Rmax (Li 2014, eqs. 4.3 and 4.4).
    pub m2_mm: f64,
    /// Far end of the working range: the target's distance.
    pub far_mm: f64,
    pub near_mm: f64,
    /// Offset of the normalised depth.
    pub alpha0_mm: f64,
    pub sensor_travel_mm: f64,
    pub coarse_um: f64,
    pub fine_um: f64,
    pub board_ms: f64,
    pub places: usize,
    pub exposures: usize,
}

/// Finds the best focus of the target in front of the rig and leaves the sensor there.
pub fn focus(settings: &FocusRequest, context: &Context<'_>) -> Result<FocusFigures> {
    let given = GivenOptics::read(&settings.optics)?;
    settings.check()?;
    let mut rig = settings.camera.connect(&settings.rig, Some(&given), context)?;
    let found = search(&mut rig, &given.optics, settings, context)?;
    figures(given.optics, &found)
}

/// The same with an open rig.
pub(super) fn search(
    rig: &mut EquippedRig,
    optics: &Optics,
    settings: &FocusRequest,
    context: &Context<'_>,
) -> Result<Focus> {
    let client = &rig.rig.client;
    let before = client.status()?.coarse;
    ensure_homed(client, &mut |what| context.info(what))?;
    let placed = is_placed(before, client.status()?.coarse);
    let default = (!placed).then_some(optics.working_range().sensor_far_mm);
    if let Some(start_mm) = settings.start_mm.or(default) {
        begin_at(client, start_mm, context)?;
    }
    let search = focus::FocusSettings {
        measure: settings.measure,
        range_mm: settings.range_mm,
        exposure: settings.camera.exposure,
        image_wait: settings.camera.image_wait,
        region: settings.region.map(Into::into),
    };
    Ok(find_focus(client, rig.camera.as_mut(), optics, &search, &mut |what| context.info(what))?)
}

/// Whether the stage was moved to its place. Homing leaves it at 0, also if the run that homed it was stopped.
fn is_placed(before: AxisStatus, homed: AxisStatus) -> bool {
    before.state == homed.state && homed.asked != Nanometres(0)
}

/// Moves the sensor to a distance from the lens, with the piezo at mid-range.
fn begin_at(client: &Client, start_mm: f64, context: &Context<'_>) -> Result<()> {
    let limits = client.hello().limits;
    let middle = i64::from(limits.fine_min.0 + limits.fine_max.0) / 2;
    let coarse_nm = start_mm * 1e6 - (base_nm(client, &client.status()?) + middle) as f64;
    let (min, max) = (f64::from(limits.coarse_min.0), f64::from(limits.coarse_max.0));
    if !(min..=max).contains(&coarse_nm) {
        let [min_mm, max_mm] = [min, max].map(|end| start_mm + (end - coarse_nm) / 1e6);
        let expected = format!("the stage reaches {min_mm:.4} to {max_mm:.4} mm");
        return Err(WorkflowError::parameter("start-mm", start_mm, expected));
    }
    let coarse = Nanometres(coarse_nm as i32);
    context.info(&format!("starting at a sensor distance of {start_mm:.4} mm"));
    client.move_to(Axis::SensorCoarse, coarse)?;
    client.move_to(Axis::SensorFine, Nanometres(middle as i32))?;
    Ok(())
}

/// Figures of the optics with the far focus at the target.
fn figures(optics: Optics, focus: &Focus) -> Result<FocusFigures> {
    let far_mm = object_mm(optics.focal_length_mm(), focus.sensor_mm)?;
    let mut file = OpticsFile::from(optics);
    file.focus.far_mm = far_mm;
    let range = file.check()?.working_range();
    let of_range = |mm: f64| rounded_for(range.far_mm - range.near_mm, mm, 4);
    Ok(FocusFigures {
        m1_mm: rounded(focus.sensor_mm, 6),
        m2_mm: rounded(range.sensor_near_mm, 6),
        far_mm: of_range(range.far_mm),
        near_mm: of_range(range.near_mm),
        alpha0_mm: of_range(range.alpha0_mm),
        sensor_travel_mm: rounded(range.sensor_travel_mm, 6),
        coarse_um: um(focus.coarse),
        fine_um: um(focus.fine),
        board_ms: focus.board.as_secs_f64() * 1e3,
        places: focus.places,
        exposures: focus.exposures,
    })
}

fn object_mm(focal_length_mm: f64, sensor_mm: f64) -> Result<f64> {
    let behind = sensor_mm - focal_length_mm;
    if behind <= 0.0 {
        return Err(WorkflowError::InsideFocalLength { sensor_mm, focal_length_mm });
    }
    Ok(focal_length_mm + focal_length_mm * focal_length_mm / behind)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use farnear_protocol::message::PositionState;

    use super::*;

    #[test]
    fn a_stage_that_was_only_homed_is_not_placed() {
        let stands = |state, nm| {
            let position = Nanometres(nm);
            AxisStatus { state, asked: position, measured: position, moving: false, request: None }
        };
        let (unknown, homed) = (PositionState::Unknown, PositionState::Homed);
        assert!(!is_placed(stands(unknown, 7), stands(homed, 0)), "it had to be homed");
        assert!(!is_placed(stands(homed, 0), stands(homed, 0)), "it was homed by the run before");
        assert!(is_placed(stands(homed, 5_800_000), stands(homed, 5_800_000)));
    }

    #[test]
    fn the_figures_of_a_microscope_keep_their_digits() {
        let text = "[lens]\nfocal_length_mm = 25.0\nf_number = 1.4\n[sensor]\npixel_um = 2.4\n[focus]\nfar_mm = 47.5\nmax_blur_px = 2.5\n";
        let given = GivenOptics::parse(text, "optics.toml".as_ref()).unwrap();
        let focus = Focus {
            sensor_mm: 52.7781,
            coarse: Nanometres(0),
            fine: Nanometres(0),
            places: 1,
            exposures: 1,
            board: Duration::ZERO,
            sweep: Vec::new(),
        };
        let found = figures(given.optics, &focus).unwrap();
        // 25 + 25 x 25 / (m - 25) at 52.7781 mm and 16.8 um further: 13.6 um apart.
        assert!((found.far_mm - 47.499_739).abs() < 6e-6, "{found:?}");
        assert!((found.near_mm - 47.486_139_5).abs() < 6e-6, "{found:?}");
    }

    #[test]
    fn the_object_of_a_sharp_image_follows_from_the_lens_equation() {
        // 1/50 = 1/933 + 1/m1.
        let sensor_mm = 1.0 / (1.0 / 50.0 - 1.0 / 933.0);
        assert!((object_mm(50.0, sensor_mm).unwrap() - 933.0).abs() < 1e-9);
        let error = object_mm(50.0, 49.9).unwrap_err();
        assert!(matches!(error, WorkflowError::InsideFocalLength { .. }), "{error}");
    }
}
