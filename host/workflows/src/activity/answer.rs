//! Answer for a recording or for one of the people in it, as all faces give it.

use std::{fmt, ops::Range};

use farnear_recognition::clip::Track;
use farnear_recognition::live::{Segment, joined, windows};
use farnear_recognition::model::{Answer, Recogniser};
use farnear_recognition::segmentation::{Worth, segmented};
use farnear_silhouettes::mask::{BoundingBox, Mask, subject::Flag};
use serde::Serialize;
use serde_with::SerializeDisplay;

use crate::{error::Result, figures::rounded};

/// The answer for all that was seen of one person.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct AnswerSummary {
    /// The activity; `None` is unknown.
    pub activity: Option<String>,
    /// Probability of the activity, 0 to 1.
    pub confidence: f64,
    /// Outlier score; above 1 the activity is unknown. `None` without a person.
    pub outlier_score: Option<f64>,
    /// Why the activity is unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Probability of every activity.
    pub probabilities: Vec<Probability>,
}

/// One person in a frame: the same for a clip, a stream and several people.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PersonInFrame {
    /// The number, from 1 in the order of coming.
    pub person: usize,
    /// Box of the person: first row, first column, one past the last row and column; `None` if empty.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub top_left_bottom_right: Option<[usize; 4]>,
    /// The activity so far; `None` is unknown.
    pub activity: Option<String>,
    /// Probability of the activity, 0 to 1.
    pub confidence: f64,
    /// Outlier score: above 1 unknown; `None` where no silhouette has been seen.
    pub outlier_score: Option<f64>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub flags: Vec<PersonFlag>,
}

/// Why the answer for a person in a frame is doubtful. Serialised as `crossing:2`, `missed`, `cut-by-edge`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, SerializeDisplay)]
pub enum PersonFlag {
    /// Overlaps with this person.
    Crossing(usize),
    /// Has parted from this person after an overlap.
    Parted(usize),
    /// May have been exchanged with this person.
    PerhapsSwapped(usize),
    /// Not found in the frame.
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

/// What one person did in a recording: the same for a clip, a stream and several people.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PersonFigures {
    pub person: usize,
    /// First frame with a silhouette.
    pub from: usize,
    /// Last frame with a silhouette.
    pub to: usize,
    /// Frames with a silhouette.
    pub silhouettes: usize,
    /// Frames in one blob with others.
    pub crossing_frames: usize,
    /// Those with whom this one may have been swapped.
    pub perhaps_swapped_with: Vec<usize>,
    /// For all that was seen.
    #[serde(flatten)]
    pub answer: AnswerSummary,
    /// Answers for windows that overlap by half.
    pub windows: Vec<Part>,
    /// Stretches of one activity each, by a hidden semi-Markov model.
    pub segments: Vec<Part>,
}

/// Probability of an activity.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Probability {
    pub activity: String,
    /// 0 to 1; all add up to 1.
    pub probability: f64,
}

/// A stretch of the recording; frames from 1, both ends included.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Part {
    pub from: usize,
    pub to: usize,
    /// The activity; `None` is unknown.
    pub activity: Option<String>,
    /// Probability of the activity, 0 to 1.
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

/// Ranges of visible frames as ranges of the recording, whose `frames` frames have been counted from 1; `numbers` are those
/// of the frames with a person.
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

/// Ranges of a recording's frames with a person, without gaps of more than [`GAP_FRAMES`]. `seen` is true where anybody is.
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

/// The windows and segments of a recording, passage by passage: `tracks[view][frame]`, and which frames show anybody.
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
        // Frames without anybody are not in the tracks.
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

/// The only person of a recording; `None` in an empty one.
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

/// The only person of a frame; `None` where the mask is empty.
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

/// The segments as [`parts`] takes them.
pub(super) fn of_segments(
    segments: &[Segment],
) -> impl Iterator<Item = (usize, usize, &Option<String>, f32)> {
    segments.iter().map(|s| (s.from, s.to, &s.activity, s.confidence))
}

/// Probability of every activity.
pub(super) fn probabilities(answer: &Answer) -> Vec<Probability> {
    let probability = |(activity, value): &(String, f32)| Probability {
        activity: activity.clone(),
        probability: rounded_probability(*value),
    };
    answer.probabilities.iter().map(probability).collect()
}

/// The answer if only some activities can be; all can where none is named.
pub(super) fn restricted(answer: Answer, among: &[String]) -> Answer {
    if among.is_empty() { answer } else { answer.among(among) }
}

/// Why an answer is unknown, in words; `None` where it is not.
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

/// A probability with four decimals, without the digits that f32 does not have.
pub(super) fn rounded_probability(value: f32) -> f64 {
    rounded(f64::from(value), 4)
}

/// JSON has no infinity: nothing was seen.
pub(super) fn outlier_score(answer: &Answer) -> Option<f64> {
    answer.outlier_score.is_finite().then(|| rounded_probability(answer.outlier_score))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_is_cut_where_nobody_is_there_for_a_while() {
        let mut seen = vec![false; 400];
        seen[3..40].fill(true);
        seen[20..25].fill(false);
        seen[340..390].fill(true);
        assert_eq!(passages(&seen), [3..40, 340..390]);
        assert!(passages(&[false; 50]).is_empty());
    }
}
