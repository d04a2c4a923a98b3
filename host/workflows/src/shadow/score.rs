//! `farnear shadow score`: how much shadow was taken off masks, and how much of the subject with it.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use farnear_activity::shadow_score::{ShadowScore, Truth};
use ndarray::{Array2, Zip};
use serde::Serialize;

use crate::{
    masks::{self, listed},
    report,
    video::pictures,
};

/// Scores shadow removal against a ground truth, over one mask or a folder of them.
///
/// Truth pictures are grey: 0 background, 50 (or 127) shadow, 255 person, 85 and 170 not judged. Masks are set from 128 on.
/// Frames of two folders belong together by name, else by the number that their names end in.
#[derive(Args)]
#[command(after_help = "Example: farnear shadow score masks/ truth/ --before raw-masks/ --json")]
pub struct Arguments {
    /// Masks after the removal: a picture or a folder.
    masks: PathBuf,
    /// The truth: a picture or a folder.
    truth: PathBuf,
    /// Masks before the removal. Then only pixels that were in them count as removed; without, all shadow that is not in
    /// the masks does. Where the truth holds no shadow at all, what these masks have beside the person counts as shadow.
    #[arg(long, value_name = "MASKS")]
    before: Option<PathBuf>,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

/// The figures; without a value where there is nothing to count.
#[derive(Debug, Serialize)]
struct Figures {
    removed_percent: Option<f64>,
    wrongly_removed_percent: Option<f64>,
    iou_percent: Option<f64>,
    frames: usize,
    shadow_pixels: u64,
    subject_pixels: u64,
}

/// Runs the command.
///
/// # Errors
/// Where pictures cannot be read, do not belong together or differ in size, or the truth holds a level without a meaning.
pub fn run(arguments: &Arguments) -> Result<()> {
    let truths = listed(&arguments.truth)?;
    let masks = Partners::new(&arguments.masks, truths.len())?;
    let before = arguments.before.as_deref().map(|path| Partners::new(path, truths.len())).transpose()?;
    let mut labelled = ShadowScore::default();
    // The same with shadow told by the masks before, for truths that hold none.
    let mut told = ShadowScore::default();
    for path in &truths {
        let truth = truth(path)?;
        let after = masks.mask(path)?;
        let before = before.as_ref().map(|before| before.mask(path)).transpose()?;
        let view = before.as_ref().map(|mask| mask.view());
        labelled
            .add(view, after.view(), truth.view())
            .with_context(|| format!("scoring {}", path.display()))?;
        if let Some(before) = &before {
            let told_truth = Zip::from(&truth).and(before).map_collect(|&truth, &before| match truth {
                Truth::Background if before => Truth::Shadow,
                other => other,
            });
            told.add(view, after.view(), told_truth.view())?;
        }
    }
    let score = if labelled.shadow_pixels == 0 && before.is_some() { told } else { labelled };
    let percent = |value: Option<f64>| value.map(|value| report::rounded(value, 3));
    let figures = Figures {
        removed_percent: percent(score.removed_percent()),
        wrongly_removed_percent: percent(score.wrongly_removed_percent()),
        iou_percent: percent(score.iou_percent()),
        frames: truths.len(),
        shadow_pixels: score.shadow_pixels,
        subject_pixels: score.subject_pixels,
    };
    report::print(&figures, arguments.json)
}

/// Masks to be found by the name of their truth.
struct Partners {
    path: PathBuf,
    only: Option<PathBuf>,
    by_name: HashMap<String, PathBuf>,
    by_number: HashMap<u64, PathBuf>,
}

impl Partners {
    fn new(path: &Path, truths: usize) -> Result<Self> {
        let found = listed(path)?;
        let only = (found.len() == 1 && truths == 1).then(|| found[0].clone());
        let mut by_number = HashMap::new();
        for mask in &found {
            let Some(number) = trailing_number(&pictures::stem(mask)) else { continue };
            if let Some(other) = by_number.insert(number, mask.clone()) {
                bail!(
                    "{} and {} both end in number {number}: which belongs to the truth's frame {number}?",
                    other.display(),
                    mask.display()
                );
            }
        }
        let by_name = found.into_iter().map(|mask| (pictures::stem(&mask), mask)).collect();
        Ok(Self { path: path.into(), only, by_name, by_number })
    }

    fn mask(&self, truth: &Path) -> Result<Array2<bool>> {
        let name = pictures::stem(truth);
        let by_number = || self.by_number.get(&trailing_number(&name)?);
        let found = self.only.as_ref().or_else(|| self.by_name.get(&name)).or_else(by_number);
        let Some(path) = found else {
            bail!(
                "{}: no mask for {}; masks need its name or a name that ends in its number",
                self.path.display(),
                truth.display()
            )
        };
        masks::read(path)
    }
}

/// The number that a name ends in.
fn trailing_number(name: &str) -> Option<u64> {
    let digits = name.bytes().rev().take_while(u8::is_ascii_digit).count();
    name[name.len() - digits..].parse().ok()
}

fn truth(path: &Path) -> Result<Array2<Truth>> {
    let levels = masks::grey(path)?;
    for ((row, column), &level) in levels.indexed_iter() {
        ensure!(
            Truth::from_grey(level).is_some(),
            "{}: level {level} at column {column}, row {row} has no meaning in a truth; use 0 background, 50 or 127 shadow, \
             255 person, 85 or 170 not judged (and no lossy compression)",
            path.display()
        );
    }
    Ok(levels.mapv(|level| Truth::from_grey(level).unwrap_or(Truth::Ignored)))
}
