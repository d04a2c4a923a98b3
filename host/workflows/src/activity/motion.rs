//! Training clips from motion files: marker or joint recordings and public joint sets, viewed from all sides.

use std::{
    fmt, fs,
    path::{Path, PathBuf},
    str::FromStr,
};

use farnear_recognition::clip::{Clip, Track};
use farnear_recognition::synthetic::recorded::{self, Bodies};
use farnear_silhouettes::readers::{
    recording::{Choices, Recording},
    skeletons::{
        FLORENCE_15, FLORENCE_ACTIVITIES, KINECT_20, Layout, SkeletonClip, UTKINECT_ACTIVITIES, dress,
        read_cells,
    },
};
use farnear_silhouettes::silhouette::template::Template;

use super::{samples::SCALING, training::TrainRequest};
use crate::{
    context::Context,
    counter::Counter,
    error::{Result, WorkflowError},
    silhouettes::{SilhouettesError, markers},
};

const DURING: &str = "drawing motion files";
const MATLAB: &str = "mat";

#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct MotionFile {
    /// `None` for files with names of activities: a set's MATLAB file, or NTU's file names.
    pub activity: Option<String>,
    /// `None` to use the file's name, or the set's subject.
    pub subject: Option<String>,
    pub path: PathBuf,
}

impl FromStr for MotionFile {
    type Err = String;

    /// `ACTIVITY=FILE`, `SUBJECT:ACTIVITY=FILE` or `FILE`.
    fn from_str(text: &str) -> Result<Self, String> {
        let named = |name: &str| Some(name.trim().to_owned()).filter(|name| !name.is_empty());
        let (names, path) = text.split_once('=').map_or((None, text), |(names, path)| (Some(names), path));
        let (subject, activity) = match names.map(|names| names.split_once(':').ok_or(names)) {
            Some(Ok((subject, activity))) => (named(subject), named(activity)),
            Some(Err(activity)) => (None, named(activity)),
            None => (None, None),
        };
        if path.trim().is_empty() || (names.is_some() && activity.is_none()) {
            return Err(
                "expected ACTIVITY=FILE, SUBJECT:ACTIVITY=FILE, or FILE if it names its activity".into()
            );
        }
        Ok(Self { activity, subject, path: path.trim().into() })
    }
}

impl fmt::Display for MotionFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(activity) = &self.activity {
            let subject = self.subject.iter().flat_map(|subject| [subject.as_str(), ":"]);
            subject.chain([activity.as_str(), "="]).try_for_each(|part| f.write_str(part))?;
        }
        self.path.display().fmt(f)
    }
}

#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum MotionError {
    #[error("{}: the activity is unknown; name it ACTIVITY=FILE", path.display())]
    Activity { path: PathBuf },
    #[error("{}: a set of joints says itself who does what; give the file alone", path.display())]
    Named { path: PathBuf },
    #[error("{}: no person is visible; the unit or the upward axis may be wrong", path.display())]
    NobodySeen { path: PathBuf },
}

struct Recorded {
    subject: String,
    activity: String,
    rate_hz: f64,
    joints: Joints,
}

enum Joints {
    Set(SkeletonClip, Layout),
    Points(Recording, Template),
}

/// Single-view clips of motion files, a list for each performance. Fails for a file without an activity or without
/// visible people.
pub(super) fn performances(request: &TrainRequest, context: &Context<'_>) -> Result<Vec<Vec<Clip>>> {
    let mut all = Vec::new();
    let counter = Counter::new(context, "motion files");
    // The trained model depends on the order of clips.
    let mut files: Vec<&MotionFile> = request.motion.iter().collect();
    files.sort();
    for file in files {
        counter.check(DURING)?;
        let mut found = Vec::new();
        let mut clips = 0;
        for recorded in recorded(file, request, context)? {
            counter.check(DURING)?;
            let seed = seed_of(&file.path, clips);
            let views = seen(&recorded, request.cameras, seed);
            clips += views.len();
            if !views.is_empty() {
                found.push(views);
            }
        }
        if found.is_empty() {
            return Err(MotionError::NobodySeen { path: file.path.clone() }.into());
        }
        all.extend(found);
        counter.one(Some(request.motion.len()));
    }
    Ok(all)
}

fn seen(recorded: &Recorded, cameras: usize, seed: u64) -> Vec<Clip> {
    let tracks: Vec<Track> = match &recorded.joints {
        Joints::Set(clip, layout) => {
            let bodies = clip.frames.iter().map(|joints| dress(joints, layout)).collect();
            recorded::tracks(&Bodies::Capsules(bodies), recorded.rate_hz, cameras, seed, SCALING)
        }
        // A recording from one side has a single view.
        Joints::Points(recording, template) if recording.planar => markers::one_view(recording, template),
        Joints::Points(recording, template) => {
            let frames = (0..recording.frames.len()).map(|n| recording.by_name(n)).collect();
            let bodies = Bodies::Parts(frames, template.clone());
            recorded::tracks(&bodies, recorded.rate_hz, cameras, seed, SCALING)
        }
    };
    let clip = |view| Clip {
        subject: recorded.subject.clone(),
        activity: recorded.activity.clone(),
        views: vec![view],
    };
    tracks.into_iter().map(clip).collect()
}

fn recorded(file: &MotionFile, request: &TrainRequest, context: &Context<'_>) -> Result<Vec<Recorded>> {
    let path = &file.path;
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if ending == MATLAB {
        return if file.activity.is_some() {
            Err(MotionError::Named { path: path.clone() }.into())
        } else {
            set(path)
        };
    }
    let (said_subject, said_activity) = ntu_names(path).map_or((None, None), |(s, a)| (Some(s), Some(a)));
    let Some(activity) = file.activity.clone().or(said_activity) else {
        return Err(MotionError::Activity { path: path.clone() }.into());
    };
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let choices = Choices { unit: request.units, up: request.up, person: None, aspect: request.aspect };
    let recording = markers::recording(path, choices)?;
    for remark in recording.remarks() {
        context.progress.warn(&format!("{}: {remark}", path.display()));
    }
    // A recording from one side is not resampled.
    if recording.rate_hz <= 0.0 && !recording.planar {
        context.progress.warn(&format!("{}: the frame rate is unknown, 30/s is assumed", path.display()));
    }
    let template = match &request.template {
        Some(name) => markers::template(name)?,
        None => markers::best_template(&recording, path)?,
    };
    markers::check_fit(&template, &recording, path)?;
    Ok(vec![Recorded {
        subject: file.subject.clone().or(said_subject).unwrap_or(stem),
        activity,
        rate_hz: recording.rate_hz,
        joints: Joints::Points(recording, template),
    }])
}

/// Reads UTKinect or Florence, distinguished by their joints.
fn set(path: &Path) -> Result<Vec<Recorded>> {
    /// Frame rate of both sets after their own cutting, Hz.
    const RATE_HZ: f64 = 15.0;
    let bytes = fs::read(path).map_err(WorkflowError::read("the skeletons", path))?;
    let sets: [(Layout, &[&str]); 2] =
        [(KINECT_20, &UTKINECT_ACTIVITIES), (FLORENCE_15, &FLORENCE_ACTIVITIES)];
    let mut last = None;
    for (layout, activities) in sets {
        match read_cells(&bytes, &layout) {
            Ok(clips) => {
                let performance = |clip: SkeletonClip| Recorded {
                    subject: format!("s{:02}", clip.subject + 1),
                    activity: activities
                        .get(clip.activity)
                        .map_or_else(|| clip.activity.to_string(), ToString::to_string),
                    rate_hz: RATE_HZ,
                    joints: Joints::Set(clip, layout),
                };
                return Ok(clips.into_iter().map(performance).collect());
            }
            Err(source) => last = Some(SilhouettesError::Skeletons { path: path.into(), source }),
        }
    }
    Err(last.map_or_else(|| MotionError::NobodySeen { path: path.into() }.into(), Into::into))
}

/// Subject and activity from an NTU name such as `S001C001P003R002A008.skeleton`.
fn ntu_names(path: &Path) -> Option<(String, String)> {
    let stem = path.file_stem()?.to_str()?;
    let part = |letter: char| {
        let from = stem.find(letter)?;
        let digits = stem.get(from + 1..from + 4)?;
        digits.bytes().all(|byte| byte.is_ascii_digit()).then(|| format!("{letter}{digits}"))
    };
    (stem.len() == 20).then_some(())?;
    Some((part('P')?, part('A')?))
}

/// Depends on the file's name and the performance's number only, so it is equal on all computers.
fn seed_of(path: &Path, number: usize) -> u64 {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    // FNV-1a.
    let hash = name.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    hash.wrapping_add(number as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::context::Heard;

    #[test]
    fn a_recording_without_a_frame_rate_is_reported_and_its_views_are_one_performance() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut csv = String::from("frame,HEAD_x,HEAD_y,HEAD_z,HIP_x,HIP_y,HIP_z,HAND_x,HAND_y,HAND_z\n");
        for frame in 0..12 {
            csv += &format!("{frame},0,0,1700,0,0,900,400,0,{}\n", 800 + 80 * frame);
        }
        let path = folder.path().join("walk.csv");
        fs::write(&path, csv).expect("written");
        let template = folder.path().join("doll.toml");
        let text = "name = 'doll'\n\
             [[part]]\nname = 'trunk'\nmarkers = ['HEAD', 'HIP']\nthickness_mm = 120.0\n\
             [[part]]\nname = 'arm'\nmarkers = ['HIP', 'HAND']\nthickness_mm = 50.0\n";
        fs::write(&template, text).expect("written");
        let request = TrainRequest {
            motion: vec![MotionFile { activity: Some("walk".into()), subject: None, path }],
            template: Some(template.display().to_string()),
            cameras: 3,
            ..TrainRequest::default()
        };
        let heard = Heard::default();
        let found = performances(&request, &heard.context());
        let found = found.expect("clips");
        assert!(
            found.len() == 1 && found[0].len() > 1,
            "{:?}",
            found.iter().map(Vec::len).collect::<Vec<_>>()
        );
        let heard = heard.said();
        assert!(
            heard.iter().any(|line| line.ends_with("walk.csv: the frame rate is unknown, 30/s is assumed"))
        );
    }

    #[test]
    fn files_are_named_with_what_is_done_by_whom() {
        let found: MotionFile = "anna: sit down =a=b.c3d".parse().expect("a file");
        assert_eq!((found.subject.as_deref(), found.activity.as_deref()), (Some("anna"), Some("sit down")));
        assert_eq!(found.path, Path::new("a=b.c3d"));
        let found: MotionFile = "walk=x.bvh".parse().expect("a file");
        assert_eq!((found.subject, found.activity.as_deref()), (None, Some("walk")));
        assert_eq!("x.mat".parse::<MotionFile>().expect("a file").activity, None);
        assert!("=x.bvh".parse::<MotionFile>().is_err() && "walk=".parse::<MotionFile>().is_err());
    }

    #[test]
    fn ntu_says_person_and_activity_in_names() {
        let found = ntu_names(Path::new("d/S001C002P003R002A008.skeleton"));
        assert_eq!(found, Some(("P003".into(), "A008".into())));
        assert_eq!(ntu_names(Path::new("APPLES.skeleton")), None);
        assert_ne!(seed_of(Path::new("a.bvh"), 0), seed_of(Path::new("b.bvh"), 0));
    }
}
