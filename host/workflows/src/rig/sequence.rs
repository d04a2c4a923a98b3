//! Runs an exposure program, from a file or as a focus stack, and writes its images.

use std::{fs, path::PathBuf};

use farnear_capture::{
    camera::Image,
    expose::{CaptureError, check_each_shot, expose_in_parts, strobe_note, unlit_note},
    ready::ensure_homed,
    record::{begin_folder, finish_sequence, record_of_sequence, write_image},
    sequence::{SequenceShot, ShotDefaults, image_name, read_program},
};
use farnear_files::staging::Staging;
use farnear_protocol::message::{Shot, TriggerMode};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    AxisName, RigAddress,
    camera::{CameraSettings, EquippedRig},
    motion::nanometres,
};
use crate::{
    context::Context,
    error::{About, Result, WorkflowError},
    optics::GivenOptics,
    request::{PathKind, Request},
    simulator::USUAL_PSF,
};

/// Most positions of a stack.
pub(super) const STEPS_MAX: usize = 10_000;

/// Run an exposure program on the board: shots from a file, or a focus stack. Write the images and capture.toml with the position
/// asked and measured, trigger and strobe times of each shot.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "\
PROGRAM.toml:
  exposure_us = 5000            # without it --exposure-us; also: settle_window_nm, settle_dwell_us, repeat, trigger
  [[shot]]
  axis = \"fine\"                 # coarse, fine, lens
  to_um = 20.0
  [[shot]]
  axis = \"fine\"
  to_um = 170.0
  trigger = \"hardware\"          # hardware, software, free-running; the same for all shots

Example: farnear rig sequence --port sim --axis fine --from 20 --to 180 --steps 9 --out stack/")
)]
#[serde(default)]
pub struct SequenceRequest {
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub rig: RigAddress,
    /// Set by the caller; the exposure is that of a stack, a file has its own.
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub camera: CameraSettings,
    /// The program.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE", conflicts_with_all = ["from", "to", "steps", "axis"]))]
    pub program: Option<PathBuf>,
    /// The axis of a focus stack.
    #[cfg_attr(feature = "clap", arg(long, requires = "steps"))]
    pub axis: Option<AxisName>,
    /// First position of the stack, um.
    #[cfg_attr(feature = "clap", arg(long, value_name = "UM", requires = "steps"))]
    pub from: Option<f64>,
    /// Last position of the stack, um.
    #[cfg_attr(feature = "clap", arg(long, value_name = "UM", requires = "steps"))]
    pub to: Option<f64>,
    /// Positions of the stack, both ends included, at most 10,000.
    #[cfg_attr(feature = "clap", arg(long, requires_all = ["axis", "from", "to"]))]
    pub steps: Option<usize>,
    /// Run the armed program so often; the images of all runs are kept.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().runs))]
    pub runs: usize,
    /// The optics file: for the record, and for what the emulated rig sees.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub optics: Option<PathBuf>,
    /// The new folder.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub out: PathBuf,
}

impl Default for SequenceRequest {
    fn default() -> Self {
        Self {
            rig: RigAddress::default(),
            camera: CameraSettings::default(),
            program: None,
            axis: None,
            from: None,
            to: None,
            steps: None,
            runs: 1,
            optics: None,
            out: PathBuf::new(),
        }
    }
}

impl Request for SequenceRequest {
    const NAME: &'static str = "rig sequence";
    const REQUIRED: &'static [&'static str] = &["out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("program", PathKind::Input), ("optics", PathKind::Input), ("out", PathKind::OutputFolder)];
    type Figures = SequenceFigures;

    fn check(&self) -> Result<()> {
        for (name, count) in [("runs", Some(self.runs)), ("steps", self.steps)] {
            if count == Some(0) {
                return Err(WorkflowError::parameter(name, 0, "it takes no images, expected 1 or more"));
            }
        }
        if let Some(steps) = self.steps.filter(|steps| *steps > STEPS_MAX) {
            return Err(WorkflowError::parameter("steps", steps, format!("expected 1 to {STEPS_MAX}")));
        }
        if let (Some(1), Some(from), Some(to)) = (self.steps, self.from, self.to)
            && from != to
        {
            let expected = format!(
                "a single image is taken at one position, but the stack goes from {from} um to {to} um; expected 2 or more, or \
                 equal positions"
            );
            return Err(WorkflowError::parameter("steps", 1, expected));
        }
        Ok(())
    }

    fn run(&self, context: &Context<'_>) -> Result<SequenceFigures> {
        run(self, context)
    }
}

crate::request::camera_request!(SequenceRequest);

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct SequenceFigures {
    pub shots: usize,
    pub exposures: usize,
    /// Board time from the first move to the end of the last exposure.
    pub board_ms: f64,
    /// Longest time from the start of a move until it settled.
    pub longest_settle_ms: f64,
    /// Largest difference between commanded and measured position at an exposure.
    pub largest_error_um: f64,
}

/// The folder appears when it is complete. Checks everything before any motion.
pub fn run(settings: &SequenceRequest, context: &Context<'_>) -> Result<SequenceFigures> {
    settings.check()?;
    let shots = settings.shots()?;
    let optics = settings.optics.as_deref().map(GivenOptics::read).transpose()?;
    let folder = begin_folder(&settings.out)?;
    let mut rig = settings.camera.connect(&settings.rig, optics.as_ref(), context)?;
    let taken = take(&mut rig, &shots, settings, optics, folder, context)?;
    Ok(figures(&shots, &taken))
}

/// Runs the shots with an open rig and writes the folder. Checks everything before any motion.
pub(super) fn take(
    rig: &mut EquippedRig,
    shots: &[Shot],
    settings: &SequenceRequest,
    optics: Option<GivenOptics>,
    folder: Staging,
    context: &Context<'_>,
) -> Result<Vec<SequenceShot>> {
    check_each_shot(&rig.rig.client, shots)?;
    ensure_homed(&rig.rig.client, &mut |what| context.info(what))?;
    let lit = settings.camera.light_with(optics.as_ref());
    let mut taken = Taken { folder, shots: Vec::new(), first: None };
    for run in 0..settings.runs {
        context.info(&format!("running {} shots", shots.len()));
        let name = |name: String| name_in_run(run, settings.runs, name);
        run_once(rig, shots, settings, name, &mut taken, context)?;
    }
    let (psf, table) = match optics {
        Some(given) => (given.optics.psf(), given.table),
        None => (USUAL_PSF, toml::Table::new()),
    };
    let Taken { folder, shots: taken, first } = taken;
    let record = first
        .and_then(|image| record_of_sequence(&taken, &image, &rig.rig.client, rig.circumstances(psf, table)))
        .ok_or(CaptureError::Count { reported: 0, asked: shots.len() })?;
    // A free-running camera has its own exposure time. A wrong one is wrong in every shot.
    let triggered = taken.iter().filter(|shot| shot.mode != TriggerMode::FreeRunning);
    let mut records = triggered.map(|shot| &shot.record);
    if let Some(note) = records.clone().find_map(strobe_note) {
        context.info(&note);
    }
    if let Some(doubt) = lit.and_then(|_| records.find_map(unlit_note)) {
        context.progress.warn(&doubt);
    }
    finish_sequence(folder, &record)?;
    context.info(&format!("wrote {}", settings.out.display()));
    Ok(taken)
}

/// File name of an image of a run; the names of all `runs` sort in their order.
fn name_in_run(run: usize, runs: usize, name: String) -> String {
    let digits = runs.saturating_sub(1).to_string().len().max(2);
    if runs > 1 { format!("run-{run:0digits$}-{name}") } else { name }
}

/// Shots whose images are in the folder.
struct Taken {
    folder: Staging,
    shots: Vec<SequenceShot>,
    first: Option<Image>,
}

fn run_once(
    rig: &mut EquippedRig,
    shots: &[Shot],
    settings: &SequenceRequest,
    name: impl Fn(String) -> String,
    taken: &mut Taken,
    context: &Context<'_>,
) -> Result<()> {
    let exposures: usize = shots.iter().map(|shot| usize::from(shot.repeat.max(1))).sum();
    let EquippedRig { camera, rig } = rig;
    let wait = settings.camera.image_wait;
    expose_in_parts(&rig.client, camera.as_mut(), shots, wait, |index, record, image| -> Result<()> {
        let shot = &shots[index];
        let name = name(image_name(index, shots.len(), &record, shot.repeat));
        write_image(&taken.folder, &name, &image)?;
        taken.first.get_or_insert(image);
        taken.shots.push(SequenceShot { name, record, mode: shot.mode });
        context.progress.advance("images", taken.shots.len(), Some(exposures * settings.runs));
        Ok(())
    })
}

impl SequenceRequest {
    fn shots(&self) -> Result<Vec<Shot>> {
        if let Some(path) = &self.program {
            let text = fs::read_to_string(path).map_err(WorkflowError::read("the program", path))?;
            return read_program(&text, self.camera.exposure)
                .about(|| format!("the program {}", path.display()));
        }
        let (Some(axis), Some(from), Some(to), Some(steps)) = (self.axis, self.from, self.to, self.steps)
        else {
            let expected = "expected a program, or axis, from, to and steps";
            return Err(WorkflowError::parameter("program", "none", expected));
        };
        let (from, to) = (nanometres("from", from)?, nanometres("to", to)?);
        let defaults = ShotDefaults { exposure: self.camera.exposure, ..ShotDefaults::default() };
        Ok(defaults.stack(axis.into(), from, to, steps))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_names_of_the_images_sort_by_run() {
        let names = |runs| (0..runs).map(|run| name_in_run(run, runs, "a".into())).collect::<Vec<_>>();
        assert_eq!([&*names(1)[0], &*names(2)[1], &*names(101)[7]], ["a", "run-01-a", "run-007-a"]);
        assert!(names(101).is_sorted());
    }
}
