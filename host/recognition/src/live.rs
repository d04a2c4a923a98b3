//! Streaming recognition over the last frames, and windows over long recordings.

use super::clip::Track;
use super::model::{Answer, ModelError, Recogniser};
use super::nearest::Nearest;
use super::network::variation::Embedded;
use super::patterns::joined as in_order;
use farnear_silhouettes::mask::Mask;
use ndarray::{Array1, Axis, concatenate};
use std::collections::VecDeque;

/// Keeps the last frames of every view. Each frame is embedded once and the nearest pattern comes from an
/// index, so a frame costs one window's pattern.
#[derive(Debug)]
pub struct Live<'a> {
    recogniser: &'a Recogniser,
    nearest: Nearest<'a>,
    window: usize,
    full_frames: bool,
    frames: VecDeque<Moment>,
}

/// A frame of each view; no row without a visible person.
type Moment = Vec<Vec<Embedded>>;

impl<'a> Live<'a> {
    /// Uses the last `window` frames (at least one).
    pub fn new(recogniser: &'a Recogniser, window: usize, full_frames: bool) -> Self {
        let nearest = Nearest::new(recogniser.patterns.view());
        Self { recogniser, nearest, window: window.max(1), full_frames, frames: VecDeque::new() }
    }

    /// Takes the masks of one moment, one per view, and answers for the window that ends with it. Empty masks
    /// only push old frames out. Fails if the number of views is not the model's.
    pub fn push(&mut self, masks: &[Mask]) -> Result<Answer, ModelError> {
        let scaling = self.recogniser.settings.scaling;
        let moment =
            masks.iter().map(|mask| Track::from_masks(std::slice::from_ref(mask), scaling, self.full_frames));
        self.push_described(moment.collect())
    }

    /// [`Self::push`] for described masks: one track of a single frame per view.
    pub fn push_described(&mut self, moment: Vec<Track>) -> Result<Answer, ModelError> {
        self.recogniser.check(&moment)?;
        let boxed = self.recogniser.uses_boxes();
        let seen = |view: Track| -> Result<Embedded, ModelError> {
            Ok(Embedded { points: self.recogniser.space.points(&view)?, boxes: view.boxes.filter(|_| boxed) })
        };
        let opinions = self.recogniser.opinions(&moment).into_iter();
        let moment: Result<Moment, ModelError> =
            opinions.map(|views| views.into_iter().map(seen).collect()).collect();
        self.frames.push_back(moment?);
        if self.frames.len() > self.window {
            self.frames.pop_front();
        }
        let opinions = self.frames.back().map_or(0, Vec::len);
        let answers: Vec<Answer> = (0..opinions).filter_map(|opinion| self.answer(opinion)).collect();
        Ok(self.recogniser.joint(&answers))
    }

    fn answer(&self, opinion: usize) -> Option<Answer> {
        let Recogniser { space, settings, .. } = self.recogniser;
        let frames: Vec<&Vec<Embedded>> =
            self.frames.iter().filter_map(|moment| moment.get(opinion)).collect();
        let views = frames.last()?.len();
        let mut seen = false;
        let patterns: Vec<Array1<f32>> = (0..views)
            .map(|view| {
                let of_view = || frames.iter().filter_map(|moment| moment.get(view));
                let points: Vec<_> = of_view().map(|frame| frame.points.view()).collect();
                let boxes: Option<Vec<_>> =
                    of_view().map(|frame| frame.boxes.as_ref().map(|boxes| boxes.view())).collect();
                let points = concatenate(Axis(0), &points).unwrap_or_default();
                let boxes = boxes.and_then(|boxes| concatenate(Axis(0), &boxes).ok());
                seen |= points.nrows() > 0;
                let vectors = space.vectors_of(points.view(), boxes.as_ref().map(|boxes| boxes.view()));
                space.pattern_of(vectors.view(), settings.sharpness)
            })
            .collect();
        let pattern = in_order(&patterns, &(0..views).collect::<Vec<_>>());
        let distance = self.nearest.squared_distance(pattern.view());
        seen.then(|| self.recogniser.answer_by(pattern.view(), distance))
    }

    /// Forgets all frames, before another clip.
    pub fn clear(&mut self) {
        self.frames.clear();
    }
}

pub fn joined<'t>(parts: impl Iterator<Item = &'t Track>) -> Track {
    let parts: Vec<&Track> = parts.collect();
    let empty_frames = parts.iter().map(|part| part.empty_frames).sum();
    let descriptors: Vec<_> = parts.iter().map(|part| part.descriptors.view()).collect();
    let cells: Vec<_> = parts.iter().map(|part| part.cells.view()).collect();
    let boxes: Option<Vec<_>> = parts.iter().map(|part| part.boxes.as_ref().map(|b| b.view())).collect();
    Track {
        descriptors: concatenate(Axis(0), &descriptors).unwrap_or_default(),
        cells: concatenate(Axis(0), &cells).unwrap_or_default(),
        boxes: boxes.and_then(|boxes| concatenate(Axis(0), &boxes).ok()),
        empty_frames,
    }
}

/// Segments of equal answers: each frame takes the window with the nearest middle; confidence is the mean.
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

/// Part of a recording with one answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// First frame, from 0.
    pub from: usize,
    /// End frame, exclusive.
    pub to: usize,
    /// Activity, `None` = unknown.
    pub activity: Option<String>,
    /// Mean confidence of its windows, 0 to 1.
    pub confidence: f32,
}

/// Answer for a segment of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Stretch {
    /// First frame, from 0.
    pub from: usize,
    /// End frame, exclusive.
    pub to: usize,
    /// Answer for these frames.
    pub answer: Answer,
}

/// Recognises windows of `length` frames every `step`. Fails if the number of views is not the model's.
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
