//! NTU RGB+D skeleton files (Shahroudy et al., CVPR 2016): 25 joints of a second Kinect, as text. The number
//! of frames; per frame the number of bodies; per body a line (its id first), the number of joints and a line
//! per joint: x, y, z in metres (x across, y up, z away), eight further numbers, and whether it was tracked.
//! Of several bodies present for at least half as long as the longest, the one whose joints vary most is
//! used: the sensor also reports chairs as bodies, and their joints only jitter. Ids that are never in one frame are one person
//! if no frame has two bodies, or if one begins near the place where another ends.

use super::kinect::JOINTS_25;
use super::reader::Reader;
use super::recording::{Found, Known, RecordingError, Source, Unit, Up, text};
use crate::silhouette::capsule::Point3;
use std::collections::BTreeMap;

pub const READER: Reader = Reader {
    name: "NTU RGB+D",
    extensions: &["skeleton"],
    about: "25 joints of a Kinect, metres, y up; the body that moves most",
    read: |bytes, _| read(bytes),
};

/// The sensor follows six bodies.
const MOST_BODIES: usize = 6;
const RATE_HZ: f64 = 30.0;
/// Largest distance between a body and the same person under the next id, metres.
const HAND_OVER_M: f64 = 0.5;

type Body = Vec<Option<Point3>>;
/// Bodies by frame.
type Track = BTreeMap<usize, Body>;

pub fn read(bytes: &[u8]) -> Result<Found, RecordingError> {
    let content = text(bytes)?;
    let mut lines = Lines { lines: content.lines(), at: 0 };
    let count = lines.count("the number of frames")?;
    let mut bodies: BTreeMap<String, Track> = BTreeMap::new();
    let mut most_together = 0;
    for frame in 0..count {
        let together = lines.count("the number of bodies")?;
        most_together = together.max(most_together);
        for _ in 0..together {
            let about = lines.next("a line about a body")?;
            let id = about.split_whitespace().next().unwrap_or_default().to_owned();
            let joints = lines.count("the number of joints")?;
            if joints != JOINTS_25.len() {
                return Err(lines.wrong(&format!("{joints} joints, expected {}", JOINTS_25.len())));
            }
            let body = (0..joints).map(|_| lines.joint()).collect::<Result<Body, RecordingError>>()?;
            bodies.entry(id).or_default().insert(frame, body);
        }
    }
    let mut remarks = Vec::new();
    let ids = bodies.len();
    let people: Vec<Track> = if most_together == 1 && ids > 1 {
        remarks.push(format!("{ids} ids, never two in a frame: they are read as one person"));
        vec![bodies.into_values().flatten().collect()]
    } else {
        let people = joined(bodies.into_values().collect());
        if people.len() < ids {
            let count = people.len();
            remarks.push(format!("{ids} ids are read as {count} bodies: some begin where others end"));
        }
        people
    };
    let longest = people.iter().map(Track::len).max().unwrap_or(0);
    let present = people.into_iter().filter(|body| 2 * body.len() >= longest.max(2) || body.len() == longest);
    let mut present: Vec<Track> = present.collect();
    present.sort_by(|a, b| variance(b).total_cmp(&variance(a)));
    present.truncate(MOST_BODIES);
    if present.len() > 1 {
        remarks.push(format!(
            "{} bodies in the file, the one that moves most first (--person selects one, default 1)",
            present.len()
        ));
    }
    let mut all = present.into_iter().map(|body| {
        let mut frames = vec![vec![None; JOINTS_25.len()]; count];
        for (frame, joints) in body {
            frames[frame] = joints;
        }
        frames
    });
    let frames = all.next().unwrap_or_else(|| vec![vec![None; JOINTS_25.len()]; count]);
    let others = all.collect();
    Ok(Found {
        names: JOINTS_25.iter().map(|name| (*name).to_owned()).collect(),
        rate_hz: RATE_HZ,
        frames,
        others,
        planar: false,
        unit: Known { value: Unit { mm: 1000.0 }, source: Source::Format },
        // The sensor's, also of a person who lies.
        up: Known { value: Up::Y, source: Source::File },
        remarks,
    })
}

/// Joins ids that are never in one frame, where one begins near the place where another ends.
fn joined(mut ids: Vec<Track>) -> Vec<Track> {
    ids.sort_by_key(|track| track.keys().next().copied());
    let mut people: Vec<Track> = Vec::new();
    for track in ids {
        let nearest = (0..people.len())
            .filter_map(|person| Some((hand_over_m(&people[person], &track)?, person)))
            .filter(|(distance_m, _)| *distance_m < HAND_OVER_M)
            .min_by(|a, b| a.0.total_cmp(&b.0));
        match nearest {
            Some((_, person)) => people[person].extend(track),
            None => people.push(track),
        }
    }
    people
}

/// Largest distance at the changes between two ids; `None` if they share a frame, or no joint is tracked at a change.
fn hand_over_m(person: &Track, track: &Track) -> Option<f64> {
    let is_between = |from: usize, to: usize| track.range(from + 1..to).next().is_some();
    let mut widest_m = 0.0_f64;
    for (&frame, body) in track {
        if person.contains_key(&frame) {
            return None;
        }
        let before = person.range(..frame).next_back().filter(|(at, _)| !is_between(**at, frame));
        let after = person.range(frame + 1..).next().filter(|(at, _)| !is_between(frame, **at));
        for (_, neighbour) in before.into_iter().chain(after) {
            widest_m = widest_m.max(distance_m(body, neighbour)?);
        }
    }
    Some(widest_m)
}

/// Mean over the joints that both have.
fn distance_m(a: &[Option<Point3>], b: &[Option<Point3>]) -> Option<f64> {
    let both: Vec<f64> = a
        .iter()
        .zip(b)
        .filter_map(|(a, b)| a.zip(*b))
        .map(|(a, b)| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt())
        .collect();
    (!both.is_empty()).then(|| both.iter().sum::<f64>() / both.len() as f64)
}

/// Variance of joint positions over time, summed over joints, file units squared.
fn variance(body: &Track) -> f64 {
    let joints = body.values().next().map_or(0, Vec::len);
    let of = |joint: usize, axis: usize| {
        let values: Vec<f64> =
            body.values().filter_map(|joints| joints.get(joint)?.map(|p| p[axis])).collect();
        let count = values.len().max(1) as f64;
        let mean = values.iter().sum::<f64>() / count;
        values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count
    };
    (0..joints).flat_map(|joint| (0..3).map(move |axis| (joint, axis))).map(|(j, k)| of(j, k)).sum()
}

struct Lines<'a> {
    lines: std::str::Lines<'a>,
    at: usize,
}

impl<'a> Lines<'a> {
    fn next(&mut self, what: &str) -> Result<&'a str, RecordingError> {
        loop {
            self.at += 1;
            match self.lines.next() {
                Some(line) if line.trim().is_empty() => {}
                Some(line) => return Ok(line.trim()),
                None => return Err(self.wrong(&format!("the file ends, expected {what}"))),
            }
        }
    }

    fn wrong(&self, reason: &str) -> RecordingError {
        RecordingError::Line { line: self.at, reason: reason.into() }
    }

    fn count(&mut self, what: &str) -> Result<usize, RecordingError> {
        /// Limit of frames, bodies and joints of a skeleton file; memory is reserved for frames only.
        const MOST: usize = 1_000_000;
        let line = self.next(what)?;
        let found = line.parse::<usize>().ok().filter(|count| *count <= MOST);
        found.ok_or_else(|| self.wrong(&format!("`{}`, expected {what}", shortened(line))))
    }

    /// `None` if not tracked.
    fn joint(&mut self) -> Result<Option<Point3>, RecordingError> {
        let line = self.next("a joint")?;
        let wrong = || self.wrong(&format!("`{}`, expected the numbers of a joint", shortened(line)));
        let numbers: Vec<f64> = line
            .split_whitespace()
            .map(|word| word.parse().map_err(|_| wrong()))
            .collect::<Result<_, _>>()?;
        match numbers.as_slice() {
            [x, y, z, .., tracked] => Ok((*tracked != 0.0).then_some([*x, *y, *z])),
            _ => Err(wrong()),
        }
    }
}

fn shortened(line: &str) -> String {
    line.chars().take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two frames: a passer-by in the first, another person in both, whose left hand was not tracked.
    fn file() -> String {
        let body = |id: &str, x: f64| {
            let joints: String = (0..25)
                .map(|joint| {
                    format!(
                        "{x} {} 3 0 0 0 0 0 0 0 0 {}\n",
                        (24 - joint) as f64 / 25.0,
                        if joint == 7 { 0 } else { 2 }
                    )
                })
                .collect();
            format!("{id} 0 1 1 1 1 0 0 0 2\n25\n{joints}")
        };
        format!("2\n2\n{}{}1\n{}", body("71", 5.0), body("72", 0.5), body("72", 0.6))
    }

    #[test]
    fn the_person_who_stays_is_taken_in_metres_with_y_up() {
        let found = read(file().as_bytes()).expect("a skeleton");
        let settled = found.settled(super::super::recording::Choices::default());
        assert_eq!((settled.frames.len(), settled.rate_hz), (2, 30.0));
        let head = settled.by_name(1)["head"];
        assert!(head.iter().zip([600.0, -3000.0, 840.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{head:?}");
        assert!(!settled.by_name(0).contains_key("left hand"));
        assert_eq!(
            settled.remarks(),
            ["2 bodies in the file, the one that moves most first (--person selects one, default 1)"]
        );
    }

    #[test]
    fn bodies_that_are_left_out_are_not_counted() {
        let text = file();
        let last = text.rfind("1\n72").map(|at| &text[at..]).expect("the second frame");
        let found = read(format!("3{}{last}", &text[1..]).as_bytes()).expect("a skeleton");
        assert!(found.frames.len() == 3 && found.others.is_empty() && found.remarks.is_empty());
    }

    #[test]
    fn bodies_that_are_never_visible_together_are_one_person() {
        let text = file();
        let (_, frames) = text.split_once('\n').expect("a count");
        let one = frames.strip_prefix("2\n").expect("two bodies");
        let lines: Vec<&str> = one.lines().collect();
        let (first, rest) = lines.split_at(27);
        let text = format!("2\n1\n{}\n1\n{}\n", first.join("\n"), rest[..27].join("\n"));
        let found = read(text.as_bytes()).expect("a skeleton");
        assert!(found.others.is_empty() && found.frames.iter().all(|frame| frame[0].is_some()));
        assert!(found.remarks[0].contains("one person"), "{:?}", found.remarks);
    }

    fn standing(id: &str, x: f64) -> String {
        let joints: String =
            (0..25).map(|j| format!("{x} {} 3 0 0 0 0 0 0 0 0 2\n", f64::from(j) / 25.0 + 0.01)).collect();
        format!("{id} 0 1 1 1 1 0 0 0 2\n25\n{joints}")
    }

    #[test]
    fn an_actor_whose_id_changes_is_one_body_although_another_appears() {
        let mut text = String::from("20\n");
        for frame in 0..20 {
            let actor = standing(if frame < 10 { "1" } else { "2" }, 0.05 * f64::from(frame));
            // Another body in one frame, too far away to be the actor.
            text += &match frame {
                5 => format!("2\n{actor}{}", standing("3", 4.0)),
                _ => format!("1\n{actor}"),
            };
        }
        let found = read(text.as_bytes()).expect("bodies");
        assert!(found.others.is_empty() && found.frames.iter().all(|frame| frame[0].is_some()));
        assert_eq!(found.remarks, ["3 ids are read as 2 bodies: some begin where others end"]);
        // Another person, a metre away.
        let apart = text.replace("\n0.5 ", "\n1.5 ");
        let found = read(apart.as_bytes()).expect("bodies");
        assert!(found.others.len() == 1 && found.remarks[0].starts_with("2 bodies"), "{:?}", found.remarks);
    }

    #[test]
    fn a_chair_that_is_visible_longer_is_not_the_actor() {
        let body = standing;
        let mut text = String::from("20\n");
        for frame in 0..20 {
            // The chair jitters; the actor walks a metre and is lost for three frames.
            let chair = body("1", 2.0 + 0.02 * f64::from(frame % 2));
            text += &if frame < 3 {
                format!("1\n{chair}")
            } else {
                format!("2\n{chair}{}", body("2", 0.05 * f64::from(frame)))
            };
        }
        let found = read(text.as_bytes()).expect("bodies");
        assert_eq!(found.frames[10][0].map(|p| p[0]), Some(0.5));
        assert!(found.remarks[0].starts_with("2 bodies"), "{:?}", found.remarks);
    }

    #[test]
    fn invalid_skeletons_are_rejected_with_the_line() {
        for (text, line) in [
            (String::new(), 1),
            ("2\n1\n71 0\n24\n".into(), 4),
            (file().replacen("0.5 0.92 3", "0.5 x 3", 1), 33),
            (file().lines().take(40).collect::<Vec<_>>().join("\n"), 41),
            ("99999999999\n".into(), 1),
        ] {
            match read(text.as_bytes()) {
                Err(RecordingError::Line { line: found, .. }) => assert_eq!(found, line, "{text:.40}"),
                other => panic!("{other:?}"),
            }
        }
    }
}
