//! Keypoints in three dimensions: whether a file's third numbers are coordinates, and the order of its points.

use super::{
    layouts::{BODY_25B, HUMAN36M, Layout, NAMED, NAMES},
    people::distance,
    points::{Person, Raw},
};
use crate::{
    readers::{posture::extent, recording::RecordingError},
    silhouette::capsule::Point3,
};

/// Confidences exceed 1 slightly in some programs.
const HIGHEST_CONFIDENCE: f64 = 1.2;
/// Share of points outside the range of confidences, or of the picture.
const LEAST_SHARE: f64 = 0.05;
const MOST_ASYMMETRY: f64 = 0.25;
/// Limbs as short names of their ends, without the side.
const LIMBS: [[char; 2]; 4] = [['s', 'e'], ['e', 'w'], ['h', 'k'], ['k', 'a']];

fn share(raw: &[&Raw], holds: impl Fn(&Raw) -> bool) -> f64 {
    raw.iter().filter(|point| holds(point)).count() as f64 / raw.len().max(1) as f64
}

fn seen<'a>(people: impl Iterator<Item = &'a Person>) -> Vec<&'a Raw> {
    people.flat_map(|person| &person.raw).filter(|point| point.x.is_finite() && point.y.is_finite()).collect()
}

/// Coordinates on both sides of zero are not those of a picture.
pub fn are_centred<'a>(people: impl Iterator<Item = &'a Person>) -> bool {
    const SHARE: f64 = 0.25;
    share(&seen(people), |point| point.x < 0.0 || point.y < 0.0) >= SHARE
}

/// Depths of a body are about as large as its other coordinates, scores next to pixels are not.
fn are_flat<'a>(people: impl Iterator<Item = &'a Person>) -> bool {
    const MOST: f64 = 0.05;
    let is_flat = |person: &Person| {
        let points: Vec<Point3> = person.raw.iter().filter_map(Raw::in_space).collect();
        let reach = |k: usize| extent(&points, k);
        (points.len() > 1).then(|| reach(2) <= MOST * reach(0).max(reach(1)))
    };
    let known: Vec<bool> = people.filter_map(is_flat).collect();
    2 * known.iter().filter(|flat| **flat).count() > known.len()
}

/// Depths of named points about the middle of the hips, as MediaPipe has them.
fn are_about_the_hips<'a>(people: impl Iterator<Item = &'a Person>) -> bool {
    const MOST: f64 = 0.01;
    let place = |name: &str| NAMES.iter().position(|known| *known == name);
    let is_about = |person: &Person| {
        let depth = |place: usize| person.raw.get(place)?.in_space().map(|point| point[2]);
        let middle = 0.5 * (depth(place("left hip")?)? + depth(place("right hip")?)?);
        let furthest = (0..NAMES.len()).filter_map(depth).fold(0.0, |most: f64, z| most.max(z.abs()));
        Some(furthest > 0.0 && middle.abs() <= MOST * furthest)
    };
    let known: Vec<bool> = people.filter_map(is_about).collect();
    2 * known.iter().filter(|about| **about).count() > known.len()
}

pub fn has_depth<'a>(people: impl Iterator<Item = &'a Person> + Clone) -> bool {
    if people.clone().any(|person| person.layout.has_picture_depth()) {
        return are_centred(people);
    }
    let thirds: Vec<&Raw> = seen(people.clone()).into_iter().filter(|point| point.third.is_some()).collect();
    let is_visibility = |point: &Raw| point.third.is_some_and(|v| v == 0.0 || v == 1.0 || v == 2.0);
    let is_outside = |point: &Raw| match (point.third, point.sure) {
        (Some(third), Some(sure)) => third != sure,
        (Some(third), None) => !(0.0..=HIGHEST_CONFIDENCE).contains(&third),
        (None, _) => false,
    };
    // A body in metres would be longer. These are shares of a picture, as of MediaPipe, or about the hips.
    let is_near =
        |point: &Raw| point.in_space().is_some_and(|point| point.iter().all(|value| value.abs() <= 1.0));
    let are_near = people.clone().all(|person| *person.layout == NAMED)
        && (share(&thirds, is_near) >= 1.0 - LEAST_SHARE || are_about_the_hips(people.clone()));
    share(&thirds, |point| !is_visibility(point)) >= LEAST_SHARE
        && share(&thirds, is_outside) >= LEAST_SHARE
        && !are_flat(people.clone())
        && (!are_near || are_centred(people))
}

/// The order in which left and right limbs are equally long.
pub fn layout<'a>(
    people: impl Iterator<Item = &'a Person> + Clone,
) -> Result<&'static Layout, RecordingError> {
    let own = people.clone().next().map(|person| person.layout);
    let count = own.map_or(0, |layout| layout.count);
    let orders = [Some(&HUMAN36M), own].into_iter().flatten().filter(|order| order.count == count);
    let in_space = |person: &Person, place: usize| person.raw.get(place)?.in_space();
    let measured = orders.map(|order| (asymmetry(people.clone(), order, in_space).unwrap_or(0.0), order));
    let best =
        measured.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(asymmetry, _)| *asymmetry <= MOST_ASYMMETRY);
    best.map(|(_, order)| order).ok_or_else(|| RecordingError::Kind {
        kind: "keypoint JSON",
        reason: format!(
            "its {count} points have three coordinates, and left and right limbs differ in every known order: write them \
             to a CSV file with columns NAME_x, NAME_y, NAME_z"
        ),
    })
}

/// Whether the second point is in the middle of the third and the sixth, as the neck between the shoulders in OpenPose's
/// layouts; `None` without them. `point` is that of a person at a place.
pub fn has_neck<'a>(
    people: impl Iterator<Item = &'a Person>,
    point: impl Fn(&Person, usize) -> Option<Point3>,
) -> Option<bool> {
    const NEAR: f64 = 0.3;
    let (mut away, mut wide) = (0.0, 0.0);
    for person in people {
        if let (Some(neck), Some(right), Some(left)) = (point(person, 1), point(person, 2), point(person, 5))
        {
            away += distance(neck, std::array::from_fn(|k| 0.5 * (right[k] + left[k])));
            wide += distance(right, left);
        }
    }
    (wide > 0.0).then_some(away <= NEAR * wide)
}

/// The order of points of a picture.
pub fn picture_layout<'a>(
    people: impl Iterator<Item = &'a Person> + Clone,
    own: &'static Layout,
) -> &'static Layout {
    if own.count != BODY_25B.count {
        return own;
    }
    let point = |person: &Person, place: usize| person.raw.get(place)?.in_picture();
    let differ = |order: &Layout| asymmetry(people.clone(), order, point);
    let is_other = differ(own).zip(differ(&BODY_25B)).is_some_and(|(own, other)| other < own);
    if is_other && has_neck(people, point) == Some(false) { &BODY_25B } else { own }
}

/// Mean difference of left and right limbs relative to their length, `None` without limbs of both sides; `point` is that of a
/// person at a place in the order.
pub fn asymmetry<'a>(
    people: impl Iterator<Item = &'a Person>,
    order: &Layout,
    point: impl Fn(&Person, usize) -> Option<Point3>,
) -> Option<f64> {
    let place =
        |side: char, joint: char| order.points.iter().position(|short| short.chars().eq([side, joint]));
    let (mut sum, mut count) = (0.0, 0_usize);
    for person in people {
        let length = |side: char, [from, to]: [char; 2]| -> Option<f64> {
            let at = |joint: char| point(person, place(side, joint)?);
            let (from, to) = (at(from)?, at(to)?);
            Some((0..3).map(|k| (from[k] - to[k]).powi(2)).sum::<f64>().sqrt())
        };
        for limb in LIMBS {
            if let (Some(left), Some(right)) = (length('l', limb), length('r', limb))
                && left + right > 0.0
            {
                sum += 2.0 * (left - right).abs() / (left + right);
                count += 1;
            }
        }
    }
    (count > 0).then(|| sum / count as f64)
}
