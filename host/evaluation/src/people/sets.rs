//! Sets of clips for recognition.

use anyhow::Result;
use farnear_recognition::clip::{Clip, Track};
use farnear_recognition::embedding::descriptor::Scaling;
use farnear_recognition::synthetic::activities;
use farnear_silhouettes::readers::skeletons::{
    FLORENCE_15, FLORENCE_ACTIVITIES, KINECT_20, UTKINECT_ACTIVITIES,
};
use rayon::prelude::*;

use super::{
    data::{Data, numbered_files},
    skeletons, strips,
};

/// Synthetic people, and their clips' frame rate.
pub const PEOPLE: usize = 21;
pub const RATE_HZ: f64 = 8.0;
pub const VIEWS: usize = 4;

pub struct Set {
    pub name: &'static str,
    pub short: &'static str,
    pub about: &'static str,
    pub clips: Vec<Clip>,
    /// Whether to train on mirrors; false for sets with mirrors.
    pub mirror: bool,
    /// Required accuracy, per cent: order-free in one view and fused, ordered in one view and fused.
    pub asked: [Option<f64>; 4],
}

impl Set {
    /// A set with its mirrors has every performance twice.
    pub fn trials(&self) -> usize {
        self.clips.len() / if self.mirror { 1 } else { 2 }
    }
}

pub type Read = fn(&Data) -> Result<Option<Set>>;

/// Ten activities from a depth sensor's joints.
pub fn utkinect(data: &Data) -> Result<Option<Set>> {
    let Some(bytes) = data.bytes("skeletons/UTKinect_Skeletons.mat")? else { return Ok(None) };
    Ok(Some(Set {
        name: "UTKinect",
        short: "utkinect",
        about: "UTKinect-Action3D (Xia et al. 2012): 10 activities, 10 subjects, two repetitions; measured joints dressed with capsules and drawn from \
                four views, 90 deg apart.",
        clips: skeletons::clips(&bytes, &KINECT_20, &UTKINECT_ACTIVITIES)?,
        mirror: true,
        asked: [Some(74.0), Some(84.0), Some(84.0), Some(93.0)],
    }))
}

pub fn florence(data: &Data) -> Result<Option<Set>> {
    let Some(bytes) = data.bytes("skeletons/Florence_3D_Action_Skeletons.mat")? else { return Ok(None) };
    Ok(Some(Set {
        name: "Florence",
        short: "florence",
        about: "Florence 3D Actions (Seidenari et al. 2013): 9 activities, 10 subjects; measured joints dressed and drawn likewise.",
        clips: skeletons::clips(&bytes, &FLORENCE_15, &FLORENCE_ACTIVITIES)?,
        mirror: true,
        asked: [Some(70.0), Some(79.0), Some(77.0), Some(85.0)],
    }))
}

pub fn synthetic() -> Set {
    Set {
        name: "Synthetic people",
        short: "synthetic",
        about: "The 10 activities of Li (2014), table 7.1, by 21 seeded people of different build, habits, tempo and handedness, once each; capsule bodies drawn from \
                four views, 90 deg apart, the first 45 deg off the path.",
        clips: activities::clips(PEOPLE, VIEWS, RATE_HZ, Scaling::default()),
        mirror: true,
        asked: [Some(95.0), Some(98.0), Some(95.0), Some(98.0)],
    }
}

const WEIZMANN: [(&str, &str); 4] = [("0", "wave one"), ("1", "wave two"), ("3", "jack"), ("4", "bend")];
/// Strips of one subject share this quotient of their numbers.
const STRIPS_PER_SUBJECT: u64 = 8;

/// Four actions from video.
pub fn weizmann(data: &Data) -> Result<Option<Set>> {
    let Some(folder) = data.path("weizmann4") else { return Ok(None) };
    let mut files = Vec::new();
    for (name, activity) in WEIZMANN {
        for (number, path) in numbered_files(&folder.join(name))? {
            files.push((number, activity, path));
        }
    }
    let clips = files
        .into_par_iter()
        .map(|(number, activity, path)| {
            let masks = strips::masks(&strips::read(&path)?);
            Ok(Clip {
                subject: format!("w{}", number / STRIPS_PER_SUBJECT),
                activity: activity.into(),
                views: vec![Track::from_masks(&masks, Scaling::default(), true)],
            })
        })
        .collect::<Result<Vec<_>>>()?;
    Ok(Some(Set {
        name: "Weizmann strips",
        short: "weizmann",
        about: "Four actions of the Weizmann set (Blank et al. 2005) by five subjects as strips of 64 x 64 video frames, segmented here (a colour model of the wall per row). Every clip is there once more as its mirror image; \
                both have the same subject, so that they are never split between training and test. Intervals count a clip and its mirror as one.",
        clips,
        mirror: false,
        asked: [Some(97.0), None, Some(97.0), None],
    }))
}
