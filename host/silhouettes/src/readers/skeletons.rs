//! Joints of skeleton data sets as capsules: x right, y away from the sensor, z up, millimetres.

use super::matlab::{self, Array, MatlabError};
use crate::silhouette::capsule::{Capsule, Point3};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layout {
    /// Joints of a frame.
    pub joints: usize,
    /// Two joints and a radius in millimetres; equal joints make a ball.
    pub bones: &'static [(usize, usize, f64)],
    pub unit_mm: f64,
}

/// First-generation Kinect, metres (as in UTKinect-Action3D): centre of the hips, spine, centre of the shoulders, head; left
/// shoulder, elbow, wrist, hand; the right ones; left hip, knee, ankle, foot; the right ones.
pub const KINECT_20: Layout = Layout {
    joints: 20,
    bones: &[
        (3, 3, 100.0),
        (2, 3, 60.0),
        (0, 2, 120.0),
        (4, 8, 70.0),
        (12, 16, 90.0),
        (4, 12, 85.0),
        (8, 16, 85.0),
        (4, 5, 48.0),
        (5, 6, 42.0),
        (6, 7, 38.0),
        (8, 9, 48.0),
        (9, 10, 42.0),
        (10, 11, 38.0),
        (12, 13, 75.0),
        (13, 14, 55.0),
        (14, 15, 40.0),
        (16, 17, 75.0),
        (17, 18, 55.0),
        (18, 19, 40.0),
    ],
    unit_mm: 1000.0,
};

/// Florence 3D Actions, millimetres: head, neck, spine; left shoulder, elbow, hand; the right ones; left hip, knee, foot; the right
/// ones.
pub const FLORENCE_15: Layout = Layout {
    joints: 15,
    bones: &[
        (0, 0, 100.0),
        (0, 1, 60.0),
        (1, 2, 120.0),
        (3, 6, 70.0),
        (9, 12, 90.0),
        (3, 9, 85.0),
        (6, 12, 85.0),
        (2, 9, 95.0),
        (2, 12, 95.0),
        (3, 4, 48.0),
        (4, 5, 42.0),
        (6, 7, 48.0),
        (7, 8, 42.0),
        (9, 10, 75.0),
        (10, 11, 55.0),
        (12, 13, 75.0),
        (13, 14, 55.0),
    ],
    unit_mm: 1.0,
};

/// In the order of the file's numbers.
pub const UTKINECT_ACTIVITIES: [&str; 10] =
    ["walk", "sit down", "stand up", "pick up", "carry", "throw", "push", "pull", "wave hands", "clap hands"];
/// In the order of the file's numbers.
pub const FLORENCE_ACTIVITIES: [&str; 9] =
    ["wave", "drink", "answer phone", "clap", "tight lace", "sit down", "stand up", "read watch", "bow"];

#[derive(Clone, Debug, PartialEq)]
pub struct SkeletonClip {
    /// As `subject` and `repetition`, an index of the cell array, from 0.
    pub activity: usize,
    pub subject: usize,
    pub repetition: usize,
    pub frames: Vec<Vec<Point3>>,
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SkeletonError {
    #[error(transparent)]
    Matlab(#[from] MatlabError),
    #[error("no cell array `data` of activities x subjects x repetitions in the file")]
    NoData,
    #[error(
        "clip (activity {activity}, subject {subject}, repetition {repetition}) is {found:?}, expected [3, {joints}, frames]"
    )]
    Form { activity: usize, subject: usize, repetition: usize, found: Vec<usize>, joints: usize },
}

/// Reads cells `data{activity, subject, repetition}` of 3 x joints x frames (x right, y up, z away).
pub fn read_cells(bytes: &[u8], layout: &Layout) -> Result<Vec<SkeletonClip>, SkeletonError> {
    let variables = matlab::read(bytes)?;
    let found = variables.into_iter().find_map(|(name, array)| match array {
        Array::Cell { dimensions, cells } if name == "data" => Some((dimensions, cells)),
        _ => None,
    });
    let (dimensions, cells) = found.ok_or(SkeletonError::NoData)?;
    let &[activities, subjects, ..] = dimensions.as_slice() else { return Err(SkeletonError::NoData) };
    let mut clips = Vec::new();
    for (index, cell) in cells.into_iter().enumerate() {
        let (activity, rest) = (index % activities.max(1), index / activities.max(1));
        let (subject, repetition) = (rest % subjects.max(1), rest / subjects.max(1));
        let form = |found: Vec<usize>| SkeletonError::Form {
            activity,
            subject,
            repetition,
            found,
            joints: layout.joints,
        };
        let Array::Numeric { dimensions, values } = cell else { return Err(form(Vec::new())) };
        if values.is_empty() {
            continue;
        }
        // A single frame lacks the third dimension.
        if dimensions.len() < 2 || dimensions[0] != 3 || dimensions[1] != layout.joints {
            return Err(form(dimensions));
        }
        let unit = layout.unit_mm;
        // [x, z, y] mirrors the body, which `kinect` and `ntu` rotate to [x, -z, y]. It stays because published figures
        // of these sets are measured on it; a rotation would change the views.
        let frames = values
            .chunks_exact(3 * layout.joints)
            .map(|frame| frame.chunks_exact(3).map(|p| [unit * p[0], unit * p[2], unit * p[1]]).collect())
            .collect();
        clips.push(SkeletonClip { activity, subject, repetition, frames });
    }
    Ok(clips)
}

pub fn dress(joints: &[Point3], layout: &Layout) -> Vec<Capsule> {
    layout
        .bones
        .iter()
        .filter_map(|&(a, b, radius_mm)| Some(Capsule::new(*joints.get(a)?, *joints.get(b)?, radius_mm)))
        .collect()
}
