//! Flicker of lamp or exposure: the brightness of whole frames of a stack. Defocus keeps the mean of a region, so a factor
//! that is common to all blocks of a frame is not of the scene. Sharpness grows with it, and a bright frame attracts depths.

mod trend;

use std::borrow::Cow;
use std::ops::Range;

use ndarray::{Array2, ArrayView2, s};

pub use trend::Trend;

const BLOCKS: usize = 6;
/// Least deviation from 1 of a factor that counts, and in multiples of its median deviation among the blocks.
const LEAST: f64 = 0.01;
const SIGNIFICANT: f64 = 3.0;
/// Largest deviation that counts, as part of the factor: the blocks must agree to a sixth, however large it is.
const COUNTED: f64 = 0.5;
/// Least factor: evened out, a darker frame would cost more by its noise than its absence does.
const DARKEST: f64 = 0.1;

/// Rows and columns of the 6x6 blocks of an image of (height, width).
pub fn blocks((height, width): (usize, usize)) -> impl Iterator<Item = [Range<usize>; 2]> {
    let edges = |size: usize, block: usize| size * block / BLOCKS..size * (block + 1) / BLOCKS;
    (0..BLOCKS * BLOCKS).map(move |block| [edges(height, block / BLOCKS), edges(width, block % BLOCKS)])
}

/// Mean of each of the [`blocks`] of a frame, without pixels that are not finite.
pub fn of_blocks(image: ArrayView2<f32>) -> Vec<f64> {
    blocks(image.dim()).map(|[rows, columns]| mean(image.slice(s![rows, columns]))).collect()
}

/// Without pixels that are not finite; 0 if none is.
pub(crate) fn mean(image: ArrayView2<f32>) -> f64 {
    let seen = || image.iter().filter(|value| value.is_finite());
    seen().map(|value| f64::from(*value)).sum::<f64>() / seen().count().max(1) as f64
}

/// Brightness of each frame, from its blocks ([`of_blocks`]), relative to the usual one of the `members`; 1 where its blocks
/// do not agree on another of at least 0.1.
pub fn gains(frames: &[Vec<f64>], members: &[usize]) -> Vec<f64> {
    let usual: Vec<f64> = (0..BLOCKS * BLOCKS)
        .map(|block| median(members.iter().map(|frame| frames[*frame][block]).collect()))
        .collect();
    let gain = |means: &Vec<f64>| {
        let ratios: Vec<f64> = means
            .iter()
            .zip(&usual)
            .filter(|(_, usual)| **usual > 0.0)
            .map(|(own, usual)| own / usual)
            .collect();
        let gain = median(ratios.clone());
        let spread = median(ratios.iter().map(|ratio| (ratio - gain).abs()).collect());
        let counts = (gain - 1.0).abs().min(COUNTED * gain) > LEAST.max(SIGNIFICANT * spread);
        if counts && gain >= DARKEST { gain } else { 1.0 }
    };
    frames.iter().map(gain).collect()
}

/// The frames divided by their [`gains`]; borrowed if all are 1.
pub fn evened(frames: &[Array2<f32>]) -> Cow<'_, [Array2<f32>]> {
    let blocks: Vec<Vec<f64>> = frames.iter().map(|frame| of_blocks(frame.view())).collect();
    let gains = gains(&blocks, &(0..frames.len()).collect::<Vec<_>>());
    if gains.iter().all(|gain| *gain == 1.0) {
        return frames.into();
    }
    frames.iter().zip(gains).map(|(frame, gain)| frame / gain as f32).collect::<Vec<_>>().into()
}

fn median(values: Vec<f64>) -> f64 {
    crate::median::median(values, f64::total_cmp).unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    fn gains_of(factors: &[f64], slope: f64) -> Vec<f64> {
        let frames: Vec<Vec<f64>> = factors
            .iter()
            .enumerate()
            .map(|(number, factor)| {
                of_blocks(
                    Array2::from_shape_fn((60, 90), |(y, x)| {
                        let tilt = 1.0 + slope * (number as f64 - 2.0) * (x as f64 - 44.5) / 44.5;
                        (factor * tilt * (0.3 + 0.002 * y as f64)) as f32
                    })
                    .view(),
                )
            })
            .collect();
        gains(&frames, &[0, 1, 2, 3, 4])
    }

    #[test]
    fn a_factor_of_the_whole_frame_is_found() {
        for factors in [[1.0, 1.3, 1.0, 0.8, 1.0], [1.0, 0.2, 1.0, 5.0, 2.2], [0.2, 0.5, 1.0, 2.5, 6.0]] {
            for (found, expected) in gains_of(&factors, 0.0).iter().zip(factors) {
                assert!((found - expected).abs() < 1e-5, "{found} {expected}");
            }
        }
    }

    /// Slices of a microscope that sees one plane, noise, and frames that are all but dark.
    #[test]
    fn other_changes_are_of_the_scene() {
        assert_eq!(gains_of(&[1.0, 1.05, 1.0, 1.1, 1.0], 0.3), [1.0; 5]);
        assert_eq!(gains_of(&[1.0, 1.005, 1.0, 0.995, 1.0], 0.0), [1.0; 5]);
        assert_eq!(gains_of(&[1.0, 1.0, 1.0, 1.0, 3.0], 0.3), [1.0; 5]);
        assert_eq!(gains_of(&[1.0, 1.0, 1.0, 1.0, 0.2], 0.3), [1.0; 5]);
        assert_eq!(gains_of(&[1.0, 0.05, 1.0, 0.0, 1.0], 0.0), [1.0; 5]);
    }
}
