//! Depth by windows of one or several sizes, with its standard deviation and the model's misfit.
//!
//! [`Bank`] filters a pair so that `rho0 + alpha rho1 + alpha^2 rho2 + alpha^3 rho3` vanishes at the true depth, except
//! for noise. A window finds the root of `sum c_k alpha^k`, `c_k = sum rho_k u`, with the matched filter `u`. The
//! variance follows from the noise, the filter's energy and the cubic's slope. [`Window::Adaptive`] takes the largest of
//! three windows where the surface is flat over it, else the smallest that is certain enough (`agreement`).
//!
//! Work proceeds in tiles (`rows`), so that memory beyond the maps does not grow with the image. Cost: five 7x7
//! kernels, five products, and 15 window sums and three cubics for three windows; see `docs/speed.md`.

mod agreement;
mod bank;
mod holes;
mod rows;
mod scales;
mod slopes;
mod whitened;

use std::fmt;
use std::str::FromStr;

use ndarray::{Array2, ArrayView2, ArrayViewMut2, Axis};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::optics::Optics;
use crate::pipeline::{MAX_SMOOTHING_PX, RunError};
use crate::prepare::noise::PairNoise;
use crate::simd::Backend;
use rows::Tile;
use scales::Scales;

pub use bank::Bank;

/// Sides of the windows that [`Window::Adaptive`] chooses from, px.
pub const ADAPTIVE_PX: [usize; 3] = [7, 13, 21];
/// The same for `calibrate stack` lenses: more texture averages their own error, which strong points may dominate.
pub const LEARNED_PX: [usize; 3] = [11, 21, 41];

/// Window over which evidence is summed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum Window {
    /// One square everywhere; odd side, px.
    Fixed(usize),
    /// The largest of [`ADAPTIVE_PX`] ([`LEARNED_PX`] for a learned lens) on flat surfaces, else the smallest that is certain
    /// enough.
    Adaptive,
}

/// Unknown window name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("expected adaptive or an odd number of pixels from 1 to {MAX_SMOOTHING_PX}")]
pub struct UnknownWindow;

impl FromStr for Window {
    type Err = UnknownWindow;

    fn from_str(text: &str) -> Result<Self, UnknownWindow> {
        match text.trim() {
            "adaptive" => Ok(Self::Adaptive),
            number => {
                let side = number.parse().map_err(|_| UnknownWindow)?;
                let usable = side % 2 == 1 && side <= MAX_SMOOTHING_PX;
                if usable { Ok(Self::Fixed(side)) } else { Err(UnknownWindow) }
            }
        }
    }
}

impl fmt::Display for Window {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed(side) => write!(f, "{side}"),
            Self::Adaptive => f.write_str("adaptive"),
        }
    }
}

impl From<Window> for String {
    fn from(window: Window) -> Self {
        window.to_string()
    }
}

impl TryFrom<String> for Window {
    type Error = UnknownWindow;

    fn try_from(text: String) -> Result<Self, UnknownWindow> {
        text.parse()
    }
}

/// Analysis of a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindowSettings {
    /// The windows.
    pub window: Window,
    /// Side of the median over depth: 1 (none), 3, 5 or 7.
    pub median_px: usize,
    /// The noise of the images.
    pub noise: PairNoise,
    /// Vector unit; `None` uses the fastest available.
    pub backend: Option<Backend>,
}

/// Maps of (height, width).
#[derive(Debug, Clone)]
pub struct Estimate {
    /// Depth, mm; NaN where a filter reaches a pixel without a value.
    pub depth_mm: Array2<f32>,
    /// Standard deviation of depth, mm, for the noise of the settings.
    pub deviation_mm: Array2<f32>,
    /// Mean square residual around the pixel relative to the noise: about 1 where the model holds.
    pub misfit: Array2<f32>,
    /// Mean square residual beyond the noise, relative to the texture: a few thousandths where PSF and blur are right.
    pub left_over: f64,
    /// The same mean square relative to noise alone.
    pub excess: f64,
    /// Noise relative to the texture, mean squares.
    pub noise_part: f64,
}

/// Depth of an aligned, balanced pair, ignoring NaN pixels. Returns [`RunError`] for images that differ in size, are
/// too small, constant or invalid, and for unusable windows.
pub fn estimate(
    far: ArrayView2<f32>,
    near: ArrayView2<f32>,
    bank: &Bank,
    optics: &Optics,
    settings: &WindowSettings,
) -> Result<Estimate, RunError> {
    let mut depth_mm = Array2::zeros(far.dim());
    let estimate = estimate_into(Some(&mut depth_mm), far, near, bank, optics, settings)?;
    Ok(Estimate { depth_mm, ..estimate })
}

/// [`estimate`] with an empty depth map: other methods' validity needs no depth, and a map is large.
pub(crate) fn estimate_without_depth(
    far: ArrayView2<f32>,
    near: ArrayView2<f32>,
    bank: &Bank,
    optics: &Optics,
    settings: &WindowSettings,
) -> Result<Estimate, RunError> {
    estimate_into(None, far, near, bank, optics, settings)
}

/// What all tiles share.
struct Job<'a> {
    far: ArrayView2<'a, f32>,
    near: ArrayView2<'a, f32>,
    bank: &'a Bank,
    optics: &'a Optics,
    settings: &'a WindowSettings,
    scales: &'a Scales,
    backend: Backend,
}

/// A band's rows of the results.
struct Maps<'a> {
    depth_mm: Option<ArrayViewMut2<'a, f32>>,
    deviation_mm: ArrayViewMut2<'a, f32>,
    misfit: ArrayViewMut2<'a, f32>,
}

fn estimate_into(
    mut depth_mm: Option<&mut Array2<f32>>,
    far: ArrayView2<f32>,
    near: ArrayView2<f32>,
    bank: &Bank,
    optics: &Optics,
    settings: &WindowSettings,
) -> Result<Estimate, RunError> {
    check_pair(far, near)?;
    let [far, near] = [&far, &near].map(|image| image.as_standard_layout());
    let [far, near] = [far.view(), near.view()];
    let smoothing_px = if let Window::Fixed(side) = settings.window { side } else { 1 };
    let windows =
        crate::pipeline::Settings { smoothing_px, median_px: settings.median_px, ..Default::default() };
    crate::pipeline::check_windows(&windows)?;
    let size = far.dim();
    let backend = settings.backend.unwrap_or_else(Backend::best);
    let scales = Scales::new(far, near, settings.noise);
    let mut maps = [(); 2].map(|()| Array2::<f32>::zeros(size));
    let rows = rows_of_band(size.0);
    let [deviation, misfit] = &mut maps;
    let of_depth: Vec<Option<ArrayViewMut2<'_, f32>>> = match &mut depth_mm {
        Some(depth_mm) => depth_mm.axis_chunks_iter_mut(Axis(0), rows).map(Some).collect(),
        None => (0..size.0.div_ceil(rows)).map(|_| None).collect(),
    };
    let job = Job { far, near, bank, optics, settings, scales: &scales, backend };
    let of_bands: Vec<[f64; 3]> = of_depth
        .into_par_iter()
        .zip(deviation.axis_chunks_iter_mut(Axis(0), rows).into_par_iter())
        .zip(misfit.axis_chunks_iter_mut(Axis(0), rows).into_par_iter())
        .enumerate()
        .map_init(
            || Tile::new(&job),
            |tile, (index, ((depth_mm, deviation_mm), misfit))| {
                tile.band(index * rows, Maps { depth_mm, deviation_mm, misfit })
            },
        )
        .collect();
    let [left, noise, texture] =
        of_bands.into_iter().fold([0.0; 3], |a, b| [a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
    if let (Some(depth_mm), Some(_)) = (depth_mm, optics.stage()) {
        // Other lenses have smaller windows.
        let half = if let Window::Fixed(side) = settings.window { side } else { LEARNED_PX[2] } / 2;
        slopes::straighten(depth_mm, &mut maps[0], half, bank.reach_px());
    }
    let left_over = if texture > 0.0 { (left - noise) / texture } else { f64::NAN };
    let excess = if noise > 0.0 { left / noise } else { f64::NAN };
    let noise_part = if texture > 0.0 { noise / texture } else { 0.0 };
    let [deviation_mm, misfit] = maps;
    Ok(Estimate { depth_mm: Array2::zeros((0, 0)), deviation_mm, misfit, left_over, excess, noise_part })
}

pub(crate) fn check_pair(far: ArrayView2<f32>, near: ArrayView2<f32>) -> Result<(), RunError> {
    let (height, width) = far.dim();
    let (near_height, near_width) = near.dim();
    if (near_height, near_width) != (height, width) {
        return Err(RunError::SizeMismatch { far_width: width, far_height: height, near_width, near_height });
    }
    if height < crate::pipeline::MIN_SIDE_PX || width < crate::pipeline::MIN_SIDE_PX {
        return Err(RunError::TooSmall { width, height });
    }
    for (which, image) in [("far", far), ("near", near)] {
        let mut finite = image.iter().copied().filter(|v| v.is_finite());
        let Some(value) = finite.next() else { return Err(RunError::NothingFinite) };
        if finite.all(|v| v == value) {
            return Err(RunError::Constant { which, value });
        }
    }
    Ok(())
}

/// Rows of a band of an image of `height`: its halo of about 20 rows on either side is computed twice.
fn rows_of_band(height: usize) -> usize {
    const MOST: usize = 256;
    let threads = rayon::current_num_threads().max(1);
    height.div_ceil(height.div_ceil(MOST).next_multiple_of(threads)).max(32)
}
