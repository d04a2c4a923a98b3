//! Segmentation of recordings by a hidden semi-Markov model (Yu, Artificial Intelligence 174, 2010). The score of a
//! segment from frame a to b is `(b - a) (ln p(a, b) - strange * outlier(a, b)) - change - unlikely(b - a)` for the
//! best activity. Dynamic programming over a grid of borders finds the best sequence; borders are then refined frame by
//! frame. O(frames / step x lengths) answers; frames are embedded once. The step depends on the model only, so that time
//! is linear in frames and short activities are found in long recordings too.

use super::clip::Track;
use super::lengths::Lengths;
use super::live::Segment;
use super::model::{Answer, ModelError, Recogniser};
use super::nearest::Nearest;
use super::network::variation::Embedded;
use super::patterns::joined;
use ndarray::{Array1, s};
use rayon::prelude::*;

/// Score parameters of a segmentation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worth {
    /// Cost of a change, nats.
    pub change: f32,
    /// Cost of outliers, nats per frame and unit of outlier score.
    pub strange: f32,
    /// Shortest and longest segment, in typical clips.
    pub lengths: [f32; 2],
}

impl Default for Worth {
    fn default() -> Self {
        Self { change: 5.0, strange: 3.0, lengths: [0.3, 2.5] }
    }
}

/// Grid borders per typical clip.
const PLACES: usize = 12;
/// Ratio of successive lengths.
const LONGER: f32 = 1.15;
const LEAST: usize = 4;

struct Recording<'a> {
    recogniser: &'a Recogniser,
    nearest: Nearest<'a>,
    groups: Vec<Vec<Embedded>>,
    typical: f32,
    step: usize,
    worth: Worth,
}

struct Valued {
    worth: f32,
    activity: Option<String>,
    confidence: f32,
}

impl<'a> Recording<'a> {
    /// Embeds all frames.
    fn new(recogniser: &'a Recogniser, views: &[Track], worth: Worth) -> Result<Self, ModelError> {
        let boxed = recogniser.uses_boxes();
        let embedded = |track: &Track| -> Result<Embedded, ModelError> {
            Ok(Embedded {
                points: recogniser.space.points(track)?,
                boxes: track.boxes.clone().filter(|_| boxed),
            })
        };
        let groups = recogniser.groups(views);
        let groups: Result<Vec<Vec<Embedded>>, ModelError> =
            groups.iter().map(|group| group.iter().map(embedded).collect()).collect();
        let typical = recogniser.typical_frames.max(LEAST);
        let step = (typical / PLACES).max(1);
        let nearest = Nearest::new(recogniser.patterns.view());
        Ok(Self { recogniser, nearest, groups: groups?, typical: typical as f32, step, worth })
    }

    fn valued(&self, from: usize, to: usize) -> Valued {
        let answers: Vec<Answer> = self.groups.iter().map(|group| self.answer(group, from, to)).collect();
        let answer = self.recogniser.joint(&answers);
        let frames = (to - from) as f32;
        let strange = self.worth.strange * answer.outlier_score.min(5.0);
        let worths = answer.probabilities.iter().map(|(activity, share)| {
            let unlikely = self.lengths_of(activity).unlikely(frames);
            (frames * (share.max(1e-6).ln() - strange) - self.worth.change - unlikely, activity, *share)
        });
        let best = worths.max_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or(
            Valued { worth: f32::MIN, activity: None, confidence: 0.0 },
            |(worth, activity, confidence)| Valued {
                worth,
                activity: answer.activity.is_some().then(|| activity.clone()),
                confidence,
            },
        )
    }

    fn lengths_of(&self, activity: &str) -> Lengths {
        let class = self.recogniser.activities.iter().position(|other| other == activity);
        let known = class.and_then(|class| self.recogniser.lengths.get(class)).copied();
        known.unwrap_or_else(|| Lengths::about(self.recogniser.typical_frames))
    }

    fn answer(&self, group: &[Embedded], from: usize, to: usize) -> Answer {
        let (space, sharpness) = (&self.recogniser.space, self.recogniser.settings.sharpness);
        let patterns: Vec<Array1<f32>> = group
            .iter()
            .map(|view| {
                let boxes = view.boxes.as_ref().map(|boxes| boxes.slice(s![from..to, ..]));
                let vectors = space.vectors_of(view.points.slice(s![from..to, ..]), boxes);
                space.pattern_of(vectors.view(), sharpness)
            })
            .collect();
        let all: Vec<usize> = (0..patterns.len()).collect();
        let pattern = joined(&patterns, &all);
        self.recogniser.answer_by(pattern.view(), self.nearest.squared_distance(pattern.view()))
    }
}

/// Cuts a recording into segments of one activity each. Frames are counted
/// as in the tracks. Fails if the views do not fit the model.
pub fn segmented(recogniser: &Recogniser, views: &[Track], worth: Worth) -> Result<Vec<Segment>, ModelError> {
    // One frame of each view checks the shape.
    let first: Vec<Track> = views.iter().map(|view| view.select(&[0][..view.frames().min(1)])).collect();
    recogniser.recognise(&first)?;
    let frames = views.iter().map(Track::frames).filter(|frames| *frames > 0).min().unwrap_or(0);
    if frames == 0 {
        return Ok(Vec::new());
    }
    let recording = Recording::new(recogniser, views, worth)?;
    let borders = refined(&recording, best_borders(&recording, frames));
    Ok(merged(&recording, &borders))
}

/// First 0, last the number of frames.
fn best_borders(recording: &Recording, frames: usize) -> Vec<usize> {
    let step = recording.step;
    let places: Vec<usize> = (0..frames).step_by(step).chain([frames]).collect();
    let [shortest, longest] = recording.worth.lengths.map(|times| times * recording.typical);
    let lengths: Vec<usize> = std::iter::successors(Some(shortest.max(LEAST as f32)), |l| Some(l * LONGER))
        .take_while(|l| *l <= longest)
        .map(|l| (l / step as f32).round().max(1.0) as usize)
        .collect();
    // Per border: starts of the parts that end there, with scores.
    let ending: Vec<Vec<(usize, f32)>> = (0..places.len())
        .into_par_iter()
        .map(|end| {
            let mut begins: Vec<usize> = lengths.iter().filter_map(|l| end.checked_sub(*l)).collect();
            // A shorter part may start the recording, which may be that short.
            if end > 0 && (begins.is_empty() || lengths.iter().all(|l| *l >= end)) {
                begins.push(0);
            }
            begins.dedup();
            begins.iter().map(|&begin| (begin, recording.valued(places[begin], places[end]).worth)).collect()
        })
        .collect();
    let mut best: Vec<(f32, usize)> = vec![(f32::NEG_INFINITY, 0); places.len()];
    best[0] = (0.0, 0);
    for end in 1..places.len() {
        for &(begin, worth) in &ending[end] {
            let all = best[begin].0 + worth;
            if all > best[end].0 {
                best[end] = (all, begin);
            }
        }
    }
    let mut at = places.len() - 1;
    let mut borders = vec![places[at]];
    while at > 0 {
        at = if best[at].0.is_finite() { best[at].1 } else { at - 1 };
        borders.push(places[at]);
    }
    borders.reverse();
    borders
}

/// Moves every border within a step to the best frame.
fn refined(recording: &Recording, mut borders: Vec<usize>) -> Vec<usize> {
    let step = recording.step;
    for place in 1..borders.len().saturating_sub(1) {
        let (before, at, after) = (borders[place - 1], borders[place], borders[place + 1]);
        let low = at.saturating_sub(step).max(before + 1);
        let high = (at + step).min(after - 1);
        let value =
            |border: usize| recording.valued(before, border).worth + recording.valued(border, after).worth;
        let values: Vec<f32> = (low..=high).into_par_iter().map(value).collect();
        for border in low..=high {
            if values[border - low] > values[borders[place] - low] {
                borders[place] = border;
            }
        }
    }
    borders
}

/// Segments between borders; neighbours with one activity are joined.
fn merged(recording: &Recording, borders: &[usize]) -> Vec<Segment> {
    let mut found: Vec<Segment> = Vec::new();
    for pair in borders.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let Valued { activity, confidence, .. } = recording.valued(from, to);
        match found.last_mut().filter(|last| last.activity == activity) {
            Some(last) => {
                let (own, all) = ((to - from) as f32, (to - last.from) as f32);
                last.confidence += (confidence - last.confidence) * own / all;
                last.to = to;
            }
            None => found.push(Segment { from, to, activity, confidence }),
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::Clip;
    use crate::embedding::descriptor::{ANGLES, CELLS};
    use crate::live::{Live, joined};
    use crate::model::RecogniserSettings;
    use crate::space::{PatternKind, SpaceSettings};
    use ndarray::Array2;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const ACTIVITIES: [&str; 3] = ["star", "stretch", "turn"];

    fn track(activity: usize, frames: usize, rng: &mut ChaCha8Rng) -> Track {
        let phase = rng.random_range(0.0..6.0_f32);
        let descriptors = Array2::from_shape_fn((frames, ANGLES), |(frame, angle)| {
            let waves = (activity + 2) as f32 * (angle as f32).to_radians();
            0.35 + 0.1 * (waves + 0.2 * frame as f32 + phase).sin() + rng.random_range(-0.01..0.01_f32)
        });
        let boxes = Array2::from_shape_fn((frames, 4), |(_, k)| {
            [90.0, 45.0, 60.0, 70.0][k] + rng.random_range(-1.0..1.0_f32)
        });
        Track { descriptors, cells: Array2::zeros((frames, CELLS)), boxes: Some(boxes), empty_frames: 0 }
    }

    fn model(rng: &mut ChaCha8Rng) -> Recogniser {
        let mut clips = Vec::new();
        for person in 0..8 {
            for (activity, name) in ACTIVITIES.iter().enumerate() {
                let frames = rng.random_range(20..32);
                let views = vec![track(activity, frames, rng)];
                clips.push(Clip { subject: format!("p{person}"), activity: (*name).into(), views });
            }
        }
        let space = SpaceSettings {
            dimensions: 6,
            pattern: PatternKind::Codebook(24),
            residuals: 8,
            ..SpaceSettings::default()
        };
        Recogniser::train(&clips, &RecogniserSettings { space, ..RecogniserSettings::default() })
            .expect("trained")
    }

    #[test]
    fn borders_are_found_where_activities_change() {
        let mut rng = ChaCha8Rng::seed_from_u64(12);
        let model = model(&mut rng);
        let parts =
            [(0, 30), (2, 22), (1, 41), (0, 26)].map(|(activity, frames)| track(activity, frames, &mut rng));
        let found = segmented(&model, &[joined(parts.iter())], Worth::default()).expect("fits");
        let names: Vec<Option<&str>> = found.iter().map(|s| s.activity.as_deref()).collect();
        assert_eq!(names, [Some("star"), Some("turn"), Some("stretch"), Some("star")], "{found:?}");
        assert_eq!((found[0].from, found[3].to), (0, 119));
        for (segment, border) in found.iter().skip(1).zip([30, 52, 93]) {
            assert!(segment.from.abs_diff(border) <= 3, "{found:?}");
        }
        assert!(found.windows(2).all(|pair| pair[0].to == pair[1].from));
        // Excluded activities are never answered, and one activity is one segment of any length.
        let two = ["star".to_owned(), "turn".to_owned()];
        let among =
            segmented(&model.restricted_to(&two), &[joined(parts.iter())], Worth::default()).expect("fits");
        assert!(among.iter().all(|s| s.activity.as_deref() != Some("stretch")));
        for frames in [3, 25, 140] {
            let one = segmented(&model, &[track(1, frames, &mut rng)], Worth::default()).expect("fits");
            assert_eq!((one.len(), one[0].from, one[0].to), (1, 0, frames), "{one:?}");
        }
        assert!(segmented(&model, &[parts[0].select(&[])], Worth::default()).expect("fits").is_empty());
        assert!(segmented(&model, &[], Worth::default()).is_err());
    }

    #[test]
    fn the_grid_of_borders_is_as_fine_in_long_recordings() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let model = model(&mut rng);
        let step = |frames: usize, rng: &mut ChaCha8Rng| {
            let views = [track(0, frames, rng)];
            Recording::new(&model, &views, Worth::default()).expect("fits").step
        };
        let long = step(6000, &mut rng);
        assert_eq!(long, step(30, &mut rng));
        assert!(long <= model.typical_frames / PLACES, "{long}");
    }

    #[test]
    fn segments_are_unknown_by_the_rule_of_whole_clips() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut model = model(&mut rng);
        // Without patterns, as in a network, the outlier score is the entropy of the joint probabilities.
        model.patterns = Array2::zeros((0, model.patterns.ncols()));
        model.limits.distances.fill(1.0);
        let views = [track(0, 25, &mut rng), track(1, 25, &mut rng)];
        let score = |views: &[Track]| model.recognise(views).expect("fits").outlier_score;
        let mean = 0.5 * (score(&views[..1]) + score(&views[1..]));
        let joint = score(&views);
        // Each view is sure of another activity.
        assert!(mean < joint, "{mean} {joint}");
        model.limits.distances.fill(0.5 * (mean + joint));
        assert_eq!(model.recognise(&views).expect("fits").activity, None);
        let recording = Recording::new(&model, &views, Worth::default()).expect("fits");
        assert_eq!(recording.valued(0, 25).activity, None);
    }

    #[test]
    fn live_answers_are_those_for_the_window() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let model = model(&mut rng);
        let stream = joined([track(0, 14, &mut rng), track(1, 14, &mut rng)].iter());
        let mut live = Live::new(&model, 10, true);
        for frame in 0..stream.frames() {
            // Every fifth frame is empty.
            let shown: &[usize] = if frame % 5 == 4 { &[] } else { &[frame] };
            let found = live.push_described(vec![stream.select(shown)]).expect("fits");
            let window: Vec<usize> =
                (frame.saturating_sub(9)..=frame).filter(|frame| frame % 5 != 4).collect();
            let whole = model.recognise(&[stream.select(&window)]).expect("fits");
            assert_eq!(found.activity, whole.activity);
            assert!((found.confidence - whole.confidence).abs() < 1e-4);
            assert!((found.outlier_score - whole.outlier_score).abs() < 1e-3 * whole.outlier_score.max(1.0));
        }
    }
}
