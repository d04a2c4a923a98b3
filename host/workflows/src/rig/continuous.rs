//! Continuous capture: far, near, far, near ... or a cycle of shots at a pace that the board holds, until its end or until a user
//! ends it; with figures of the pace, and pairs or images in a folder where one is named.

mod figures;
mod folder;

use std::{fs, path::PathBuf};

use farnear_capture::{
    continuous::{Continuous, Cycles, Frame, Outcome, Pace},
    expose::{CaptureError, check_exposures},
    pair::{Exposures, Reach, reach},
    plan::SensorPair,
    ready::ensure_homed,
    sequence::read_program,
};
use farnear_protocol::{Micros, message::Shot};

use self::{figures::Tally, folder::Folder};
use super::{
    RigAddress,
    camera::{CameraSettings, EquippedRig},
};
use crate::{
    context::Context,
    error::{About, Result, WorkflowError},
    optics::GivenOptics,
};

pub use figures::ContinuousFigures;

/// Fastest and slowest pace, exposures a second: beyond it the request's 32-bit microseconds, and any camera, end.
const RATES_HZ: std::ops::RangeInclusive<f64> = 0.001..=10_000.0;

/// Repeated exposures.
#[derive(Clone, PartialEq, Debug)]
pub enum Cycle {
    /// Far and near focus of these optics.
    Pair {
        optics: PathBuf,
    },
    Program {
        path: PathBuf,
    },
}

/// When it is enough; the user may end it at any time.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Enough {
    /// On request of the user.
    Never,
    /// After this many exposures.
    Exposures(u32),
    /// After this many seconds of the board's time, from the first exposure.
    Seconds(f64),
}

#[derive(Clone, PartialEq, Debug)]
pub struct ContinuousSettings {
    pub rig: RigAddress,
    pub camera: CameraSettings,
    pub cycle: Cycle,
    /// Exposures a second; `None` = as fast as position and camera allow.
    pub rate_hz: Option<f64>,
    pub enough: Enough,
    /// The new folder, where images are kept.
    pub out: Option<PathBuf>,
}

impl ContinuousSettings {
    fn pace(&self) -> Result<Pace> {
        let period = match self.rate_hz {
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
        let exposures = match self.enough {
            Enough::Exposures(0) => {
                return Err(WorkflowError::parameter("frames", 0, "it takes no images, expected 1 or more"));
            }
            Enough::Exposures(exposures) => exposures,
            Enough::Seconds(seconds) if !(seconds > 0.0 && seconds.is_finite()) => {
                return Err(WorkflowError::parameter("for", seconds, "expected a number of seconds above 0"));
            }
            Enough::Seconds(_) | Enough::Never => 0,
        };
        Ok(Pace { period, exposures })
    }
}

/// A rig that is ready to begin.
struct Ready {
    shots: Vec<Shot>,
    pair: Option<(GivenOptics, SensorPair, Reach)>,
}

/// Captures until the end condition. Cancelling ends it in order: the figures cover the exposures until then.
pub fn run(settings: &ContinuousSettings, context: &Context<'_>) -> Result<ContinuousFigures> {
    let pace = settings.pace()?;
    let (program, optics) = match &settings.cycle {
        Cycle::Pair { optics } => (None, Some(GivenOptics::read(optics)?)),
        Cycle::Program { path } => {
            let text = fs::read_to_string(path).map_err(WorkflowError::read("the program", path))?;
            (Some(read_program(&text).about(|| format!("the program {}", path.display()))?), None)
        }
    };
    let mut folder = settings.out.as_deref().map(Folder::begin).transpose()?;
    let lens = optics.as_ref().map(GivenOptics::for_emulation);
    let mut equipped = settings.camera.connect(&settings.rig, lens, context)?;
    let ready = make_ready(&equipped, program, optics, settings, context)?;
    context.info("capturing; Ctrl-C ends it");
    let mut tally = Tally::new(pace.period, &ready.shots);
    let captured = capture(&mut equipped, &ready, (settings, pace), &mut tally, folder.as_mut(), context);
    match captured {
        Err(error) if !error.is_cancelled() => return Err(error),
        _ => {}
    }
    if let Some(folder) = folder {
        folder.finish()?;
        context.info(&format!("wrote {}", settings.out.as_deref().unwrap_or(".".as_ref()).display()));
    }
    Ok(tally.figures())
}

fn make_ready(
    equipped: &EquippedRig,
    program: Option<Vec<Shot>>,
    optics: Option<GivenOptics>,
    settings: &ContinuousSettings,
    context: &Context<'_>,
) -> Result<Ready> {
    let (client, say) = (&equipped.rig.client, &mut |what: &str| context.info(what));
    let Some(optics) = optics else {
        let shots = program.unwrap_or_default();
        check_exposures(client, &shots).map_err(CaptureError::from)?;
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
    (settings, pace): (&ContinuousSettings, Pace),
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
    while let Some(outcome) = stream.outcome()? {
        context.cancel.check("capturing continuously")?;
        if let (Enough::Seconds(seconds), Outcome::Taken(frame)) = (settings.enough, &outcome)
            && tally.seconds_at(frame) >= seconds
        {
            return Ok(());
        }
        tally.count(&outcome);
        context.progress.advance("frames", tally.exposures(), None);
        if let Some(folder) = &mut folder {
            folder.note(&outcome);
        }
        let Outcome::Taken(frame) = outcome else { continue };
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
    use crate::rig::camera::CameraAddress;

    #[test]
    fn paces_that_cannot_be_are_refused() {
        let settings = |rate_hz, enough| ContinuousSettings {
            rig: RigAddress::Port("none".into()),
            camera: CameraSettings {
                address: CameraAddress::Emulated,
                exposure: Micros(5_000),
                image_wait: std::time::Duration::from_secs(1),
                settings: Vec::new(),
                light: None,
            },
            cycle: Cycle::Program { path: "none".into() },
            rate_hz,
            enough,
            out: None,
        };
        for (rate_hz, enough) in [
            (Some(0.0), Enough::Never),
            (Some(f64::NAN), Enough::Never),
            (Some(1e9), Enough::Never),
            (None, Enough::Exposures(0)),
            (None, Enough::Seconds(-1.0)),
        ] {
            assert!(
                settings(rate_hz, enough).pace().is_err_and(|error| error.is_usage()),
                "{rate_hz:?} {enough:?}"
            );
        }
        let pace = settings(Some(30.0), Enough::Exposures(7)).pace().unwrap();
        assert_eq!(pace, Pace { period: Micros(33_333), exposures: 7 });
    }
}
