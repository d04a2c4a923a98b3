//! Answers for a recording or for one of its people, shared by all interfaces.

use std::fmt;

use farnear_recognition::model::Answer;
use farnear_silhouettes::mask::subject::Flag;
use serde::Serialize;
use serde_with::SerializeDisplay;

use crate::figures::rounded;

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

pub(super) fn probabilities(answer: &Answer) -> Vec<Probability> {
    let probability = |(activity, value): &(String, f32)| Probability {
        activity: activity.clone(),
        probability: rounded_probability(*value),
    };
    answer.probabilities.iter().map(probability).collect()
}

fn unknown_because(answer: &Answer, frames: usize) -> Option<String> {
    if answer.activity.is_some() {
        return None;
    }
    let score = answer.outlier_score;
    Some(match answer.best() {
        _ if frames == 0 => "there is no frame".into(),
        Some(best) if score.is_finite() => {
            format!("most like `{best}`, but the outlier score is {score:.2}, above the limit of 1")
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
