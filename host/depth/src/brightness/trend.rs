//! Vignetting that changes with the focus: over a stack, each place becomes steadily brighter or darker. Sharpness grows with
//! brightness, so that depth is drawn to the brighter end.

use nalgebra::{DMatrix, DVector};
use ndarray::{Array2, Zip};

use super::BLOCKS;

/// Fewest bright blocks.
const FEWEST: usize = BLOCKS * BLOCKS / 2;
/// Least part of the blocks' changes (sum of squares) that the trend is. Rendered stacks had 0.9 to 1 with vignetting of 13 %, at most
/// 0.1 without, bright objects that blur 0.5, and slices of a confocal microscope 0.6.
const EXPLAINED: f64 = 0.85;
/// Change of brightness over the stack, as a logarithm, from which it counts and from which it is of the scene.
const LEAST: f64 = 0.01;
const MOST: f64 = 0.5;

/// The logarithm of brightness at a place grows in proportion to the position, by a polynomial of the place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trend {
    /// Largest change over the stack, as a logarithm.
    pub change: f64,
    coefficients: [f64; 6],
    middle: f64,
    length: f64,
}

impl Trend {
    /// From the blocks of images ([`super::of_blocks`]) of even brightness and their positions, rising or falling. `None` where the
    /// blocks follow no trend.
    pub fn of(images: &[Vec<f64>], positions: &[f64]) -> Option<Self> {
        let length = positions.last()? - positions.first()?;
        let middle = positions.iter().sum::<f64>() / positions.len() as f64;
        let times: Vec<f64> = positions.iter().map(|position| (position - middle) / length).collect();
        let bright = |block: &usize| images.iter().all(|image| image[*block] > 0.0);
        let seen: Vec<usize> = (0..BLOCKS * BLOCKS).filter(bright).collect();
        if seen.len() < FEWEST {
            return None;
        }
        let of_times: f64 = times.iter().map(|time| time * time).sum();
        let (mut all, mut slopes) = (0.0, DVector::zeros(seen.len()));
        for (block, slope) in seen.iter().zip(slopes.iter_mut()) {
            let logs: Vec<f64> = images.iter().map(|image| image[*block].ln()).collect();
            let mean = logs.iter().sum::<f64>() / logs.len() as f64;
            all += logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>();
            *slope = logs.iter().zip(&times).map(|(log, time)| log * time).sum::<f64>() / of_times;
        }
        let centre = |block: usize| [block % BLOCKS, block / BLOCKS].map(|at| place(at, BLOCKS));
        let matrix = DMatrix::from_fn(seen.len(), 6, |row, term| terms(centre(seen[row]))[term]);
        let found = matrix.clone().svd(true, true).solve(&slopes, 1e-12).ok()?;
        let smooth = matrix * &found;
        let change = smooth.amax();
        let counts = of_times * smooth.norm_squared() > EXPLAINED * all && (LEAST..MOST).contains(&change);
        let coefficients = std::array::from_fn(|term| found[term]);
        counts.then_some(Self { change, coefficients, middle, length })
    }

    /// Divides the trend out of an image at a position.
    pub fn divide(&self, image: &mut Array2<f32>, position: f64) {
        let time = (position - self.middle) / self.length;
        let (height, width) = image.dim();
        Zip::indexed(image).par_for_each(|(row, column), value| {
            let terms = terms([place(column, width), place(row, height)]);
            let log: f64 = terms.iter().zip(&self.coefficients).map(|(term, by)| term * by).sum();
            *value *= (-time * log).exp() as f32;
        });
    }
}

/// The centre of one of `size` parts of a side, which reaches from -1 to 1.
fn place(at: usize, size: usize) -> f64 {
    (2 * at + 1) as f64 / size as f64 - 1.0
}

fn terms([x, y]: [f64; 2]) -> [f64; 6] {
    [1.0, x, y, x * x, x * y, y * y]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brightness::of_blocks;

    const POSITIONS: [f64; 5] = [-1.0, -1.5, -2.0, -3.0, -4.0];

    /// Images of a scene whose brightness at the time from 0 to 1 and the place from -1 to 1 has this factor.
    fn stack(factor: impl Fn(f64, [f64; 2]) -> f64) -> Vec<Array2<f32>> {
        let image = |position: &f64| {
            Array2::from_shape_fn((60, 90), |(y, x)| {
                let scene = 0.3 + 0.002 * y as f64 + 0.1 * ((x * 7 + y * 13) % 29) as f64 / 29.0;
                (scene * factor((-1.0 - position) / 3.0, [place(x, 90), place(y, 60)])) as f32
            })
        };
        POSITIONS.iter().map(image).collect()
    }

    fn trend(images: &[Array2<f32>]) -> Option<Trend> {
        let blocks: Vec<Vec<f64>> = images.iter().map(|image| of_blocks(image.view())).collect();
        Trend::of(&blocks, &POSITIONS)
    }

    #[test]
    fn vignetting_that_grows_with_the_focus_is_divided_out() {
        let still = stack(|_, _| 1.0);
        let mut images = stack(|time, [x, y]| 1.0 - 0.13 * time * (x * x + y * y) / 2.0);
        let found = trend(&images).unwrap();
        assert!((0.08..0.14).contains(&found.change), "{found:?}");
        images.iter_mut().zip(POSITIONS).for_each(|(image, position)| found.divide(image, position));
        let ratio = |at: (usize, usize)| {
            let of = |index: usize| images[index][at] / still[index][at];
            of(4) / of(0)
        };
        // In the corner, where it was 0.87, and in the middle.
        assert!((ratio((0, 0)) - 1.0).abs() < 0.015 && (ratio((30, 45)) - 1.0).abs() < 0.015);
    }

    #[test]
    fn other_changes_are_of_the_scene() {
        assert_eq!(trend(&stack(|_, _| 1.0)), None);
        // An optical section that moves over a slope, a lamp on one part, one image, a place that becomes far brighter.
        assert_eq!(trend(&stack(|time, [x, _]| (-2.0 * (2.0 * time - 1.0 - x).powi(2)).exp())), None);
        assert_eq!(trend(&stack(|time, [x, _]| if x.abs() < 0.3 { 1.0 + 0.2 * time } else { 1.0 })), None);
        let is_one = |time: f64| (0.2..0.5).contains(&time);
        assert_eq!(trend(&stack(|time, [x, _]| if is_one(time) { 1.0 + 0.1 * x } else { 1.0 })), None);
        assert_eq!(trend(&stack(|time, [x, _]| (2.0 * time * x).exp())), None);
        assert_eq!(trend(&stack(|_, _| 0.0)), None);
    }
}
