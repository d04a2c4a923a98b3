//! Points that state their name or number: a file may list them in any order and leave some out.

use std::collections::{BTreeSet, HashMap, HashSet};

use serde_json::Value;

use super::{
    layouts::{Layout, NAMED, NAMES},
    points::{Person, Raw},
    spatial,
};
use crate::{
    readers::{people::prefixed, recording::RecordingError},
    silhouette::aliases,
};

const KEYS: [&str; 3] = ["name", "part", "id"];
/// Points of COCO, the usual layout of programs that leave points out.
const USUAL: usize = 17;
/// Points of OpenPose's COCO layout and of BODY_25, of which the second is the neck.
const WITH_NECK: [usize; 2] = [18, 25];
/// Fewer numbers are not those of a body.
pub const LEAST: usize = 6;

struct Order {
    layout: &'static Layout,
    /// Indices in the layout.
    places: HashMap<String, usize>,
    about: String,
}

/// Labels of a person's points; empty if they do not tell most points apart.
pub fn labels(points: &[Value]) -> Vec<String> {
    let by = |key: &str, all: bool| -> Option<Vec<String>> {
        let label = |point: &Value| match point.get(key)? {
            Value::String(name) => Some(name.clone()),
            other => Some(other.as_f64()?.to_string()),
        };
        let labels: Vec<String> = points.iter().map(label).collect::<Option<_>>()?;
        let distinct = labels.iter().collect::<HashSet<_>>().len();
        (distinct == labels.len() || !all && 2 * distinct > labels.len()).then_some(labels)
    };
    [true, false].iter().find_map(|all| KEYS.iter().find_map(|key| by(key, *all))).unwrap_or_default()
}

/// Puts points with labels in the order of a layout, and reports it. Fails if no person remains, or if two points of a
/// person have one label.
pub fn order(frames: &mut [Vec<Person>]) -> Result<Option<String>, RecordingError> {
    let labels: BTreeSet<&str> =
        frames.iter().flatten().flat_map(|person| &person.labels).map(String::as_str).collect();
    let labels: Vec<String> = labels.into_iter().map(str::to_owned).collect();
    if labels.is_empty() {
        return Ok(None);
    }
    let Some(order) = by_number(&labels, frames).or_else(|| by_name(&labels)) else {
        return by_place(&labels, frames).map(Some);
    };
    for (number, people) in (1..).zip(frames) {
        for person in people.iter_mut().filter(|person| !person.labels.is_empty()) {
            let mut raw = vec![Raw::MISSING; order.layout.count];
            let mut seen = HashSet::new();
            for (label, point) in person.labels.iter().zip(&person.raw) {
                let Some(place) = order.places.get(label) else { continue };
                if !seen.insert(place) {
                    return Err(repeated(label, number));
                }
                raw[*place] = *point;
            }
            (person.raw, person.layout) = (raw, order.layout);
        }
    }
    Ok(Some(order.about))
}

fn repeated(label: &str, frame: usize) -> RecordingError {
    RecordingError::Kind {
        kind: "keypoint",
        reason: format!(
            "frame {frame} has two points `{label}` of one person, expected each once: rename or remove one"
        ),
    }
}

/// Numbers count from 0 or 1, in the layout of as many points as they reach, or if they reach less far in COCO, or in OpenPose's
/// if there is a neck: that in which left and right limbs differ least.
fn by_number(labels: &[String], frames: &[Vec<Person>]) -> Option<Order> {
    let ids: Vec<usize> = labels.iter().map(|label| label.parse().ok()).collect::<Option<_>>()?;
    let (least, last) = (*ids.iter().min()?, *ids.iter().max()?);
    let people = || frames.iter().flatten().filter(|person| !person.labels.is_empty());
    // Numbers of which none is repeated run through the file.
    let points: usize = people().map(|person| person.labels.len()).sum();
    if least >= USUAL || ids.len() < LEAST || (people().count() > 1 && points == ids.len()) {
        return None;
    }
    let reach = last.checked_add(1)?;
    let point = |first: usize| {
        move |person: &Person, place: usize| {
            let is_it = |label: &String| label.parse().is_ok_and(|id: usize| id == place + first);
            let raw = person.raw.get(person.labels.iter().position(is_it)?)?;
            raw.in_space().or_else(|| raw.in_picture())
        }
    };
    let candidates = [1_usize, 0].into_iter().filter(|first| *first == 0 || least == 1).flat_map(|first| {
        let counts = match spatial::has_neck(people(), point(first)) {
            Some(true) => [&[reach - first][..], &WITH_NECK].concat(),
            _ => vec![USUAL, reach - first],
        };
        let counts = counts.into_iter().filter(move |count| reach <= first + count);
        counts.filter_map(Layout::of).map(move |layout| (first, layout))
    });
    let measured = candidates.map(|(first, layout)| {
        // Without limbs of both sides nothing favours a layout.
        (spatial::asymmetry(people(), layout, point(first)).unwrap_or(f64::INFINITY), first, layout)
    });
    let (_, first, layout) = measured.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let about = format!(
        "keypoints by their numbers, from {first} up to {last}, in the layout {} (a guess)",
        layout.name
    );
    let places = labels.iter().cloned().zip(ids.iter().map(|id| id - first)).collect();
    Some(Order { layout, places, about })
}

fn by_name(labels: &[String]) -> Option<Order> {
    let with_prefixes = prefixed(labels);
    let known = aliases::keypoints(with_prefixes.as_deref().unwrap_or(labels));
    let about = format!("{} of {} named points are keypoints", known.len(), labels.len());
    let places = |layout: &'static Layout| -> Option<HashMap<String, usize>> {
        let place = |(label, name): &(usize, String)| {
            let of = |place: usize| NAMES.get(place).is_some_and(|known| known == name);
            let place = layout.places().position(|place| place.is_some_and(of))?;
            Some((labels.get(*label)?.clone(), place))
        };
        known.iter().map(place).collect()
    };
    // Depths of MediaPipe are those of a picture.
    let with_depth = Layout::of(labels.len()).filter(|layout| layout.has_picture_depth());
    let with_depth = with_depth.and_then(|layout| Some((layout, places(layout)?)));
    let (layout, places) = with_depth.or_else(|| Some((&NAMED, places(&NAMED)?)))?;
    (!known.is_empty()).then_some(Order { layout, places, about })
}

/// People without a known number of points are left out.
fn by_place(labels: &[String], frames: &mut [Vec<Person>]) -> Result<String, RecordingError> {
    let names = labels.iter().take(6).map(String::as_str).collect::<Vec<_>>().join(", ");
    let is_animal = aliases::are_of_another_body(labels);
    let mut left_out = 0;
    for people in frames.iter_mut() {
        let before = people.len();
        let is_known = |person: &Person| !is_animal && Layout::of(person.raw.len()).is_some();
        people.retain(|person| person.labels.is_empty() || is_known(person));
        left_out += before - people.len();
    }
    let Some(person) = frames.iter().flatten().next() else {
        return Err(RecordingError::Kind {
            kind: "keypoint",
            reason: format!(
                "too few of its named points ({names}) are those of a person: expected names such as nose, left_shoulder and \
                 right_hip, or numbers such as COCO's from 0 to 16"
            ),
        });
    };
    let about = format!(
        "{} keypoints by their order in the layout {}, for their names ({names}) are unknown",
        person.layout.count, person.layout.name
    );
    Ok(match left_out {
        0 => about,
        _ => format!("{about}; {left_out} with another number of points are left out"),
    })
}
