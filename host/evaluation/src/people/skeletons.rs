//! Clips of skeleton data sets: joints dressed with capsules, drawn and described.

use farnear_recognition::clip::{Clip, Track};
use farnear_recognition::embedding::descriptor::Scaling;
use farnear_silhouettes::readers::skeletons::{Layout, SkeletonError, dress, read_cells};
use farnear_silhouettes::silhouette::{capsule::Capsule, view::views_round};
use rayon::prelude::*;

use super::sets::VIEWS;

/// Views at equal steps, the first from the sensor's side.
pub fn clips(bytes: &[u8], layout: &Layout, activities: &[&str]) -> Result<Vec<Clip>, SkeletonError> {
    let clips = read_cells(bytes, layout)?
        .par_iter()
        .map(|clip| {
            let bodies: Vec<Vec<Capsule>> = clip.frames.iter().map(|joints| dress(joints, layout)).collect();
            Clip {
                subject: format!("s{:02}", clip.subject + 1),
                activity: activities
                    .get(clip.activity)
                    .map_or_else(|| clip.activity.to_string(), |a| (*a).to_owned()),
                views: views_round(VIEWS, 0.0)
                    .iter()
                    .map(|view| Track::from_bodies(&bodies, view, Scaling::default()))
                    .collect(),
            }
        })
        .collect();
    Ok(clips)
}
