//! Clips of skeleton data sets: joints dressed with capsules, drawn from views round the subject, described.

use crate::embedding::descriptor::Scaling;
use crate::readers::skeletons::{
    FLORENCE_15, FLORENCE_ACTIVITIES, KINECT_20, Layout, SkeletonClip, SkeletonError, UTKINECT_ACTIVITIES,
    dress, read_cells,
};
use crate::recognition::clip::{Clip, Track};
use crate::silhouette::capsule::Capsule;
use crate::silhouette::raster::Point;
use crate::silhouette::view::{Canvas, View, draw, extent, views_round};
use rayon::prelude::*;

/// Millimetres per pixel of the drawn silhouettes.
const MM_PER_PX: f64 = 10.0;

/// The clips of UTKinect-Action3D (a MAT-file's bytes) in `views` views.
///
/// # Errors
/// A file that is not one.
pub fn utkinect(bytes: &[u8], views: usize, scaling: Scaling) -> Result<Vec<Clip>, SkeletonError> {
    Ok(from_skeletons(&read_cells(bytes, &KINECT_20)?, &KINECT_20, &UTKINECT_ACTIVITIES, views, scaling))
}

/// The clips of Florence 3D Actions (a MAT-file's bytes) in `views` views.
///
/// # Errors
/// A file that is not one.
pub fn florence(bytes: &[u8], views: usize, scaling: Scaling) -> Result<Vec<Clip>, SkeletonError> {
    Ok(from_skeletons(&read_cells(bytes, &FLORENCE_15)?, &FLORENCE_15, &FLORENCE_ACTIVITIES, views, scaling))
}

/// Draws and describes skeleton clips from `views` views at equal steps, the first from the sensor's side.
pub fn from_skeletons(
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
                views: views_round(views, 0.0).iter().map(|view| track(&bodies, view, scaling)).collect(),
            }
        })
        .collect()
}

/// Draws every frame of a performance on one canvas, so that the box's motion is kept, and describes it.
pub fn track(bodies: &[Vec<Capsule>], view: &View, scaling: Scaling) -> Track {
    let reach: Vec<Point> = bodies.iter().flat_map(|body| extent(body, view)).collect();
    let Some(canvas) = Canvas::fitting(&reach, MM_PER_PX, 2) else {
        return Track::from_masks(&[], scaling, true);
    };
    let masks: Vec<_> = bodies.iter().map(|body| draw(body, view, &canvas)).collect();
    Track::from_masks(&masks, scaling, true)
}
