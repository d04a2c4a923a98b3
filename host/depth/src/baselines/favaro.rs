//! Favaro & Soatto's method (2005): projectors onto what a depth cannot show.
//!
//! The two 7x7 patches of a pair are a vector of 98 numbers. Blur couples the patches, so all textures at one depth
//! fill only part of that space; the rest is the depth's null space. It follows from a singular value decomposition of
//! patches of random textures rendered at the depth: the directions beyond the first ones. The depth is the one whose
//! null space receives the least of the measured vector. Textures mix the spectra of sand and of a fractal. The
//! vector's mean is subtracted (lighting). Vectors are taken every 3 px, residuals summed over the window, and a
//! parabola refines the least residual. Cost: learning about 1 s; run time 98 x rank operations per depth and vector,
//! about 1 s for 640x480.

mod learn;

use nalgebra::DMatrix;
use ndarray::{Array2, Array3, ArrayView2, Axis};

use super::BaselineError;
use super::common::{Evidence, Pair};
use crate::optics::Optics;
use crate::pipeline::{DepthMap, MAX_ALPHA, Settings};
use crate::psf::Psf;

const PATCH_PX: usize = 7;

const VECTOR: usize = 2 * PATCH_PX * PATCH_PX;

const STEP_PX: usize = 3;

/// How the projectors are learned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FavaroSettings {
    /// Number of depths, evenly spaced in alpha a little beyond both foci; 9 to 129.
    pub depths: usize,
    /// Dimensions of a depth's textures, the rest is null space; 10 to 90. 60 has the least error for every PSF.
    pub rank: usize,
    /// Seed of the random textures.
    pub seed: u64,
}

impl Default for FavaroSettings {
    fn default() -> Self {
        Self { depths: 33, rank: 60, seed: 1 }
    }
}

/// Projectors of a series of depths.
#[derive(Debug, Clone)]
pub struct Favaro {
    psf: Psf,
    max_blur_px: f64,
    alphas: Vec<f64>,
    signals: Vec<DMatrix<f32>>,
}

impl Favaro {
    /// Learns the projectors for a PSF and largest blur radius.
    pub fn learn(optics: &Optics, settings: &FavaroSettings) -> Result<Self, BaselineError> {
        let check = |name, value, least, most| {
            if (least..=most).contains(&value) {
                Ok(())
            } else {
                Err(BaselineError::Setting { name, value, least, most })
            }
        };
        check("depths", settings.depths, 9, 129)?;
        check("rank", settings.rank, 10, 90)?;
        let last = (settings.depths - 1) as f64;
        let limit = f64::from(MAX_ALPHA);
        let alphas: Vec<f64> = (0..settings.depths).map(|i| limit * (2.0 * i as f64 / last - 1.0)).collect();
        let signals = learn::signals(optics, &alphas, settings)?;
        Ok(Self { psf: optics.psf(), max_blur_px: optics.max_blur_px(), alphas, signals })
    }

    /// As [`super::depth_from_pair`] without learning. Returns [`BaselineError::OtherOptics`] for another blur.
    pub fn depth_from_pair(
        &self,
        far: ArrayView2<f32>,
        near: ArrayView2<f32>,
        optics: &Optics,
        settings: &Settings,
    ) -> Result<DepthMap, BaselineError> {
        if (self.psf, self.max_blur_px) != (optics.psf(), optics.max_blur_px()) {
            let text = |psf: Psf, blur_px: f64| format!("{psf} and {blur_px} px");
            return Err(BaselineError::OtherOptics {
                learned: text(self.psf, self.max_blur_px),
                optics: text(optics.psf(), optics.max_blur_px()),
            });
        }
        let pair = Pair::new(far, near, settings)?;
        let evidence = self.evidence(&pair, settings);
        Ok(pair.finish(evidence, optics, settings))
    }

    pub(super) fn evidence(&self, pair: &Pair, settings: &Settings) -> Evidence {
        let (height, width) = pair.far.dim();
        let points = |length: usize| (length - PATCH_PX) / STEP_PX + 1;
        let (rows, columns) = (points(height), points(width));
        // Residual of each depth, then the vector's energy.
        let mut residuals = Array3::<f32>::zeros((rows, columns, self.alphas.len() + 1));
        let mut vectors = DMatrix::<f32>::zeros(VECTOR, columns);
        for (row, mut residuals) in residuals.axis_iter_mut(Axis(0)).enumerate() {
            for column in 0..columns {
                let mut vector = vectors.column_mut(column);
                fill(vector.as_mut_slice(), &pair.far, &pair.near, (row * STEP_PX, column * STEP_PX));
                residuals[(column, self.alphas.len())] = vector.norm_squared();
            }
            for (depth, signal) in self.signals.iter().enumerate() {
                let inside = signal * &vectors;
                for column in 0..columns {
                    let energy = residuals[(column, self.alphas.len())];
                    residuals[(column, depth)] = (energy - inside.column(column).norm_squared()).max(0.0);
                }
            }
        }
        let reach = settings.smoothing_px.div_ceil(STEP_PX) / 2;
        let summed = sum_windows(&residuals, reach);
        let on_grid = Array2::from_shape_fn((rows, columns), |(row, column)| {
            let at = summed.slice(ndarray::s![row, column, ..]);
            self.least(&at.to_vec())
        });
        let to_map = |value: fn(&Found) -> f32| expand(&on_grid.map(value), (height, width));
        Evidence {
            alpha: to_map(|found| found.alpha),
            texture: to_map(|found| found.energy),
            misfit: to_map(|found| found.misfit),
            reach_px: PATCH_PX + reach * STEP_PX,
        }
    }

    fn least(&self, values: &[f32]) -> Found {
        let (residuals, energy) = values.split_at(self.alphas.len());
        let energy = energy[0];
        let best = (0..residuals.len()).min_by(|a, b| residuals[*a].total_cmp(&residuals[*b])).unwrap_or(0);
        if energy <= 0.0 {
            return Found { alpha: f32::NAN, energy: 0.0, misfit: 0.0 };
        }
        let step = self.alphas[1] - self.alphas[0];
        let mut alpha = self.alphas[best];
        if best > 0 && best + 1 < residuals.len() {
            let [before, here, after] = [-1, 0, 1].map(|i| f64::from(residuals[best.wrapping_add_signed(i)]));
            let curvature = before - 2.0 * here + after;
            if curvature > 0.0 {
                alpha += step * (0.5 * (before - after) / curvature).clamp(-0.5, 0.5);
            }
        }
        // Contrast of the best depth with the average one: 0 for a perfect fit.
        let mean = residuals.iter().sum::<f32>() / residuals.len() as f32;
        let misfit = residuals[best] / (mean - residuals[best]).max(1e-12 * energy);
        Found { alpha: alpha as f32, energy, misfit }
    }
}

struct Found {
    alpha: f32,
    energy: f32,
    misfit: f32,
}

fn fill(vector: &mut [f32], far: &Array2<f32>, near: &Array2<f32>, (row, column): (usize, usize)) {
    let mut next = 0;
    for image in [far, near] {
        for y in row..row + PATCH_PX {
            for x in column..column + PATCH_PX {
                vector[next] = image[(y, x)];
                next += 1;
            }
        }
    }
    let mean = vector.iter().sum::<f32>() / VECTOR as f32;
    vector.iter_mut().for_each(|value| *value -= mean);
}

fn sum_windows(values: &Array3<f32>, reach: usize) -> Array3<f32> {
    let along = |values: &Array3<f32>, axis: usize| {
        let length = values.len_of(Axis(axis));
        let mut sums = Array3::zeros(values.dim());
        for (i, mut sum) in sums.axis_iter_mut(Axis(axis)).enumerate() {
            for j in i.saturating_sub(reach)..(i + reach + 1).min(length) {
                sum += &values.index_axis(Axis(axis), j);
            }
        }
        sums
    };
    along(&along(values, 0), 1)
}

fn expand(grid: &Array2<f32>, dim: (usize, usize)) -> Array2<f32> {
    let place = |pixel: usize, points: usize| {
        let at = (pixel as f32 - (PATCH_PX / 2) as f32) / STEP_PX as f32;
        let at = at.clamp(0.0, (points - 1) as f32);
        let first = (at as usize).min(points.saturating_sub(2));
        (first, (first + 1).min(points - 1), at - first as f32)
    };
    let (rows, columns) = grid.dim();
    Array2::from_shape_fn(dim, |(y, x)| {
        let ((top, bottom, down), (left, right, across)) = (place(y, rows), place(x, columns));
        let along = |row: usize| grid[(row, left)] + across * (grid[(row, right)] - grid[(row, left)]);
        along(top) + down * (along(bottom) - along(top))
    })
}
