//! Depth from focus of a flat target: the slice of most detail per block, and the plane through all blocks.

use nalgebra::{DMatrix, DVector};
use ndarray::{Array2, s};
use serde::{Deserialize, Serialize};

/// Side of a block in parts of the shorter side.
const BLOCKS: usize = 24;
/// Least ratio of a block's largest to its least energy for a peak.
const PEAK: f64 = 1.3;

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
        let at_origin = self.at((b - 1.0) / 2.0, (b - 1.0) / 2.0);
        Self { x_per_px: self.x_per_px * b, y_per_px: self.y_per_px * b, at_origin, ..*self }
    }

    /// Finds the plane. Returns a message if too few blocks have a peak inside the stack.
    pub fn of(slices: &[Array2<f32>]) -> Result<Self, String> {
        let (height, width) = slices[0].dim();
        let side = (height.min(width) / BLOCKS).clamp(12, 64);
        let energies: Vec<Array2<f64>> = slices.iter().map(|slice| laplacian_energy(slice, side)).collect();
        let mut points = Vec::new();
        for (block, _) in energies[0].indexed_iter() {
            let curve: Vec<f64> = energies.iter().map(|energy| energy[block]).collect();
            if let Some(peak) = peak(&curve) {
                let centre = |i: usize| (i * side) as f64 + (side - 1) as f64 / 2.0;
                points.push([centre(block.1), centre(block.0), peak]);
            }
        }
        let all = energies[0].len();
        if points.len() < 12.max(all / 20) {
            return Err(format!(
                "{} of {all} blocks are sharpest inside the stack: the target must be textured, and the stack must go through its focus",
                points.len()
            ));
        }
        Ok(fit(&points))
    }
}

/// Maximum of a parabola through the logarithms around it; `None` at the ends of the stack.
fn peak(curve: &[f64]) -> Option<f64> {
    let floor = curve.iter().copied().fold(f64::INFINITY, f64::min);
    let (top, most) = curve.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
    if most.partial_cmp(&(PEAK * floor)) != Some(std::cmp::Ordering::Greater)
        || top == 0
        || top + 1 == curve.len()
    {
        return None;
    }
    let reach = 2.min(top).min(curve.len() - 1 - top);
    let points: Vec<(f64, f64)> = (top - reach..=top + reach)
        .map(|i| (i as f64 - top as f64, (curve[i] - 0.9 * floor).max(1e-30).ln()))
        .collect();
    let matrix = DMatrix::from_fn(points.len(), 3, |i, j| points[i].0.powi(j as i32));
    let right = DVector::from_fn(points.len(), |i, _| points[i].1);
    let c = matrix.svd(true, true).solve(&right, 1e-12).ok()?;
    let place = -c[1] / (2.0 * c[2]);
    (c[2] < 0.0 && place.abs() <= 1.0).then_some(top as f64 + place)
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
        let mut sizes: Vec<f64> = errors.iter().map(|e| e.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        spread = 1.4826 * sizes[sizes.len() / 2];
        let limit = (4.0 * spread).max(1e-6);
        weights = errors.iter().map(|e| (1.0 - (e / limit).powi(2)).max(0.0).powi(2)).collect();
    }
    FocusPlane { x_per_px: found[0], y_per_px: found[1], at_origin: found[2], spread, blocks: points.len() }
}

/// Slices of a map of blocks, for tests and blur.
pub(super) fn middle(image: &Array2<f32>) -> Array2<f32> {
    let (height, width) = image.dim();
    let side = height.min(width);
    let (top, left) = ((height - side) / 2, (width - side) / 2);
    image.slice(s![top..top + side, left..left + side]).to_owned()
}

/// Mean square over blocks of the Laplacian, after a binomial blur of five taps.
fn laplacian_energy(image: &Array2<f32>, side: usize) -> Array2<f64> {
    let (height, width) = image.dim();
    let taps = [1.0_f32, 4.0, 6.0, 4.0, 1.0].map(|tap| tap / 16.0);
    let smooth = |image: &Array2<f32>| {
        let rows = Array2::from_shape_fn((height, width), |(y, x)| {
            (0..5)
                .map(|i| taps[i] * image[(y, crate::border::reflect(x as isize + i as isize - 2, width))])
                .sum::<f32>()
        });
        Array2::from_shape_fn((height, width), |(y, x)| {
            (0..5)
                .map(|i| taps[i] * rows[(crate::border::reflect(y as isize + i as isize - 2, height), x)])
                .sum::<f32>()
        })
    };
    let image = smooth(image);
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
