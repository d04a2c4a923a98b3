//! Regions of low texture and the margins around them.

use ndarray::{Array2, ArrayView2};

use super::{GROWN_TEXTURE, Sample, trace_boundary};
use crate::confidence::texture_scale;
use crate::depth_map::DepthMap;

const MARGIN_PX: [usize; 2] = [7, 112];

/// Width of a margin for each pixel of its region's radius.
const WIDTH_PER_RADIUS: f64 = 1.5;

/// Largest spacing of samples, px; twice that beyond [`NEAR_PX`] from the region.
const MAX_STEP_PX: usize = 4;

/// Distance up to which samples are dense, px.
const NEAR_PX: usize = 14;

/// Neighbouring pixels share windows and kernels: so many count as one.
const PIXELS_PER_INDEPENDENT: f64 = 60.0;

const BORDER_POINTS: usize = 48;

pub(super) struct Regions {
    mask: Array2<bool>,
    regions: Vec<Vec<(usize, usize)>>,
    /// Texture energy, the unit of weights.
    scale: f32,
}

impl Regions {
    /// The regions of `low`, grown by up to `reach_px` over low `texture` (NaN: none); touching regions merge.
    pub fn find(low: Array2<bool>, texture: ArrayView2<f32>, reach_px: usize) -> Self {
        let scale = texture_scale(texture);
        let grown = (GROWN_TEXTURE * scale).max(f32::MIN_POSITIVE);
        let mut mask = low;
        let mut border: Vec<(usize, usize)> =
            mask.indexed_iter().filter(|(_, low)| **low).map(|(at, _)| at).collect();
        for _ in 0..reach_px {
            let mut next = Vec::new();
            for at in border {
                for neighbour in neighbours(at, mask.dim()) {
                    if !mask[neighbour] && texture[neighbour] < grown {
                        mask[neighbour] = true;
                        next.push(neighbour);
                    }
                }
            }
            border = next;
        }
        Self::of(mask, scale)
    }

    /// The regions of a mask, unchanged, in reading order of their first pixels.
    pub fn of(mask: Array2<bool>, scale: f32) -> Self {
        let mut taken = Array2::from_elem(mask.dim(), false);
        let mut regions = Vec::new();
        for (start, _) in mask.indexed_iter().filter(|(_, set)| **set) {
            if !taken[start] {
                regions.push(connected(mask.view(), start, &mut taken));
            }
        }
        Self { mask, regions, scale }
    }

    pub fn count(&self) -> usize {
        self.regions.len()
    }

    /// The pixels of a region, the first in reading order first.
    pub fn region(&self, index: usize) -> &[(usize, usize)] {
        &self.regions[index]
    }

    pub fn pixels(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.regions.iter().flatten().copied()
    }

    /// Measured pixels around a region and on its islands, nearest first, on a grid that is denser near the region.
    pub fn margin(&self, index: usize, map: &DepthMap, texture: ArrayView2<f32>) -> Vec<Sample> {
        let (height, width) = texture.dim();
        let region = &self.regions[index];
        let radius_px = (region.len() as f64 / std::f64::consts::PI).sqrt();
        let width_px = ((WIDTH_PER_RADIUS * radius_px) as usize).clamp(MARGIN_PX[0], MARGIN_PX[1]);
        let border = self.border(index);
        let range = |of: fn(&(usize, usize)) -> usize, n: usize| {
            let [low, high] =
                [region.iter().map(of).min(), region.iter().map(of).max()].map(|v| v.unwrap_or(0));
            [width_px, NEAR_PX.min(width_px)]
                .map(|around| low.saturating_sub(around)..(high + around + 1).min(n))
        };
        let [[rows, near_rows], [columns, near_columns]] = [range(|p| p.0, height), range(|p| p.1, width)];
        let step = ((radius_px / 10.0).round() as usize).clamp(1, MAX_STEP_PX);
        let mut samples = Vec::new();
        for y in rows.filter(|y| y % step == 0) {
            for x in columns.clone().filter(|x| x % step == 0) {
                let coarse = y % (2 * step) == 0 && x % (2 * step) == 0;
                if !(coarse || (near_rows.contains(&y) && near_columns.contains(&x))) {
                    continue;
                }
                let depth_mm = f64::from(map.depth_mm[(y, x)]);
                let confidence = map.confidence[(y, x)];
                if !depth_mm.is_finite() || self.mask[(y, x)] || confidence <= 0.0 {
                    continue;
                }
                let distance = |[ry, rx]: &[f32; 2]| (ry - y as f32).abs().max((rx - x as f32).abs());
                let distance_px = border.iter().map(distance).fold(f32::INFINITY, f32::min) as usize;
                let near = distance_px <= NEAR_PX;
                if near || (coarse && distance_px <= width_px) {
                    let pixels = (if near { step * step } else { 4 * step * step }) as f64;
                    let independent = (pixels / PIXELS_PER_INDEPENDENT).min(1.0);
                    let weight =
                        independent * f64::from(confidence * (texture[(y, x)] / self.scale).min(4.0));
                    samples.push(Sample {
                        y: y as f64,
                        x: x as f64,
                        depth_mm,
                        weight,
                        independent,
                        distance_px,
                    });
                }
            }
        }
        samples.sort_by_key(|sample| sample.distance_px);
        samples
    }

    /// About [`BORDER_POINTS`] places (row, column) on a region's outer boundary and those of its islands.
    fn border(&self, index: usize) -> Vec<[f32; 2]> {
        let region = &self.regions[index];
        let mut border = trace_boundary(self.mask.view(), region[0]);
        let islands = |at: &(usize, usize)| {
            let (y, x) = *at;
            let inner = y > 0 && x > 0 && y + 1 < self.mask.nrows() && x + 1 < self.mask.ncols();
            inner && [(y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)].iter().any(|at| !self.mask[*at])
        };
        // The outer boundary appears twice, which is harmless.
        border.extend(region.iter().filter(|at| islands(at)));
        let step = border.len().div_ceil(BORDER_POINTS);
        border.into_iter().step_by(step).map(|(y, x)| [y as f32, x as f32]).collect()
    }
}

fn neighbours(
    (y, x): (usize, usize),
    (height, width): (usize, usize),
) -> impl Iterator<Item = (usize, usize)> {
    let rows = y.saturating_sub(1)..(y + 2).min(height);
    rows.flat_map(move |ny| (x.saturating_sub(1)..(x + 2).min(width)).map(move |nx| (ny, nx)))
        .filter(move |at| *at != (y, x))
}

fn connected(mask: ArrayView2<bool>, start: (usize, usize), taken: &mut Array2<bool>) -> Vec<(usize, usize)> {
    let mut pixels = vec![start];
    taken[start] = true;
    let mut next = 0;
    while next < pixels.len() {
        for neighbour in neighbours(pixels[next], mask.dim()) {
            if mask[neighbour] && !taken[neighbour] {
                taken[neighbour] = true;
                pixels.push(neighbour);
            }
        }
        next += 1;
    }
    pixels
}
