//! Cuts a folder of masks into passages of a person, for example KTH's walking.

use std::{path::PathBuf, time::Instant};

use farnear_files::{
    masks::{self, MaskError},
    staging::Staging,
};
use farnear_silhouettes::mask::{Mask, area};
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

type NamedMask = (String, Mask);

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
    let (mut passages, mut too_short) = (Vec::new(), 0);
    let mut passage: Vec<NamedMask> = Vec::new();
    let (mut last, mut size) = (None, None);
    let mut end = |passage: &mut Vec<NamedMask>| {
        let whole = std::mem::take(passage);
        if whole.len() >= settings.least_frames {
            passages.push(whole);
        } else {
            too_short += usize::from(!whole.is_empty());
        }
    };
    for file in &files {
        counter.check("cutting passages")?;
        let mask = masks::read(file, &levels)?;
        let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let (first, expected) = size.get_or_insert_with(|| (name.clone(), mask.dim()));
        if mask.dim() != *expected {
            let (path, found) = (file.clone(), mask.dim());
            return Err(MaskError::Size { path, found, first: first.clone(), expected: *expected }.into());
        }
        let number = last_number(&name);
        let leaps = matches!((last, number), (Some(last), Some(number)) if number != last + 1);
        last = number;
        let seen = area(mask.view()) >= settings.least_px.max(1);
        if leaps || !seen {
            end(&mut passage);
        }
        if seen {
            passage.push((name, mask));
        }
        counter.one(Some(files.len()));
    }
    end(&mut passage);
    if passages.is_empty() {
        return Err(SilhouettesError::NoPassage {
            path: settings.masks.clone(),
            least: settings.least_frames,
        }
        .into());
    }
    let mut samples = String::new();
    for (number, passage) in (1..).zip(&passages) {
        let folder = format!("passage{number}");
        out.make_folder(&folder)?;
        for (name, mask) in passage {
            out.write(&format!("{folder}/{name}.png"), &masks::png(mask)?)?;
        }
        samples += &samples_entry(&folder, &performer, 1, &folder);
    }
    out.write("samples.toml", samples.as_bytes())?;
    out.finish()?;
    context.info(&format!("wrote {}", settings.out.display()));
    Ok(PassagesFigures {
        masks: files.len(),
        passages: passages.len(),
        frames: passages.iter().map(Vec::len).sum(),
        too_short,
        seconds: rounded(start.elapsed().as_secs_f64(), 3),
    })
}

fn last_number(name: &str) -> Option<u64> {
    let end = name.rfind(|c: char| c.is_ascii_digit())? + 1;
    let begin = name[..end]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |at| at + name[at..].chars().next().map_or(1, char::len_utf8));
    name[begin..end].parse().ok()
}

#[cfg(test)]
mod tests {
    use super::last_number;

    #[test]
    fn names_are_numbered_by_their_last_number() {
        for (name, number) in
            [("silho_10", Some(10)), ("p2é07x", Some(7)), ("0042", Some(42)), ("walk", None), ("", None)]
        {
            assert_eq!(last_number(name), number, "{name}");
        }
    }
}
