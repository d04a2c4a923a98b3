//! SAMPLES.toml: which masks show whom doing what from where, read into described clips.
//!
//! Samples of one performance from several views are one clip: those with one `clip` name, or, without names, the first of
//! each view, the second of each, and so on in the file's order.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    fs,
    io::IsTerminal,
    path::{Path, PathBuf},
    sync::atomic::{AtomicUsize, Ordering},
};

use anyhow::{Context, Result, bail, ensure};
use farnear_activity::{
    embedding::descriptor::Scaling,
    mask::{Mask, centre::SIDE_PX},
    recognition::clip::{Clip, Track},
};
use rayon::prelude::*;
use serde::Deserialize;

use crate::masks;

/// How all masks are scaled before they are described.
pub const SCALING: Scaling = Scaling::KeepAspect;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(rename = "sample", default)]
    samples: Vec<Sample>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Sample {
    masks: PathBuf,
    subject: String,
    activity: String,
    #[serde(default = "first")]
    view: u32,
    clip: Option<String>,
}

fn first() -> u32 {
    1
}

/// What a file of samples holds.
pub struct Samples {
    /// Clips whose views are in the order of their numbers.
    pub clips: Vec<Clip>,
    /// Numbers of the views of every clip; `None` where clips differ in that.
    pub views: Option<Vec<u32>>,
    /// Frames read, and how many of them were empty.
    pub frames: usize,
    /// Frames without a subject.
    pub empty_frames: usize,
    /// Whether masks are full frames, so that the box's motion counts.
    pub full_frames: bool,
    /// Folders of the first clips, one per view: what times are taken with.
    pub folders: Vec<PathBuf>,
}

/// Whether masks of this size are full frames rather than cut-out silhouettes.
pub fn are_full_frames(masks: &[Mask]) -> bool {
    masks.first().is_some_and(|mask| mask.dim() != (SIDE_PX, SIDE_PX))
}

impl Samples {
    /// Reads a file of samples and describes all of its masks.
    ///
    /// # Errors
    /// Files, folders and masks that cannot be read or hold nothing, samples of which some are full frames and others are not.
    pub fn read(path: &Path) -> Result<Self> {
        let shown = path.display();
        let text = fs::read_to_string(path).with_context(|| format!("cannot read {shown}"))?;
        let file: File = toml::from_str(&text).with_context(|| format!("{shown}"))?;
        ensure!(!file.samples.is_empty(), "{shown}: it has no [[sample]] (masks, subject, activity, view)");
        let base = path.parent().unwrap_or(Path::new(""));
        let folders: Vec<PathBuf> = file.samples.iter().map(|sample| base.join(&sample.masks)).collect();
        let done = AtomicUsize::new(0);
        let progress = std::io::stderr().is_terminal();
        let described: Result<Vec<(Track, bool)>> = folders
            .par_iter()
            .map(|folder| {
                let described = described(folder);
                let done = 1 + done.fetch_add(1, Ordering::Relaxed);
                if progress {
                    eprint!("\r{done} of {} samples read", folders.len());
                }
                described
            })
            .collect();
        if progress {
            eprintln!();
        }
        let described = described.with_context(|| format!("{shown}"))?;
        let full_frames = described[0].1;
        if let Some(other) = described.iter().position(|(_, full)| *full != full_frames) {
            let kind = |full| if full { "full frames" } else { "cut out at 100x100" };
            bail!(
                "{shown}: the masks of {} are {}, those of {} {}; samples must be alike",
                folders[0].display(),
                kind(full_frames),
                folders[other].display(),
                kind(!full_frames)
            );
        }
        let frames = described.iter().map(|(track, _)| track.frames() + track.empty_frames).sum();
        let empty_frames = described.iter().map(|(track, _)| track.empty_frames).sum();
        let tracks = described.into_iter().map(|(track, _)| track);
        let (clips, views) = grouped(file.samples.iter().zip(tracks)).with_context(|| format!("{shown}"))?;
        let count = views.as_ref().map_or(1, Vec::len);
        let folders = first_folders(&file.samples, &folders, count);
        Ok(Self { clips, views, frames, empty_frames, full_frames, folders })
    }

    /// Every view of every clip as a clip of its own.
    pub fn split(self) -> Vec<Clip> {
        let alone = |clip: Clip| {
            let Clip { subject, activity, views } = clip;
            views.into_iter().map(move |view| Clip {
                subject: subject.clone(),
                activity: activity.clone(),
                views: vec![view],
            })
        };
        self.clips.into_iter().flat_map(alone).collect()
    }
}

/// The track of a folder of masks, and whether they are full frames.
fn described(folder: &Path) -> Result<(Track, bool)> {
    let read: Vec<Mask> = masks::read_all(folder)?.into_iter().map(|named| named.mask).collect();
    let full = are_full_frames(&read);
    let track = Track::from_masks(&read, SCALING, full);
    ensure!(track.frames() > 0, "{}: all {} masks are empty", folder.display(), read.len());
    Ok((track, full))
}

/// Clips in the order in which they first appear, and the views that all of them have.
fn grouped<'a>(samples: impl Iterator<Item = (&'a Sample, Track)>) -> Result<(Vec<Clip>, Option<Vec<u32>>)> {
    let mut seen: HashMap<(&str, &str, u32), usize> = HashMap::new();
    let mut places: HashMap<(&str, &str, String), usize> = HashMap::new();
    let mut clips: Vec<(&Sample, BTreeMap<u32, Track>)> = Vec::new();
    for (sample, track) in samples {
        let (subject, activity) = (sample.subject.as_str(), sample.activity.as_str());
        ensure!(!subject.is_empty() && !activity.is_empty(), "a sample has an empty subject or activity");
        let name = match &sample.clip {
            Some(name) => name.clone(),
            None => {
                let count = seen.entry((subject, activity, sample.view)).or_default();
                *count += 1;
                format!("\0{count}") // no name that a user can give
            }
        };
        let place = *places.entry((subject, activity, name)).or_insert_with(|| {
            clips.push((sample, BTreeMap::new()));
            clips.len() - 1
        });
        ensure!(
            clips[place].1.insert(sample.view, track).is_none(),
            "clip `{}` of {subject} at {activity} has view {} twice",
            sample.clip.as_deref().unwrap_or_default(),
            sample.view
        );
    }
    let kinds: BTreeSet<Vec<u32>> = clips.iter().map(|(_, views)| views.keys().copied().collect()).collect();
    let common = (kinds.len() == 1).then(|| kinds.into_iter().next().unwrap_or_default());
    let clip = |(sample, views): (&Sample, BTreeMap<u32, Track>)| Clip {
        subject: sample.subject.clone(),
        activity: sample.activity.clone(),
        views: views.into_values().collect(),
    };
    Ok((clips.into_iter().map(clip).collect(), common))
}

/// The folders of the first clip's views, in the order of the views.
fn first_folders(samples: &[Sample], folders: &[PathBuf], count: usize) -> Vec<PathBuf> {
    let Some(first) = samples.first() else { return Vec::new() };
    let mut found: BTreeMap<u32, &PathBuf> = BTreeMap::new();
    for (sample, folder) in samples.iter().zip(folders) {
        let of_first = (&sample.subject, &sample.activity, &sample.clip)
            == (&first.subject, &first.activity, &first.clip);
        if of_first {
            found.entry(sample.view).or_insert(folder);
        }
    }
    found.into_values().take(count).cloned().collect()
}
