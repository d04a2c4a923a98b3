//! Continuous capture: pairs, or a cycle of shots, at a pace kept by the board.

mod figures;
mod folder;

use std::{fs, path::PathBuf};

use farnear_capture::{
    continuous::{Continuous, Cycles, Frame, Outcome, Pace},
    expose::{check_shots, strobe_note},
    pair::{Exposures, Reach, reach},
    plan::SensorPair,
    ready::ensure_homed,
    sequence::read_program,
};
use farnear_protocol::{
    Micros,
    message::{Shot, TriggerMode},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::{figures::Tally, folder::Folder};
use super::{
    RigAddress,
    camera::{CameraSettings, EquippedRig},
};
use crate::{
    context::Context,
    error::{About, Result, WorkflowError},
    optics::GivenOptics,
    request::{PathKind, Request},
};

pub use figures::ContinuousFigures;

/// Exposures per second. The request's 32-bit microseconds and any camera allow no more.
const RATES_HZ: std::ops::RangeInclusive<f64> = 0.001..=10_000.0;

/// Capture far, near, far, near ... (or any cycle of shots) until the limit or Ctrl-C: home if needed, move the stage near, and let
/// the board hold the pace.
///
/// Prints the exposures per second, what was dropped and why, and the error of the pace. With --out each pair is a capture folder
/// (pair-00000, pair-00001, ...) that `farnear depth` takes; frames.csv has a row for each frame.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear rig continuous --port sim --optics optics.toml --rate 30 --for 10 --out run/"
    )
)]
#[serde(default)]
pub struct ContinuousRequest {
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub rig: RigAddress,
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub camera: CameraSettings,
    /// The optics file: far and near focus in turn.
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "FILE", required_unless_present = "program", conflicts_with = "program")
    )]
    pub optics: Option<PathBuf>,
    /// A cycle of up to 64 shots instead, a program as `farnear rig sequence` takes it.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub program: Option<PathBuf>,
    /// Exposures per second, each at its microsecond [default: as fast as position and camera allow, about 50].
    #[cfg_attr(feature = "clap", arg(long, value_name = "HZ"))]
    pub rate: Option<f64>,
    /// End after this time by the board's clock, seconds.
    #[cfg_attr(feature = "clap", arg(long, value_name = "S", conflicts_with = "frames"))]
    pub r#for: Option<f64>,
    /// End after this number of exposures.
    #[cfg_attr(feature = "clap", arg(long, value_name = "N"))]
    pub frames: Option<u32>,
    /// Keep the images in this new folder.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub out: Option<PathBuf>,
}

impl Request for ContinuousRequest {
    const NAME: &'static str = "rig continuous";
    const REQUIRED: &'static [&'static str] = &[];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("optics", PathKind::Input), ("program", PathKind::Input), ("out", PathKind::OutputFolder)];
    type Figures = ContinuousFigures;

    fn run(&self, context: &Context<'_>) -> Result<ContinuousFigures> {
        run(self, context)
    }
}

crate::request::camera_request!(ContinuousRequest);

impl ContinuousRequest {
    fn pace(&self) -> Result<Pace> {
        let period = match self.rate {
            None => Micros(0),
            Some(rate) if RATES_HZ.contains(&rate) => Micros((1e6 / rate).round() as u32),
            Some(rate) => {
                return Err(WorkflowError::parameter(
                    "rate",
                    rate,
                    "expected 0.001 to 10000 exposures a second",
                ));
            }
        };
        if self.frames == Some(0) {
            return Err(WorkflowError::parameter("frames", 0, "it takes no images, expected 1 or more"));
        }
        if let Some(seconds) = self.r#for.filter(|seconds| !(*seconds > 0.0 && seconds.is_finite())) {
            return Err(WorkflowError::parameter("for", seconds, "expected a number of seconds above 0"));
        }
        let exposures = self.frames.unwrap_or(0);
        Ok(Pace { period, exposures })
    }
}

struct Ready {
    shots: Vec<Shot>,
    pair: Option<(GivenOptics, SensorPair, Reach)>,
}

/// Cancelling is not an error: the figures cover the frames taken. Checks everything before any motion.
pub fn run(settings: &ContinuousRequest, context: &Context<'_>) -> Result<ContinuousFigures> {
    let pace = settings.pace()?;
    let (program, optics) = match (&settings.program, &settings.optics) {
        (None, None) => {
            return Err(WorkflowError::parameter("optics", "none", "expected optics or a program"));
        }
        (None, Some(optics)) => (None, Some(GivenOptics::read(optics)?)),
        (Some(path), _) => {
            let text = fs::read_to_string(path).map_err(WorkflowError::read("the program", path))?;
            let shots = read_program(&text, settings.camera.exposure);
            (Some(shots.about(|| format!("the program {}", path.display()))?), None)
        }
    };
    let mut folder = settings.out.as_deref().map(Folder::begin).transpose()?;
    let mut equipped = settings.camera.connect(&settings.rig, optics.as_ref(), context)?;
    let ready = make_ready(&equipped, program, optics, settings, context)?;
    context.info("capturing; Ctrl-C ends it");
    let mut tally = Tally::new(pace.period, &ready.shots);
    let captured = capture(&mut equipped, &ready, (settings, pace), &mut tally, folder.as_mut(), context);
    match captured {
        // Fails if the board is silent, and so perhaps not stopped.
        Err(error) if error.is_cancelled() => equipped.rig.client.stop()?,
        captured => captured?,
    }
    if let Some(folder) = folder.filter(|folder| !folder.is_empty()) {
        context.info(&format!("wrote {}", folder.path().display()));
    }
    Ok(tally.figures())
}

fn make_ready(
    equipped: &EquippedRig,
    program: Option<Vec<Shot>>,
    optics: Option<GivenOptics>,
    settings: &ContinuousRequest,
    context: &Context<'_>,
) -> Result<Ready> {
    let (client, say) = (&equipped.rig.client, &mut |what: &str| context.info(what));
    let Some(optics) = optics else {
        let shots = program.unwrap_or_default();
        check_shots(client, &shots)?;
        ensure_homed(client, say)?;
        return Ok(Ready { shots, pair: None });
    };
    let range = optics.optics.working_range();
    let sensor = SensorPair { far_mm: range.sensor_far_mm, near_mm: range.sensor_near_mm };
    let exposures = Exposures { exposure: settings.camera.exposure, ..Exposures::default() };
    let reach = reach(client, &sensor, &exposures, say)?;
    Ok(Ready { shots: reach.shots.to_vec(), pair: Some((optics, sensor, reach)) })
}

fn capture(
    equipped: &mut EquippedRig,
    ready: &Ready,
    (settings, pace): (&ContinuousRequest, Pace),
    tally: &mut Tally,
    mut folder: Option<&mut Folder>,
    context: &Context<'_>,
) -> Result<()> {
    let circumstances = ready
        .pair
        .as_ref()
        .map(|(optics, ..)| equipped.circumstances(optics.optics.psf(), optics.table.clone()));
    let EquippedRig { camera, rig } = equipped;
    let wait = settings.camera.image_wait;
    let mut stream = Continuous::start(&rig.client, camera.as_mut(), &ready.shots, pace, wait)?;
    let mut cycles = Cycles::of(&ready.shots);
    // A free-running camera has its own exposure time. A wrong one is wrong in every frame.
    let mut noted = ready.shots.iter().any(|shot| shot.mode == TriggerMode::FreeRunning);
    while let Some(outcome) = stream.outcome()? {
        context.cancel.check("capturing continuously")?;
        if let (Some(seconds), Outcome::Taken(frame)) = (settings.r#for, &outcome)
            && tally.seconds_at(frame) >= seconds
        {
            return Ok(());
        }
        tally.count(&outcome);
        context.progress.advance("frames", tally.exposures(), None);
        if let Some(folder) = &mut folder {
            folder.note(&outcome)?;
        }
        let Outcome::Taken(frame) = outcome else { continue };
        if let Some(note) = strobe_note(&frame.record).filter(|_| !noted) {
            context.info(&note);
            noted = true;
        }
        match (&mut folder, &ready.pair, &circumstances) {
            (Some(folder), Some((_, sensor, reach)), Some(circumstances)) => {
                let Some(cycle) = cycles.push(*frame) else { continue };
                tally.completed();
                folder.pair(cycle, (sensor, reach.coarse), &rig.client, circumstances)?;
            }
            (Some(folder), ..) => {
                folder.image(&frame)?;
                tally.completed_by(cycles.push(*frame));
            }
            (None, ..) => tally.completed_by(cycles.push(*frame)),
        }
    }
    Ok(())
}

impl Tally {
    fn completed_by(&mut self, cycle: Option<Vec<Frame>>) {
        if cycle.is_some() {
            self.completed();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rejects_impossible_paces() {
        let settings = |rate, frames, r#for| ContinuousRequest {
            program: Some("none".into()),
            rate,
            frames,
            r#for,
            ..Default::default()
        };
        for (rate, frames, seconds) in [
            (Some(0.0), None, None),
            (Some(f64::NAN), None, None),
            (Some(1e9), None, None),
            (None, Some(0), None),
            (None, None, Some(-1.0)),
        ] {
            assert!(
                settings(rate, frames, seconds).pace().is_err_and(|error| error.is_usage()),
                "{rate:?} {frames:?} {seconds:?}"
            );
        }
        let pace = settings(Some(30.0), Some(7), None).pace().unwrap();
        assert_eq!(pace, Pace { period: Micros(33_333), exposures: 7 });
    }
}
