//! Clips of skeleton data sets: joints dressed with capsules, drawn and described.

use farnear_recognition::clip::{Clip, Track};
use farnear_recognition::embedding::descriptor::Scaling;
use farnear_silhouettes::readers::skeletons::{
    FLORENCE_15, FLORENCE_ACTIVITIES, KINECT_20, Layout, SkeletonClip, SkeletonError, UTKINECT_ACTIVITIES,
    dress, read_cells,
};
use farnear_silhouettes::silhouette::{capsule::Capsule, view::views_round};
use rayon::prelude::*;

pub fn utkinect(bytes: &[u8], views: usize, scaling: Scaling) -> Result<Vec<Clip>, SkeletonError> {
    Ok(from_skeletons(&read_cells(bytes, &KINECT_20)?, &KINECT_20, &UTKINECT_ACTIVITIES, views, scaling))
}

pub fn florence(bytes: &[u8], views: usize, scaling: Scaling) -> Result<Vec<Clip>, SkeletonError> {
    Ok(from_skeletons(&read_cells(bytes, &FLORENCE_15)?, &FLORENCE_15, &FLORENCE_ACTIVITIES, views, scaling))
}

/// Views at equal steps, the first from the sensor's side.
fn from_skeletons(
    clips: &[SkeletonClip],
    layout: &Layout,
    activities: &[&str],
    views: usize,
    scaling: Scaling,
) -> Vec<Clip> {
    clips
        .par_iter()
        .map(|clip| {
            let bodies: Vec<Vec<Capsule>> = clip.frames.iter().map(|joints| dress(joints, layout)).collect();
            Clip {
                subject: format!("s{:02}", clip.subject + 1),
                activity: activities
                    .get(clip.activity)
                    .map_or_else(|| clip.activity.to_string(), |a| (*a).to_owned()),
                views: views_round(views, 0.0)
                    .iter()
                    .map(|view| Track::from_bodies(&bodies, view, scaling))
                    .collect(),
            }
        })
        .collect()
}
