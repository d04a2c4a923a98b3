//! Scores shadow removal against ground truth: shadow removed, and person lost. Grey levels of truth pictures: 0
//! background, 50 (or 127) shadow, 255 person, 85 and 170 ignored.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
};

use farnear_files::{
    masks::{self, levels::Levels, listed},
    video::pictures,
};
use farnear_shadow::score::{ShadowScore, Truth};
use ndarray::{Array2, Zip};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    context::Context,
    error::{About, Result},
    figures::rounded,
    request::{PathKind, Request},
};

/// Scores shadow removal against a ground truth, over one mask or a folder of them.
///
/// Truth pictures are grey: 0 background, 50 (or 127) shadow, 255 person, 85 and 170 not judged. Masks are set from 128 on.
/// Frames of two folders belong together by name, else by the number that their names end in.
#[derive(Clone, Default, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear shadow score masks/ truth/ --before raw-masks/ --json")
)]
#[serde(default)]
pub struct ShadowScoreRequest {
    /// Masks after the removal: a picture or a folder.
    pub masks: PathBuf,
    /// The truth: a picture or a folder.
    pub truth: PathBuf,
    /// Masks before the removal. Then only pixels that were in them count as removed; without, all shadow that is not in
    /// the masks does. If the truth has no shadow, everything in these masks except the person counts as shadow.
    #[cfg_attr(feature = "clap", arg(long, value_name = "MASKS"))]
    pub before: Option<PathBuf>,
}

impl Request for ShadowScoreRequest {
    const NAME: &'static str = "shadow score";
    const REQUIRED: &'static [&'static str] = &["masks", "truth"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("masks", PathKind::Input), ("truth", PathKind::Input), ("before", PathKind::Input)];
    type Figures = ScoreFigures;

    fn run(&self, context: &Context<'_>) -> Result<ScoreFigures> {
        score(self, context)
    }
}

/// Sums over all frames; `None` if there is nothing to count.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct ScoreFigures {
    pub removed_percent: Option<f64>,
    pub wrongly_removed_percent: Option<f64>,
    /// Intersection over union of result and person.
    pub iou_percent: Option<f64>,
    pub frames: usize,
    /// Pixels of shadow in the truth.
    pub shadow_pixels: u64,
    pub subject_pixels: u64,
}

#[derive(Debug, thiserror::Error)]
pub enum ScoreError {
    #[error(
        "{} and {} both end in number {number}: which belongs to the truth's frame {number}?", one.display(), other.display()
    )]
    Ambiguous { one: PathBuf, other: PathBuf, number: u64 },
    #[error(
        "{}: no mask for {}; masks need its name or a name that ends in its number", masks.display(), truth.display()
    )]
    NoMask { masks: PathBuf, truth: PathBuf },
    #[error(
        "{}: level {level} at column {column}, row {row} has no meaning in a truth; use 0 background, 50 or 127 shadow, \
         255 person, 85 or 170 not judged (and no lossy compression)", path.display()
    )]
    Level { path: PathBuf, level: u8, column: usize, row: usize },
}

/// Fails if pictures do not match in name or size, or for an undefined level in the truth.
pub fn score(settings: &ShadowScoreRequest, context: &Context<'_>) -> Result<ScoreFigures> {
    let truths = listed(&settings.truth)?;
    let masks = Partners::new(&settings.masks, truths.len())?;
    let before = settings.before.as_deref().map(|path| Partners::new(path, truths.len())).transpose()?;
    let mut labelled = ShadowScore::default();
    // Score with shadow taken from the previous masks, for truths without shadow.
    let mut told = ShadowScore::default();
    for path in &truths {
        context.cancel.check("scoring masks")?;
        let truth = truth(path)?;
        let after = masks.mask(path)?;
        let before = before.as_ref().map(|before| before.mask(path)).transpose()?;
        let view = before.as_ref().map(|mask| mask.view());
        labelled.add(view, after.view(), truth.view()).about(|| format!("scoring {}", path.display()))?;
        if let Some(before) = &before {
            let told_truth = Zip::from(&truth).and(before).map_collect(|&truth, &before| match truth {
                Truth::Background if before => Truth::Shadow,
                other => other,
            });
            told.add(view, after.view(), told_truth.view())?;
        }
    }
    let score = if labelled.shadow_pixels == 0 && before.is_some() { told } else { labelled };
    let percent = |value: Option<f64>| value.map(|value| rounded(value, 3));
    Ok(ScoreFigures {
        removed_percent: percent(score.removed_percent()),
        wrongly_removed_percent: percent(score.wrongly_removed_percent()),
        iou_percent: percent(score.iou_percent()),
        frames: truths.len(),
        shadow_pixels: score.shadow_pixels,
        subject_pixels: score.subject_pixels,
    })
}

struct Partners {
    path: PathBuf,
    levels: Levels,
    only: Option<PathBuf>,
    by_name: HashMap<String, PathBuf>,
    by_number: HashMap<u64, PathBuf>,
}

impl Partners {
    fn new(path: &Path, truths: usize) -> Result<Self> {
        let found = listed(path)?;
        let levels = masks::levels_of(&found)?;
        let only = (found.len() == 1 && truths == 1).then(|| found[0].clone());
        let mut by_number = HashMap::new();
        for mask in &found {
            let Some(number) = trailing_number(&pictures::stem(mask)) else { continue };
            if let Some(other) = by_number.insert(number, mask.clone()) {
                return Err(ScoreError::Ambiguous { one: other, other: mask.clone(), number }.into());
            }
        }
        let by_name = found.into_iter().map(|mask| (pictures::stem(&mask), mask)).collect();
        Ok(Self { path: path.into(), levels, only, by_name, by_number })
    }

    fn mask(&self, truth: &Path) -> Result<Array2<bool>> {
        let name = pictures::stem(truth);
        let by_number = || self.by_number.get(&trailing_number(&name)?);
        let found = self.only.as_ref().or_else(|| self.by_name.get(&name)).or_else(by_number);
        let none = || ScoreError::NoMask { masks: self.path.clone(), truth: truth.into() };
        Ok(masks::read(found.ok_or_else(none)?, &self.levels)?)
    }
}

fn trailing_number(name: &str) -> Option<u64> {
    let digits = name.bytes().rev().take_while(u8::is_ascii_digit).count();
    name[name.len() - digits..].parse().ok()
}

fn truth(path: &Path) -> Result<Array2<Truth>> {
    let levels = masks::grey(path, pictures::reading_of(&[path.into()]))?;
    let nameless = levels.indexed_iter().find(|&(_, &level)| Truth::from_grey(level).is_none());
    if let Some(((row, column), &level)) = nameless {
        return Err(ScoreError::Level { path: path.into(), level, column, row }.into());
    }
    Ok(levels.mapv(|level| Truth::from_grey(level).unwrap_or(Truth::Ignored)))
}
