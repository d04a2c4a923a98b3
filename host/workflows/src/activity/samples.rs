//! Reads SAMPLES.toml (folders of masks with subject, activity and view) into described clips. Views with the same
//! `clip` name form a clip. Without names, the n-th samples of each view do. Otherwise the order of the list has no effect.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap, HashSet},
    fs,
    io::Write,
    path::{Path, PathBuf},
};

use farnear_files::masks;
use farnear_recognition::clip::{Clip, Track};
use farnear_recognition::embedding::descriptor::Scaling;
use farnear_silhouettes::mask::{Mask, centre::SIDE_PX};
use rayon::prelude::*;
use serde::Deserialize;

use crate::{
    context::Context,
    counter::Counter,
    error::{About, Result, WorkflowError},
};

pub const SCALING: Scaling = Scaling::KeepAspect;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    /// Why the set is kept for releases.
    blind: Option<String>,
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

#[derive(Debug, thiserror::Error)]
pub enum SamplesError {
    #[error("it has no [[sample]] (masks, subject, activity, view)")]
    None,
    #[error(
        "{}: the set is blind ({why}); it is opened for a release only: farnear activity evaluate --open-blind-set REASON", samples.display()
    )]
    Blind { samples: PathBuf, why: String },
    #[error("cannot record the opening of a blind set in {}: {source}", file.display())]
    Record { file: PathBuf, source: std::io::Error },
    #[error("a sample has an empty subject or activity")]
    Nameless,
    #[error("{}: all {count} masks are empty", folder.display())]
    NobodySeen { folder: PathBuf, count: usize },
    #[error(
        "the masks of {} are full frames, those of {} cut out at 100x100; samples must be alike", full.display(), cut_out.display()
    )]
    Kinds { full: PathBuf, cut_out: PathBuf },
    #[error("the masks of {} are listed twice: a clip that is in training and test says nothing", folder.display())]
    ListedTwice { folder: PathBuf },
    #[error("clip `{clip}` of {subject} at {activity} has view {view} twice")]
    Twice { clip: String, subject: String, activity: String, view: u32 },
    #[error(
        "clips differ in their views (from {least} to {most} of them): fused views must be the same in all clips"
    )]
    Views { least: usize, most: usize },
    #[error("{} and {} hold other views, which cannot be fused", test.display(), train.display())]
    OtherViews { test: PathBuf, train: PathBuf },
    #[error(
        "{}: none of its activities ({}) is among those that were learned ({}); names must be the same",
        samples.display(), found.join(", "), known.join(", ")
    )]
    NothingInCommon { samples: PathBuf, found: Vec<String>, known: Vec<String> },
    #[error(
        "subject `{subject}` is in both {} and {}: recognising people by themselves says nothing", test.display(), train.display()
    )]
    SamePerson { subject: String, test: PathBuf, train: PathBuf },
}

pub struct Samples {
    pub path: PathBuf,
    /// The views of a clip are in the order of their numbers.
    pub clips: Vec<Clip>,
    /// View numbers of every clip; `None` if clips differ.
    pub views: Option<Vec<u32>>,
    pub frames: usize,
    pub empty_frames: usize,
    /// Whether masks are full frames, so that motion of the bounding box counts.
    pub full_frames: bool,
    pub folders: Vec<PathBuf>,
}

/// Whether masks of this size are full frames, not cut-out silhouettes.
pub fn are_full_frames(masks: &[Mask]) -> bool {
    masks.first().is_some_and(|mask| mask.dim() != (SIDE_PX, SIDE_PX))
}

/// Appends time, user, version, set and reason to `openings.csv` in a folder.
fn record_opening(folder: &Path, path: &Path, reason: &str) -> Result<()> {
    const FILE: &str = "openings.csv";
    let file = folder.join(FILE);
    let failed = |source| SamplesError::Record { file: file.clone(), source };
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "'").replace(['\n', '\r'], " "));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let time = crate::clock::now_rfc3339().unwrap_or_default();
    let user = ["USER", "LOGNAME", "USERNAME"].into_iter().find_map(|name| std::env::var(name).ok());
    let [user, name, reason] = [&user.unwrap_or_default(), &*name, reason].map(quoted);
    let line = format!("{time},{user},{},{name},{reason}\n", env!("CARGO_PKG_VERSION"));
    let new = !file.exists();
    let mut opened = fs::OpenOptions::new().create(true).append(true).open(&file).map_err(failed)?;
    let head = if new { "time,user,version,samples,reason\n" } else { "" };
    Ok(opened.write_all(format!("{head}{line}").as_bytes()).map_err(failed)?)
}

fn listed(path: &Path) -> Result<File> {
    let text = fs::read_to_string(path).map_err(WorkflowError::read("the samples", path))?;
    let mut file: File = toml::from_str(&text).about(|| path.display().to_string())?;
    for sample in &mut file.samples {
        // A blank at the end of a name would make another person of the same one.
        for name in [&mut sample.subject, &mut sample.activity] {
            *name = name.trim().to_owned();
        }
    }
    Ok(file)
}

/// The reason to open a set, if it is blind. Fails without one.
fn opening<'a>(blind: Option<String>, path: &Path, reason: Option<&'a str>) -> Result<Option<&'a str>> {
    let Some(why) = blind else { return Ok(None) };
    match reason.filter(|reason| !reason.trim().is_empty()) {
        Some(reason) => Ok(Some(reason)),
        None => Err(SamplesError::Blind { samples: path.into(), why }.into()),
    }
}

impl Samples {
    pub fn folders(path: &Path) -> Result<Vec<PathBuf>> {
        let base = path.parent().unwrap_or(Path::new(""));
        Ok(listed(path)?.samples.iter().map(|sample| base.join(&sample.masks)).collect())
    }

    /// Subject and activity of every sample, of a blind set with a reason only. Reads no masks and records nothing.
    pub fn labels(path: &Path, reason: Option<&str>) -> Result<Vec<[String; 2]>> {
        let file = listed(path)?;
        opening(file.blind, path, reason)?;
        Ok(file.samples.into_iter().map(|sample| [sample.subject, sample.activity]).collect())
    }

    /// Reads and describes the masks. Fails for a mix of full frames and cut-out silhouettes.
    pub fn read(path: &Path, context: &Context<'_>) -> Result<Self> {
        Self::read_opened(path, None, context)
    }

    /// With a reason, also reads a blind set and records this in `openings.csv` next to the file.
    pub fn read_opened(path: &Path, reason: Option<&str>, context: &Context<'_>) -> Result<Self> {
        let base = path.parent().unwrap_or(Path::new(""));
        let file = listed(path)?;
        if let Some(reason) = opening(file.blind, path, reason)? {
            record_opening(base, path, reason)?;
            context.progress.warn(&format!("{}: this set is blind; its opening is recorded", path.display()));
        }
        Self::described(file.samples, base, path, context).about(|| path.display().to_string())
    }

    fn described(samples: Vec<Sample>, base: &Path, path: &Path, context: &Context<'_>) -> Result<Self> {
        if samples.is_empty() {
            return Err(SamplesError::None.into());
        }
        let folders: Vec<PathBuf> = samples.iter().map(|sample| base.join(&sample.masks)).collect();
        let mut listed = HashSet::new();
        if let Some(folder) = folders
            .iter()
            .find(|folder| !listed.insert(folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf())))
        {
            return Err(SamplesError::ListedTwice { folder: folder.clone() }.into());
        }
        let counter = Counter::new(context, "samples read");
        let described: Result<Vec<(Track, bool)>> = folders
            .par_iter()
            .map(|folder| {
                counter.check("reading samples")?;
                let described = described(folder, context);
                counter.one(Some(folders.len()));
                described
            })
            .collect();
        let described = described?;
        let full_frames = described[0].1;
        if let Some(other) = described.iter().position(|(_, full)| *full != full_frames) {
            return Err(kinds(&folders[0], &folders[other], full_frames).into());
        }
        let frames = described.iter().map(|(track, _)| track.frames() + track.empty_frames).sum();
        let empty_frames = described.iter().map(|(track, _)| track.empty_frames).sum();
        let tracks = described.into_iter().map(|(track, _)| track);
        let (clips, views) = grouped(samples.iter().zip(tracks))?;
        let count = views.as_ref().map_or(1, Vec::len);
        let folders = first_folders(&samples, &folders, count);
        Ok(Self { path: path.into(), clips, views, frames, empty_frames, full_frames, folders })
    }

    pub fn check_kind(&self, other: &Self) -> Result<(), SamplesError> {
        if self.full_frames == other.full_frames {
            return Ok(());
        }
        Err(kinds(&self.path, &other.path, self.full_frames))
    }

    pub fn fused(self) -> Result<Vec<Clip>> {
        if self.views.is_some() {
            return Ok(self.clips);
        }
        let counts = || self.clips.iter().map(|clip| clip.views.len());
        let (least, most) = (counts().min().unwrap_or(0), counts().max().unwrap_or(0));
        Err(SamplesError::Views { least, most }).about(|| self.path.display().to_string())
    }

    /// Every view of every clip as a separate clip.
    pub fn split(self) -> Vec<Clip> {
        self.split_by_performance().into_iter().flatten().collect()
    }

    /// [`Self::split`], a list for the views of each clip.
    pub fn split_by_performance(self) -> Vec<Vec<Clip>> {
        let alone = |clip: Clip| -> Vec<Clip> {
            let Clip { subject, activity, views } = clip;
            let clip =
                |view| Clip { subject: subject.clone(), activity: activity.clone(), views: vec![view] };
            views.into_iter().map(clip).collect()
        };
        self.clips.into_iter().map(alone).collect()
    }
}

fn kinds(one: &Path, other: &Path, one_is_full: bool) -> SamplesError {
    let (full, cut_out) = if one_is_full { (one, other) } else { (other, one) };
    SamplesError::Kinds { full: full.into(), cut_out: cut_out.into() }
}

/// Track of a folder of masks, and whether they are full frames.
fn described(folder: &Path, context: &Context<'_>) -> Result<(Track, bool)> {
    let read = masks::read_all(folder)?;
    let levels = read.levels.clone();
    if let Some(remark) = &levels.remark {
        context.progress.warn(&format!("{}: {remark}", folder.display()));
    }
    let read = read.pixels();
    let full = are_full_frames(&read);
    if full {
        levels.check_people(folder)?;
    }
    let track = Track::from_masks(&read, SCALING, full);
    if track.frames() == 0 {
        return Err(SamplesError::NobodySeen { folder: folder.into(), count: read.len() }.into());
    }
    Ok((track, full))
}

/// Views of a clip with their masks; the sample has the clip's names.
type Grouped<'a> = (&'a Sample, BTreeMap<u32, (Track, &'a Path)>);

/// A clip's place in the training, whose result depends on the order.
fn place<'a>((sample, views): &Grouped<'a>) -> (&'a str, &'a str, Option<&'a str>, Option<&'a Path>) {
    let masks = views.values().next().map(|(_, masks)| *masks);
    (sample.subject.as_str(), sample.activity.as_str(), sample.clip.as_deref(), masks)
}

fn grouped<'a>(
    samples: impl Iterator<Item = (&'a Sample, Track)>,
) -> Result<(Vec<Clip>, Option<Vec<u32>>), SamplesError> {
    let mut seen: HashMap<(&str, &str, u32), usize> = HashMap::new();
    let mut indices: HashMap<(&str, &str, String), usize> = HashMap::new();
    let mut clips: Vec<Grouped<'a>> = Vec::new();
    for (sample, track) in samples {
        let (subject, activity) = (sample.subject.as_str(), sample.activity.as_str());
        if subject.is_empty() || activity.is_empty() {
            return Err(SamplesError::Nameless);
        }
        let name = match &sample.clip {
            Some(name) => name.clone(),
            None => {
                let count = seen.entry((subject, activity, sample.view)).or_default();
                *count += 1;
                format!("\0{count}") // no name that a user can give
            }
        };
        let index = *indices.entry((subject, activity, name)).or_insert_with(|| {
            clips.push((sample, BTreeMap::new()));
            clips.len() - 1
        });
        if clips[index].1.insert(sample.view, (track, sample.masks.as_path())).is_some() {
            return Err(SamplesError::Twice {
                clip: sample.clip.clone().unwrap_or_default(),
                subject: subject.into(),
                activity: activity.into(),
                view: sample.view,
            });
        }
    }
    clips.sort_by_key(place);
    let kinds: BTreeSet<Vec<u32>> = clips.iter().map(|(_, views)| views.keys().copied().collect()).collect();
    let common = (kinds.len() == 1).then(|| kinds.into_iter().next().unwrap_or_default());
    let clip = |(sample, views): Grouped<'_>| Clip {
        subject: sample.subject.clone(),
        activity: sample.activity.clone(),
        views: views.into_values().map(|(track, _)| track).collect(),
    };
    Ok((clips.into_iter().map(clip).collect(), common))
}

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

#[cfg(test)]
mod tests {
    use farnear_files::masks;
    use farnear_silhouettes::mask::Mask;

    use super::*;
    use crate::{Cancel, Unattended};

    struct Silent;

    impl crate::Progress for Silent {
        fn info(&self, _what: &str) {}
    }

    fn write_masks(folder: &Path, width: usize) {
        fs::create_dir(folder).expect("a folder");
        let mask =
            Mask::from_shape_fn((40, 30), |(row, column)| (10..35).contains(&row) && column + width > 30);
        fs::write(folder.join("a.png"), masks::png(&mask).expect("a picture")).expect("written");
    }

    #[test]
    fn the_order_of_the_list_does_not_change_the_clips() {
        let folder = tempfile::tempdir().expect("a folder");
        let sample = |masks: &str, subject: &str, activity: &str, more: &str| {
            format!(
                "[[sample]]\nmasks = \"{masks}\"\nsubject = \"{subject}\"\nactivity = \"{activity}\"\n{more}"
            )
        };
        let listed = [
            sample("m8", "b", "walk", ""),
            sample("m5", "a", "walk", ""),
            sample("m7", "a", "walk", ""),
            sample("m9", "a", "dig", "clip = \"x\"\nview = 2\n"),
            sample("m6", "a ", " dig", "clip = \"x\"\n"),
        ];
        for width in 5..10 {
            write_masks(&folder.path().join(format!("m{width}")), width);
        }
        let clips = |list: Vec<&String>| {
            let path = folder.path().join("samples.toml");
            fs::write(&path, list.into_iter().map(String::as_str).collect::<String>()).expect("written");
            let context = Context::new(&Silent, &Unattended, Cancel::default());
            Samples::read(&path, &context).expect("samples").clips
        };
        let found = clips(listed.iter().collect());
        assert_eq!(found.len(), 4);
        assert_ne!(found[1], found[2]);
        assert!(found == clips(listed.iter().rev().collect()), "the order changes the clips");
    }

    #[test]
    fn a_blind_set_is_refused_and_its_openings_are_recorded() {
        let folder = tempfile::tempdir().expect("a folder");
        let masks = folder.path().join("m");
        write_masks(&masks, 9);
        let samples = folder.path().join("samples.toml");
        let text = "blind = \"kept for releases\"\n[[sample]]\nmasks = \"m\"\nsubject = \"a\"\nactivity = \"walk\"\n";
        fs::write(&samples, text).expect("written");
        let context = Context::new(&Silent, &Unattended, Cancel::default());
        let error = Samples::read(&samples, &context).map(|_| ()).expect_err("blind").to_string();
        assert!(error.contains("kept for releases") && error.contains("--open-blind-set"), "{error}");
        assert!(Samples::read_opened(&samples, Some(" "), &context).is_err());
        assert_eq!(Samples::labels(&samples, None).expect_err("blind").to_string(), error);
        assert_eq!(Samples::labels(&samples, Some("release 1")).expect("labels"), [["a", "walk"]]);
        let openings = folder.path().join("openings.csv");
        assert!(!openings.exists());
        for reason in ["release 1", "release \"2\""] {
            assert_eq!(
                Samples::read_opened(&samples, Some(reason), &context).expect("opened").clips.len(),
                1
            );
        }
        let record = fs::read_to_string(openings).expect("a record");
        let lines: Vec<&str> = record.lines().collect();
        assert_eq!((lines.len(), lines[0]), (3, "time,user,version,samples,reason"));
        assert!(
            lines[1].ends_with("\"samples.toml\",\"release 1\"") && lines[2].ends_with("\"release '2'\""),
            "{record}"
        );
    }
}
