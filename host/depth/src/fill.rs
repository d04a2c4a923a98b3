//! Fills regions of low texture from what surrounds them.
//!
//! Depth from defocus says nothing where the surface has no texture. Each connected region (8-neighbours) of low-texture
//! pixels is bounded by Moore-neighbour tracing, and the surface `c1 + c2 x + c3 x^2 + c4 x^3 + c5 y + c6 y^2 + c7 y^3` (Li
//! 2014, eq. 6.16) is fitted to the depths in a margin around the boundary and evaluated inside. The thesis takes a margin
//! of one pixel; seven average more noise. Two more things keep noise and depth steps out of the filling: the fit is robust
//! (Huber's weights, times the confidence), and quadratic and cubic terms are used only if the margin supports them
//! (Bayesian information criterion with one independent sample per smoothing window).
//!
//! A filled pixel gets [`FILLED_CONFIDENCE`]; a region without a usable margin keeps NaN. Cost: O(pixels of the regions and
//! their margins), 2 to 5 ms for 640x480.

mod boundary;
mod surface;

use ndarray::{Array2, ArrayView2};

pub use boundary::trace_boundary;

use crate::run::DepthMap;
use surface::Surface;

/// Width of the margin that the surface is fitted to, px.
pub const MARGIN_PX: usize = 7;

/// Confidence of a filled pixel: less than any that was measured on enough texture.
pub const FILLED_CONFIDENCE: f32 = 0.2;

/// What was done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Filled {
    /// Number of regions that were filled.
    pub regions: usize,
    /// Number of pixels that were filled.
    pub pixels: usize,
    /// Number of pixels that could not be filled and are NaN now.
    pub left_empty: usize,
}

/// Replaces the depth of the pixels that `low_texture` marks; the mask has the map's size.
///
/// # Panics
/// If mask and map differ in size.
pub fn fill_low_texture(map: &mut DepthMap, low_texture: ArrayView2<bool>) -> Filled {
    assert_eq!(low_texture.dim(), map.depth_mm.dim(), "mask and map must have one size");
    let mut done = Array2::from_elem(low_texture.dim(), false);
    let mut filled = Filled::default();
    // The measured depths of low-texture pixels are gone before any margin is looked at.
    for (at, _) in low_texture.indexed_iter().filter(|(_, low)| **low) {
        map.depth_mm[at] = f32::NAN;
        map.confidence[at] = 0.0;
    }
    let mut results = Vec::new();
    for (start, _) in low_texture.indexed_iter().filter(|(_, low)| **low) {
        if done[start] {
            continue;
        }
        let region = connected(low_texture, start, &mut done);
        let boundary = trace_boundary(low_texture, start);
        let margin = margin(map, low_texture, &boundary);
        match Surface::fit(&margin) {
            Some(surface) => {
                filled.regions += 1;
                filled.pixels += region.len();
                results.extend(region.into_iter().map(|(y, x)| ((y, x), surface.depth_mm(y, x))));
            }
            None => filled.left_empty += region.len(),
        }
    }
    // Written at the end, so that no region is fitted to another one's filling.
    for (at, depth_mm) in results {
        map.depth_mm[at] = depth_mm;
        map.confidence[at] = FILLED_CONFIDENCE;
    }
    filled
}

/// The pixels connected with `start`, which are marked in `done`.
fn connected(mask: ArrayView2<bool>, start: (usize, usize), done: &mut Array2<bool>) -> Vec<(usize, usize)> {
    let mut pixels = vec![start];
    done[start] = true;
    let mut next = 0;
    while next < pixels.len() {
        let (y, x) = pixels[next];
        next += 1;
        for ny in y.saturating_sub(1)..(y + 2).min(mask.nrows()) {
            for nx in x.saturating_sub(1)..(x + 2).min(mask.ncols()) {
                if mask[(ny, nx)] && !done[(ny, nx)] {
                    done[(ny, nx)] = true;
                    pixels.push((ny, nx));
                }
            }
        }
    }
    pixels
}

/// A pixel of a margin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sample {
    pub y: f64,
    pub x: f64,
    pub depth_mm: f64,
    pub confidence: f64,
}

/// The measured pixels within [`MARGIN_PX`] of the boundary.
fn margin(map: &DepthMap, low_texture: ArrayView2<bool>, boundary: &[(usize, usize)]) -> Vec<Sample> {
    let (height, width) = low_texture.dim();
    let range = |of: fn(&(usize, usize)) -> usize, n: usize| {
        let [low, high] =
            [boundary.iter().map(of).min(), boundary.iter().map(of).max()].map(|v| v.unwrap_or(0));
        low.saturating_sub(MARGIN_PX)..(high + MARGIN_PX + 1).min(n)
    };
    let [rows, columns] = [range(|p| p.0, height), range(|p| p.1, width)];
    let mut seen = Array2::from_elem((rows.len(), columns.len()), false);
    let mut samples = Vec::new();
    for &(by, bx) in boundary {
        for y in by.saturating_sub(MARGIN_PX)..(by + MARGIN_PX + 1).min(height) {
            for x in bx.saturating_sub(MARGIN_PX)..(bx + MARGIN_PX + 1).min(width) {
                let seen = &mut seen[(y - rows.start, x - columns.start)];
                if *seen {
                    continue;
                }
                *seen = true;
                let [depth_mm, confidence] = [map.depth_mm[(y, x)], map.confidence[(y, x)]].map(f64::from);
                if !low_texture[(y, x)] && depth_mm.is_finite() && confidence > 0.0 {
                    samples.push(Sample { y: y as f64, x: x as f64, depth_mm, confidence });
                }
            }
        }
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map_of(depth: impl Fn(f32, f32) -> f32, size: (usize, usize)) -> DepthMap {
        DepthMap {
            depth_mm: Array2::from_shape_fn(size, |(y, x)| depth(y as f32, x as f32)),
            confidence: Array2::from_elem(size, 0.9),
            low_texture_fraction: 0.0,
            warnings: Vec::new(),
        }
    }

    fn disc(size: (usize, usize), (cy, cx): (f32, f32), radius: f32) -> Array2<bool> {
        Array2::from_shape_fn(size, |(y, x)| (y as f32 - cy).hypot(x as f32 - cx) <= radius)
    }

    #[test]
    fn a_cubic_surface_is_restored() {
        let surface =
            |y: f32, x: f32| 900.0 + 0.1 * x - 0.05 * y + 1e-3 * x * x - 2e-5 * x * x * x + 1e-5 * y * y * y;
        let size = (80, 100);
        let mut map = map_of(surface, size);
        let mask = disc(size, (40.0, 50.0), 20.0) | disc(size, (0.0, 0.0), 10.0);
        for (at, _) in mask.indexed_iter().filter(|(_, low)| **low) {
            map.depth_mm[at] = 500.0;
        }
        let filled = fill_low_texture(&mut map, mask.view());
        assert_eq!((filled.regions, filled.left_empty), (2, 0));
        assert_eq!(filled.pixels, mask.iter().filter(|m| **m).count());
        for ((y, x), depth) in map.depth_mm.indexed_iter() {
            let error = (depth - surface(y as f32, x as f32)).abs();
            // The corner is extrapolated, the disc interpolated.
            assert!(error < if x < 15 { 0.2 } else { 0.01 }, "({x}, {y}): {error}");
            let confidence = if mask[(y, x)] { FILLED_CONFIDENCE } else { 0.9 };
            assert_eq!(map.confidence[(y, x)], confidence);
        }
    }

    #[test]
    fn noise_and_outliers_in_the_margin_do_little() {
        let size = (120, 120);
        let mut state = 7_u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 8_388_608.0 - 1.0
        };
        let mut map = map_of(|y, x| 900.0 + 0.05 * x - 0.02 * y, size);
        map.depth_mm.mapv_inplace(|d| d + noise());
        // A twentieth of the pixels far off.
        map.depth_mm.iter_mut().step_by(20).for_each(|d| *d += 30.0);
        let mask = disc(size, (60.0, 60.0), 25.0);
        fill_low_texture(&mut map, mask.view());
        for ((y, x), _) in mask.indexed_iter().filter(|(_, low)| **low) {
            let error = (map.depth_mm[(y, x)] - (900.0 + 0.05 * x as f32 - 0.02 * y as f32)).abs();
            assert!(error < 0.25, "({x}, {y}): {error}");
        }
    }

    #[test]
    fn a_map_without_texture_stays_empty() {
        let mut map = map_of(|_, _| 900.0, (20, 20));
        let mask = Array2::from_elem((20, 20), true);
        let filled = fill_low_texture(&mut map, mask.view());
        assert_eq!(filled, Filled { regions: 0, pixels: 0, left_empty: 400 });
        assert!(map.depth_mm.iter().all(|d| d.is_nan()) && map.confidence.iter().all(|c| *c == 0.0));
    }
}
