//! Depth from focus of a flat target: the slice of most detail per block, and the plane through all blocks. Detail is
//! the energy of a Laplacian. Its scale and the size of the blocks are those with the least standard error of the plane:
//! fine ones are the sharpest measure of focus, coarse ones remain where noise hides fine detail. Energy grows with the square
//! of brightness, so that vignetting which changes with focus would move the plane: it is relative to the block's brightness.

use nalgebra::{DMatrix, DVector};
use ndarray::{Array2, Zip, s};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::StackError;
use crate::border::reflect;
use crate::brightness::mean;
use crate::median::deviation;
use crate::optics::binned_place;
use crate::prepare::band::binomial;

/// Side of the smallest block in parts of the shorter side.
const BLOCKS: usize = 24;
/// Sides of larger blocks in smallest ones.
const MERGED: [usize; 3] = [1, 2, 4];
/// Binomial blurs before the Laplacian, each of variance 1 px^2.
const BLURS: [usize; 3] = [1, 4, 12];
/// Fewest blocks of a plane.
const FEWEST: usize = 12;
/// Least ratio of a block's largest to its least energy for a peak.
const PEAK: f64 = 1.3;
/// Least height of a peak in standard deviations of the curve's noise. Curves of few slices, whose peak is sharp, have
/// large second differences without noise.
const ABOVE_NOISE: f64 = 10.0;

/// Brightness of a block relative to the other slices that vignetting and the lamp explain.
const VIGNETTING: [f64; 2] = [0.5, 2.0];

/// The slice in focus, from 0, at column x and row y: `x_per_px x + y_per_px y + at_origin`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FocusPlane {
    /// Slices per column.
    pub x_per_px: f64,
    /// Slices per row.
    pub y_per_px: f64,
    /// At column 0, row 0.
    pub at_origin: f64,
    /// Robust spread of the blocks around the plane, slices.
    pub spread: f64,
    /// Number of blocks with a peak.
    pub blocks: usize,
}

impl FocusPlane {
    /// The slice in focus at a pixel.
    pub fn at(&self, y: f64, x: f64) -> f64 {
        self.x_per_px * x + self.y_per_px * y + self.at_origin
    }

    /// The plane for images binned by `bin` x `bin`.
    pub fn binned(&self, bin: usize) -> Self {
        let b = bin as f64;
        let first = binned_place(0.0, b.recip());
        let at_origin = self.at(first, first);
        Self { x_per_px: self.x_per_px * b, y_per_px: self.y_per_px * b, at_origin, ..*self }
    }
}

/// The slices of a stack with the brightness of their blocks.
pub(super) struct Slices<'a> {
    slices: &'a [Array2<f32>],
    side: usize,
    brightness: Vec<Array2<f64>>,
}

impl<'a> Slices<'a> {
    pub fn new(slices: &'a [Array2<f32>]) -> Self {
        let (height, width) = slices[0].dim();
        let side = (height.min(width) / BLOCKS).clamp(12, 64);
        Self { slices, side, brightness: brightness(slices, side) }
    }

    pub fn dim(&self) -> (usize, usize) {
        self.slices[0].dim()
    }

    /// The plane of focus. Fails if too few blocks have a peak inside the stack, and when `proceed` returns false.
    pub fn plane(&self, proceed: &(dyn Fn() -> bool + Sync)) -> Result<FocusPlane, StackError> {
        self.plane_of(Array2::clone, &BLURS, proceed)
    }

    /// As [`plane`](Self::plane), of the differences of pixels `apart` (down, right): mostly of texture that changes in this
    /// direction.
    pub fn plane_along(
        &self,
        apart: [isize; 2],
        proceed: &(dyn Fn() -> bool + Sync),
    ) -> Result<FocusPlane, StackError> {
        self.plane_of(|slice| difference(slice, apart), &BLURS[..2], proceed)
    }

    /// Of the `detail` of slices, after each number of blurs in `scales`.
    fn plane_of(
        &self,
        detail: impl Fn(&Array2<f32>) -> Array2<f32> + Sync,
        scales: &[usize],
        proceed: &(dyn Fn() -> bool + Sync),
    ) -> Result<FocusPlane, StackError> {
        let of_slice = |(slice, brightness): (&Array2<f32>, &Array2<f64>)| {
            let (mut smooth, mut passes) = (detail(slice), 0);
            let mut of_scale = |blurs: &usize| {
                while passes < *blurs {
                    smooth = proceed().then(|| binomial(smooth.view()))?;
                    passes += 1;
                }
                Some(laplacian_energy(&smooth, self.side) / (brightness * brightness))
            };
            scales.iter().map(&mut of_scale).collect::<Option<Vec<Array2<f64>>>>()
        };
        let energies = self.slices.par_iter().zip(&self.brightness).map(of_slice);
        let energies: Vec<Vec<Array2<f64>>> = energies.collect::<Option<_>>().ok_or(StackError::Stopped)?;
        let mut best: Option<(f64, FocusPlane)> = None;
        let (mut most, mut of_most) = (0, 0);
        for scale in 0..scales.len() {
            let energies: Vec<&Array2<f64>> = energies.iter().map(|of_slice| &of_slice[scale]).collect();
            for merged in MERGED {
                let points = peaks(&energies, merged, self.side);
                let all = (energies[0].nrows() / merged) * (energies[0].ncols() / merged);
                if points.len() > most {
                    (most, of_most) = (points.len(), all);
                }
                if points.len() < FEWEST.max(all / 20) {
                    continue;
                }
                let found = fit(&points);
                let error = found.spread / (points.len() as f64).sqrt();
                if best.is_none_or(|(least, _)| error < least) {
                    best = Some((error, found));
                }
            }
        }
        best.map(|(_, found)| found).ok_or(StackError::NoFocus { blocks: most, of: of_most })
    }
}

/// Column, row and slice of the blocks with a peak; a block is `merged` x `merged` of the energies' blocks.
fn peaks(energies: &[&Array2<f64>], merged: usize, side: usize) -> Vec<[f64; 3]> {
    let (rows, columns) = energies[0].dim();
    let mut points = Vec::new();
    for y in 0..rows / merged {
        for x in 0..columns / merged {
            let part = s![y * merged..(y + 1) * merged, x * merged..(x + 1) * merged];
            let curve: Vec<f64> = energies.iter().map(|energy| energy.slice(part).sum()).collect();
            if let Some(peak) = peak(&curve) {
                let centre = |i: usize| (i * merged * side) as f64 + (merged * side - 1) as f64 / 2.0;
                points.push([centre(x), centre(y), peak]);
            }
        }
    }
    points
}

/// Maximum of a parabola through the logarithms of the peak's upper half; `None` at the stack's ends or within noise.
fn peak(curve: &[f64]) -> Option<f64> {
    let floor = curve.iter().copied().fold(f64::INFINITY, f64::min);
    let (top, most) = curve.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
    // Second differences of independent noise have six times its variance.
    let mut bends: Vec<f64> = curve.windows(3).map(|v| (v[0] - 2.0 * v[1] + v[2]).abs()).collect();
    bends.sort_by(f64::total_cmp);
    let noise = 1.4826 * bends.get(bends.len() / 2)? / 6.0_f64.sqrt();
    let high = most > PEAK * floor && most - floor > ABOVE_NOISE * noise;
    if !high || top == 0 || top + 1 == curve.len() {
        return None;
    }
    let upper = |i: &usize| curve[*i] > 0.5 * (floor + most);
    let below = (0..top).rev().take_while(upper).count();
    let above = (top + 1..curve.len()).take_while(upper).count();
    let reach = below.min(above).max(2).min(top).min(curve.len() - 1 - top);
    let points: Vec<(f64, f64)> = (top - reach..=top + reach)
        .map(|i| (i as f64 - top as f64, (curve[i] - 0.9 * floor).max(1e-30).ln()))
        .collect();
    let matrix = DMatrix::from_fn(points.len(), 3, |i, j| points[i].0.powi(j as i32));
    let right = DVector::from_fn(points.len(), |i, _| points[i].1);
    let c = matrix.svd(true, true).solve(&right, 1e-12).ok()?;
    let place = -c[1] / (2.0 * c[2]);
    (c[2] < 0.0 && place.abs() <= 0.5 * reach as f64).then_some(top as f64 + place)
}

/// Least squares with Tukey's weights.
fn fit(points: &[[f64; 3]]) -> FocusPlane {
    let mut weights = vec![1.0; points.len()];
    let mut found = [0.0; 3];
    let mut spread = f64::INFINITY;
    for _ in 0..12 {
        let row = |i: usize| [points[i][0], points[i][1], 1.0];
        let mut normal = DMatrix::zeros(3, 3);
        let mut right = DVector::zeros(3);
        for (i, weight) in weights.iter().enumerate() {
            for (a, va) in row(i).iter().enumerate() {
                right[a] += weight * va * points[i][2];
                for (b, vb) in row(i).iter().enumerate() {
                    normal[(a, b)] += weight * va * vb;
                }
            }
        }
        let Ok(c) = normal.svd(true, true).solve(&right, 1e-12) else { break };
        found = [c[0], c[1], c[2]];
        let errors: Vec<f64> =
            points.iter().map(|[x, y, z]| z - found[0] * x - found[1] * y - found[2]).collect();
        spread = deviation(errors.iter().copied()).unwrap_or(0.0);
        let limit = (4.0 * spread).max(1e-6);
        weights = errors.iter().map(|e| (1.0 - (e / limit).powi(2)).max(0.0).powi(2)).collect();
    }
    FocusPlane { x_per_px: found[0], y_per_px: found[1], at_origin: found[2], spread, blocks: points.len() }
}

/// The square in the middle of an image.
pub(super) fn middle(image: &Array2<f32>) -> Array2<f32> {
    let (height, width) = image.dim();
    let side = height.min(width);
    let (top, left) = ((height - side) / 2, (width - side) / 2);
    image.slice(s![top..top + side, left..left + side]).to_owned()
}

/// Each pixel's difference to the one `apart` (down, right) from it.
fn difference(image: &Array2<f32>, [down, right]: [isize; 2]) -> Array2<f32> {
    let (height, width) = image.dim();
    Array2::from_shape_fn((height, width), |(y, x)| {
        let other = (reflect(y as isize + down, height), reflect(x as isize + right, width));
        image[other] - image[(y, x)]
    })
}

/// Mean of the blocks of each slice, relative to its mean over the slices and within [`VIGNETTING`]; 1 without light.
fn brightness(slices: &[Array2<f32>], side: usize) -> Vec<Array2<f64>> {
    let of_blocks =
        |slice: &Array2<f32>| Zip::from(slice.exact_chunks((side, side))).map_collect(|block| mean(block));
    let means: Vec<Array2<f64>> = slices.par_iter().map(of_blocks).collect();
    let sum = means.iter().fold(Array2::<f64>::zeros(means[0].dim()), |sum, means| sum + means);
    let usual = sum / slices.len() as f64;
    let relative = |own: f64, usual: f64| {
        let relative = own / usual;
        if relative > 0.0 { relative.clamp(VIGNETTING[0], VIGNETTING[1]) } else { 1.0 }
    };
    means
        .iter()
        .map(|means| Zip::from(means).and(&usual).map_collect(|own, usual| relative(*own, *usual)))
        .collect()
}

/// Sum of squares over blocks of the Laplacian.
fn laplacian_energy(image: &Array2<f32>, side: usize) -> Array2<f64> {
    let (height, width) = image.dim();
    Array2::from_shape_fn((height / side, width / side), |(by, bx)| {
        let mut sum = 0.0;
        for y in (by * side).max(1)..((by + 1) * side).min(height - 1) {
            for x in (bx * side).max(1)..((bx + 1) * side).min(width - 1) {
                let around = image[(y - 1, x)] + image[(y + 1, x)] + image[(y, x - 1)] + image[(y, x + 1)];
                sum += f64::from(around - 4.0 * image[(y, x)]).powi(2);
            }
        }
        sum
    })
}
