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
        self.frames.push_back(moment.collect());
        if self.frames.len() > self.window {
            self.frames.pop_front();
        }
        let views: Vec<Track> = (0..masks.len())
            .map(|view| joined(self.frames.iter().filter_map(|moment| moment.get(view))))
            .collect();
        self.recogniser.recognise(&views)
    }

    /// Forgets all frames.
    pub fn clear(&mut self) {
        self.frames.clear();
    }
}

/// Tracks one after the other.
fn joined<'t>(parts: impl Iterator<Item = &'t Track>) -> Track {
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

/// What was recognised in a stretch of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Stretch {
    /// First frame.
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
