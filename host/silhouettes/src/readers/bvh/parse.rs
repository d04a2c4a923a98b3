//! The syntax of BVH: a tree of joints, then one line of numbers per frame.
//! ```text
//! HIERARCHY ROOT Hips
//! { OFFSET 0 0 0 CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
//!     JOINT LeftUpLeg
//!     { OFFSET 1.6 -1.8 0.6 CHANNELS 3 Zrotation Yrotation Xrotation
//!         End Site { OFFSET 2.6 -7.1 0 } } }
//! MOTION
//! Frames: 1
//! Frame Time: 0.0083333
//! 9.4 17.9 -17.3 0 0 0 0 0 -21
//! ```
//! Keywords in any case; free white space and line breaks up to `MOTION`. Names extend to the end of their
//! line, so they may hold blanks (`Bip01 L Foot`) and colons (`mixamorig:Hips`).

use std::iter::Peekable;

use super::super::recording::{self, RecordingError};
use crate::silhouette::capsule::Point3;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Along this axis (0 to 2), file unit.
    Position(usize),
    /// About this axis (0 to 2), degrees.
    Rotation(usize),
}

const CHANNELS: [(&str, Channel); 6] = [
    ("Xposition", Channel::Position(0)),
    ("Yposition", Channel::Position(1)),
    ("Zposition", Channel::Position(2)),
    ("Xrotation", Channel::Rotation(0)),
    ("Yrotation", Channel::Rotation(1)),
    ("Zrotation", Channel::Rotation(2)),
];

#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// End sites have their joint's name with `_End`.
    pub name: String,
    /// Earlier in the list; `None` for roots.
    pub parent: Option<usize>,
    /// From the parent at rest, in the file's unit.
    pub offset: Point3,
    /// In the order of the numbers in a frame.
    pub channels: Vec<Channel>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// In file order: parents before their children.
    pub joints: Vec<Joint>,
    pub frame_time_s: f64,
    pub frames: Vec<Vec<f64>>,
    /// Differences from the promised frames.
    pub remarks: Vec<String>,
}

/// Limit of points per byte of text; without it a few bytes could request any memory. A joint with three
/// channels takes at least six bytes per frame, so real files are far below.
const POINTS_PER_BYTE: usize = 4;

pub fn parse(text: &str) -> Result<Motion, RecordingError> {
    let mut cursor = Cursor { rest: text, line: 1 };
    cursor.expect("HIERARCHY")?;
    let joints = hierarchy(&mut cursor)?;
    let channels = joints.iter().map(|joint| joint.channels.len()).sum();
    let mut lines = Lines::after(&cursor);
    let most_points = POINTS_PER_BYTE.saturating_mul(text.len());
    let promised = if lines.is_next("Frame Time") { None } else { Some(lines.frame_count()?) };
    let (line, time) = lines.value("Frame Time")?;
    let frame_time_s = number(time, line, "the seconds from frame to frame")?;
    if frame_time_s <= 0.0 {
        return Err(wrong(line, format!("found a frame time of {frame_time_s} s, expected more than 0")));
    }
    let last = lines.last;
    let (frames, cut) = lines.frames(channels, most_points / joints.len().max(1))?;
    let mut remarks = Vec::new();
    if cut {
        remarks.push("the last frame is cut short and left out".into());
    }
    let found = frames.len();
    match promised {
        // Some programs count one frame too many.
        Some(promised) if found + 1 < promised => {
            let reason = format!("found the end of the file after {found} frames, expected {promised}");
            return Err(wrong(last, reason));
        }
        Some(promised) if found == promised => {}
        Some(promised) => remarks.push(format!("{promised} frames are promised, the file has {found}")),
        None => remarks.push(format!("the file does not state the number of frames: {found} are read")),
    }
    Ok(Motion { joints, frame_time_s, frames, remarks })
}

/// Joints up to the word MOTION. One loop with an arm per word: splitting would spread the bracket handling.
fn hierarchy(cursor: &mut Cursor) -> Result<Vec<Joint>, RecordingError> {
    let mut joints: Vec<Joint> = Vec::new();
    // Open joints, and whether each has had its OFFSET.
    let mut open: Vec<(usize, bool)> = Vec::new();
    loop {
        let word = cursor.word();
        let line = cursor.line;
        let is = |key: &str| word.is_some_and(|word| word.eq_ignore_ascii_case(key));
        match open.last_mut() {
            None if is("ROOT") => {
                let name = cursor.name("the root's name")?;
                open.push((joints.len(), false));
                joints.push(Joint { name, parent: None, offset: [0.0; 3], channels: Vec::new() });
                cursor.expect("{")?;
            }
            None if is("MOTION") && !joints.is_empty() => return Ok(joints),
            Some((joint, _)) if is("JOINT") || is("End") => {
                let parent = *joint;
                let name = if is("End") {
                    // `Site`; some programs write a name.
                    cursor.name("Site")?;
                    format!("{}_End", joints[parent].name)
                } else {
                    cursor.name("the joint's name")?
                };
                let end = if is("End") { Some(cursor.end_site()?) } else { None };
                if end.is_none() {
                    open.push((joints.len(), false));
                    cursor.expect("{")?;
                }
                let offset = end.unwrap_or_default();
                joints.push(Joint { name, parent: Some(parent), offset, channels: Vec::new() });
            }
            Some((joint, placed)) if is("OFFSET") && !*placed => {
                joints[*joint].offset = cursor.offset()?;
                *placed = true;
            }
            Some((joint, _)) if is("CHANNELS") && joints[*joint].channels.is_empty() => {
                joints[*joint].channels = cursor.channels()?;
            }
            Some((_, true)) if is("}") => {
                open.pop();
            }
            Some((joint, placed)) => {
                let offset = if *placed { "" } else { "OFFSET, " };
                let channels = if joints[*joint].channels.is_empty() { "CHANNELS, " } else { "" };
                let end = if *placed { " or `}`" } else { "" };
                let name = short(&joints[*joint].name).to_owned();
                return Err(wrong(
                    line,
                    format!(
                        "found {}, expected {offset}{channels}JOINT, End Site{end} of `{name}`",
                        shown(word)
                    ),
                ));
            }
            None => {
                let expected = if joints.is_empty() { "ROOT" } else { "ROOT or MOTION" };
                return Err(wrong(line, format!("found {}, expected {expected}", shown(word))));
            }
        }
    }
}

fn wrong(line: usize, reason: String) -> RecordingError {
    RecordingError::Line { line, reason }
}

fn short(text: &str) -> &str {
    const LONGEST: usize = 40;
    text.char_indices().nth(LONGEST).map_or(text, |(at, _)| &text[..at])
}

fn shown(word: Option<&str>) -> String {
    word.map_or_else(|| "the end of the file".into(), |word| format!("`{}`", short(word)))
}

fn number(text: &str, line: usize, what: &str) -> Result<f64, RecordingError> {
    let value = recording::number(text).filter(|value| value.is_finite());
    value.ok_or_else(|| wrong(line, format!("found `{}`, expected a number: {what}", short(text))))
}

struct Cursor<'a> {
    rest: &'a str,
    line: usize,
}

impl<'a> Cursor<'a> {
    fn skip(&mut self) {
        let trimmed = self.rest.trim_start();
        let skipped = &self.rest[..self.rest.len() - trimmed.len()];
        self.line += skipped.matches('\n').count();
        self.rest = trimmed;
    }

    /// The next word; a bracket is a word.
    fn word(&mut self) -> Option<&'a str> {
        self.skip();
        let ends = |c: char| c.is_whitespace() || matches!(c, '{' | '}');
        let length = match self.rest.chars().next()? {
            '{' | '}' => 1,
            _ => self.rest.find(ends).unwrap_or(self.rest.len()),
        };
        let (word, rest) = self.rest.split_at(length);
        self.rest = rest;
        Some(word)
    }

    fn expect(&mut self, key: &str) -> Result<(), RecordingError> {
        match self.word() {
            Some(word) if word.eq_ignore_ascii_case(key) => Ok(()),
            other => Err(wrong(self.line, format!("found {}, expected `{key}`", shown(other)))),
        }
    }

    fn name(&mut self, what: &str) -> Result<String, RecordingError> {
        let length = self.rest.find(['\n', '{', '}']).unwrap_or(self.rest.len());
        let (name, rest) = self.rest.split_at(length);
        self.rest = rest;
        match name.trim() {
            "" => Err(wrong(self.line, format!("found nothing, expected {what}"))),
            name => Ok(name.to_owned()),
        }
    }

    fn offset(&mut self) -> Result<Point3, RecordingError> {
        let mut offset = [0.0; 3];
        for value in &mut offset {
            let word = self.word();
            let what = "OFFSET has three";
            *value = number(word.unwrap_or("the end of the file"), self.line, what)?;
        }
        Ok(offset)
    }

    fn channels(&mut self) -> Result<Vec<Channel>, RecordingError> {
        let count = self.word();
        let most = CHANNELS.len();
        let count: usize =
            count.and_then(|word| word.parse().ok()).filter(|n| *n <= most).ok_or_else(|| {
                wrong(
                    self.line,
                    format!("found {}, expected the number of channels, 0 to {most}", shown(count)),
                )
            })?;
        let mut channels: Vec<Channel> = Vec::with_capacity(count);
        for _ in 0..count {
            let word = self.word();
            let known = CHANNELS.iter().find(|(name, _)| word.is_some_and(|w| w.eq_ignore_ascii_case(name)));
            match known {
                Some((_, channel)) if !channels.contains(channel) => channels.push(*channel),
                found => {
                    let twice = if found.is_some() { " a second time" } else { "" };
                    let names = CHANNELS.map(|(name, _)| name).join(", ");
                    let reason =
                        format!("found {}{twice}, expected {count} different of {names}", shown(word));
                    return Err(wrong(self.line, reason));
                }
            }
        }
        Ok(channels)
    }

    fn end_site(&mut self) -> Result<Point3, RecordingError> {
        self.expect("{")?;
        self.expect("OFFSET")?;
        let offset = self.offset()?;
        self.expect("}")?;
        Ok(offset)
    }
}

struct Lines<'a> {
    lines: Peekable<Box<dyn Iterator<Item = (usize, &'a str)> + 'a>>,
    last: usize,
}

impl<'a> Lines<'a> {
    fn after(cursor: &Cursor<'a>) -> Self {
        let (first, rest) = (cursor.line, cursor.rest);
        let lines = rest.lines().enumerate().map(move |(n, line)| (first + n, line.trim()));
        let last = first + rest.lines().count().saturating_sub(1);
        let filled: Box<dyn Iterator<Item = (usize, &'a str)> + 'a> =
            Box::new(lines.filter(|(_, line)| !line.is_empty()));
        Self { lines: filled.peekable(), last }
    }

    fn is_next(&mut self, key: &str) -> bool {
        self.lines.peek().is_some_and(|(_, text)| value_of(text, key).is_some())
    }

    fn frame_count(&mut self) -> Result<usize, RecordingError> {
        let (line, count) = self.value("Frames")?;
        count
            .parse()
            .map_err(|_| wrong(line, format!("found `{}`, expected the number of frames", short(count))))
    }

    /// Line `key: value`, with optional blanks around the colon.
    fn value(&mut self, key: &str) -> Result<(usize, &'a str), RecordingError> {
        let Some((line, text)) = self.lines.next() else {
            return Err(wrong(self.last, format!("found the end of the file, expected `{key}:`")));
        };
        let value = value_of(text, key).map(|value| (line, value));
        value.ok_or_else(|| wrong(line, format!("found `{}`, expected `{key}:`", short(text))))
    }

    /// The frames, at most `most`, with one value per channel; and whether a shorter last one follows.
    fn frames(mut self, channels: usize, most: usize) -> Result<(Vec<Vec<f64>>, bool), RecordingError> {
        if channels == 0 {
            return Err(wrong(
                self.last,
                "the hierarchy has no CHANNELS, expected at least the root's".into(),
            ));
        }
        let mut frames: Vec<Vec<f64>> = Vec::new();
        for (line, text) in self.lines.by_ref() {
            if frames.len() == most {
                let reason =
                    format!("found {channels} channels, too few for the number of joints, expected a body");
                return Err(wrong(line, reason));
            }
            let words = values(text);
            if words.len() < channels && line == self.last {
                return Ok((frames, true));
            }
            if words.len() != channels {
                let reason = format!("found {} values, expected {channels}, one per channel", words.len());
                return Err(wrong(line, reason));
            }
            frames.push(
                words
                    .into_iter()
                    .map(|word| number(word, line, "a channel's value"))
                    .collect::<Result<_, _>>()?,
            );
        }
        Ok((frames, false))
    }
}

/// The value of a line `key: value`.
fn value_of<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    let (found, value) = text.split_once(':')?;
    let found = found.split_whitespace().collect::<Vec<_>>().join(" ");
    found.eq_ignore_ascii_case(key).then(|| value.trim())
}

/// Words of a line; numbers without a blank between them are several (`0.0-7.5`, as SlimeVR wrote).
fn values(line: &str) -> Vec<&str> {
    let mut words = Vec::new();
    for mut word in line.split_ascii_whitespace() {
        while let Some(at) = second_sign(word) {
            let (number, rest) = word.split_at(at);
            words.push(number);
            word = rest;
        }
        words.push(word);
    }
    words
}

/// Place of a minus sign that begins another number, not an exponent.
fn second_sign(word: &str) -> Option<usize> {
    word.as_bytes()
        .windows(2)
        .position(|pair| pair[1] == b'-' && !matches!(pair[0], b'e' | b'E'))
        .map(|before| before + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = "HIERARCHY\nROOT Bip01 Hips\n{\n  OFFSET 0 0 0\n  CHANNELS 4 zrotation Xposition Yposition ZPosition\n  \
        JOINT m:Leg {\n    OFFSET 0 -4 0.5\n    CHANNELS 1 Xrotation\n    End Site { OFFSET 0 -4 0 }\n  }\n}\n\
        MOTION\nFrames: 2\nFrame Time: .025\n1 2 3 4 5\n\n6 7 8 9 1e1\n";

    #[test]
    fn joints_channels_and_frames_are_read_as_written() {
        let motion = parse(SMALL).expect("a BVH file");
        let names: Vec<_> = motion.joints.iter().map(|joint| (joint.name.as_str(), joint.parent)).collect();
        assert_eq!(names, [("Bip01 Hips", None), ("m:Leg", Some(0)), ("m:Leg_End", Some(1))]);
        assert_eq!(
            motion.joints[0].channels,
            [Channel::Rotation(2), Channel::Position(0), Channel::Position(1), Channel::Position(2)]
        );
        assert_eq!(motion.joints[1].offset, [0.0, -4.0, 0.5]);
        assert_eq!(motion.frames, [[1.0, 2.0, 3.0, 4.0, 5.0], [6.0, 7.0, 8.0, 9.0, 10.0]]);
        assert!((motion.frame_time_s - 0.025).abs() < 1e-12);
        let crlf = SMALL.replace('\n', "\r\n");
        assert_eq!(parse(&crlf), Ok(motion));
    }

    #[track_caller]
    fn refused(from: &str, to: &str, expected: &str) {
        assert!(SMALL.contains(from), "{from}");
        let error = parse(&SMALL.replacen(from, to, 1)).expect_err(to).to_string();
        assert_eq!(error, expected);
    }

    #[test]
    fn errors_name_the_line_its_content_and_the_expectation() {
        refused("HIERARCHY", "TREE", "line 1: found `TREE`, expected `HIERARCHY`");
        refused("ROOT Bip01 Hips", "ROOT", "line 2: found nothing, expected the root's name");
        refused("ROOT", "JOINT", "line 2: found `JOINT`, expected ROOT");
        refused("\n{", "\n(", "line 3: found `(`, expected `{`");
        refused(
            "OFFSET 0 0 0",
            "OFFSET 0 0",
            "line 5: found `CHANNELS`, expected a number: OFFSET has three",
        );
        refused("CHANNELS 4", "CHANNELS 7", "line 5: found `7`, expected the number of channels, 0 to 6");
        refused(
            "CHANNELS 4",
            "CHANNELS 5",
            "line 6: found `JOINT`, expected 5 different of Xposition, Yposition, Zposition, Xrotation, Yrotation, Zrotation",
        );
        refused(
            "Yposition",
            "Xposition",
            "line 5: found `Xposition` a second time, expected 4 different of Xposition, Yposition, Zposition, Xrotation, \
             Yrotation, Zrotation",
        );
        refused("OFFSET 0 -4 0.5\n", "\n", "line 10: found `}`, expected OFFSET, JOINT, End Site of `m:Leg`");
        refused(
            "  }\n}\n",
            "  }\n",
            "line 11: found `MOTION`, expected JOINT, End Site or `}` of `Bip01 Hips`",
        );
        refused("MOTION", "", "line 13: found `Frames:`, expected ROOT or MOTION");
        refused("Frames: 2", "Frames: two", "line 13: found `two`, expected the number of frames");
        refused("Frame Time: .025", "Time: 1", "line 14: found `Time: 1`, expected `Frame Time:`");
        refused(".025", "0", "line 14: found a frame time of 0 s, expected more than 0");
        refused("1 2 3 4 5", "1 2 3 4", "line 15: found 4 values, expected 5, one per channel");
        refused("1 2 3 4 5", "1 2 x 4 5", "line 15: found `x`, expected a number: a channel's value");
        refused("1 2 3 4 5", "1 2 NaN 4 5", "line 15: found `NaN`, expected a number: a channel's value");
    }

    #[test]
    fn files_that_differ_from_what_they_promise_are_read_and_it_is_said() {
        let good = parse(SMALL).expect("a BVH file");
        for (frames, left, phrases) in [
            ("Frames: 1", 2, vec!["1 frames are promised, the file has 2"]),
            ("Frames: 3", 2, vec!["3 frames are promised, the file has 2"]),
            ("", 2, vec!["the file does not state the number of frames: 2 are read"]),
        ] {
            let motion = parse(&SMALL.replace("Frames: 2", frames)).expect("a BVH file");
            assert_eq!(
                (motion.frames.len(), motion.remarks),
                (left, phrases.into_iter().map(String::from).collect())
            );
        }
        refused("Frames: 2", "Frames: 4", "line 17: found the end of the file after 2 frames, expected 4");
        let cut = parse(SMALL.trim_end().trim_end_matches(" 9 1e1")).expect("a BVH file");
        assert_eq!(cut.frames, good.frames[..1]);
        assert_eq!(cut.remarks[0], "the last frame is cut short and left out");
    }

    #[test]
    fn numbers_as_programs_of_many_countries_write_them() {
        let good = parse(SMALL).expect("a BVH file");
        for (from, to) in [
            (".025", "0,025"),
            ("6 7 8 9 1e1", "6,0 7 8 9 1,0e1"),
            ("Frame Time:", "Frame\tTime :"),
            ("End Site", "End l_toes"),
            ("0 -4 0.5", "0 -4 5e-1"),
        ] {
            assert_eq!(parse(&SMALL.replacen(from, to, 1)), Ok(good.clone()), "{to}");
        }
        let glued = parse(&SMALL.replace("1 2 3 4 5", "1-2-3e-1 4-5")).expect("a BVH file");
        assert_eq!(glued.frames[0], [1.0, -2.0, -0.3, 4.0, -5.0]);
    }

    #[test]
    fn a_few_bytes_cannot_ask_for_much_memory() {
        let joints = "JOINT a { OFFSET 0 0 0 ".repeat(3000) + &"}".repeat(3000);
        let frames = "0\n".repeat(3000);
        let text = format!(
            "HIERARCHY ROOT a {{ OFFSET 0 0 0 CHANNELS 1 Xposition {joints} }} MOTION\nFrames: 3000\nFrame Time: 1\n{frames}"
        );
        // Names extend to the bracket: a chain of 3001 joints with one moving.
        let error = parse(&text).expect_err("nine million points from 80 kB");
        assert!(error.to_string().contains("found 1 channels, too few for the number of joints"), "{error}");
    }
}
