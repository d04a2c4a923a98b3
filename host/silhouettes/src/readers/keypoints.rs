//! Keypoints of pose estimators: OpenPose, COCO and HALPE (AlphaPose, MMPose), MediaPipe as JSON, others in tables. In two dimensions there is
//! one view, x to the right and y down in the picture, and lengths are guessed from the body: the longest trunk and legs in a
//! frame are those of an adult. In three dimensions lengths are metres. People without numbers are followed by place.

pub mod aspect;
mod document;
mod json;
mod labels;
mod layouts;
pub mod names;
mod people;
mod points;
mod spatial;
pub mod table;

use super::{
    posture,
    reader::Reader,
    recording::{Choices, Found, Known, RecordingError, Source, Unit, Up},
};
use crate::silhouette::capsule::Point3;
use aspect::Aspect;
use document::Document;
use layouts::NAMES;
use people::{People, distance};
use points::{LEAST_CONFIDENCE, Person, full_confidence};

pub const READER: Reader = Reader {
    name: "keypoints",
    extensions: &["json"],
    about: "keypoints of OpenPose (a folder of files), COCO, HALPE, MMPose and MediaPipe; one view in two dimensions; one person of several",
    read,
};

/// Lengths of an adult, mm; ends are indices of [`NAMES`].
const BONES_MM: [([usize; 2], f64); 4] =
    [([16, 18], 420.0), ([17, 19], 420.0), ([18, 20], 420.0), ([19, 21], 420.0)];
const TRUNK_MM: f64 = 500.0;
const HEAD: [usize; 6] = [0, 1, 2, 3, 4, 5];
const ANKLES: [usize; 2] = [20, 21];
const SHOULDERS: [usize; 2] = [8, 9];
const HIPS: [usize; 2] = [16, 17];
/// A file with more unread entries than this per frame with a person holds something else.
const MOST_UNREAD: usize = 9;
/// Coordinates up to this are shares of the picture's sides, not pixels; points may be outside, and few far outside.
const NORMALISED: f64 = 3.0;
const MOST_FAR_OUTSIDE: f64 = 0.05;
/// Aspect ratio if the file does not state it.
const USUAL_ASPECT: f64 = 16.0 / 9.0;

pub fn read(bytes: &[u8], choices: Choices) -> Result<Found, RecordingError> {
    found(Document::parse(bytes)?, choices, None)
}

/// Reads names and contents of a folder's JSON files, one frame each, in order.
pub fn read_files<'a>(
    files: impl IntoIterator<Item = (&'a str, &'a [u8])>,
    choices: Choices,
) -> Result<Found, RecordingError> {
    found(Document::of_files(files)?, choices, None)
}

/// The first remark is `about` the points, or about their labels or layout.
fn found(document: Document, choices: Choices, about: Option<String>) -> Result<Found, RecordingError> {
    let Document { mut frames, size, remarks: of_document, unread, longest, .. } = document;
    let labelled = labels::order(&mut frames)?;
    let everyone = || frames.iter().flatten();
    let with_people = frames.iter().filter(|people| !people.is_empty()).count();
    let is_read = unread <= MOST_UNREAD * with_people;
    let first = everyone().next().filter(|_| is_read).ok_or_else(|| {
        let what = match with_people {
            0 if longest > 0 => {
                format!("it holds no person's points, the longest list in a frame has {longest} values")
            }
            0 => "it holds no person's points".to_owned(),
            _ => format!("it holds people's points in {with_people} frames, other values in {unread}"),
        };
        let counts: Vec<String> = layouts::LAYOUTS.iter().map(|layout| layout.count.to_string()).collect();
        let reason = format!(
            "{what}: expected `people`, `annotations`, `keypoints` or `landmarks` of {} points",
            counts.join(", ")
        );
        RecordingError::Kind { kind: "keypoint JSON", reason }
    })?;
    let has_depth = spatial::has_depth(everyone());
    let in_picture = !has_depth && !spatial::are_centred(everyone());
    let own = first.layout;
    let layout = match labelled {
        _ if has_depth => spatial::layout(everyone())?,
        Some(_) => own,
        None => spatial::picture_layout(everyone(), own),
    };
    let seen = if has_depth { "in three dimensions" } else { "seen from one side" };
    let about = about
        .or(labelled)
        .unwrap_or_else(|| format!("{} keypoints of the layout {}", layout.count, layout.name));
    let mut remarks = vec![format!("{about}, {seen}")];
    if unread > 0 {
        remarks.push(format!(
            "values that are not the points of a person in a known layout are taken as empty: {unread} entries"
        ));
    }
    remarks.extend(of_document);
    let order = |person: &Person| if has_depth || person.layout == own { layout } else { person.layout };
    let full = full_confidence(everyone().flat_map(|person| person.confidences(order(person), has_depth)));
    if full > 1.0 {
        remarks.push(format!("confidences are taken as parts of {full} (a guess by their range)"));
    }
    let people = frames.iter_mut().flatten();
    let placed = people.map(|person| {
        let layout = order(person);
        person.placed(layout, has_depth, full)
    });
    let unsure: usize = placed.sum();
    if unsure > 0 {
        let least = LEAST_CONFIDENCE * full;
        remarks.push(format!("{unsure} points below a confidence of {least} are treated as missing"));
    }
    let points: Vec<&Point3> =
        frames.iter().flatten().flat_map(|person| person.points.iter().flatten()).collect();
    let far = points.iter().filter(|point| point.iter().any(|value| value.abs() > NORMALISED)).count();
    if in_picture && !points.is_empty() && far as f64 <= MOST_FAR_OUTSIDE * points.len() as f64 {
        let (aspect, known) = match (choices.aspect, size) {
            (Some(aspect), _) => (aspect.ratio(), "by --aspect"),
            (None, Some([width, height])) => (width / height, "stated"),
            (None, None) => (USUAL_ASPECT, "a doubtful guess; --aspect gives its shape"),
        };
        remarks.push(format!("coordinates are parts of a picture of {aspect:.3} times its height ({known})"));
        let across = usize::from(matches!(choices.up, Some(Up::X | Up::MinusX)));
        let points = frames.iter_mut().flatten().flat_map(|person| person.points.iter_mut().flatten());
        points.for_each(|point| point[across] *= aspect);
    } else {
        remarks.extend(choices.aspect.filter(|_| !has_depth).map(Aspect::ignored));
    }
    let People { tracks, others, places } = people::followed(&frames);
    if places > 0 {
        remarks.push(format!(
            "no frame shows two people, and the one shown leaps between {places} places: all are taken as one person"
        ));
    }
    if tracks.len() > 1 {
        let left_out =
            if others > 0 { format!("; {others} who are seen less are left out") } else { String::new() };
        let count = tracks.len();
        remarks.push(format!(
            "{count} people, the one seen most first (--person selects one, default 1){left_out}"
        ));
    }
    let drawn = tracks.get(choices.person.unwrap_or(1).saturating_sub(1));
    remarks.extend(drawn.and_then(|frames| unseen(frames)));
    let mut all = tracks.into_iter();
    let frames = all.next().unwrap_or_else(|| vec![vec![None; NAMES.len()]; frames.len()]);
    let (unit, up) = if has_depth {
        let metres = Known { value: Unit { mm: 1000.0 }, source: Source::Format };
        (metres, posture::upright(&frames, &HEAD, &ANKLES, Up::MinusY))
    } else {
        (unit(&frames), Known { value: Up::MinusY, source: Source::Format })
    };
    Ok(Found {
        names: NAMES.iter().map(|name| (*name).to_owned()).collect(),
        rate_hz: 0.0,
        frames,
        others: all.collect(),
        planar: !has_depth,
        unit,
        up,
        remarks,
    })
}

fn middle(points: &[Option<Point3>], [a, b]: [usize; 2]) -> Option<Point3> {
    let (a, b) = ((*points.get(a)?)?, (*points.get(b)?)?);
    Some(std::array::from_fn(|k| 0.5 * (a[k] + b[k])))
}

/// Joints of arms and legs that no frame shows.
fn unseen(frames: &[Vec<Option<Point3>>]) -> Option<String> {
    let is_seen = |place: usize| frames.iter().any(|points| points.get(place).is_some_and(Option::is_some));
    let limbs = (SHOULDERS[0]..SHOULDERS[0] + 6).chain(HIPS[0]..HIPS[0] + 6);
    let names: Vec<&str> = limbs.filter(|place| !is_seen(*place)).map(|place| NAMES[place]).collect();
    (!names.is_empty())
        .then(|| format!("no frame shows {}: the body is drawn without them", names.join(", ")))
}

/// Millimetres per unit of the file, for an adult's trunk and legs.
fn unit(frames: &[Vec<Option<Point3>>]) -> Known<Unit> {
    let per_mm = |points: &Vec<Option<Point3>>| -> Option<f64> {
        let trunk =
            middle(points, SHOULDERS).zip(middle(points, HIPS)).map(|(a, b)| distance(a, b) / TRUNK_MM);
        let bones = BONES_MM
            .iter()
            .filter_map(|([a, b], mm)| Some(distance((*points.get(*a)?)?, (*points.get(*b)?)?) / mm));
        // Bones towards the camera are shortened, never lengthened.
        trunk.into_iter().chain(bones).max_by(f64::total_cmp).filter(|scale| *scale > 0.0)
    };
    let mut scales: Vec<f64> = frames.iter().filter_map(per_mm).collect();
    scales.sort_by(f64::total_cmp);
    let (mm, reason, sure) = match scales.get(scales.len() / 2) {
        Some(scale) => {
            let reason = format!("for trunk and legs are then an adult's ({TRUNK_MM} and 420 mm)");
            (1.0 / scale, reason, true)
        }
        None => (5.0, "for neither trunk nor legs are seen".into(), false),
    };
    Known { value: Unit::rounded(mm), source: Source::Guess { reason, sure } }
}

#[cfg(test)]
mod tests;
