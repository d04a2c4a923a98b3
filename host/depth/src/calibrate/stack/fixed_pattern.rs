//! The camera's fixed pattern, or dust on the sensor: fine detail that the first and the last slice share. Of the target's
//! detail, which is blurred in both, the sharpest slice shares more with each of them than they do with each other.

use ndarray::Array2;

/// Least part of the sharpest slice's detail that both ends share.
const LEAST: f64 = 0.05;
/// Least detail that the ends share, relative to what each shares with the sharpest slice.
const UNBLURRED: f64 = 0.8;

/// The pattern's part of the finest detail of the sharpest slice; `None` below [`LEAST`], or if defocus blurs it.
pub(super) fn find(slices: &[Array2<f32>], sharpest: usize) -> Option<f64> {
    let [first, last, sharp] = [0, slices.len() - 1, sharpest].map(|index| laplacian(&slices[index]));
    let pattern = shared(&first, &last);
    let part = pattern / shared(&sharp, &sharp);
    let is_unblurred = [&first, &last].iter().all(|end| pattern > UNBLURRED * shared(&sharp, end));
    (part > LEAST && is_unblurred).then_some(part)
}

/// Relative to the slice's brightness.
fn laplacian(slice: &Array2<f32>) -> Array2<f32> {
    let (height, width) = slice.dim();
    let mean = slice.mean().unwrap_or(1.0);
    Array2::from_shape_fn((height - 2, width - 2), |(y, x)| {
        let around = slice[(y, x + 1)] + slice[(y + 2, x + 1)] + slice[(y + 1, x)] + slice[(y + 1, x + 2)];
        (around - 4.0 * slice[(y + 1, x + 1)]) / mean
    })
}

fn shared(one: &Array2<f32>, other: &Array2<f32>) -> f64 {
    one.iter().zip(other).map(|(one, other)| f64::from(one * other)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prepare::band::box_mean;

    /// Seven slices of a noisy texture whose blur grows with the distance from the middle one, behind a sensor whose pixels
    /// respond by up to `pattern` more or less than others.
    fn stack(pattern: f32) -> Vec<Array2<f32>> {
        let uniform = |seed: usize| {
            Array2::from_shape_fn((96, 128), |(y, x)| {
                let mixed = (((y * 128 + x) << 8) + seed).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                (mixed >> 40) as f32 / (1 << 24) as f32 - 0.5
            })
        };
        let (texture, response) = (uniform(1), uniform(2));
        let slice = |index: usize| {
            let blurred = box_mean(texture.view(), 1 + 2 * index.abs_diff(3));
            let light = blurred * 0.3 + 0.5;
            light * (&response * pattern + 1.0) + uniform(10 + index) * 0.01
        };
        (0..7).map(slice).collect()
    }

    #[test]
    fn a_pattern_is_what_does_not_blur() {
        assert_eq!(find(&stack(0.0), 3), None);
        let part = find(&stack(0.2), 3).unwrap();
        // Variances relative to the light: 0.2^2 of 0.2^2 + 0.6^2 + 0.02^2.
        assert!((part - 0.1).abs() < 0.02, "{part}");
        assert_eq!(find(&stack(0.02), 3), None);
    }

    /// Ends that are hardly defocused share much of the target's detail, and the sharpest slice more.
    #[test]
    fn a_short_stack_has_no_pattern() {
        let sharp = stack(0.0).swap_remove(3);
        let end = sharp.mapv(|value| 0.25 + 0.5 * value);
        assert_eq!(find(&[end.clone(), sharp, end], 1), None);
    }
}
