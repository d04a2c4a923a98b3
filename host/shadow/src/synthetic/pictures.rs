//! Synthetic colour pictures with known shadow, for scoring detectors: a scene's masks ([`super::scene`])
//! with speckled paving under warm sun and blue sky, soft shadow edge, patterned shirt and plain trousers,
//! camera noise. Shares with the detectors' models only that light is additive.

use ndarray::{Array2, Array3, ArrayView2};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::score::Truth;

#[derive(Clone, Debug)]
pub struct Pictures {
    pub frame: Array3<u8>,
    /// Without person, noise averaged out as by a background model.
    pub background: Array3<u8>,
}

/// Sun and sky per channel, relative to full sunlight.
const SUN: [f32; 3] = [0.62, 0.58, 0.50];
const SKY: [f32; 3] = [0.38, 0.42, 0.50];
/// Standard deviation in grey levels.
const NOISE_SD: f32 = 2.0;

/// Equal truth and seed give equal pictures.
#[must_use]
pub fn colour_in(truth: ArrayView2<'_, Truth>, seed: u64) -> Pictures {
    let (height, width) = truth.dim();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut garment = || -> [f32; 3] { std::array::from_fn(|_| rng.random_range(20.0..220.0)) };
    let (shirt, trousers) = (garment(), garment());
    let tint: [f32; 3] =
        std::array::from_fn(|channel| [1.0, 0.92, 0.82][channel] * rng.random_range(0.85..1.05));
    let speckle = smooth_noise(&mut rng, (height, width), 2);
    let weave = smooth_noise(&mut rng, (height, width), 2);
    let lit = soft_light(truth);
    let waist = waist_row(truth);
    let mut frame = Array3::zeros((height, width, 3));
    let mut background = Array3::zeros((height, width, 3));
    for row in 0..height {
        for column in 0..width {
            let slab = if (row / 24 + column / 40) % 2 == 0 { 8.0 } else { -8.0 };
            let ground = 150.0 + slab + 15.0 * speckle[[row, column]];
            for channel in 0..3 {
                let empty = tint[channel] * ground;
                let light = SUN[channel] * lit[[row, column]] + SKY[channel];
                let level = if truth[[row, column]] == Truth::Subject {
                    let cloth = if row < waist {
                        shirt[channel] * (1.0 + 0.15 * weave[[row, column]])
                    } else {
                        trousers[channel]
                    };
                    // One side of the body faces away from the sun.
                    cloth * (0.7 * SUN[channel] + SKY[channel])
                } else {
                    empty * light
                };
                let noise = NOISE_SD * gaussian(&mut rng);
                frame[[row, column, channel]] = (level + noise).round().clamp(0.0, 255.0) as u8;
                background[[row, column, channel]] = empty.round().clamp(0.0, 255.0) as u8;
            }
        }
    }
    Pictures { frame, background }
}

/// Share of sunlight per ground pixel, 0 to 1: three pixels of soft edge.
fn soft_light(truth: ArrayView2<'_, Truth>) -> Array2<f32> {
    let (height, width) = truth.dim();
    Array2::from_shape_fn((height, width), |(row, column)| {
        let (mut lit, mut all) = (0.0_f32, 0.0_f32);
        for r in row.saturating_sub(1)..(row + 2).min(height) {
            for c in column.saturating_sub(1)..(column + 2).min(width) {
                if truth[[r, c]] != Truth::Subject {
                    all += 1.0;
                    lit += f32::from(u8::from(truth[[r, c]] != Truth::Shadow));
                }
            }
        }
        if all > 0.0 { lit / all } else { 1.0 }
    })
}

fn waist_row(truth: ArrayView2<'_, Truth>) -> usize {
    let rows = truth.indexed_iter().filter(|&(_, &what)| what == Truth::Subject).map(|((row, _), _)| row);
    let (top, bottom) = rows.fold((usize::MAX, 0), |(top, bottom), row| (top.min(row), bottom.max(row)));
    if top == usize::MAX { 0 } else { (top + bottom) / 2 }
}

fn gaussian(rng: &mut ChaCha8Rng) -> f32 {
    (0..12).map(|_| rng.random::<f32>()).sum::<f32>() - 6.0
}

fn smooth_noise(rng: &mut ChaCha8Rng, (height, width): (usize, usize), grain_px: usize) -> Array2<f32> {
    let coarse = Array2::from_shape_fn((height / grain_px + 2, width / grain_px + 2), |_| gaussian(rng));
    Array2::from_shape_fn((height, width), |(row, column)| {
        let (r, c) = (row / grain_px, column / grain_px);
        let (y, x) =
            ((row % grain_px) as f32 / grain_px as f32, (column % grain_px) as f32 / grain_px as f32);
        let top = coarse[[r, c]] * (1.0 - x) + coarse[[r, c + 1]] * x;
        let bottom = coarse[[r + 1, c]] * (1.0 - x) + coarse[[r + 1, c + 1]] * x;
        top * (1.0 - y) + bottom * y
    })
}
