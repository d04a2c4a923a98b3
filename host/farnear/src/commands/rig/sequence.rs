//! `farnear rig sequence`: runs an exposure program, from a file or as a focus stack, and writes its images.

use std::{fs, path::PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use farnear_capture::{
    expose::{CaptureError, expose},
    ready::ensure_homed,
    record::{begin_folder, finish_sequence, record_of_sequence},
    sequence::{SequenceShot, ShotDefaults, image_name, read_program},
};
use farnear_depth::psf::Psf;
use farnear_protocol::message::Shot;
use serde::Serialize;

use super::{
    AxisName, Target,
    camera::{self, CameraArguments},
    nanometres,
};
use crate::{
    files,
    report::{self, Usage},
};

/// Run an exposure program on the board: shots from a file, or a focus stack. Writes the images and capture.toml with the
/// position asked and measured, trigger and strobe times of each shot.
#[derive(Args)]
#[command(after_help = "\
PROGRAM.toml:
  exposure_us = 5000            # also: settle_window_nm, settle_dwell_us, repeat, trigger
  [[shot]]
  axis = \"fine\"                 # coarse, fine, lens
  to_um = 20.0
  [[shot]]
  axis = \"fine\"
  to_um = 170.0
  trigger = \"hardware\"          # hardware, software, free-running; the same for all shots

Example: farnear rig sequence --port sim --axis fine --from 20 --to 180 --steps 9 --out stack/")]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    camera: CameraArguments,
    /// The program.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["from", "to", "steps", "axis"])]
    program: Option<PathBuf>,
    /// The axis of a focus stack.
    #[arg(long, requires = "steps")]
    axis: Option<AxisName>,
    /// First position of the stack, um.
    #[arg(long, value_name = "UM", allow_negative_numbers = true, requires = "steps")]
    from: Option<f64>,
    /// Last position of the stack, um.
    #[arg(long, value_name = "UM", allow_negative_numbers = true, requires = "steps")]
    to: Option<f64>,
    /// Positions of the stack.
    #[arg(long, requires_all = ["axis", "from", "to"])]
    steps: Option<usize>,
    /// Run the armed program so often; the images of all runs are kept.
    #[arg(long, default_value_t = 1)]
    runs: usize,
    /// The optics file: for the record, and for what the emulated rig sees.
    #[arg(long, value_name = "FILE")]
    optics: Option<PathBuf>,
    /// The new folder.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Figures {
    shots: usize,
    exposures: usize,
    /// From the first move to the end of the last exposure, by the board's clock.
    board_ms: f64,
    longest_settle_ms: f64,
    /// Largest distance between the position asked for and the one measured at an exposure.
    largest_error_um: f64,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let shots = shots(&arguments)?;
    let (psf, table) = match &arguments.optics {
        Some(path) => (files::optics::read(path)?.psf(), files::optics::text(path)?.parse()?),
        None => (Psf::Gaussian { k: 0.4578 }, toml::Table::new()),
    };
    let folder = begin_folder(&arguments.out)?;
    let camera = arguments.camera.open_early(&arguments.target)?;
    let rig = arguments.target.connect(arguments.optics.as_deref().map(|path| (path, psf)))?;
    let mut camera = camera::of_rig(camera, &rig)?;
    ensure_homed(&rig.client, &mut |what| eprintln!("{what}"))?;
    let mut taken: Vec<SequenceShot> = Vec::new();
    for run in 0..arguments.runs {
        eprintln!("running {} shots", shots.len());
        let wait = arguments.camera.image_wait();
        expose(&rig.client, camera.as_mut(), &shots, wait, |record, image| -> Result<(), CaptureError> {
            let shot = &shots[usize::from(record.index).min(shots.len() - 1)];
            let mut name = image_name(&record, shot.repeat);
            if arguments.runs > 1 {
                name = format!("run-{run:02}-{name}");
            }
            taken.push(SequenceShot { name, record, mode: shot.mode, image });
            Ok(())
        })?;
    }
    let circumstances = camera::circumstances(&rig, &arguments.target, camera.as_ref(), psf, table);
    let record = record_of_sequence(&taken, &rig.client, circumstances).context("no exposure was taken")?;
    finish_sequence(folder, &taken, &record)?;
    eprintln!("wrote {}", arguments.out.display());
    report::print(&figures(&shots, &taken), arguments.json)
}

fn shots(arguments: &Arguments) -> Result<Vec<Shot>> {
    if arguments.runs == 0 {
        bail!(Usage("--runs 0 takes no images".into()));
    }
    if let Some(path) = &arguments.program {
        let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        return read_program(&text).with_context(|| format!("the program {}", path.display()));
    }
    let (Some(axis), Some(from), Some(to), Some(steps)) =
        (arguments.axis, arguments.from, arguments.to, arguments.steps)
    else {
        bail!(Usage("a program is needed: --program FILE, or --axis, --from, --to and --steps".into()));
    };
    if steps == 0 {
        bail!(Usage("--steps 0 takes no images".into()));
    }
    let defaults = ShotDefaults { exposure: arguments.camera.exposure(), ..ShotDefaults::default() };
    Ok(defaults.stack(axis.axis(), nanometres(from)?, nanometres(to)?, steps))
}

fn figures(shots: &[Shot], taken: &[SequenceShot]) -> Figures {
    let records = || taken.iter().map(|shot| &shot.record);
    let begin = records().map(|r| r.trigger.0.saturating_sub(u64::from(r.settle.0))).min().unwrap_or(0);
    let end = records().map(|r| r.strobe_end.0).max().unwrap_or(begin);
    let error_nm = records().map(|r| r.measured(r.axis).0.abs_diff(r.asked.0));
    Figures {
        shots: shots.len(),
        exposures: taken.len(),
        board_ms: (end - begin) as f64 / 1e3,
        longest_settle_ms: f64::from(records().map(|r| r.settle.0).max().unwrap_or(0)) / 1e3,
        largest_error_um: f64::from(error_nm.max().unwrap_or(0)) / 1e3,
    }
}
