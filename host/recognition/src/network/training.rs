//! Network training by Adam (Kingma and Ba, ICLR 2015) with cosine decay.

use super::variation::{self, Embedded};
use super::{Dense, Layers, Network, pooled, rectified, rows, with_neighbours};
use crate::watch::Watch;
use ndarray::{Array1, Array2, ArrayView2, Axis, s};
use rand::{Rng, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use rayon::prelude::*;

/// Settings of the network's training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetworkSettings {
    /// Outputs of the three layers.
    pub widths: [usize; 3],
    /// Neighbouring frames on each side of the second layer; 0 for order-free.
    pub reach: usize,
    /// Passes over all clips.
    pub passes: usize,
    /// Clips per step of the optimiser.
    pub batch: usize,
    /// Least share of a clip's frames in a step, drawn up to 1. Motion is between the remaining frames.
    pub keep: f32,
    /// Random offset per component, constant over a clip, in spreads of the component.
    pub shift: f32,
    /// Members of the ensemble.
    pub members: usize,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Default for NetworkSettings {
    fn default() -> Self {
        Self {
            widths: [64, 128, 96],
            reach: 0,
            passes: 30,
            batch: 64,
            keep: 1.0,
            shift: 0.0,
            members: 1,
            seed: 1,
        }
    }
}

/// Initial learning rate.
const RATE: f32 = 2e-3;
/// Weight decay, times the learning rate.
const DECAY: f32 = 1e-2;
/// Dropout share of the pooled values.
const DROPOUT: f32 = 0.3;
/// Random noise per number of a frame, in spreads of the number.
const NOISE: f32 = 0.05;
/// Label smoothing (Szegedy et al., CVPR 2016).
const SMOOTHING: f32 = 0.1;

struct Moments {
    first: Vec<f32>,
    second: Vec<f32>,
}

struct Learner {
    layer: Dense,
    weights: Moments,
    offsets: Moments,
}

impl Learner {
    /// Initial weights after He et al. (ICCV 2015).
    fn new(inputs: usize, outputs: usize, rng: &mut ChaCha8Rng) -> Self {
        let spread = (2.0 / inputs.max(1) as f32).sqrt();
        let mut draw = || Normal::new(0.0, spread).map_or(0.0, |normal| normal.sample(rng));
        let weights = Array2::from_shape_simple_fn((inputs, outputs), &mut draw);
        let moments = |n: usize| Moments { first: vec![0.0; n], second: vec![0.0; n] };
        Self {
            layer: Dense { weights, offsets: Array1::zeros(outputs) },
            weights: moments(inputs * outputs),
            offsets: moments(outputs),
        }
    }

    fn step(
        &mut self,
        inputs: ArrayView2<f32>,
        gradient: &Array2<f32>,
        step: Step,
        back: bool,
    ) -> Option<Array2<f32>> {
        let before = back.then(|| gradient.dot(&self.layer.weights.t()));
        let of_weights = inputs.t().dot(gradient);
        let of_offsets = gradient.sum_axis(Axis(0));
        step.take(self.layer.weights.iter_mut().zip(of_weights.iter()), &mut self.weights, true);
        step.take(self.layer.offsets.iter_mut().zip(of_offsets.iter()), &mut self.offsets, false);
        before
    }
}

#[derive(Clone, Copy)]
struct Step {
    number: i32,
    rate: f32,
}

impl Step {
    fn take<'a>(
        self,
        values: impl Iterator<Item = (&'a mut f32, &'a f32)>,
        moments: &mut Moments,
        shrink: bool,
    ) {
        const FIRST: f32 = 0.9;
        const SECOND: f32 = 0.999;
        let (first, second) = (1.0 - FIRST.powi(self.number), 1.0 - SECOND.powi(self.number));
        let decay = if shrink { self.rate * DECAY } else { 0.0 };
        for (((value, gradient), m), v) in values.zip(&mut moments.first).zip(&mut moments.second) {
            *m = FIRST * *m + (1.0 - FIRST) * gradient;
            *v = SECOND * *v + (1.0 - SECOND) * gradient * gradient;
            *value -= self.rate * (*m / first) / ((*v / second).sqrt() + 1e-8) + decay * *value;
        }
    }
}

/// Frame vectors (frames x F) of an embedded clip.
pub type Vectors<'a> = &'a (dyn Fn(&Embedded) -> Array2<f32> + Sync);

/// Trains on non-empty clips with labels below `classes`; returns the network and the mean of the members'
/// linear output layers. `watch` is called per pass and member; `None` stops.
pub fn train(
    clips: &[Embedded],
    vectors: Vectors<'_>,
    labels: &[usize],
    classes: usize,
    settings: &NetworkSettings,
    watch: &dyn Watch,
) -> Option<(Network, Dense)> {
    let scale = Scale::of(clips, vectors)?;
    let seeds: Vec<u64> =
        (0..settings.members.max(1) as u64).map(|n| settings.seed.wrapping_add(n)).collect();
    let (members, last): (Vec<Layers>, Vec<Dense>) = seeds
        .into_par_iter()
        .map(|seed| {
            let settings = NetworkSettings { seed, ..*settings };
            one_member(clips, vectors, &scale, labels, classes, &settings, watch)
        })
        .collect::<Option<Vec<_>>>()?
        .into_iter()
        .unzip();
    Some((Network { mean: scale.mean, spread: scale.spread, members }, Dense::mean_of(&last)))
}

fn one_member(
    clips: &[Embedded],
    vectors: Vectors<'_>,
    scale: &Scale,
    labels: &[usize],
    classes: usize,
    settings: &NetworkSettings,
    watch: &dyn Watch,
) -> Option<(Layers, Dense)> {
    let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
    let [a, b, c] = settings.widths;
    let mut learners = [(scale.mean.len(), a), ((2 * settings.reach + 1) * a, b), (2 * b, c), (c, classes)]
        .map(|(inputs, outputs)| Learner::new(inputs, outputs, &mut rng));
    let mut order: Vec<usize> = (0..clips.len()).collect();
    let steps = settings.passes * clips.len().div_ceil(settings.batch.max(1));
    let mut number = 0;
    for _ in 0..settings.passes {
        if watch.is_stopped() {
            return None;
        }
        order.shuffle(&mut rng);
        for chosen in order.chunks(settings.batch.max(1)) {
            number += 1;
            let share = number as f32 / steps.max(1) as f32;
            let rate = RATE * (0.5 + 0.5 * (std::f32::consts::PI * share).cos());
            let step = Step { number, rate };
            let varied: Vec<Embedded> =
                chosen.iter().map(|&clip| clips[clip].varied(settings, &scale.points, &mut rng)).collect();
            let seen: Vec<Array2<f32>> = varied.par_iter().map(|clip| scale.applied(vectors(clip))).collect();
            let labels = chosen.iter().map(|&clip| labels[clip]);
            one_step(&mut learners, &seen, labels, settings, step, &mut rng);
        }
        watch.fold_done(settings.passes * settings.members.max(1));
    }
    let [first, second, third, last] = learners.map(|learner| learner.layer);
    Some(([first, second, third], last))
}

/// Mean and spread of all frame vectors; constant ones are unchanged.
struct Scale {
    mean: Array1<f32>,
    spread: Array1<f32>,
    points: Array1<f32>,
}

impl Scale {
    fn of(clips: &[Embedded], vectors: Vectors<'_>) -> Option<Self> {
        let frames: usize = clips.iter().map(|clip| clip.points.nrows()).sum();
        let n = frames.max(1) as f32;
        let sums = |of: &(dyn Fn(Array2<f32>) -> Array2<f32> + Sync)| -> Option<Array1<f32>> {
            let sums: Vec<Array1<f32>> =
                clips.par_iter().map(|clip| of(vectors(clip)).sum_axis(Axis(0)) / n).collect();
            sums.into_iter().reduce(|sum, next| sum + next)
        };
        let mean = sums(&|vectors| vectors)?;
        let spread = sums(&|vectors| (vectors - &mean).mapv(|v| v * v))?;
        let points = variation::spread(clips);
        Some(Self { spread: spread.mapv(|v| if v > 1e-10 { v.sqrt() } else { 1.0 }), mean, points })
    }

    fn applied(&self, vectors: Array2<f32>) -> Array2<f32> {
        (vectors - &self.mean) / &self.spread
    }
}

fn one_step(
    learners: &mut [Learner; 4],
    clips: &[Array2<f32>],
    labels: impl Iterator<Item = usize>,
    settings: &NetworkSettings,
    step: Step,
    rng: &mut ChaCha8Rng,
) {
    let parts: Vec<ArrayView2<f32>> = clips.iter().map(|clip| clip.view()).collect();
    let Ok(mut frames) = ndarray::concatenate(Axis(0), &parts) else { return };
    if let Ok(normal) = Normal::new(0.0, NOISE) {
        frames.mapv_inplace(|v| v + normal.sample(rng));
    }
    let [first, second, third, last] = learners;
    let hidden = rectified(first.layer.apply(frames.view()));
    let mut spans = Vec::with_capacity(clips.len());
    let mut windows = Array2::zeros((hidden.nrows(), (2 * settings.reach + 1) * hidden.ncols()));
    for part in &parts {
        let from = spans.last().map_or(0, |(_, to)| *to);
        let to = from + part.nrows();
        windows.slice_mut(s![from..to, ..]).assign(&with_neighbours(rows(&hidden, from, to), settings.reach));
        spans.push((from, to));
    }
    let seen = rectified(second.layer.apply(windows.view()));
    let width = seen.ncols();
    let mut clip = Array2::zeros((clips.len(), 2 * width));
    for (row, &(from, to)) in spans.iter().enumerate() {
        clip.row_mut(row).assign(&pooled(rows(&seen, from, to)));
    }
    let keep = 1.0 - DROPOUT;
    let kept =
        Array2::from_shape_simple_fn(
            clip.dim(),
            || if rng.random::<f32>() < keep { 1.0 / keep } else { 0.0 },
        );
    let dropped = &clip * &kept;
    let pattern = rectified(third.layer.apply(dropped.view()));
    let decision = last.layer.apply(pattern.view());
    let gradient = cross_entropy(&decision, labels);
    let Some(mut gradient) = last.step(pattern.view(), &gradient, step, true) else { return };
    only_above_zero(&mut gradient, &pattern);
    let Some(gradient) = third.step(dropped.view(), &gradient, step, true) else { return };
    let gradient = gradient * &kept;
    let mut of_seen = Array2::zeros(seen.dim());
    for (row, &(from, to)) in spans.iter().enumerate() {
        let n = (to - from) as f32;
        for k in 0..width {
            let column = seen.slice(s![from..to, k]);
            let largest = clip[[row, width + k]];
            let at = column.iter().position(|&v| v >= largest).unwrap_or(0);
            let mut out = of_seen.slice_mut(s![from..to, k]);
            out.fill(gradient[[row, k]] / n);
            out[at] += gradient[[row, width + k]];
        }
    }
    only_above_zero(&mut of_seen, &seen);
    let Some(of_windows) = second.step(windows.view(), &of_seen, step, true) else { return };
    let mut of_hidden = Array2::zeros(hidden.dim());
    for &(from, to) in &spans {
        let own = to_neighbours(rows(&of_windows, from, to), settings.reach);
        of_hidden.slice_mut(s![from..to, ..]).assign(&own);
    }
    only_above_zero(&mut of_hidden, &hidden);
    first.step(frames.view(), &of_hidden, step, false);
}

/// Adjoint of [`with_neighbours`]: sums the gradients over all places of a row.
fn to_neighbours(windows: ArrayView2<f32>, reach: usize) -> Array2<f32> {
    let (n, width) = (windows.nrows(), windows.ncols() / (2 * reach + 1));
    let mut out = Array2::zeros((n, width));
    for (place, from) in (0..=2 * reach).map(|place| (place, place * width)) {
        let (begin, shift) = (reach.saturating_sub(place).min(n), place.saturating_sub(reach).min(n));
        let count = n - begin - shift;
        let mut to = out.slice_mut(s![shift..shift + count, ..]);
        to += &windows.slice(s![begin..begin + count, from..from + width]);
    }
    out
}

fn cross_entropy(decision: &Array2<f32>, labels: impl Iterator<Item = usize>) -> Array2<f32> {
    let (n, classes) = decision.dim();
    let mut gradient = decision.clone();
    for (mut row, label) in gradient.rows_mut().into_iter().zip(labels) {
        let best = row.iter().fold(f32::NEG_INFINITY, |m, v| m.max(*v));
        row.mapv_inplace(|v| (v - best).exp());
        let total = row.sum();
        row.mapv_inplace(|v| v / total - SMOOTHING / classes as f32);
        row[label] -= 1.0 - SMOOTHING;
    }
    gradient / n as f32
}

fn only_above_zero(gradient: &mut Array2<f32>, values: &Array2<f32>) {
    gradient.zip_mut_with(values, |gradient, &value| {
        if value <= 0.0 {
            *gradient = 0.0;
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::Unwatched;
    use std::collections::BTreeSet;
    use std::sync::Mutex;

    fn trained(
        clips: &[Array2<f32>],
        labels: &[usize],
        classes: usize,
        settings: &NetworkSettings,
    ) -> (Network, Dense) {
        let clips: Vec<Embedded> =
            clips.iter().map(|points| Embedded { points: points.clone(), boxes: None }).collect();
        train(&clips, &|clip| clip.points.clone(), labels, classes, settings, &Unwatched)
            .expect("not stopped")
    }

    /// Classes differ in which kinds of frames occur, not in how often.
    fn clips(rng: &mut ChaCha8Rng) -> (Vec<Array2<f32>>, Vec<usize>) {
        (0..240)
            .map(|i| {
                let label = i % 3;
                let frames = rng.random_range(3..9);
                let clip = Array2::from_shape_fn((frames, 4), |(frame, k)| {
                    let kind = [0, 1, frame % 2][label];
                    let middle = if k == kind { 2.0 } else { 0.0 };
                    middle + rng.random_range(-0.7..0.7_f32)
                });
                (clip, label)
            })
            .unzip()
    }

    #[test]
    fn neighbours_are_appended_to_a_row_and_return_their_gradient() {
        let rows = Array2::from_shape_fn((3, 2), |(row, k)| (10 * (row + 1) + k) as f32);
        let windows = with_neighbours(rows.view(), 1);
        assert_eq!(windows.row(0).to_vec(), [0.0, 0.0, 10.0, 11.0, 20.0, 21.0]);
        assert_eq!(windows.row(1).to_vec(), [10.0, 11.0, 20.0, 21.0, 30.0, 31.0]);
        // Adjoint test: <W x, y> = <x, W' y>, also for a reach beyond both ends.
        for reach in 0..5 {
            let there = with_neighbours(rows.view(), reach);
            let other = Array2::from_shape_fn(there.dim(), |(row, k)| (3 * row + 7 * k % 5) as f32);
            let back = to_neighbours(other.view(), reach);
            assert_eq!((&there * &other).sum(), (&rows * &back).sum(), "{reach}");
        }
    }

    #[test]
    fn with_neighbours_it_tells_what_only_the_order_of_frames_tells() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        // The same frames, alternating or in pairs.
        let mut clips = |n: usize| -> (Vec<Array2<f32>>, Vec<usize>) {
            let clip = |label: usize, rng: &mut ChaCha8Rng| {
                Array2::from_shape_fn((12, 2), |(frame, k)| {
                    let kind = if label == 0 { frame % 2 } else { frame / 2 % 2 };
                    f32::from(k == kind) + rng.random_range(-0.3..0.3_f32)
                })
            };
            (0..n).map(|i| (clip(i % 2, &mut rng), i % 2)).unzip()
        };
        let ((train_clips, labels), (fresh, truth)) = (clips(200), clips(100));
        let right = |reach: usize| {
            let settings =
                NetworkSettings { widths: [8, 12, 8], batch: 16, reach, ..NetworkSettings::default() };
            let (network, last) = trained(&train_clips, &labels, 2, &settings);
            assert!(network.fits(2));
            let says = |clip: &Array2<f32>| {
                let decision = last.apply(network.pattern(clip.view()).insert_axis(Axis(0)).view());
                usize::from(decision[[0, 1]] > decision[[0, 0]])
            };
            fresh.iter().zip(&truth).filter(|(clip, truth)| says(clip) == **truth).count()
        };
        assert!(right(2) > 97, "{}", right(2));
        // Chance, and five standard deviations of 100 guesses.
        assert!(right(0) < 75, "{}", right(0));
    }

    #[test]
    fn every_step_sees_other_frames_of_a_clip_and_the_scale_all_of_them() {
        let whole: Vec<Embedded> = (0..4)
            .map(|_| Embedded {
                points: Array2::from_shape_fn((30, 1), |(frame, _)| frame as f32),
                boxes: None,
            })
            .collect();
        let seen = |keep: f32| {
            let sums = Mutex::new(Vec::new());
            let vectors = |clip: &Embedded| {
                sums.lock().expect("not poisoned").push(clip.points.sum());
                clip.points.clone()
            };
            let settings = NetworkSettings { widths: [2; 3], passes: 5, keep, ..NetworkSettings::default() };
            let (network, _) =
                train(&whole, &vectors, &[0, 1, 0, 1], 2, &settings, &Unwatched).expect("not stopped");
            assert!((network.mean[0] - 14.5).abs() < 1e-4, "{}", network.mean);
            let sums = sums.into_inner().expect("not poisoned");
            // Twice for mean and spread, then once per pass; 435 is that of all frames.
            assert_eq!(sums.len(), 4 * 2 + 4 * 5);
            assert!(sums[..8].iter().all(|sum| *sum == 435.0), "{sums:?}");
            sums[8..].iter().map(|sum| sum.to_bits()).collect::<BTreeSet<u32>>().len()
        };
        assert_eq!(seen(1.0), 1);
        assert!(seen(0.4) > 15, "nearly every time others");
    }

    #[test]
    fn it_learns_what_means_alone_tell_and_ignores_the_order_of_frames() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let (train_clips, labels) = clips(&mut rng);
        let settings = NetworkSettings { widths: [8, 12, 8], batch: 16, ..NetworkSettings::default() };
        let (network, last) = trained(&train_clips, &labels, 3, &settings);
        assert!(network.fits(4) && !network.fits(5) && last.is(8, 3));
        let (fresh, truth) = clips(&mut rng);
        let right = fresh.iter().zip(&truth).filter(|(clip, truth)| {
            let pattern = network.pattern(clip.view()).insert_axis(Axis(0));
            let decision = last.apply(pattern.view()).remove_axis(Axis(0));
            (0..3).max_by(|&a, &b| decision[a].total_cmp(&decision[b])) == Some(**truth)
        });
        let right = right.count();
        assert!(right > 225, "{right} of 240");
        let clip = &fresh[2];
        let backwards = clip.slice(s![..;-1, ..]);
        let (a, b) = (network.pattern(clip.view()), network.pattern(backwards));
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-5));
        assert_eq!(network.pattern(clip.slice(s![..0, ..])).len(), 8);
    }
}
