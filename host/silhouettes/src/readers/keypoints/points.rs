//! Points of one person in JSON: lists of numbers or of points, objects with x and y, or points by their names.

use serde_json::{Map, Value};

use super::{
    json::{first_number, number},
    labels::{self, labels},
    layouts::{Layout, NAMED, NAMES},
};
use crate::silhouette::capsule::Point3;

pub const PEOPLE: [&str; 8] =
    ["people", "bodies", "instances", "persons", "poses", "predictions", "detections", "annotations"];
pub const POINTS: [&str; 12] = [
    "pose_keypoints_2d",
    "pose_keypoints",
    "keypoints",
    "joints",
    "pose_landmarks",
    "poseLandmarks",
    "landmarks",
    "landmark",
    "pose",
    "pose_world_landmarks",
    "poseWorldLandmarks",
    "worldLandmarks",
];
/// Beyond all pictures, pixels.
const FAR: f64 = 9999.0;
const LOW: f64 = -999.0;
/// Points of less confidence are missing.
pub const LEAST_CONFIDENCE: f64 = 0.1;

#[derive(Clone, Copy, Debug)]
pub struct Raw {
    pub x: f64,
    pub y: f64,
    /// A depth, or the confidence if it is not `sure`.
    pub third: Option<f64>,
    pub sure: Option<f64>,
}

impl Raw {
    pub const MISSING: Self = Self { x: f64::NAN, y: f64::NAN, third: None, sure: None };

    pub fn in_space(&self) -> Option<Point3> {
        let point = [self.x, self.y, self.third?];
        point.iter().all(|v| v.is_finite()).then_some(point)
    }

    /// The third number of a point in a picture may be one.
    fn confidence(&self, layout: &Layout, has_depth: bool) -> Option<f64> {
        self.sure.or(self.third.filter(|_| !has_depth && !layout.has_picture_depth()))
    }

    /// 0, 0 and -1, -1 are a missing point, and so are two equal numbers outside every picture.
    pub fn in_picture(&self) -> Option<Point3> {
        let missing = self.x == self.y && (self.x == 0.0 || self.x == -1.0 || self.x <= LOW || self.x >= FAR);
        // Not 0, 0, 0, which is a missing marker.
        (!missing && self.x.is_finite() && self.y.is_finite()).then_some([self.x, self.y, 1e-9])
    }
}

#[derive(Clone, Debug)]
pub struct Person {
    pub raw: Vec<Raw>,
    pub layout: &'static Layout,
    pub id: Option<i64>,
    /// Of the points, see [`labels()`].
    pub labels: Vec<String>,
    /// Whether the points were triples in one list.
    pub in_triples: bool,
    /// By [`NAMES`], see [`Person::placed`].
    pub points: Vec<Option<Point3>>,
}

impl Person {
    /// Points in the order of [`NAMES`].
    pub fn named(raw: Vec<Raw>, id: Option<i64>) -> Self {
        Self { raw, layout: &NAMED, id, labels: Vec::new(), in_triples: false, points: Vec::new() }
    }

    /// For formats that define the third number of a triple as a visibility or a score, of any range.
    pub fn scored(mut self) -> Self {
        if self.in_triples && !self.layout.has_picture_depth() {
            for raw in &mut self.raw {
                raw.sure = raw.third.take().or(raw.sure);
            }
        }
        self
    }

    /// Of the points in a layout.
    pub fn confidences(&self, layout: &'static Layout, has_depth: bool) -> impl Iterator<Item = f64> {
        self.raw.iter().filter_map(move |raw| raw.confidence(layout, has_depth))
    }

    /// Orders the points; returns the number that are hidden for their low confidence, of which `full` is the largest.
    pub fn placed(&mut self, layout: &Layout, has_depth: bool, full: f64) -> usize {
        let mut unsure = 0;
        self.points = vec![None; NAMES.len()];
        for (place, raw) in layout.places().zip(&self.raw) {
            let Some(place) = place else { continue };
            let confidence = raw.confidence(layout, has_depth);
            let is_sure = confidence.is_none_or(|confidence| confidence >= LEAST_CONFIDENCE * full);
            let point = if has_depth { raw.in_space() } else { raw.in_picture() };
            unsure += usize::from(point.is_some() && !is_sure);
            self.points[place] = point.filter(|_| is_sure);
        }
        unsure
    }
}

/// The largest possible confidence: 1, or that of percent, bytes or parts of 1000, if most values reach
/// half of it. Scores of heat maps and logits may exceed 1, too.
pub fn full_confidence(confidences: impl Iterator<Item = f64>) -> f64 {
    const FULL: [f64; 3] = [100.0, 255.0, 1000.0];
    let mut all: Vec<f64> = confidences.filter(|value| value.is_finite()).collect();
    all.sort_unstable_by(f64::total_cmp);
    // A few may be garbage.
    let high = all.get(all.len() * 9 / 10).copied();
    high.and_then(|high| FULL.into_iter().find(|full| (0.5 * full..=*full).contains(&high))).unwrap_or(1.0)
}

pub fn points(value: &Value, confidences: Option<&[Value]>) -> Option<Person> {
    match value {
        Value::Object(map) => match rows(map) {
            Some(rows) => points_of(&rows, confidences),
            None => named(map),
        },
        other => points_of(other.as_array()?, confidences),
    }
}

/// Points as x, y, c, ... in one list, lists of two to four numbers, or objects with x and y.
pub fn points_of(items: &[Value], confidences: Option<&[Value]>) -> Option<Person> {
    let flat = items.iter().any(|item| number(item).is_some());
    let labels = labels(items);
    let (layout, in_triples, mut raw): (_, _, Vec<Raw>) = if flat {
        let (layout, width) = [3, 2, 4].iter().find_map(|width| {
            let layout =
                Layout::of(items.len() / width).filter(|layout| layout.count * width == items.len())?;
            // Joints in succession are near each other: numbers of a length of several layouts may be triples of another.
            let are_triples = items.len().is_multiple_of(3) && change(items, *width) > change(items, 3);
            (!are_triples).then_some((layout, *width))
        })?;
        (layout, width == 3, items.chunks_exact(width).map(of_numbers).collect())
    } else {
        let of = |item: &Value| match item {
            Value::Null => Some(Raw::MISSING),
            other => point(other),
        };
        let layout = Layout::of(items.len()).or((!labels.is_empty()).then_some(&NAMED))?;
        (layout, false, items.iter().map(of).collect::<Option<_>>()?)
    };
    for (raw, given) in raw.iter_mut().zip(confidences.unwrap_or_default()) {
        raw.sure = Some(number(given).unwrap_or(f64::NAN));
    }
    Some(Person { raw, layout, id: None, labels, in_triples, points: Vec::new() })
}

/// Mean difference of numbers `width` apart, without zeros, which are missing points.
fn change(items: &[Value], width: usize) -> f64 {
    let seen = |item: &Value| number(item).filter(|value| value.is_finite() && *value != 0.0);
    let pairs = items.iter().zip(items.iter().skip(width));
    let steps: Vec<f64> = pairs.filter_map(|(from, to)| Some((seen(from)? - seen(to)?).abs())).collect();
    steps.iter().sum::<f64>() / steps.len() as f64
}

/// Points under their names as keys; other values are ignored.
pub fn named(map: &Map<String, Value>) -> Option<Person> {
    let named = map.iter().filter_map(|(name, value)| Some((name.clone(), point(value)?)));
    let (labels, raw): (Vec<String>, Vec<Raw>) = named.unzip();
    let person = Person { raw, layout: &NAMED, id: None, labels, in_triples: false, points: Vec::new() };
    (person.raw.len() >= labels::LEAST).then_some(person)
}

pub fn id_of(person: &Map<String, Value>) -> Option<i64> {
    let id = ["person_id", "idx", "track_id"].iter().find_map(|key| first_number(person.get(*key)?));
    id.filter(|id| *id >= 0.0).map(|id| id as i64)
}

/// A COCO annotation of a category with names.
pub fn annotated(annotation: &Value, names: &[String]) -> Option<Person> {
    let numbers =
        annotation.get("keypoints")?.as_array().filter(|numbers| numbers.len() == 3 * names.len())?;
    let scored = |raw: Raw| Raw { third: None, sure: raw.third, ..raw };
    let raw = numbers.chunks_exact(3).map(|numbers| scored(of_numbers(numbers))).collect();
    let layout = Layout::of(names.len()).unwrap_or(&NAMED);
    let id = id_of(annotation.as_object()?);
    Some(Person { raw, layout, id, labels: names.to_vec(), in_triples: false, points: Vec::new() })
}

fn point(value: &Value) -> Option<Raw> {
    match value {
        Value::Array(numbers) if (2..=4).contains(&numbers.len()) && !numbers.iter().any(is_nested) => {
            Some(of_numbers(numbers))
        }
        Value::Object(map) => of_object(map),
        _ => None,
    }
}

fn is_nested(value: &Value) -> bool {
    value.is_array() || value.is_object()
}

fn of_numbers(numbers: &[Value]) -> Raw {
    let at = |k: usize| numbers.get(k).map(|value| number(value).unwrap_or(f64::NAN));
    Raw { x: at(0).unwrap_or(f64::NAN), y: at(1).unwrap_or(f64::NAN), third: at(2), sure: at(3) }
}

fn of_object(map: &Map<String, Value>) -> Option<Raw> {
    // A person's box has a place, too.
    if has_key(map) {
        return None;
    }
    let sure = ["visibility", "score", "confidence", "c", "conf", "likelihood"]
        .iter()
        .find_map(|key| map.get(*key).and_then(number));
    // PoseNet nests the position.
    let place = map.get("position").and_then(Value::as_object).unwrap_or(map);
    let own = |key: &str| place.get(key).filter(|value| !is_nested(value));
    let [x, y] = ["x", "y"].map(|key| own(key).map(|value| number(value).unwrap_or(f64::NAN)));
    Some(Raw { x: x?, y: y?, third: place.get("z").and_then(number), sure: sure.or(Some(1.0)) })
}

/// Points of Ultralytics' columns `x`, `y` and `visible`.
fn rows(columns: &Map<String, Value>) -> Option<Vec<Value>> {
    let column = |key: &str| columns.get(key).and_then(Value::as_array);
    let (x, y) = (column("x")?, column("y")?);
    let sure = ["visible", "confidence"].into_iter().find_map(column);
    let row = |(index, (x, y)): (usize, (&Value, &Value))| {
        let sure = sure.and_then(|sure| sure.get(index)).cloned();
        Value::Array([Some(x.clone()), Some(y.clone()), sure].into_iter().flatten().collect())
    };
    Some(x.iter().zip(y).enumerate().map(row).collect())
}

fn has_key(map: &Map<String, Value>) -> bool {
    PEOPLE.iter().chain(&POINTS).any(|key| map.contains_key(*key))
}

/// Whether a map holds people, a person or its points.
pub fn is_frame(map: &Map<String, Value>) -> bool {
    has_key(map) || named(map).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_outside_every_picture_are_missing_points() {
        let seen = |x: f64, y: f64| Raw { x, y, ..Raw::MISSING }.in_picture().is_some();
        for constant in [0.0, -1.0, -9999.99, 9_999_999.0, f64::NAN] {
            assert!(!seen(constant, constant), "{constant}");
        }
        assert!(seen(120.0, 120.0) && seen(-1.0, 200.0) && seen(-30.0, -30.0));
    }

    #[test]
    fn scores_far_below_a_full_confidence_are_those_of_heat_maps() {
        for (high, full) in
            [(300.0, 1.0), (20.0, 1.0), (0.9, 1.0), (95.0, 100.0), (250.0, 255.0), (900.0, 1000.0)]
        {
            assert_eq!(full_confidence([high; 10].into_iter()), full, "{high}");
        }
    }
}
