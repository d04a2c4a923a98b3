//! `farnear rig focus`: finds m1, the sensor distance of the best focus, and says what working range follows from it.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args;
use farnear_capture::{
    describe::um,
    focus::{FocusSettings, find_focus},
    ready::{base_nm, ensure_homed},
};
use farnear_depth::{focus_measure::FocusMeasure, optics::OpticsFile};
use farnear_protocol::{Nanometres, message::Axis};
use serde::Serialize;

use super::{
    Target,
    camera::{self, CameraArguments},
};
use crate::{files, report};

/// Find the sensor distance at which a target is sharpest (m1), and the working range that begins there.
///
/// Put the target where the working range shall end far away, and let the rig focus. The second distance
/// follows from the optics: m2 = m1 + 2 Fe Rmax (Li 2014, eqs. 4.3 and 4.4).
#[derive(Args)]
#[command(after_help = "Example: farnear rig focus --port sim --scene plane:900 --optics optics.toml --json")]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    camera: CameraArguments,
    /// The optics file; its far focus is where the search begins, unless told otherwise.
    #[arg(long, value_name = "FILE")]
    optics: PathBuf,
    /// Begin at this sensor distance; without it, where the stage stands, or at the optics' far focus if it had to be
    /// homed.
    #[arg(long, value_name = "MM")]
    start_mm: Option<f64>,
    /// How far the focus may be from the start.
    #[arg(long, value_name = "MM", default_value_t = 1.0)]
    range_mm: f64,
    /// Focus measure: tenengrad, modified-laplacian or fft-sum.
    #[arg(long, default_value = "tenengrad")]
    measure: FocusMeasure,
    /// The part of the image that counts.
    #[arg(long, value_name = "COLUMN,ROW,WIDTH,HEIGHT", value_delimiter = ',')]
    region: Vec<usize>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Figures {
    /// Where the target is sharpest.
    m1_mm: f64,
    /// The second sensor distance of a pair.
    m2_mm: f64,
    far_mm: f64,
    near_mm: f64,
    alpha0_mm: f64,
    sensor_travel_mm: f64,
    coarse_um: f64,
    fine_um: f64,
    /// The board's time for the search.
    board_ms: f64,
    places: usize,
    exposures: usize,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let optics = files::optics::read(&arguments.optics)?;
    let region = match arguments.region[..] {
        [] => None,
        [column, row, width, height] => Some([column, row, width, height]),
        _ => bail!(report::Usage("--region needs four numbers: COLUMN,ROW,WIDTH,HEIGHT".into())),
    };
    if !(arguments.range_mm > 0.0 && arguments.range_mm.is_finite()) {
        bail!(report::Usage(format!("--range-mm {} must be a positive length", arguments.range_mm)));
    }
    let camera = arguments.camera.open_early(&arguments.target)?;
    let rig = arguments.target.connect(Some((&arguments.optics, optics.psf())))?;
    let mut camera = camera::of_rig(camera, &rig)?;
    let mut say = |what: &str| eprintln!("{what}");

    let homings = rig.client.status()?.coarse.state;
    ensure_homed(&rig.client, &mut say)?;
    let was_homed = homings == rig.client.status()?.coarse.state;
    let default = (!was_homed).then_some(optics.working_range().sensor_far_mm);
    if let Some(start_mm) = arguments.start_mm.or(default) {
        let status = rig.client.status()?;
        let limits = rig.client.hello().limits;
        let middle = i64::from(limits.fine_min.0 + limits.fine_max.0) / 2;
        let coarse = start_mm * 1e6 - (base_nm(&rig.client, &status) + middle) as f64;
        let coarse = farnear_capture::sequence::nanometres(coarse / 1e3)
            .with_context(|| format!("--start-mm {start_mm} is no sensor distance"))?;
        say(&format!("starting at a sensor distance of {start_mm:.4} mm"));
        rig.client.move_to(Axis::SensorCoarse, coarse)?;
        rig.client.move_to(Axis::SensorFine, Nanometres(middle as i32))?;
    }
    let settings = FocusSettings {
        measure: arguments.measure,
        range_mm: arguments.range_mm,
        exposure: arguments.camera.exposure(),
        image_wait: arguments.camera.image_wait(),
        region,
    };
    let focus = find_focus(&rig.client, camera.as_mut(), &optics, &settings, &mut say)?;

    // The optics with their far focus where the target was found to be.
    let far_mm = object_mm(optics.focal_length_mm(), focus.sensor_mm)?;
    let mut file = OpticsFile::from(optics);
    file.focus.far_mm = far_mm;
    let range = file.check()?.working_range();
    let figures = Figures {
        m1_mm: report::rounded(focus.sensor_mm, 6),
        m2_mm: report::rounded(range.sensor_near_mm, 6),
        far_mm: report::rounded(range.far_mm, 4),
        near_mm: report::rounded(range.near_mm, 4),
        alpha0_mm: report::rounded(range.alpha0_mm, 4),
        sensor_travel_mm: report::rounded(range.sensor_travel_mm, 6),
        coarse_um: um(focus.coarse),
        fine_um: um(focus.fine),
        board_ms: focus.board.as_secs_f64() * 1e3,
        places: focus.places,
        exposures: focus.exposures,
    };
    report::print(&figures, arguments.json)
}

/// Where an object is whose image is sharp at this sensor distance.
fn object_mm(focal_length_mm: f64, sensor_mm: f64) -> Result<f64> {
    let behind = sensor_mm - focal_length_mm;
    if behind <= 0.0 {
        bail!(
            "the sharpest image lies {sensor_mm:.4} mm behind the lens, inside its focal length of {focal_length_mm} mm: \
             is the setting datum_nm right (`farnear rig settings`)?"
        );
    }
    Ok(focal_length_mm + focal_length_mm * focal_length_mm / behind)
}
