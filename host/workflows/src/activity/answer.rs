//! Answers for a recording or for one of its people, shared by all interfaces.

use std::{fmt, ops::Range};

use farnear_recognition::clip::Track;
use farnear_recognition::live::{Segment, joined, windows};
use farnear_recognition::model::{Answer, Recogniser};
use farnear_recognition::segmentation::{Worth, segmented};
use farnear_silhouettes::mask::{BoundingBox, Mask, subject::Flag};
use serde::Serialize;
use serde_with::SerializeDisplay;

use crate::{error::Result, figures::rounded};

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct AnswerSummary {
    /// Name of the activity; `None` is unknown.
    pub activity: Option<String>,
    pub confidence: f64,
    /// Above 1 the activity is unknown. `None` without a person.
    pub outlier_score: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    pub probabilities: Vec<Probability>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PersonInFrame {
    /// From 1 in order of appearance.
    pub person: usize,
    /// First row, first column, one past the last row and column; `None` if empty.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub top_left_bottom_right: Option<[usize; 4]>,
    /// Name of the activity; `None` is unknown.
    pub activity: Option<String>,
    pub confidence: f64,
    /// Above 1 the activity is unknown; `None` before the first silhouette.
    pub outlier_score: Option<f64>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub flags: Vec<PersonFlag>,
}

/// Why the answer for a person in a frame is doubtful. Serialised as `crossing:2`, `missed`, `cut-by-edge`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, SerializeDisplay)]
pub enum PersonFlag {
    Crossing(usize),
    /// Separated from this person after an overlap.
    Parted(usize),
    /// May have been exchanged with this person.
    PerhapsSwapped(usize),
    Missed,
    Mask(Flag),
}

impl fmt::Display for PersonFlag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Crossing(other) => write!(f, "crossing:{other}"),
            Self::Parted(other) => write!(f, "parted:{other}"),
            Self::PerhapsSwapped(other) => write!(f, "perhaps-swapped:{other}"),
            Self::Missed => f.write_str("missed"),
            Self::Mask(flag) => flag.fmt(f),
        }
    }
}

/// One person's activities in a recording.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PersonFigures {
    pub person: usize,
    pub from: usize,
    pub to: usize,
    pub silhouettes: usize,
    pub crossing_frames: usize,
    pub perhaps_swapped_with: Vec<usize>,
    #[serde(flatten)]
    pub answer: AnswerSummary,
    /// Answers for windows that overlap by half.
    pub windows: Vec<Part>,
    /// Segments of one activity, by a hidden semi-Markov model.
    pub segments: Vec<Part>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Probability {
    pub activity: String,
    /// The sum over all activities is 1.
    pub probability: f64,
}

/// Range of frames, from 1, both ends included.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Part {
    pub from: usize,
    pub to: usize,
    /// Name of the activity; `None` is unknown.
    pub activity: Option<String>,
    pub confidence: f64,
}

impl AnswerSummary {
    pub(super) fn new(answer: Answer, frames: usize) -> Self {
        Self {
            confidence: rounded_probability(answer.confidence),
            outlier_score: outlier_score(&answer),
            reason: unknown_because(&answer, frames),
            probabilities: probabilities(&answer),
            activity: answer.activity,
        }
    }
}

/// Converts ranges of visible frames to ranges of the recording; `numbers` are the frames with a person.
pub(super) fn parts<'a>(
    stretches: impl IntoIterator<Item = (usize, usize, &'a Option<String>, f32)>,
    numbers: &[usize],
    frames: usize,
) -> Vec<Part> {
    let part = |(from, to, activity, confidence): (usize, usize, &Option<String>, f32)| Part {
        from: numbers.get(from).copied().unwrap_or(1),
        to: to.checked_sub(1).and_then(|last| numbers.get(last)).copied().unwrap_or(frames),
        activity: activity.clone(),
        confidence: rounded_probability(confidence),
    };
    stretches.into_iter().map(part).collect()
}

/// Frames without a person after which a new part begins: another person may have come.
const GAP_FRAMES: usize = 15;

/// Ranges of frames with a person, without gaps of more than [`GAP_FRAMES`].
pub(super) fn passages(seen: &[bool]) -> Vec<Range<usize>> {
    let mut found: Vec<Range<usize>> = Vec::new();
    for (frame, _) in (0..).zip(seen).filter(|(_, seen)| **seen) {
        match found.last_mut() {
            Some(last) if frame - last.end <= GAP_FRAMES => last.end = frame + 1,
            _ => found.push(frame..frame + 1),
        }
    }
    found
}

/// Windows and segments of a recording from `tracks[view][frame]` and the frames with a person.
pub(super) fn stretches(
    model: &Recogniser,
    tracks: &[Vec<Track>],
    seen: &[bool],
    window: usize,
    among: &[String],
) -> Result<(Vec<Part>, Vec<Part>)> {
    let (mut in_windows, mut in_segments) = (Vec::new(), Vec::new());
    for passage in passages(seen) {
        let frames =
            |view: &Vec<Track>| passage.clone().filter_map(|f| view.get(f)).cloned().collect::<Vec<_>>();
        let views: Vec<Vec<Track>> = tracks.iter().map(frames).collect();
        let whole: Vec<Track> = views.iter().map(|view| joined(view.iter())).collect();
        let mut found = windows(model, &whole, window, window.div_ceil(2))?;
        found.iter_mut().for_each(|s| s.answer = restricted(s.answer.clone(), among));
        let segments = segmented(model, &whole, among, Worth::default())?;
        // Empty frames are not in the tracks.
        let numbers: Vec<usize> = views
            .iter()
            .find(|view| view.iter().any(|track| track.frames() > 0))
            .into_iter()
            .flat_map(|view| (passage.start..).zip(view).filter(|(_, track)| track.frames() > 0))
            .map(|(frame, _)| frame + 1)
            .collect();
        let answers = found.iter().map(|s| (s.from, s.to, &s.answer.activity, s.answer.confidence));
        in_windows.extend(parts(answers, &numbers, passage.end));
        in_segments.extend(parts(of_segments(&segments), &numbers, passage.end));
    }
    Ok((in_windows, in_segments))
}

pub(super) fn only_person(
    seen: &[bool],
    answer: &AnswerSummary,
    windows: &[Part],
    segments: &[Part],
) -> Option<PersonFigures> {
    Some(PersonFigures {
        person: 1,
        from: seen.iter().position(|seen| *seen)? + 1,
        to: seen.iter().rposition(|seen| *seen)? + 1,
        silhouettes: seen.iter().filter(|seen| **seen).count(),
        crossing_frames: 0,
        perhaps_swapped_with: Vec::new(),
        answer: answer.clone(),
        windows: windows.to_vec(),
        segments: segments.to_vec(),
    })
}

pub(super) fn only_in_frame(mask: &Mask, answer: &Answer, flags: &[Flag]) -> Option<PersonInFrame> {
    let b = BoundingBox::of(mask.view())?;
    Some(PersonInFrame {
        person: 1,
        top_left_bottom_right: Some([b.top, b.left, b.bottom, b.right]),
        activity: answer.activity.clone(),
        confidence: rounded_probability(answer.confidence),
        outlier_score: outlier_score(answer),
        flags: flags.iter().copied().map(PersonFlag::Mask).collect(),
    })
}

pub(super) fn of_segments(
    segments: &[Segment],
) -> impl Iterator<Item = (usize, usize, &Option<String>, f32)> {
    segments.iter().map(|s| (s.from, s.to, &s.activity, s.confidence))
}

pub(super) fn probabilities(answer: &Answer) -> Vec<Probability> {
    let probability = |(activity, value): &(String, f32)| Probability {
        activity: activity.clone(),
        probability: rounded_probability(*value),
    };
    answer.probabilities.iter().map(probability).collect()
}

/// Restricts the answer to some activities; all if `among` is empty.
pub(super) fn restricted(answer: Answer, among: &[String]) -> Answer {
    if among.is_empty() { answer } else { answer.among(among) }
}

fn unknown_because(answer: &Answer, frames: usize) -> Option<String> {
    if answer.activity.is_some() {
        return None;
    }
    let score = answer.outlier_score;
    Some(match answer.best() {
        _ if frames == 0 => "there is no frame".into(),
        Some(best) if score.is_finite() => {
            format!("most like `{best}`, but {score:.2} times as far from it as what the model knows")
        }
        _ => format!("no person in any of the {frames} frames"),
    })
}

/// Rounds to four decimals, without digits beyond f32 precision.
pub(super) fn rounded_probability(value: f32) -> f64 {
    rounded(f64::from(value), 4)
}

/// JSON has no infinity, the score of an empty recording.
pub(super) fn outlier_score(answer: &Answer) -> Option<f64> {
    answer.outlier_score.is_finite().then(|| rounded_probability(answer.outlier_score))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_is_split_at_long_gaps_without_a_person() {
        let mut seen = vec![false; 400];
        seen[3..40].fill(true);
        seen[20..25].fill(false);
        seen[340..390].fill(true);
        assert_eq!(passages(&seen), [3..40, 340..390]);
        assert!(passages(&[false; 50]).is_empty());
    }
}
