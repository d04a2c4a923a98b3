//! An exposure program, from a file or as a focus stack, and the folder with its images.

use std::{fs, path::PathBuf};

use farnear_capture::{
    expose::{CaptureError, check_exposures, expose},
    ready::ensure_homed,
    record::{begin_folder, finish_sequence, record_of_sequence},
    sequence::{SequenceShot, ShotDefaults, image_name, read_program},
};
use farnear_protocol::{
    Micros,
    message::{Axis, Shot},
};
use serde::Serialize;

use super::{
    RigAddress,
    camera::{CameraSettings, EquippedRig},
    motion::nanometres,
};
use crate::{
    context::Context,
    error::{About, Result, WorkflowError},
    optics::GivenOptics,
    simulator::USUAL_PSF,
};

#[derive(Clone, PartialEq, Debug)]
pub enum Program {
    File(PathBuf),
    Stack {
        /// The axis that goes through it.
        axis: Axis,
        from_um: f64,
        to_um: f64,
        steps: usize,
    },
}

#[derive(Clone, PartialEq, Debug)]
pub struct SequenceSettings {
    pub rig: RigAddress,
    /// Its camera; the exposure is that of a stack, a file has its own.
    pub camera: CameraSettings,
    pub program: Program,
    /// How often the armed program runs; the images of all runs are kept.
    pub runs: usize,
    /// The optics file: for the record, and for what the emulated rig sees.
    pub optics: Option<PathBuf>,
    pub out: PathBuf,
}

/// What there is to say of a sequence.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct SequenceFigures {
    /// Shots of the program.
    pub shots: usize,
    pub exposures: usize,
    /// From the first move to the end of the last exposure, by the board's clock.
    pub board_ms: f64,
    /// Longest time from the start of a move until it was settled.
    pub longest_settle_ms: f64,
    /// Largest distance between the position asked for and the one measured at an exposure.
    pub largest_error_um: f64,
}

/// Runs a program and writes its images. The folder appears when everything is in it.
pub fn run(settings: &SequenceSettings, context: &Context<'_>) -> Result<SequenceFigures> {
    if settings.runs == 0 {
        return Err(WorkflowError::parameter("runs", 0, "it takes no images, expected 1 or more"));
    }
    let shots = shots(&settings.program, settings.camera.exposure)?;
    let optics = settings.optics.as_deref().map(GivenOptics::read).transpose()?;
    let folder = begin_folder(&settings.out)?;
    let lens = optics.as_ref().map(GivenOptics::for_emulation);
    let mut rig = settings.camera.connect(&settings.rig, lens, context)?;
    check_exposures(&rig.rig.client, &shots).map_err(CaptureError::from)?;
    ensure_homed(&rig.rig.client, &mut |what| context.info(what))?;
    let mut taken = Vec::new();
    for run in 0..settings.runs {
        context.info(&format!("running {} shots", shots.len()));
        let name = |name: String| if settings.runs > 1 { format!("run-{run:02}-{name}") } else { name };
        run_once(&mut rig, &shots, settings, name, &mut taken)?;
    }
    let (psf, table) = match optics {
        Some(given) => (given.optics.psf(), given.table),
        None => (USUAL_PSF, toml::Table::new()),
    };
    let record = record_of_sequence(&taken, &rig.rig.client, rig.circumstances(psf, table))
        .ok_or(CaptureError::Count { told: 0, asked: shots.len() })?;
    finish_sequence(folder, &taken, &record)?;
    context.info(&format!("wrote {}", settings.out.display()));
    Ok(figures(&shots, &taken))
}

/// Runs the program once and adds its images to `taken`.
fn run_once(
    rig: &mut EquippedRig,
    shots: &[Shot],
    settings: &SequenceSettings,
    name: impl Fn(String) -> String,
    taken: &mut Vec<SequenceShot>,
) -> Result<(), CaptureError> {
    let EquippedRig { camera, rig } = rig;
    let wait = settings.camera.image_wait;
    expose(&rig.client, camera.as_mut(), shots, wait, |record, image| {
        let shot = &shots[usize::from(record.index).min(shots.len() - 1)];
        let name = name(image_name(&record, shot.repeat));
        taken.push(SequenceShot { name, record, mode: shot.mode, image });
        Ok(())
    })
}

fn shots(program: &Program, exposure: Micros) -> Result<Vec<Shot>> {
    match program {
        Program::File(path) => {
            let text = fs::read_to_string(path).map_err(WorkflowError::read("the program", path))?;
            read_program(&text).about(|| format!("the program {}", path.display()))
        }
        Program::Stack { steps: 0, .. } => {
            Err(WorkflowError::parameter("steps", 0, "it takes no images, expected 1 or more"))
        }
        Program::Stack { axis, from_um, to_um, steps } => {
            let (from, to) = (nanometres("from", *from_um)?, nanometres("to", *to_um)?);
            Ok(ShotDefaults { exposure, ..ShotDefaults::default() }.stack(*axis, from, to, *steps))
        }
    }
}

fn figures(shots: &[Shot], taken: &[SequenceShot]) -> SequenceFigures {
    let records = || taken.iter().map(|shot| &shot.record);
    let begin = records().map(|r| r.trigger.0.saturating_sub(u64::from(r.settle.0))).min().unwrap_or(0);
    let end = records().map(|r| r.strobe_end.0).max().unwrap_or(begin);
    let error_nm = records().map(|r| r.measured(r.axis).0.abs_diff(r.asked.0));
    SequenceFigures {
        shots: shots.len(),
        exposures: taken.len(),
        board_ms: (end - begin) as f64 / 1e3,
        longest_settle_ms: f64::from(records().map(|r| r.settle.0).max().unwrap_or(0)) / 1e3,
        largest_error_um: f64::from(error_nm.max().unwrap_or(0)) / 1e3,
    }
}
