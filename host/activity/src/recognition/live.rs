//! Recognition while frames come in: a running answer over the last frames, and windows over a long recording.

use super::clip::Track;
use super::model::{Answer, ModelError, Recogniser};
use crate::mask::Mask;
use ndarray::{Axis, concatenate};
use std::collections::VecDeque;

/// Keeps the last frames of every view and answers for them.
#[derive(Debug)]
pub struct Live<'a> {
    recogniser: &'a Recogniser,
    window: usize,
    full_frames: bool,
    frames: VecDeque<Vec<Track>>,
}

impl<'a> Live<'a> {
    /// Watches the last `window` frames (at least one).
    pub fn new(recogniser: &'a Recogniser, window: usize, full_frames: bool) -> Self {
        Self { recogniser, window: window.max(1), full_frames, frames: VecDeque::new() }
    }

    /// Takes the masks of one moment, one per view, and answers for the window that ends with it. Empty masks are left out, so a moment
    /// without anybody changes nothing but pushes old frames out.
    ///
    /// # Errors
    /// Another number of views than the model's.
    pub fn push(&mut self, masks: &[Mask]) -> Result<Answer, ModelError> {
        let scaling = self.recogniser.settings.scaling;
        let moment =
            masks.iter().map(|mask| Track::from_masks(std::slice::from_ref(mask), scaling, self.full_frames));
        self.push_described(moment.collect())
    }

    /// As [`Self::push`], for masks that are described already: one track of a single frame per view.
    ///
    /// # Errors
    /// Another number of views than the model's.
    pub fn push_described(&mut self, moment: Vec<Track>) -> Result<Answer, ModelError> {
        let count = moment.len();
        self.frames.push_back(moment);
        if self.frames.len() > self.window {
            self.frames.pop_front();
        }
        let views: Vec<Track> =
            (0..count).map(|view| joined(self.frames.iter().filter_map(|moment| moment.get(view)))).collect();
        self.recogniser.recognise(&views)
    }

    /// Forgets all frames.
    pub fn clear(&mut self) {
        self.frames.clear();
    }
}

/// Tracks one after the other.
pub fn joined<'t>(parts: impl Iterator<Item = &'t Track>) -> Track {
    let parts: Vec<&Track> = parts.collect();
    let empty_frames = parts.iter().map(|part| part.empty_frames).sum();
    let descriptors: Vec<_> = parts.iter().map(|part| part.descriptors.view()).collect();
    let boxes: Option<Vec<_>> = parts.iter().map(|part| part.boxes.as_ref().map(|b| b.view())).collect();
    Track {
        descriptors: concatenate(Axis(0), &descriptors).unwrap_or_default(),
        boxes: boxes.and_then(|boxes| concatenate(Axis(0), &boxes).ok()),
        empty_frames,
    }
}

/// A recording cut where the answer changes: every frame goes to the window whose middle is nearest, neighbours with one answer
/// become one stretch, whose confidence is the mean.
pub fn segments(windows: &[Stretch]) -> Vec<Segment> {
    let mut found: Vec<Segment> = Vec::new();
    let mut merged = 0.0;
    for (index, window) in windows.iter().enumerate() {
        let border = |a: &Stretch, b: &Stretch| (a.from + a.to + b.from + b.to).div_ceil(4);
        let from = if index == 0 { window.from } else { border(&windows[index - 1], window) };
        let to = windows.get(index + 1).map_or(window.to, |next| border(window, next));
        match found.last_mut().filter(|last| last.activity == window.answer.activity) {
            Some(last) => {
                last.to = to;
                merged += 1.0;
                last.confidence += (window.answer.confidence - last.confidence) / merged;
            }
            None => {
                merged = 1.0;
                found.push(Segment {
                    from,
                    to,
                    activity: window.answer.activity.clone(),
                    confidence: window.answer.confidence,
                });
            }
        }
    }
    found
}

/// A part of a recording with one answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// First frame, counted from 0.
    pub from: usize,
    /// One past the last frame.
    pub to: usize,
    /// The activity, `None` = unknown.
    pub activity: Option<String>,
    /// Mean confidence of its windows, 0 to 1.
    pub confidence: f32,
}

/// What was recognised in a stretch of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Stretch {
    /// First frame, counted from 0.
    pub from: usize,
    /// One past the last frame.
    pub to: usize,
    /// The answer for it.
    pub answer: Answer,
}

/// Recognises a long recording window by window: `length` frames every `step`. The last window is shorter if it has to be.
///
/// # Errors
/// Another number of views than the model's.
pub fn windows(
    recogniser: &Recogniser,
    views: &[Track],
    length: usize,
    step: usize,
) -> Result<Vec<Stretch>, ModelError> {
    let frames = views.iter().map(Track::frames).min().unwrap_or(0);
    let mut found = Vec::new();
    let mut from = 0;
    loop {
        let to = (from + length.max(1)).min(frames);
        let part: Vec<Track> =
            views.iter().map(|view| view.select(&(from..to).collect::<Vec<_>>())).collect();
        found.push(Stretch { from, to, answer: recogniser.recognise(&part)? });
        if to >= frames {
            return Ok(found);
        }
        from += step.max(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_with_one_answer_become_one_segment() {
        let window = |from: usize, activity: Option<&str>, confidence: f32| Stretch {
            from,
            to: from + 20,
            answer: Answer {
                activity: activity.map(str::to_owned),
                confidence,
                probabilities: Vec::new(),
                outlier_score: 0.5,
            },
        };
        let windows = [
            window(0, Some("walk"), 0.5),
            window(10, Some("walk"), 0.75),
            window(20, None, 0.25),
            window(30, Some("dig"), 1.0),
        ];
        let found = segments(&windows);
        let spans: Vec<_> = found.iter().map(|s| (s.from, s.to, s.activity.as_deref())).collect();
        assert_eq!(spans, [(0, 25, Some("walk")), (25, 35, None), (35, 50, Some("dig"))]);
        assert!((found[0].confidence - 0.625).abs() < 1e-6);
        assert!(segments(&[]).is_empty());
    }
}
