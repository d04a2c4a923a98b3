//! One person's recognition in progress: of a recording with one person, of each of several, or before a camera.

use std::ops::Range;

use farnear_recognition::clip::Track;
use farnear_recognition::live::{Live, joined, windows};
use farnear_recognition::model::{Answer, ModelError, Recogniser};
use farnear_recognition::segmentation::{Worth, segmented};

use super::answer::{AnswerSummary, Part, PersonFigures, rounded_probability};
use crate::error::Result;

/// Frames without the person after which a new part begins.
const GAP_FRAMES: usize = 15;

pub(super) struct Person<'m> {
    model: &'m Recogniser,
    live: Live<'m>,
    window: usize,
    /// Indexed as `[view][frame]`.
    tracks: Vec<Vec<Track>>,
    /// The recording's number of each frame, from 1.
    numbers: Vec<usize>,
}

impl<'m> Person<'m> {
    /// Answers for the last `window` frames of `views` views.
    pub fn new(model: &'m Recogniser, views: usize, window: usize) -> Self {
        Self {
            live: Live::new(model, window, true),
            model,
            window,
            tracks: vec![Vec::new(); views],
            numbers: Vec::new(),
        }
    }

    /// Adds frame `number`, a track of one frame per view, and answers for the window that ends with it.
    pub fn see(&mut self, number: usize, views: Vec<Track>) -> Result<Answer, ModelError> {
        for (track, frame) in self.tracks.iter_mut().zip(&views) {
            track.push(frame.clone());
        }
        self.numbers.push(number);
        self.live.push_described(views)
    }

    /// Drops the frames but those of the running window.
    pub fn forget(&mut self) {
        self.tracks.iter_mut().for_each(Vec::clear);
        self.numbers.clear();
    }

    /// Frames without the person, summed over the views.
    pub fn empty_frames(&self) -> usize {
        self.tracks.iter().flatten().map(|track| track.empty_frames).sum()
    }

    /// The answer for all frames.
    pub fn summary(&self) -> Result<AnswerSummary> {
        let whole: Vec<Track> = self.tracks.iter().map(|frames| joined(frames.iter())).collect();
        Ok(AnswerSummary::new(self.model.recognise(&whole)?, self.numbers.len()))
    }

    /// A remark on several passages of more than [`GAP_FRAMES`] silhouettes, with more frames than that without the person between
    /// them.
    pub fn joined_passages(&self) -> Option<String> {
        let all = passages(&self.seen(), &self.numbers);
        let count = all.iter().filter(|passage| passage.len() > GAP_FRAMES).count();
        (count > 1).then(|| {
            format!(
                "the person has no silhouette of their own between {count} passages, which the answer for the whole joins; use `windows` and \
                 `segments`, or cut the masks (farnear silhouettes passages) and recognise each passage"
            )
        })
    }

    /// Frames with a silhouette in a view.
    fn seen(&self) -> Vec<usize> {
        let is_seen = |frame: &usize| {
            self.tracks.iter().any(|view| view.get(*frame).is_some_and(|track| track.frames() > 0))
        };
        (0..self.numbers.len()).filter(is_seen).collect()
    }

    /// Answers for all frames, for windows and for segments; `None` if no frame has a silhouette.
    pub fn figures(&self, person: usize, answer: AnswerSummary) -> Result<Option<PersonFigures>> {
        let seen = self.seen();
        let number = |frame: Option<&usize>| frame.and_then(|frame| self.numbers.get(*frame)).copied();
        let (Some(from), Some(to)) = (number(seen.first()), number(seen.last())) else { return Ok(None) };
        let (mut in_windows, mut in_segments) = (Vec::new(), Vec::new());
        for passage in passages(&seen, &self.numbers) {
            let (windows, segments) = self.stretches(passage)?;
            in_windows.extend(windows);
            in_segments.extend(segments);
        }
        Ok(Some(PersonFigures {
            person,
            from,
            to,
            silhouettes: seen.len(),
            crossing_frames: 0,
            perhaps_swapped_with: Vec::new(),
            answer,
            windows: in_windows,
            segments: in_segments,
        }))
    }

    /// Windows that overlap by half, and segments.
    fn stretches(&self, passage: Range<usize>) -> Result<(Vec<Part>, Vec<Part>)> {
        let numbers = &self.numbers[passage.clone()];
        let views: Vec<&[Track]> = self.tracks.iter().map(|view| &view[passage.clone()]).collect();
        let kept = aligned(&views, self.model.views > 1);
        let Some(frames) = kept.first().map(|(_, frames)| frames) else {
            return Ok((Vec::new(), Vec::new()));
        };
        let numbers: Vec<usize> = frames.iter().map(|frame| numbers[*frame]).collect();
        let whole: Vec<Track> =
            kept.iter().map(|(view, frames)| joined(frames.iter().map(|frame| &view[*frame]))).collect();
        let part = |from: usize, to: usize, activity: Option<String>, confidence: f32| {
            let last = numbers.len().saturating_sub(1);
            let number = |frame: usize| numbers.get(frame.min(last)).copied().unwrap_or(1);
            Part {
                from: number(from),
                to: number(to.saturating_sub(1)),
                activity,
                confidence: rounded_probability(confidence),
            }
        };
        let of_windows = windows(self.model, &whole, self.window, self.window.div_ceil(2))?;
        let of_segments = segmented(self.model, &whole, Worth::default())?;
        Ok((
            of_windows
                .into_iter()
                .map(|window| part(window.from, window.to, window.answer.activity, window.answer.confidence))
                .collect(),
            of_segments
                .into_iter()
                .map(|segment| part(segment.from, segment.to, segment.activity, segment.confidence))
                .collect(),
        ))
    }
}

/// The views that see the person in a passage, and the frames in which all of these do. A model of several views needs each; of
/// others, views that see less than half as much as the best are left out.
fn aligned<'t>(views: &[&'t [Track]], all_needed: bool) -> Vec<(&'t [Track], Vec<usize>)> {
    let is_seen = |view: &[Track], frame: usize| view[frame].frames() > 0;
    let seen = |view: &[Track]| (0..view.len()).filter(|frame| is_seen(view, *frame)).count();
    let most = views.iter().map(|view| seen(view)).max().unwrap_or(0);
    let counts = |view: &&[Track]| all_needed || 2 * seen(view) >= most.max(1);
    let views: Vec<&[Track]> = views.iter().copied().filter(counts).collect();
    let length = views.iter().map(|view| view.len()).min().unwrap_or(0);
    let frames: Vec<usize> =
        (0..length).filter(|frame| views.iter().all(|view| is_seen(view, *frame))).collect();
    if frames.is_empty() {
        Vec::new()
    } else {
        views.into_iter().map(|view| (view, frames.clone())).collect()
    }
}

/// Splits the frames `seen` where more than [`GAP_FRAMES`] of the recording lie between two.
fn passages(seen: &[usize], numbers: &[usize]) -> Vec<Range<usize>> {
    let near = |a: &usize, b: &usize| numbers[*b] - numbers[*a] <= GAP_FRAMES + 1;
    seen.chunk_by(near).filter_map(|part| Some(*part.first()?..part.last()? + 1)).collect()
}

#[cfg(test)]
mod tests {
    use farnear_recognition::embedding::descriptor::Scaling;
    use farnear_silhouettes::mask::centre::SIDE_PX;
    use ndarray::Array2;

    use super::*;

    #[test]
    fn views_are_compared_in_frames_that_all_of_them_see() {
        let frame = |is_seen: bool| {
            let mask = Array2::from_elem((SIDE_PX, SIDE_PX), is_seen);
            Track::from_masks(&[mask], Scaling::default(), false)
        };
        let view =
            |seen: std::ops::Range<usize>| (0..10).map(|at| frame(seen.contains(&at))).collect::<Vec<_>>();
        let [whole, late, little, none] = [view(0..10), view(3..10), view(0..2), view(0..0)];
        let frames = |views: &[&[Track]], all_needed| {
            let kept = aligned(views, all_needed);
            (kept.len(), kept.first().map(|(_, frames)| frames.clone()).unwrap_or_default())
        };
        assert_eq!(frames(&[&whole, &late], true), (2, (3..10).collect()));
        assert_eq!(frames(&[&whole, &late, &little, &none], false), (2, (3..10).collect()));
        assert_eq!(frames(&[&whole, &little], true), (2, vec![0, 1]));
        assert_eq!(frames(&[&whole, &none], true), (0, vec![]));
        assert_eq!(frames(&[&none], false), (0, vec![]));
    }

    #[test]
    fn a_recording_is_split_at_long_gaps_without_a_person() {
        let numbers: Vec<usize> = (1..=400).collect();
        let seen: Vec<usize> = (3..20).chain(25..40).chain(340..390).collect();
        assert_eq!(passages(&seen, &numbers), [3..40, 340..390]);
        assert!(passages(&[], &numbers).is_empty());
        // Frames of a person whom another hid for a second are numbered with a gap.
        let numbers: Vec<usize> = (1..=20).chain(46..=60).collect();
        assert_eq!(passages(&(0..35).collect::<Vec<_>>(), &numbers), [0..20, 20..35]);
    }
}
