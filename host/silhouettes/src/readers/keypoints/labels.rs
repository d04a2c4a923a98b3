//! Points that state their name or number: a file may list them in any order and leave some out.

use std::collections::{BTreeSet, HashMap, HashSet};

use serde_json::Value;

use super::{
    document::{Person, Raw},
    layouts::{Layout, NAMED, NAMES},
};
use crate::{readers::recording::RecordingError, silhouette::aliases};

const KEYS: [&str; 3] = ["name", "part", "id"];
/// Points of COCO, the usual layout of programs that leave points out.
const USUAL: usize = 17;

struct Order {
    layout: &'static Layout,
    /// Indices in the layout.
    places: HashMap<String, usize>,
    about: String,
}

/// Labels of a person's points; empty if they do not tell the points apart.
pub fn labels(points: &[Value]) -> Vec<String> {
    let by = |key: &&str| -> Option<Vec<String>> {
        let label = |point: &Value| match point.get(*key)? {
            Value::String(name) => Some(name.clone()),
            other => Some(other.as_f64()?.to_string()),
        };
        let labels: Vec<String> = points.iter().map(label).collect::<Option<_>>()?;
        let is_distinct = labels.iter().collect::<HashSet<_>>().len() == labels.len();
        is_distinct.then_some(labels)
    };
    KEYS.iter().find_map(by).unwrap_or_default()
}

/// Puts points with labels in the order of a layout, and reports it. Fails if no person remains.
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
    for person in frames.iter_mut().flatten().filter(|person| !person.labels.is_empty()) {
        let mut raw = vec![Raw::MISSING; order.layout.count];
        for (label, point) in person.labels.iter().zip(&person.raw) {
            if let Some(place) = order.places.get(label) {
                raw[*place] = *point;
            }
        }
        (person.raw, person.layout) = (raw, order.layout);
    }
    Ok(Some(order.about))
}

/// The layout of as many points as the numbers reach; COCO for fewer, except if everybody has them all.
fn by_number(labels: &[String], frames: &[Vec<Person>]) -> Option<Order> {
    let ids: Vec<usize> = labels.iter().map(|label| label.parse().ok()).collect::<Option<_>>()?;
    let last = *ids.iter().max()?;
    let people = || frames.iter().flatten().filter(|person| !person.labels.is_empty());
    let most = people().map(|person| person.labels.len()).max()?;
    // Some programs count from 1.
    let first = usize::from(ids.iter().min() == Some(&1) && Layout::of(last).is_some());
    let count = last.checked_add(1)? - first;
    // Other numbers are not those of keypoints, or run through the file.
    if 2 * most <= count {
        return None;
    }
    let is_whole = people().all(|person| person.labels.len() == count);
    let layout = Layout::of(if count < USUAL && !is_whole { USUAL } else { count })?;
    let about = format!(
        "keypoints by their numbers, from {first} up to {last}, in the layout {} (a guess)",
        layout.name
    );
    let places = labels.iter().cloned().zip(ids.iter().map(|id| id - first)).collect();
    Some(Order { layout, places, about })
}

fn by_name(labels: &[String]) -> Option<Order> {
    let known = aliases::keypoints(labels);
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
    let mut left_out = 0;
    for people in frames.iter_mut() {
        let before = people.len();
        people.retain(|person| person.labels.is_empty() || Layout::of(person.raw.len()).is_some());
        left_out += before - people.len();
    }
    let Some(person) = frames.iter().flatten().next() else {
        return Err(RecordingError::Kind {
            kind: "keypoint JSON",
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
