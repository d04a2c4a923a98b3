//! Fills regions of low texture from their surroundings.
//!
//! A region begins with connected (8-neighbours) pixels whose texture energy is below
//! [`LOW_TEXTURE`](crate::confidence::LOW_TEXTURE) times its median. It grows, as far as kernels and windows reach,
//! over adjacent pixels below [`GROWN_TEXTURE`] times the median, because noise biases their depth towards the middle
//! of the range. A cubic surface (Li 2014, eq. 6.16, plus the mixed terms it lacks) is fitted to the depths in a margin
//! around the Moore-neighbour boundary. The thesis' margin is one pixel. Here it is 1.5 times as wide as the region's
//! radius, unless that contradicts the nearest surroundings (`surface`), because the margin's curvature determines the
//! middle. The fit is robust (Huber's weights, times the texture energy, which is inverse to the variance) with no more
//! terms than the margin supports. [`Filling`] selects criterion ([`LowTexture`]) and order ([`FillBy`]), including the
//! thesis' for comparison. A filled pixel gets [`FILLED_CONFIDENCE`]; a region without a usable margin stays NaN. Cost:
//! 3 to 8 ms for 640x480.

mod boundary;
mod criterion;
mod region;
mod surface;
mod thesis;

use std::fmt;
use std::str::FromStr;

use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};

pub use boundary::trace_boundary;
pub use criterion::{LowTexture, UnknownCriterion};

use crate::depth_map::DepthMap;
use region::Regions;
use surface::Surface;

/// Texture energy relative to its median below which a region grows over a pixel.
pub const GROWN_TEXTURE: f32 = 0.7;

/// Confidence of a filled pixel: lower than any measured on enough texture.
pub const FILLED_CONFIDENCE: f32 = 0.2;

/// Counts of a filling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Filled {
    /// Number of regions that were filled.
    pub regions: usize,
    /// Number of pixels that were filled.
    pub pixels: usize,
    /// Number of pixels that could not be filled and are NaN.
    pub left_empty: usize,
}

/// Order and surroundings of the filling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FillBy {
    /// `surface`: each region grown to the kernels' reach, from a wide margin, independent of other fillings.
    #[default]
    Surface,
    /// `thesis`: sequentially, each from the rectangle around it, including earlier fillings.
    Thesis,
}

impl FillBy {
    /// The name as the command line writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Surface => "surface",
            Self::Thesis => "thesis",
        }
    }
}

impl fmt::Display for FillBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Unknown filling name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a way to fill: use surface or thesis")]
pub struct UnknownFilling(String);

impl FromStr for FillBy {
    type Err = UnknownFilling;

    fn from_str(text: &str) -> Result<Self, UnknownFilling> {
        let known = [Self::Surface, Self::Thesis].into_iter().find(|by| by.name() == text.trim());
        known.ok_or_else(|| UnknownFilling(text.to_owned()))
    }
}

/// Selection and method of filling.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Filling {
    /// Criterion of low texture.
    pub low_texture: LowTexture,
    /// Order and surroundings.
    pub by: FillBy,
    /// Side of the criterion's window, px; odd, at least 3 is used.
    pub window_px: usize,
}

/// Replaces the depth where there is too little texture. `texture` is the energy of each pixel, NaN for pixels to keep;
/// `pair` are the far- and the near-focused image; `reach_px` is the reach of kernels and windows.
///
/// # Panics
/// If energy, images and map differ in size.
pub fn fill(
    map: &mut DepthMap,
    texture: ArrayView2<f32>,
    pair: [ArrayView2<f32>; 2],
    reach_px: usize,
    how: Filling,
) -> Filled {
    let low = how.low_texture.mask(texture, pair, how.window_px.max(3));
    match how.by {
        FillBy::Surface => fill_by_surfaces(map, texture, low, reach_px),
        FillBy::Thesis => fill_as_thesis(map, low),
    }
}

/// [`fill`] by energy and surfaces, which needs no images.
///
/// # Panics
/// If energy and map differ in size.
pub fn fill_low_texture(map: &mut DepthMap, texture: ArrayView2<f32>, reach_px: usize) -> Filled {
    let low = LowTexture::Energy.mask(texture, [texture; 2], 1);
    fill_by_surfaces(map, texture, low, reach_px)
}

/// Fills the same pixels again after a correction, in the thesis' order, which corrects first and fills last.
pub fn refill_as_thesis(map: &mut DepthMap) -> Filled {
    match map.filled.take() {
        Some(filled) => fill_as_thesis(map, filled),
        None => Filled::default(),
    }
}

fn mark(map: &mut DepthMap, at: (usize, usize)) {
    map.confidence[at] = FILLED_CONFIDENCE;
    let size = map.depth_mm.dim();
    map.filled.get_or_insert_with(|| Array2::from_elem(size, false))[at] = true;
}

fn fill_as_thesis(map: &mut DepthMap, low: Array2<bool>) -> Filled {
    let regions = Regions::of(low, 0.0);
    empty(map, &regions);
    let mut filled = Filled::default();
    for index in 0..regions.count() {
        let region = regions.region(index);
        if thesis::fill_region(&mut map.depth_mm, region) {
            filled.regions += 1;
            filled.pixels += region.len();
            region.iter().for_each(|at| mark(map, *at));
        } else {
            filled.left_empty += region.len();
        }
    }
    filled
}

fn empty(map: &mut DepthMap, regions: &Regions) {
    for at in regions.pixels() {
        map.depth_mm[at] = f32::NAN;
        map.confidence[at] = 0.0;
    }
}

fn fill_by_surfaces(
    map: &mut DepthMap,
    texture: ArrayView2<f32>,
    low: Array2<bool>,
    reach_px: usize,
) -> Filled {
    assert_eq!(texture.dim(), map.depth_mm.dim(), "energy and map must have one size");
    let regions = Regions::find(low, texture, reach_px);
    let mut filled = Filled::default();
    empty(map, &regions);
    let mut results = Vec::new();
    for index in 0..regions.count() {
        let margin = regions.margin(index, map, texture);
        let region = regions.region(index);
        match Surface::fit(&margin) {
            Some(surface) => {
                filled.regions += 1;
                filled.pixels += region.len();
                results.extend(region.iter().map(|&(y, x)| ((y, x), surface.depth_mm(y, x))));
            }
            None => filled.left_empty += region.len(),
        }
    }
    // Written at the end, so that regions do not use each other's filling.
    for (at, depth_mm) in results {
        map.depth_mm[at] = depth_mm;
        mark(map, at);
    }
    filled
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sample {
    pub y: f64,
    pub x: f64,
    pub depth_mm: f64,
    /// Inverse to the variance of the depth, up to a factor.
    pub weight: f64,
    /// Number of independent measurements it represents.
    pub independent: f64,
    pub distance_px: usize,
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    fn map_of(depth: impl Fn(f32, f32) -> f32, size: (usize, usize)) -> DepthMap {
        DepthMap {
            depth_mm: Array2::from_shape_fn(size, |(y, x)| depth(y as f32, x as f32)),
            confidence: Array2::from_elem(size, 0.9),
            filled: None,
            low_texture_fraction: 0.0,
            warnings: Vec::new(),
        }
    }

    fn disc(size: (usize, usize), (cy, cx): (f32, f32), radius: f32) -> Array2<f32> {
        let inside = |(y, x)| (y as f32 - cy).hypot(x as f32 - cx) <= radius;
        Array2::from_shape_fn(size, |at| if inside(at) { 0.0 } else { 1.0 })
    }

    fn noise() -> impl FnMut() -> f32 {
        let mut state = 7_u32;
        move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 8_388_608.0 - 1.0
        }
    }

    #[test]
    fn a_cubic_surface_is_restored() {
        let surface =
            |y: f32, x: f32| 900.0 + 0.1 * x - 0.05 * y + 1e-3 * x * y - 2e-5 * x * x * x + 1e-5 * y * y * x;
        let size = (80, 100);
        let mut map = map_of(surface, size);
        let texture = disc(size, (40.0, 50.0), 20.0) * disc(size, (0.0, 0.0), 10.0);
        for (at, _) in texture.indexed_iter().filter(|(_, energy)| **energy == 0.0) {
            map.depth_mm[at] = 500.0;
        }
        let filled = fill_low_texture(&mut map, texture.view(), 9);
        assert_eq!((filled.regions, filled.left_empty), (2, 0));
        assert_eq!(filled.pixels, texture.iter().filter(|energy| **energy == 0.0).count());
        for ((y, x), depth) in map.depth_mm.indexed_iter() {
            let error = (depth - surface(y as f32, x as f32)).abs();
            assert!(error < if x < 15 { 0.2 } else { 0.01 }, "({x}, {y}): {error}");
            let confidence = if texture[(y, x)] == 0.0 { FILLED_CONFIDENCE } else { 0.9 };
            assert_eq!(map.confidence[(y, x)], confidence);
        }
    }

    #[test]
    fn noise_and_outliers_in_the_margin_do_little() {
        let size = (120, 120);
        let mut map = map_of(|y, x| 900.0 + 0.05 * x - 0.02 * y, size);
        let mut noise = noise();
        map.depth_mm.mapv_inplace(|d| d + noise());
        map.depth_mm.mapv_inplace(|d| if noise() > 0.9 { d + 30.0 } else { d });
        let texture = disc(size, (60.0, 60.0), 25.0);
        fill_low_texture(&mut map, texture.view(), 9);
        for ((y, x), _) in texture.indexed_iter().filter(|(_, energy)| **energy == 0.0) {
            let error = (map.depth_mm[(y, x)] - (900.0 + 0.05 * x as f32 - 0.02 * y as f32)).abs();
            assert!(error < 0.25, "({x}, {y}): {error}");
        }
    }

    /// A wall begins 12 px next to the region: the margin must exclude it.
    #[test]
    fn a_step_in_a_wide_margin_is_left_out() {
        let size = (140, 160);
        let surface = |y: f32| 900.0 + 0.03 * y;
        let mut map = map_of(|y, x| if x > 112.0 { 930.0 } else { surface(y) }, size);
        let mut noise = noise();
        map.depth_mm.mapv_inplace(|d| d + 0.3 * noise());
        let texture = disc(size, (70.0, 70.0), 30.0);
        fill_low_texture(&mut map, texture.view(), 9);
        for ((y, x), _) in texture.indexed_iter().filter(|(_, energy)| **energy == 0.0) {
            let error = (map.depth_mm[(y, x)] - surface(y as f32)).abs();
            assert!(error < 0.3, "({x}, {y}): {error}");
        }
    }

    #[test]
    fn one_sided_regions_are_filled_and_marked_pixels_stay() {
        let size = (60, 60);
        let mut texture = disc(size, (30.0, 30.0), 12.0);
        // Five more pixels on each side with 0.3 of the usual energy, and a strip of it far from any region.
        let ring = disc(size, (30.0, 30.0), 17.0);
        ndarray::Zip::from(&mut texture).and(&ring).for_each(|energy, outside| {
            if *outside == 0.0 && *energy > 0.0 {
                *energy = 0.3;
            }
        });
        texture.slice_mut(ndarray::s![0..4, ..]).fill(0.3);
        texture[(30, 30)] = f32::NAN;
        let mut map = map_of(|_, _| 900.0, size);
        map.depth_mm[(30, 30)] = 950.0;
        let filled = fill_low_texture(&mut map, texture.view(), 6);
        assert_eq!(filled.pixels, ring.iter().filter(|energy| **energy == 0.0).count() - 1);
        assert_eq!((map.depth_mm[(30, 30)], map.confidence[(30, 30)]), (950.0, 0.9));
        assert_eq!(map.confidence[(2, 30)], 0.9, "little texture alone does not make a region");
    }

    /// Two discs that touch each other's rectangles: in the thesis' order the second uses the first one's filling.
    #[test]
    fn the_thesis_order_fills_one_after_the_other_and_again_after_a_change() {
        let size = (60, 90);
        let surface = |y: f32, x: f32| 900.0 + 0.05 * x - 0.1 * y + 1e-4 * x * x;
        let mut map = map_of(surface, size);
        let texture = disc(size, (30.0, 30.0), 9.0) * disc(size, (34.0, 48.0), 7.0);
        for (at, _) in texture.indexed_iter().filter(|(_, energy)| **energy == 0.0) {
            map.depth_mm[at] = 500.0;
        }
        let how = Filling { by: FillBy::Thesis, ..Filling::default() };
        let filled = fill(&mut map, texture.view(), [texture.view(); 2], 9, how);
        assert_eq!((filled.regions, filled.left_empty), (2, 0));
        assert_eq!(filled.pixels, texture.iter().filter(|energy| **energy == 0.0).count(), "nothing grows");
        let worst = |map: &DepthMap, by: f32| {
            let error =
                |((y, x), depth): ((usize, usize), &f32)| (depth - by - surface(y as f32, x as f32)).abs();
            map.depth_mm.indexed_iter().map(error).fold(0.0, f32::max)
        };
        assert!(worst(&map, 0.0) < 2e-3, "{}", worst(&map, 0.0));
        ndarray::Zip::from(&mut map.depth_mm).and(&texture).for_each(|depth, energy| {
            *depth += if *energy == 0.0 { -77.0 } else { 3.0 };
        });
        assert_eq!(refill_as_thesis(&mut map), filled);
        assert!(worst(&map, 3.0) < 2e-3, "{}", worst(&map, 3.0));
    }

    #[test]
    fn ways_of_filling_are_named() {
        for by in [FillBy::Surface, FillBy::Thesis] {
            assert_eq!(by.to_string().parse(), Ok(by));
        }
        assert!("cubic".parse::<FillBy>().unwrap_err().to_string().contains("`cubic`"));
    }

    #[test]
    fn a_map_without_texture_stays_empty() {
        let mut map = map_of(|_, _| 900.0, (20, 20));
        let mut texture = Array2::zeros((20, 20));
        texture[(10, 10)] = 1.0;
        let filled = fill_low_texture(&mut map, texture.view(), 9);
        assert_eq!(filled, Filled { regions: 0, pixels: 0, left_empty: 399 });
        assert_eq!(map.depth_mm.iter().filter(|d| d.is_nan()).count(), 399);
    }
}
