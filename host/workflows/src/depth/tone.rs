//! Finds images whose values are not linear in light.
//!
//! Blur keeps the mean of light around a place. Of the values `v = light^(1/g)` behind a tone curve it is lower where the image is
//! sharper, by `(g - 1) / 2` times the difference of the variance over `v`. Differences between neighbouring windows cancel a gain
//! that varies slowly, and a term in `1 / v` another black level.

use std::f64::consts::PI;

use farnear_depth::{
    optics::Optics,
    prepare::{PrepareSettings, prepare},
};
use ndarray::{Array2, s};

/// Side of a window, px. Its weights fall to 0 at the border, because light that blur moves across it looks like a tone curve.
const SIDE_PX: usize = 48;
/// Windows along the shorter side of large images, about.
const WINDOWS: usize = 48;
const LEAST_COMPARED: usize = 40;
/// Brightness relative to the brightest window below which noise decides.
const DARK: f64 = 0.05;
/// Least exponent that is reported. Photographs blurred by another program had 0.97 to 1.03, in sRGB 2.1 to 2.4. Slopes with coarse
/// texture had up to 1.4, because light moves between windows, and cloth after edge-aware demosaicing up to 1.8.
const CURVED: f64 = 1.8;
/// Least distance from 1 in standard errors.
const SIGNIFICANT: f64 = 5.0;

/// A doubt about an aligned pair that is not linear in light. Windows with a pixel without a value (NaN) do not count.
pub fn doubt(far: &Array2<f32>, near: &Array2<f32>) -> Option<String> {
    let (exponent, error) = exponent(far, near)?;
    (exponent > CURVED && exponent - 1.0 > SIGNIFICANT * error).then(|| {
        format!(
            "the images are not linear in light: their brightness changes with the blur as behind a tone curve (exponent about \
             {exponent:.1}; linear images have 1, sRGB images such as a camera's JPEG 2.2). Depth then depends on the texture and the \
             light, by more than its standard deviation: take images without a tone curve (raw), or undo it in all images first"
        )
    })
}

/// [`doubt`] about two slices of a stack.
pub fn doubt_of_slices(far: &Array2<f32>, near: &Array2<f32>, optics: &Optics) -> Option<String> {
    // Integers are relative to their white level, float images of any scale have none.
    let has_white = far.iter().chain(near).all(|value| *value <= 1.0);
    let limits = has_white.then_some([0.0, 1.0]);
    let settings = PrepareSettings { trust: true, limits, ..PrepareSettings::default() };
    let pair = prepare([far.clone(), near.clone()], optics, None, &settings).ok()?;
    doubt(&pair.far, &pair.near)
}

#[derive(Clone, Copy)]
struct Window {
    mean: f64,
    /// Of the mean, far minus near.
    difference: f64,
    /// Of the variance, far minus near.
    variance: f64,
}

/// Exponent of the tone curve, and its standard error; not a number for images without contrast.
fn exponent(far: &Array2<f32>, near: &Array2<f32>) -> Option<(f64, f64)> {
    let (height, width) = far.dim();
    let step = (SIDE_PX / 2).max(height.min(width) / WINDOWS);
    let count = |side: usize| (side + step).saturating_sub(SIDE_PX) / step;
    let side = SIDE_PX as f64;
    let weights: Vec<f64> =
        (0..SIDE_PX).map(|at| (PI * (at as f64 + 0.5) / side).sin().powi(2) * 2.0 / side).collect();
    let moments = |image: &Array2<f32>, top: usize, left: usize| {
        let mut sums = [0.0; 2];
        let window = image.slice(s![top..top + SIDE_PX, left..left + SIDE_PX]);
        for (row, of_row) in window.rows().into_iter().zip(&weights) {
            let mut across = [0.0; 2];
            for (value, weight) in row.iter().zip(&weights) {
                let value = f64::from(*value);
                across[0] += weight * value;
                across[1] += weight * value * value;
            }
            sums = [sums[0] + of_row * across[0], sums[1] + of_row * across[1]];
        }
        [sums[0], sums[1] - sums[0] * sums[0]]
    };
    let windows = Array2::from_shape_fn((count(height), count(width)), |(y, x)| {
        let [far, near] = [far, near].map(|image| moments(image, y * step, x * step));
        Window { mean: 0.5 * (far[0] + near[0]), difference: far[0] - near[0], variance: far[1] - near[1] }
    });
    let brightest = windows.iter().map(|window| window.mean).fold(0.0, f64::max);
    let is_bright = |window: &Window| window.mean > DARK * brightest;
    let (mut compared, [mut pp, mut pq, mut qq, mut py, mut qy, mut yy]) = (0, [0.0; 6]);
    for pair in windows.windows((2, 1)).into_iter().chain(windows.windows((1, 2))) {
        let (one, other) = (pair[(0, 0)], pair[(pair.nrows() - 1, pair.ncols() - 1)]);
        if !is_bright(&one) || !is_bright(&other) {
            continue;
        }
        let weight = one.mean.min(other.mean);
        let differs = |of: fn(&Window) -> f64| weight * (of(&one) - of(&other));
        let p = differs(|window| window.mean.recip());
        let q = differs(|window| window.variance / window.mean.powi(2));
        let y = differs(|window| window.difference / window.mean);
        (pp, pq, qq) = (pp + p * p, pq + p * q, qq + q * q);
        (py, qy, yy) = (py + p * y, qy + q * y, yy + y * y);
        compared += 1;
    }
    if compared < LEAST_COMPARED {
        return None;
    }
    let determinant = pp * qq - pq * pq;
    let [black, slope] = [(qq * py - pq * qy) / determinant, (pp * qy - pq * py) / determinant];
    // Each window takes part in four differences.
    let residual = (yy - black * py - slope * qy) / (0.5 * compared as f64 - 2.0);
    Some((1.0 - 2.0 * slope, 2.0 * (residual * pp / determinant).sqrt()))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Grain whose contrast differs between patches: its mean over 3 x 3 px and over 5 x 5 px.
    pub(in crate::depth) fn pair(exponent: f64) -> [Array2<f32>; 2] {
        let light = |y: usize, x: usize| {
            let grain = ((y * 7919 + x * 104_729) ^ (x * y * 31)) % 997;
            let contrast = 0.2 + 0.2 * ((y / 40 + x / 40) % 4) as f64;
            0.3 * (1.0 + contrast * (grain as f64 / 997.0 - 0.5))
        };
        [3, 5].map(|side: usize| {
            let edge = (5 - side) / 2;
            Array2::from_shape_fn((240, 320), |(y, x)| {
                let around = (0..side * side).map(|i| light(y + edge + i / side, x + edge + i % side));
                (around.sum::<f64>() / (side * side) as f64).powf(exponent.recip()) as f32
            })
        })
    }

    #[test]
    fn a_tone_curve_is_doubted_and_another_gain_and_black_level_are_not() {
        for (truth, is_doubted) in [(1.0, false), (1.5, false), (2.2, true)] {
            let [far, near] = pair(truth);
            let found = exponent(&far, &near).unwrap().0;
            assert!((found - truth).abs() < 0.05, "{truth}: {found}");
            for [far, near] in [[&far, &near], [&near, &far]] {
                let doubt = doubt(&far.mapv(|value| 0.9 * value + 0.03), near);
                assert_eq!(doubt.is_some(), is_doubted, "{truth}: {doubt:?}");
            }
        }
    }

    #[test]
    fn slices_behind_a_tone_curve_are_doubted() {
        let optics: Optics = toml::from_str(include_str!("../../../../examples/rig.toml")).unwrap();
        for (truth, is_doubted) in [(1.0, false), (2.2, true)] {
            let [far, near] = pair(truth);
            assert_eq!(doubt_of_slices(&far, &near, &optics).is_some(), is_doubted, "{truth}");
        }
    }

    #[test]
    fn images_without_contrast_or_of_few_windows_have_no_doubt() {
        let flat = Array2::from_elem((240, 320), 0.5);
        assert_eq!(doubt(&flat, &flat), None);
        let [far, near] = pair(2.2).map(|image| image.slice(s![..90, ..90]).to_owned());
        assert_eq!(doubt(&far, &near), None);
    }
}
