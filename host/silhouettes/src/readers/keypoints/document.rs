//! People in the JSON of pose estimators, in all common nestings: a frame per file (OpenPose), a list of
//! people with their picture (COCO, AlphaPose), lists of frames (MMPose, MediaPipe), picture names, or tracks of people.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

use super::{
    json::{finite, text},
    names::{Name, gaps, split},
    points::{PEOPLE, POINTS, Person, annotated, id_of, is_frame, named, points, points_of},
};
use crate::readers::recording::RecordingError;

#[derive(Debug, Default)]
pub struct Document {
    pub frames: Vec<Vec<Person>>,
    pub size: Option<[f64; 2]>,
    /// About the frames' names and the people's categories.
    pub remarks: Vec<String>,
    /// Entries (frames, people of a picture or a track) whose values are not points of a person.
    pub unread: usize,
    /// Length of the longest list in them.
    pub longest: usize,
    /// A list, whose items may be frames, or people of one frame.
    is_list: bool,
}

const FRAMES: [&str; 6] = ["frames", "instance_info", "pose_frames", "results", "data", "root"];
/// Keys that only OpenPose and its relatives use.
const OPENPOSE: [&str; 2] = ["pose_keypoints_2d", "pose_keypoints"];
const CONFIDENCES: [&str; 3] = ["keypoint_scores", "keypoints_scores", "keypoint_confidences"];

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
        let longest = documents.iter().map(|(_, document)| document.longest).max().unwrap_or(0);
        let mut whole = Self { size, unread, longest, ..Self::default() };
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
        let categories: BTreeMap<String, Vec<String>> =
            list("categories").iter().filter_map(category).collect();
        let listed: Vec<String> =
            list("categories").iter().filter_map(|category| text(category.get("id")?)).collect();
        let mut unlisted: BTreeMap<String, usize> = BTreeMap::new();
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
            let category = item.get("category_id").and_then(text);
            let is_unlisted = !listed.is_empty() && item.get("keypoints").is_some();
            if let Some(id) = category.as_ref().filter(|id| is_unlisted && !listed.contains(id)) {
                *unlisted.entry(id.clone()).or_insert(0_usize) += 1;
            }
            let points = category.and_then(|id| categories.get(&id));
            let people = match points.and_then(|names| annotated(item, names)) {
                Some(person) => vec![person],
                None => self.entry(item),
            };
            let people = people.into_iter().map(|person| if is_coco { person.scored() } else { person });
            frames.entry(key).or_default().extend(people);
        }
        self.remarks.extend(unlisted.into_iter().map(|(id, count)| {
            let listed = listed.join(", ");
            format!(
                "`categories` ({listed}) lacks the category_id {id} of {count} annotations: their points are read by their order"
            )
        }));
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
        let (names, people): (Vec<Name>, Vec<Vec<Person>>) = frames.into_iter().unzip();
        let (missing, remarks) = gaps(&names);
        self.remarks.extend(remarks);
        for (people, missing) in people.into_iter().zip(missing) {
            self.frames.extend((0..missing).map(|_| Vec::new()));
            self.frames.push(people);
        }
    }

    fn entry(&mut self, value: &Value) -> Vec<Person> {
        let people = self.people(value);
        if people.is_empty() && holds_values(value) {
            self.unread += 1;
            self.longest = self.longest.max(longest(value));
        }
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
        });
        Some(Person { id: id_of(map), ..found.or_else(|| named(map))? })
    }
}

/// Id of a COCO category and the names of its points.
fn category(category: &Value) -> Option<(String, Vec<String>)> {
    let names = category.get("keypoints")?.as_array()?.iter();
    let names: Vec<String> = names.map(|name| Some(name.as_str()?.to_owned())).collect::<Option<_>>()?;
    Some((text(category.get("id")?)?, names)).filter(|(_, names)| !names.is_empty())
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

/// Length of the longest list.
fn longest(value: &Value) -> usize {
    match value {
        Value::Array(items) => items.iter().map(longest).fold(items.len(), usize::max),
        Value::Object(map) => map.values().map(longest).max().unwrap_or(0),
        _ => 0,
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
