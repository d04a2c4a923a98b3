//! A folder of masks cut into passages: one for each passage of a person (KTH's walking, say).

use std::{path::PathBuf, time::Instant};

use farnear_files::{
    masks::{self, MaskError},
    staging::Staging,
};
use farnear_silhouettes::mask::{Mask, area};
use serde::Serialize;

use super::{SilhouettesError, markers::Performer, performances::samples_entry};
use crate::{context::Context, counter::Counter, error::Result, figures::rounded, parameters::at_least};

#[derive(Clone, PartialEq, Debug)]
pub struct PassagesSettings {
    /// The folder of masks, in the order of their names.
    pub masks: PathBuf,
    /// The new folder: `passage1`, `passage2`, ... and `samples.toml`.
    pub out: PathBuf,
    /// Who does what in all of them.
    pub performer: Performer,
    /// Shorter passages are left out, frames.
    pub least_frames: usize,
    /// Smallest person, px.
    pub least_px: usize,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PassagesFigures {
    pub masks: usize,
    pub passages: usize,
    pub frames: usize,
    /// Passages too short to be written.
    pub too_short: usize,
    pub seconds: f64,
}

/// A mask on its way into a passage.
type Kept = (String, Mask);

/// Cuts at gaps in the numbers of the masks' names, and at frames without a person.
///
/// # Errors
/// Masks that cannot be read, no passage of enough frames, a folder that cannot be written.
pub fn cut(settings: &PassagesSettings, context: &Context<'_>) -> Result<PassagesFigures> {
    at_least("frames of a passage", settings.least_frames, 2, "frames")?;
    let start = Instant::now();
    let out = Staging::new_folder(&settings.out)?;
    let files = masks::listed(&settings.masks)?;
    let levels = masks::levels_of(&files)?;
    if let Some(remark) = &levels.remark {
        context.progress.warn(&format!("{}: {remark}", settings.masks.display()));
    }
    let counter = Counter::new(context, "masks");
    let (mut passages, mut too_short) = (Vec::new(), 0);
    let mut passage: Vec<Kept> = Vec::new();
    let (mut last, mut size) = (None, None);
    let mut end = |passage: &mut Vec<Kept>| {
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
        samples += &samples_entry(&folder, &settings.performer, 1, &folder);
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

/// The last number in a name.
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
