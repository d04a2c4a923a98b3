//! Cuts a folder of masks into passages of a person, for example KTH's walking.

use std::{
    ops::Range,
    path::{Path, PathBuf},
    time::Instant,
};

use farnear_files::{
    masks::{self, MaskError},
    order,
    staging::Staging,
};
use farnear_silhouettes::mask::area;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{SilhouettesError, markers::Performer, performances::samples_entry};
use crate::{
    context::Context,
    counter::Counter,
    error::Result,
    figures::rounded,
    parameters::at_least,
    request::{PathKind, Request},
};

/// Cut a folder of masks into passages: where the numbers in their names leap, and where no person is visible.
///
/// Writes a folder of masks for every passage and `samples.toml` for `farnear activity`.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear silhouettes passages kth/person01 --activity walk --subject person01 --out passages/"
    )
)]
#[serde(default)]
pub struct PassagesRequest {
    /// The folder of masks: pictures of black and white, JPEG too.
    pub masks: PathBuf,
    /// The activity in all of them.
    #[cfg_attr(feature = "clap", arg(long))]
    pub activity: String,
    /// The person.
    #[cfg_attr(feature = "clap", arg(long))]
    pub subject: String,
    /// Folder for the passages and samples.toml; must not exist or be empty.
    #[cfg_attr(feature = "clap", arg(long))]
    pub out: PathBuf,
    /// Leave out shorter passages, frames.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().least_frames))]
    pub least_frames: usize,
    /// Ignore fewer pixels.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().least_px))]
    pub least_px: usize,
}

impl Default for PassagesRequest {
    fn default() -> Self {
        Self {
            masks: PathBuf::new(),
            activity: String::new(),
            subject: String::new(),
            out: PathBuf::new(),
            least_frames: 20,
            least_px: 200,
        }
    }
}

impl Request for PassagesRequest {
    const NAME: &'static str = "silhouettes passages";
    const REQUIRED: &'static [&'static str] = &["masks", "activity", "subject", "out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("masks", PathKind::Input), ("out", PathKind::OutputFolder)];
    type Figures = PassagesFigures;

    fn run(&self, context: &Context<'_>) -> Result<PassagesFigures> {
        cut(self, context)
    }
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PassagesFigures {
    pub masks: usize,
    pub passages: usize,
    pub frames: usize,
    pub too_short: usize,
    pub seconds: f64,
}

const DURING: &str = "cutting passages";

/// Cuts at gaps in the numbers of the masks' names, and at frames without a person.
pub fn cut(settings: &PassagesRequest, context: &Context<'_>) -> Result<PassagesFigures> {
    at_least("frames of a passage", settings.least_frames, 2, "frames")?;
    let start = Instant::now();
    let performer = Performer { subject: settings.subject.clone(), activity: settings.activity.clone() };
    let out = Staging::new_folder(&settings.out)?;
    let files = masks::listed(&settings.masks)?;
    let levels = masks::levels_of(&files)?;
    levels.check_people(&settings.masks)?;
    if let Some(remark) = &levels.remark {
        context.progress.warn(&format!("{}: {remark}", settings.masks.display()));
    }
    let counter = Counter::new(context, "masks");
    let mut seen = Vec::with_capacity(files.len());
    let mut size = None;
    for file in &files {
        counter.check(DURING)?;
        let mask = masks::read(file, &levels)?;
        let (first, expected) = size.get_or_insert_with(|| (name_of(file), mask.dim()));
        if mask.dim() != *expected {
            let (path, found) = (file.clone(), mask.dim());
            return Err(MaskError::Size { path, found, first: first.clone(), expected: *expected }.into());
        }
        seen.push(area(mask.view()) >= settings.least_px.max(1));
        counter.one(Some(files.len()));
    }
    let leaps = leaps(&order::numbers(&files));
    let (passages, short): (Vec<Range<usize>>, Vec<Range<usize>>) =
        runs(&seen, &leaps).into_iter().partition(|run| run.len() >= settings.least_frames);
    if passages.is_empty() {
        let leap = (1..files.len()).find(|&at| leaps[at] && seen[at - 1] && seen[at]);
        return Err(SilhouettesError::NoPassage {
            path: settings.masks.clone(),
            least: settings.least_frames,
            leap: leap.map(|at| [name_of(&files[at - 1]), name_of(&files[at])]),
        }
        .into());
    }
    let mut samples = String::new();
    for (number, passage) in (1..).zip(&passages) {
        let folder = format!("passage{number}");
        out.make_folder(&folder)?;
        // Read again, so that memory does not grow with the number of masks.
        for file in &files[passage.clone()] {
            counter.check(DURING)?;
            let mask = masks::read(file, &levels)?;
            out.write(&format!("{folder}/{}.png", name_of(file)), &masks::png(&mask)?)?;
        }
        samples += &samples_entry(&folder, &performer, 1, &folder);
    }
    out.write("samples.toml", samples.as_bytes())?;
    out.finish()?;
    context.info(&format!("wrote {}", settings.out.display()));
    Ok(PassagesFigures {
        masks: files.len(),
        passages: passages.len(),
        frames: passages.iter().map(Range::len).sum(),
        too_short: short.len(),
        seconds: rounded(start.elapsed().as_secs_f64(), 3),
    })
}

fn name_of(file: &Path) -> String {
    file.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Whether the number of each file is not after the one before, or more than 1.5 usual steps after it.
fn leaps(numbers: &[Option<f64>]) -> Vec<bool> {
    const MOST_STEPS: f64 = 1.5;
    let steps: Vec<Option<f64>> = numbers.windows(2).map(|two| Some(two[1]? - two[0]?)).collect();
    let mut onward: Vec<f64> = steps.iter().flatten().copied().filter(|step| *step > 0.0).collect();
    onward.sort_unstable_by(f64::total_cmp);
    // The most frequent; of several the smallest.
    let usual =
        onward.chunk_by(|a, b| a == b).rev().max_by_key(|same| same.len()).map_or(0.0, |same| same[0]);
    let leaps = |step: &Option<f64>| step.is_some_and(|step| step <= 0.0 || step > MOST_STEPS * usual);
    std::iter::once(false).chain(steps.iter().map(leaps)).collect()
}

/// Successive frames with a person, without a leap.
fn runs(seen: &[bool], leaps: &[bool]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for at in (0..seen.len()).filter(|&at| seen[at]) {
        match runs.last_mut().filter(|run| run.end == at && !leaps[at]) {
            Some(run) => run.end = at + 1,
            None => runs.push(at..at + 1),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn the_usual_step_is_the_most_frequent_and_no_leap() {
        let found = |numbers: &[f64]| leaps(&numbers.iter().copied().map(Some).collect::<Vec<_>>());
        assert_eq!(found(&[1.0, 4.0, 7.0, 13.0, 16.0]), [false, false, false, true, false]);
        assert_eq!(found(&[8.0, 9.0, 10.0, 2.0, 3.0]), [false, false, false, true, false]);
        assert_eq!(leaps(&[None, Some(3.0), None]), [false; 3]);
        assert_eq!(
            runs(&[true, true, false, true, true], &[false, false, false, false, true]),
            [0..2, 3..4, 4..5]
        );
    }

    #[test]
    fn masks_with_a_step_or_a_constant_last_number_are_one_passage() {
        let folder = tempfile::tempdir().unwrap();
        let request = |name: &str, of: &dyn Fn(usize) -> String| {
            let masks = folder.path().join(name);
            std::fs::create_dir(&masks).unwrap();
            let png = masks::png(&Array2::from_shape_fn((20, 20), |(y, _)| y > 7)).unwrap();
            for frame in 0..5 {
                std::fs::write(masks.join(of(frame)), &png).unwrap();
            }
            let out = folder.path().join(format!("{name}-out"));
            PassagesRequest { masks, out, least_frames: 5, ..PassagesRequest::default() }
        };
        type Named = fn(usize) -> String;
        let names: [(&str, Named); 3] = [
            ("step", |frame| format!("frame_{:06}.png", 1 + 3 * frame)),
            ("person", |frame| format!("{frame:06}_p1.png")),
            ("size", |frame| format!("frame_{frame:04}_512x512.png")),
        ];
        for (name, of) in names {
            let figures = cut(&request(name, &of), &Context::unattended()).unwrap();
            assert_eq!((figures.passages, figures.frames, figures.too_short), (1, 5, 0), "{name}");
        }
        let gap = request("gap", &|frame| format!("f{}.png", if frame < 3 { frame } else { 7 + frame }));
        let error = cut(&gap, &Context::unattended()).unwrap_err().to_string();
        assert!(error.contains("5 successive frames") && error.contains("from `f2` to `f10`"), "{error}");
    }
}
