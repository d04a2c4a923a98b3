//! People in the JSON of pose estimators, in all common nestings: a frame per file (OpenPose), a list of
//! people with their picture (COCO, AlphaPose), lists of frames (MMPose, MediaPipe), picture names, or tracks of people.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

use super::{
    json::{finite, first_number, number, text},
    labels::labels,
    layouts::{Layout, NAMED, NAMES},
};
use crate::{readers::recording::RecordingError, silhouette::capsule::Point3};

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

    pub fn in_picture(&self) -> Option<Point3> {
        let zero = self.x == 0.0 && self.y == 0.0;
        // Not 0, 0, 0, which is a missing marker.
        (!zero && self.x.is_finite() && self.y.is_finite()).then_some([self.x, self.y, 1e-9])
    }
}

#[derive(Clone, Debug)]
pub struct Person {
    pub raw: Vec<Raw>,
    pub layout: &'static Layout,
    pub id: Option<i64>,
    /// Of the points, see [`labels`].
    pub labels: Vec<String>,
    /// Whether the points were triples in one list.
    in_triples: bool,
    /// By [`NAMES`], see [`Person::placed`].
    pub points: Vec<Option<Point3>>,
}

impl Person {
    /// Points in the order of [`NAMES`].
    pub fn named(raw: Vec<Raw>, id: Option<i64>) -> Self {
        Self { raw, layout: &NAMED, id, labels: Vec::new(), in_triples: false, points: Vec::new() }
    }

    /// For formats that define the third number of a triple as a visibility or a score, of any range.
    fn scored(mut self) -> Self {
        if self.in_triples && !self.layout.has_picture_depth() {
            for raw in &mut self.raw {
                raw.sure = raw.third.take().or(raw.sure);
            }
        }
        self
    }

    /// Orders the points; returns the number that are hidden for their low confidence.
    pub fn placed(&mut self, layout: &Layout, has_depth: bool) -> usize {
        let mut unsure = 0;
        self.points = vec![None; NAMES.len()];
        for (place, raw) in layout.places().zip(&self.raw) {
            let Some(place) = place else { continue };
            let third = raw.third.filter(|_| !has_depth && !layout.has_picture_depth());
            let is_sure = raw.sure.or(third).unwrap_or(1.0) >= LEAST_CONFIDENCE;
            let point = if has_depth { raw.in_space() } else { raw.in_picture() };
            unsure += usize::from(point.is_some() && !is_sure);
            self.points[place] = point.filter(|_| is_sure);
        }
        unsure
    }
}

#[derive(Debug, Default)]
pub struct Document {
    pub frames: Vec<Vec<Person>>,
    pub size: Option<[f64; 2]>,
    /// Whether gaps in the numbers are too long to be filled.
    pub has_wide_gaps: bool,
    /// Entries (frames, people of a picture or a track) whose values are not points of a person.
    pub unread: usize,
    /// A list, whose items may be frames, or people of one frame.
    is_list: bool,
}

const PEOPLE: [&str; 8] =
    ["people", "bodies", "instances", "persons", "poses", "predictions", "detections", "annotations"];
const FRAMES: [&str; 6] = ["frames", "instance_info", "pose_frames", "results", "data", "root"];
const POINTS: [&str; 12] = [
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
/// Keys that only OpenPose and its relatives use.
const OPENPOSE: [&str; 2] = ["pose_keypoints_2d", "pose_keypoints"];
const CONFIDENCES: [&str; 3] = ["keypoint_scores", "keypoints_scores", "keypoint_confidences"];

/// A name's texts, each with the number after it, so that `frame_9` sorts before `frame_10`.
type Name = Vec<(String, u128)>;
type Named = BTreeMap<Name, Vec<Person>>;

impl Document {
    pub fn parse(bytes: &[u8]) -> Result<Self, RecordingError> {
        let value: Value = serde_json::from_slice(&finite(bytes)).map_err(|error| RecordingError::Line {
            line: error.line(),
            reason: format!("not JSON: {error}"),
        })?;
        let mut document = Self { size: size(&value), ..Self::default() };
        document.whole(&value);
        Ok(document)
    }

    /// People by the names of their frames; a frame may occur several times.
    pub fn of_frames(people: impl IntoIterator<Item = (String, Vec<Person>)>) -> Self {
        let (mut frames, mut document) = (Named::new(), Self::default());
        for (frame, people) in people {
            frames.entry(split(&frame)).or_default().extend(people);
        }
        document.numbered(frames);
        document
    }

    /// Reads a folder's files in order: a frame each, or a recording in a single file.
    pub fn of_files<'a>(
        files: impl IntoIterator<Item = (&'a str, &'a [u8])>,
    ) -> Result<Self, RecordingError> {
        let mut documents = files
            .into_iter()
            .map(|(name, bytes)| match Self::parse(bytes) {
                Ok(document) => Ok((name, document)),
                Err(error) => Err(RecordingError::File { name: name.into(), error: error.into() }),
            })
            .collect::<Result<Vec<(&str, Self)>, RecordingError>>()?;
        if documents.len() < 2 {
            return Ok(documents.pop().map(|(_, document)| document).unwrap_or_default());
        }
        let is_recording = |document: &Self| document.frames.len() > 1 && !document.is_list;
        if let Some((name, document)) = documents.iter().find(|(_, document)| is_recording(document)) {
            let frames = document.frames.len();
            let reason = format!(
                "{name} holds {frames} frames, and the folder other files: give each recording alone"
            );
            return Err(RecordingError::Kind { kind: "keypoint JSON", reason });
        }
        let size = documents.iter().find_map(|(_, document)| document.size);
        let unread = documents.iter().map(|(_, document)| document.unread).sum();
        let mut whole = Self { size, unread, ..Self::default() };
        // A list in such a file holds people, not frames.
        let people = |document: Self| -> Vec<Person> { document.frames.into_iter().flatten().collect() };
        whole.numbered(documents.into_iter().map(|(name, document)| (split(name), people(document))));
        Ok(whole)
    }

    fn whole(&mut self, value: &Value) {
        match value {
            Value::Array(items) if items.iter().any(|item| picture_of(item).is_some()) => {
                self.by_picture(items, None);
            }
            Value::Array(items) => {
                self.is_list = true;
                self.frames_of(items);
            }
            Value::Object(map) => {
                if let Some(items) = map.get("annotations").and_then(Value::as_array) {
                    return self.by_picture(items, Some(map));
                }
                if let Some(items) = FRAMES.iter().find_map(|key| map.get(*key)?.as_array()) {
                    return self.frames_of(items);
                }
                if is_frame(map) {
                    let frame = self.entry(value);
                    self.frames.push(frame);
                    return;
                }
                if map.values().any(is_track) {
                    return self.by_names(map);
                }
                // Frames by picture names.
                let mut frames: Named = BTreeMap::new();
                for (name, frame) in map {
                    if frame.as_object().is_some_and(is_frame) || frame.is_array() {
                        frames.entry(split(name)).or_default().extend(self.entry(frame));
                    }
                }
                self.numbered(frames);
            }
            _ => {}
        }
    }

    fn frames_of(&mut self, items: &[Value]) {
        // The points of one person, or people of one frame.
        if let Some(person) = points_of(items, None) {
            self.frames.push(vec![person]);
            return;
        }
        for item in items {
            let frame = self.entry(item);
            self.frames.push(frame);
        }
    }

    /// Pictures between them without people are empty frames. `about` has COCO's lists of pictures and categories.
    fn by_picture(&mut self, items: &[Value], about: Option<&Map<String, Value>>) {
        let list =
            |key: &str| about.and_then(|about| about.get(key)?.as_array()).map_or(&[][..], Vec::as_slice);
        let named: BTreeMap<String, Vec<String>> = list("categories").iter().filter_map(category).collect();
        let mut frames: Named = BTreeMap::new();
        let mut names: BTreeMap<String, String> = BTreeMap::new();
        for picture in list("images") {
            if let (Some(id), Some(name)) =
                (picture.get("id").and_then(text), picture.get("file_name").and_then(Value::as_str))
            {
                names.insert(id, name.into());
                frames.entry(split(name)).or_default();
            }
        }
        for item in items {
            let Some(picture) = picture_of(item) else { continue };
            let is_coco = item.get("image_id").is_some();
            let key = split(names.get(&picture).unwrap_or(&picture));
            let points = item.get("category_id").and_then(text).and_then(|id| named.get(&id));
            let people = match points.and_then(|names| annotated(item, names)) {
                Some(person) => vec![person],
                None => self.entry(item),
            };
            let people = people.into_iter().map(|person| if is_coco { person.scored() } else { person });
            frames.entry(key).or_default().extend(people);
        }
        self.numbered(frames);
    }

    /// Maps of people's frames (ShanghaiTech's poses, PoseLift), or of frames' people: there are fewer people.
    fn by_names(&mut self, outer: &Map<String, Value>) {
        let longest = outer.values().filter_map(|inner| Some(inner.as_object()?.len())).max();
        let are_frames = longest.is_some_and(|inner| outer.len() > inner);
        let mut frames: Named = BTreeMap::new();
        for (name, inner) in outer {
            for (own, value) in inner.as_object().into_iter().flatten() {
                let (id, frame) = if are_frames { (own, name) } else { (name, own) };
                let people = self.entry(value).into_iter();
                let people =
                    people.map(|person| Person { id: id.parse().ok().or(person.id), ..person.scored() });
                frames.entry(split(frame)).or_default().extend(people);
            }
        }
        self.numbered(frames);
    }

    /// Missing numbers are frames without people.
    fn numbered(&mut self, frames: impl IntoIterator<Item = (Name, Vec<Person>)>) {
        /// Gaps are filled if the recording grows at most by this factor.
        const LONGEST: u128 = 10;
        let (names, people): (Vec<Name>, Vec<Vec<Person>>) = frames.into_iter().unzip();
        let steps: Vec<u128> = names.windows(2).map(|pair| step(&pair[0], &pair[1]).unwrap_or(0)).collect();
        let least = steps.iter().copied().filter(|step| *step > 0).min().unwrap_or(1);
        let reach = steps.iter().fold(0, |sum: u128, step| sum.saturating_add(*step));
        self.has_wide_gaps = reach / least > LONGEST * names.len() as u128;
        for (people, step) in people.into_iter().zip(std::iter::once(0).chain(steps)) {
            let missing = if self.has_wide_gaps { 0 } else { (step / least).saturating_sub(1) };
            self.frames.extend((0..missing).map(|_| Vec::new()));
            self.frames.push(people);
        }
    }

    fn entry(&mut self, value: &Value) -> Vec<Person> {
        let people = self.people(value);
        self.unread += usize::from(people.is_empty() && holds_values(value));
        people
    }

    fn people(&mut self, value: &Value) -> Vec<Person> {
        let people = match value {
            Value::Object(map) => PEOPLE.iter().find_map(|key| map.get(*key)).unwrap_or(value),
            other => other,
        };
        match people {
            Value::Array(items) => match points(people, None) {
                Some(person) => vec![person],
                None => items.iter().filter_map(|item| self.person(item)).collect(),
            },
            Value::Object(map) => {
                // Several people's landmarks in one list.
                let several = POINTS.iter().find_map(|key| map.get(*key)?.as_array());
                if let Some(items) = several
                    && points_of(items, None).is_none()
                {
                    return items.iter().filter_map(|item| self.person(item)).collect();
                }
                self.person(people).into_iter().collect()
            }
            _ => Vec::new(),
        }
    }

    fn person(&mut self, value: &Value) -> Option<Person> {
        let Value::Object(map) = value else {
            return points(value, None);
        };
        let confidences = CONFIDENCES.iter().find_map(|key| map.get(*key)?.as_array());
        let found = POINTS.iter().find_map(|key| {
            let value = map.get(*key)?;
            // MediaPipe's Python objects and ml5.js keep a list within.
            let value = ["landmark", "keypoints"].iter().find_map(|key| value.get(key)).unwrap_or(value);
            let person = points(value, confidences.map(Vec::as_slice))?;
            Some(if OPENPOSE.contains(key) { person.scored() } else { person })
        })?;
        Some(Person { id: id_of(map), ..found })
    }
}

fn points(value: &Value, confidences: Option<&[Value]>) -> Option<Person> {
    match value {
        Value::Object(columns) => points_of(&rows(columns)?, confidences),
        other => points_of(other.as_array()?, confidences),
    }
}

/// Points as x, y, c, ... in one list, lists of two to four numbers, or objects with x and y.
fn points_of(items: &[Value], confidences: Option<&[Value]>) -> Option<Person> {
    let flat = items.iter().any(|item| number(item).is_some());
    let labels = labels(items);
    let (layout, in_triples, mut raw): (_, _, Vec<Raw>) = if flat {
        // No two layouts share a length.
        let (layout, width) = [3, 2, 4].iter().find_map(|width| {
            let layout =
                Layout::of(items.len() / width).filter(|layout| layout.count * width == items.len())?;
            Some((layout, *width))
        })?;
        (layout, width == 3, items.chunks_exact(width).map(of_numbers).collect())
    } else {
        let of = |item: &Value| match item {
            Value::Array(numbers) if (2..=4).contains(&numbers.len()) => Some(of_numbers(numbers)),
            Value::Object(map) => of_object(map),
            Value::Null => Some(Raw::MISSING),
            _ => None,
        };
        let layout = Layout::of(items.len()).or((!labels.is_empty()).then_some(&NAMED))?;
        (layout, false, items.iter().map(of).collect::<Option<_>>()?)
    };
    for (raw, given) in raw.iter_mut().zip(confidences.unwrap_or_default()) {
        raw.sure = Some(number(given).unwrap_or(f64::NAN));
    }
    Some(Person { raw, layout, id: None, labels, in_triples, points: Vec::new() })
}

fn id_of(person: &Map<String, Value>) -> Option<i64> {
    let id = ["person_id", "idx", "track_id"].iter().find_map(|key| first_number(person.get(*key)?));
    id.filter(|id| *id >= 0.0).map(|id| id as i64)
}

/// Id of a COCO category and the names of its points.
fn category(category: &Value) -> Option<(String, Vec<String>)> {
    let names = category.get("keypoints")?.as_array()?.iter();
    let names: Vec<String> = names.map(|name| Some(name.as_str()?.to_owned())).collect::<Option<_>>()?;
    Some((text(category.get("id")?)?, names)).filter(|(_, names)| !names.is_empty())
}

/// A COCO annotation of a category with names.
fn annotated(annotation: &Value, names: &[String]) -> Option<Person> {
    let numbers =
        annotation.get("keypoints")?.as_array().filter(|numbers| numbers.len() == 3 * names.len())?;
    let scored = |raw: Raw| Raw { third: None, sure: raw.third, ..raw };
    let raw = numbers.chunks_exact(3).map(|numbers| scored(of_numbers(numbers))).collect();
    let layout = Layout::of(names.len()).unwrap_or(&NAMED);
    let id = id_of(annotation.as_object()?);
    Some(Person { raw, layout, id, labels: names.to_vec(), in_triples: false, points: Vec::new() })
}

fn of_numbers(numbers: &[Value]) -> Raw {
    let at = |k: usize| numbers.get(k).map(|value| number(value).unwrap_or(f64::NAN));
    Raw { x: at(0).unwrap_or(f64::NAN), y: at(1).unwrap_or(f64::NAN), third: at(2), sure: at(3) }
}

fn of_object(map: &Map<String, Value>) -> Option<Raw> {
    // A person's box has a place, too.
    if is_frame(map) {
        return None;
    }
    let sure =
        ["visibility", "score", "confidence", "c"].iter().find_map(|key| map.get(*key).and_then(number));
    // PoseNet nests the position.
    let place = map.get("position").and_then(Value::as_object).unwrap_or(map);
    let [x, y] = ["x", "y"].map(|key| place.get(key).map(|value| number(value).unwrap_or(f64::NAN)));
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

fn is_frame(map: &Map<String, Value>) -> bool {
    PEOPLE.iter().chain(&POINTS).any(|key| map.contains_key(*key))
}

/// Whether anything is where people's points are expected.
fn holds_values(value: &Value) -> bool {
    match value {
        Value::Array(items) => items.iter().any(holds_values),
        Value::Object(map) => PEOPLE
            .iter()
            .chain(&POINTS)
            .chain(&["x", "position"])
            .any(|key| map.get(*key).is_some_and(holds_values)),
        Value::Number(_) | Value::String(_) => true,
        Value::Null | Value::Bool(_) => false,
    }
}

fn is_track(value: &Value) -> bool {
    value.as_object().is_some_and(|track| {
        !is_frame(track) && track.values().any(|frame| frame.as_object().is_some_and(is_frame))
    })
}

fn picture_of(item: &Value) -> Option<String> {
    let id = item.get("image_id").or_else(|| item.get("frame_id")).or_else(|| item.get("image_name"))?;
    text(id).filter(|_| item.get("instances").is_none())
}

fn split(name: &str) -> Name {
    let mut pieces = Name::new();
    let mut rest = name;
    while let Some(at) = rest.find(|c: char| c.is_ascii_digit()) {
        let (text, numbers) = rest.split_at(at);
        let end = numbers.find(|c: char| !c.is_ascii_digit()).unwrap_or(numbers.len());
        pieces.push((text.into(), numbers[..end].parse().unwrap_or(u128::MAX)));
        rest = &numbers[end..];
    }
    pieces.push((rest.into(), 0));
    pieces
}

/// How far the one number rises in which the names differ.
fn step(from: &Name, to: &Name) -> Option<u128> {
    let mut differing = from.iter().zip(to).filter(|(from, to)| from != to);
    let (before, after) = differing.next().filter(|_| from.len() == to.len())?;
    let alone = differing.next().is_none() && before.0 == after.0;
    after.1.checked_sub(before.1).filter(|_| alone)
}

fn size(value: &Value) -> Option<[f64; 2]> {
    let map = value.as_object()?;
    let of = |map: &Map<String, Value>| {
        let get = |keys: &[&str]| keys.iter().find_map(|key| map.get(*key)?.as_f64()).filter(|v| *v > 0.0);
        Some([get(&["width", "image_width", "img_width"])?, get(&["height", "image_height", "img_height"])?])
    };
    let pair = ["image_size", "img_size", "size"].iter().find_map(|key| {
        let pair = map.get(*key)?.as_array()?;
        Some([pair.first()?.as_f64()?, pair.get(1)?.as_f64()?])
    });
    let first = map.get("images").and_then(|images| images.get(0)?.as_object());
    let about = ["info", "metadata", "meta", "meta_info"].iter().find_map(|key| map.get(*key)?.as_object());
    of(map).or(pair).or_else(|| first.and_then(of)).or_else(|| about.and_then(of))
}
