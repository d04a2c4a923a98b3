//! Small-region texture: in shadow the texture around a pixel stays and only its gain drops (Leone and
//! Distante, "Shadow detection for moving objects based on texture analysis", Pattern Recognition 40, 2007).
//!
//! For each darker foreground pixel, frame and background are projected on Gabor functions (two wavelengths,
//! four orientations, even and odd) and divided by their local mean. If the squared distance, averaged over a
//! small region and without the noise, is small relative to the background's squared length, the region is
//! shadow. Windows have the functions' Gaussian weight and include foreground pixels only, because a shadow's
//! edge is not texture. About 2600 multiplications per candidate.

use ndarray::{Array2, ArrayView2};

use super::images::{Images, intensity, window_means};
use farnear_silhouettes::mask::{Mask, bits::BitMask};

/// Intensity of a candidate relative to the background.
const DARKEST: f32 = 0.2;
const LIGHTEST: f32 = 0.95;
/// Largest distance relative to the background's length.
const DISTANCE: f32 = 0.7;
/// Background length without texture, relative to the local mean; such ground counts as equal.
const SMOOTH: f32 = 0.01;
/// Camera noise, standard deviation in grey levels (mean of three channels).
const NOISE_SD: f32 = 1.5;
const REGION_RADIUS_PX: usize = 3;
const RADIUS: usize = 4;
const SIDE: usize = 2 * RADIUS + 1;
const WAVELENGTHS_PX: [f32; 2] = [4.0, 8.0];
const ORIENTATIONS: usize = 4;
const FUNCTIONS: usize = WAVELENGTHS_PX.len() * ORIENTATIONS * 2;
const SD_PX: f32 = 2.0;

type Window = [[f32; SIDE]; SIDE];

pub(super) fn detect(images: &Images<'_>) -> Mask {
    let (frame, background) = (intensity(images.frame), intensity(images.background));
    let bank = gabor_bank();
    let candidates = images.foreground_where(|at| {
        let ratio = frame[at] / background[at].max(f32::MIN_POSITIVE);
        (DARKEST..=LIGHTEST).contains(&ratio)
    });
    // At a soft outline the gain varies; inner pixels decide.
    let inside = BitMask::pack(images.foreground).eroded(1).unpack();
    let mut squares = Array2::from_elem(images.size(), [0.0_f32; 3]);
    for (at, _) in candidates.indexed_iter().filter(|&(at, &set)| set && inside[at]) {
        let (shaded, shaded_mean) = project(&frame, inside.view(), at, &bank);
        let (lit, _) = project(&background, inside.view(), at, &bank);
        let apart: f32 = shaded.iter().zip(&lit).map(|(a, b)| (a - b).powi(2)).sum();
        let noise = (NOISE_SD / shaded_mean).powi(2) * bank.energy;
        squares[at] = [apart - noise, lit.iter().map(|value| value * value).sum(), 1.0];
    }
    let means = window_means(&squares, candidates.view(), REGION_RADIUS_PX);
    images.foreground_where(|at| {
        // The share of valid pixels is in all three and cancels.
        let [apart, length, speaking] = means[at];
        let limit = DISTANCE.powi(2) * length + SMOOTH.powi(2) * speaking;
        candidates[at] && speaking > 0.0 && apart <= limit
    })
}

/// Projections of the foreground pixels in the window, relative to their weighted mean; and that mean.
fn project(
    image: &Array2<f32>,
    foreground: ArrayView2<'_, bool>,
    (row, column): (usize, usize),
    bank: &Bank,
) -> ([f32; FUNCTIONS], f32) {
    let (height, width) = image.dim();
    let mut window: Window = [[0.0; SIDE]; SIDE];
    let mut counted = [[0.0_f32; SIDE]; SIDE];
    for y in RADIUS.saturating_sub(row)..SIDE.min(height + RADIUS - row) {
        for x in RADIUS.saturating_sub(column)..SIDE.min(width + RADIUS - column) {
            let at = [row + y - RADIUS, column + x - RADIUS];
            if foreground[at] {
                window[y][x] = image[at];
                counted[y][x] = 1.0;
            }
        }
    }
    let inner = |a: &Window, b: &Window| -> f32 {
        a.iter().zip(b).flat_map(|(a, b)| a.iter().zip(b)).map(|(a, b)| a * b).sum()
    };
    let mean = (inner(&window, &bank.mean) / inner(&counted, &bank.mean).max(f32::MIN_POSITIVE)).max(1.0);
    for (values, counted) in window.iter_mut().zip(&counted) {
        values.iter_mut().zip(counted).for_each(|(value, counted)| *value = (*value / mean - 1.0) * counted);
    }
    (std::array::from_fn(|index| inner(&window, &bank.functions[index])), mean)
}

struct Bank {
    /// Gaussian window, sum 1.
    mean: Window,
    /// Zero-mean Gabor functions, absolute sum 1.
    functions: [Window; FUNCTIONS],
    /// Sum of squares: the squared length of white noise with variance 1.
    energy: f32,
}

fn gabor_bank() -> Bank {
    let offsets = |y: usize, x: usize| (y as f32 - RADIUS as f32, x as f32 - RADIUS as f32);
    let build = |value: &dyn Fn(f32, f32) -> f32| -> Window {
        std::array::from_fn(|y| {
            std::array::from_fn(|x| {
                let (dy, dx) = offsets(y, x);
                value(dy, dx)
            })
        })
    };
    let sum = |window: &Window, of: &dyn Fn(f32) -> f32| {
        window.iter().flatten().map(|&value| of(value)).sum::<f32>()
    };
    let bell = |dy: f32, dx: f32| (-0.5 * (dy * dy + dx * dx) / (SD_PX * SD_PX)).exp();
    let raw = build(&bell);
    let total = sum(&raw, &|value| value);
    let mean = raw.map(|line| line.map(|value| value / total));
    let functions: [Window; FUNCTIONS] = std::array::from_fn(|index| {
        let angle = std::f32::consts::PI * (index % ORIENTATIONS) as f32 / ORIENTATIONS as f32;
        let wavelength = WAVELENGTHS_PX[index / ORIENTATIONS % WAVELENGTHS_PX.len()];
        let odd = index >= FUNCTIONS / 2;
        let wave = |dy: f32, dx: f32| {
            let phase = 2.0 * std::f32::consts::PI * (dx * angle.cos() + dy * angle.sin()) / wavelength;
            bell(dy, dx) * if odd { phase.sin() } else { phase.cos() }
        };
        let raw = build(&wave);
        let offset = sum(&raw, &|value| value);
        let zero_mean = build(&|dy, dx| wave(dy, dx) - offset * bell(dy, dx) / total);
        let size = sum(&zero_mean, &f32::abs);
        zero_mean.map(|line| line.map(|value| value / size))
    });
    let energy = functions.iter().map(|function| sum(function, &|value| value * value)).sum();
    Bank { mean, functions, energy }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    #[test]
    fn functions_have_no_mean_and_their_squares_sum_to_the_energy() {
        let bank = gabor_bank();
        let total =
            |window: &Window, of: fn(f32) -> f32| window.iter().flatten().map(|v| of(*v)).sum::<f32>();
        // Sums of 81 single-precision numbers.
        for function in &bank.functions {
            assert!(total(function, |v| v).abs() < 1e-5 && (total(function, f32::abs) - 1.0).abs() < 1e-5);
        }
        let squares: f32 = bank.functions.iter().map(|function| total(function, |v| v.powi(2))).sum();
        assert!((bank.energy - squares).abs() < 1e-5 * squares, "{} {squares}", bank.energy);
    }

    #[test]
    fn functions_ignore_constants_and_gain() {
        let bank = gabor_bank();
        let all = Array2::from_elem((20, 20), true);
        let (flat, _) = project(&Array2::from_elem((20, 20), 90.0), all.view(), (10, 10), &bank);
        assert!(flat.iter().all(|value| value.abs() < 1e-5), "{flat:?}");
        let texture =
            Array2::from_shape_fn((20, 20), |(row, column)| 60.0 + ((row * 7 + column * 13) % 11) as f32);
        let (lit, _) = project(&texture, all.view(), (9, 9), &bank);
        let (shaded, mean) = project(&texture.mapv(|level| 0.4 * level), all.view(), (9, 9), &bank);
        assert!((20.0..32.0).contains(&mean), "0.4 of about 65: {mean}");
        assert!(lit.iter().zip(shaded).all(|(a, b)| (a - b).abs() < 1e-5));
    }

    #[test]
    fn ignores_pixels_outside_the_foreground() {
        let bank = gabor_bank();
        let texture =
            Array2::from_shape_fn((20, 20), |(row, column)| 60.0 + ((row * 7 + column * 13) % 11) as f32);
        let mask = Array2::from_shape_fn((20, 20), |(row, _)| row < 11);
        let mut other = texture.clone();
        other.slice_mut(ndarray::s![11.., ..]).fill(250.0);
        assert_eq!(
            project(&texture, mask.view(), (9, 0), &bank),
            project(&other, mask.view(), (9, 0), &bank)
        );
    }

    #[test]
    fn orientations_respond_to_their_own_stripes() {
        let bank = gabor_bank();
        let stripes = Array2::from_shape_fn((30, 30), |(_, column)| {
            100.0 + 20.0 * (std::f32::consts::PI * 0.5 * column as f32).cos()
        });
        let all = Array2::from_elem((30, 30), true);
        let (answers, _) = project(&stripes, all.view(), (15, 16), &bank);
        let strongest = (0..FUNCTIONS).max_by(|&a, &b| answers[a].abs().total_cmp(&answers[b].abs()));
        // Wavelength 4, orientation 0, even.
        assert_eq!(strongest, Some(0));
    }

    #[test]
    fn the_same_texture_darker_is_shadow_and_another_is_not() {
        let level = |row: usize, column: usize, turned: bool| {
            let phase = if turned { row } else { column };
            if (phase / 2) % 2 == 0 { 170.0 } else { 110.0 }
        };
        let image = |gain: f32, turned: bool| {
            Array3::from_shape_fn((24, 24, 3), |(row, column, _)| (gain * level(row, column, turned)) as u8)
        };
        let mask = Array2::from_elem((24, 24), true);
        let background = image(1.0, false);
        for (gain, turned, share) in [(0.5, false, 1.0), (0.5, true, 0.0), (1.2, false, 0.0)] {
            let frame = image(gain, turned);
            let images = Images::new(frame.view(), background.view(), mask.view()).unwrap();
            let found = detect(&images);
            let found = found.iter().filter(|&&set| set).count() as f32 / 576.0;
            assert!((found - share).abs() < 0.02, "gain {gain}, turned {turned}: {found}");
        }
    }
}
