//! A series of pairs, each in its own folder: to measure noise, or changes over time (time lapse).

use std::{
    path::PathBuf,
    thread,
    time::{Duration, Instant},
};

use farnear_capture::record::{begin_folder, finish_folder};
use serde::Serialize;

use super::{
    RigAddress,
    camera::CameraSettings,
    pair::{PairFigures, take},
};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    optics::GivenOptics,
};

const MOST: usize = 1000;
/// Interval at which a wait looks for cancellation.
const LOOK: Duration = Duration::from_millis(50);
/// Wait that is announced.
const SAID: Duration = Duration::from_secs(1);

#[derive(Clone, Debug)]
pub struct SeriesSettings {
    pub rig: RigAddress,
    pub camera: CameraSettings,
    pub optics: PathBuf,
    /// From the start of a pair to that of the next; a pair that takes longer delays the next one.
    pub interval: Duration,
    pub out: Vec<PathBuf>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct SeriesFigures {
    pub pairs: Vec<PairFigures>,
}

/// Captures the pairs. A cancelled series keeps its complete pairs.
pub fn capture(settings: &SeriesSettings, context: &Context<'_>) -> Result<SeriesFigures> {
    let count = settings.out.len();
    if count == 0 || count > MOST {
        return Err(WorkflowError::parameter("pairs", count, format!("expected 1 to {MOST}")));
    }
    let optics = GivenOptics::read(&settings.optics)?;
    let mut rig = settings.camera.connect(&settings.rig, Some(&optics), context)?;
    let mut pairs = Vec::new();
    let mut due = Instant::now();
    for out in &settings.out {
        wait(due, context)?;
        // A late pair delays the next one: they are at least an interval apart.
        due = if due.elapsed() > LOOK { Instant::now() } else { due } + settings.interval;
        let folder = begin_folder(out)?;
        let (pair, record) = take(&mut rig, &optics, &settings.camera, context)?;
        finish_folder(folder, &pair, &record)?;
        pairs.push(PairFigures::from(&pair));
        context.progress.advance("pairs", pairs.len(), Some(count));
    }
    Ok(SeriesFigures { pairs })
}

fn wait(due: Instant, context: &Context<'_>) -> Result<()> {
    let left = || due.saturating_duration_since(Instant::now());
    if left() > SAID {
        context.info(&format!("the next pair is due in {:.0} s", left().as_secs_f64()));
    }
    let whole = left();
    while !left().is_zero() {
        context.cancel.check("capturing a series")?;
        if whole > SAID {
            let passed = whole.saturating_sub(left()).as_secs() as usize;
            context.progress.advance(
                "seconds until the next pair",
                passed,
                Some(whole.as_secs() as usize + 1),
            );
        }
        thread::sleep(left().min(LOOK));
    }
    context.cancel.check("capturing a series")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::context::Counted;

    #[test]
    fn the_seconds_of_a_wait_are_counted() {
        let counted = Counted::default();
        let context = Context { progress: &counted, ..Context::unattended() };
        wait(Instant::now() + Duration::from_millis(1100), &context).unwrap();
        let mut seen = counted.0.into_inner().unwrap();
        seen.dedup();
        assert_eq!(seen, [(0, Some(2)), (1, Some(2))]);
    }

    #[test]
    fn a_pair_waits_until_it_is_due_and_a_stop_ends_the_wait() {
        let context = Context::unattended();
        let begin = Instant::now();
        wait(begin + Duration::from_millis(120), &context).unwrap();
        assert!(begin.elapsed() >= Duration::from_millis(120));
        wait(begin, &context).unwrap();
        context.cancel.cancel();
        assert!(wait(Instant::now() + Duration::from_secs(3600), &context).unwrap_err().is_cancelled());
    }
}
