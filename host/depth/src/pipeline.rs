//! Run time: a defocused pair and operators to a depth map with its confidence.
//!
//! [`depth_from_pair`] processes one pair, a [`Processor`] many.
//! 1. `M = Q * (I2 - I1)`, `P = Q * (I2 + I1)`; `m = Gm1 * M`, `p1 = Gp1 * P`, `p2 = Gp2 * P` (Li 2014, eqs. 1.7 to
//!    1.9), borders reflected without repeating the edge pixel.
//! 2. Coefficient smoothing: window sums of `p1 p1`, `p1 p2`, `p1 m` (and `m m` for the residual).
//! 3. `c1 alpha + c3 alpha^3 = c0` solved on the branch through 0 (`crate::cubic`), median, alpha to mm.
//! 4. The border, where the operators reach beyond the images, takes the nearest inner depth (`border_fill`).
//! 5. Confidence in [0, 1] from texture energy `c1` and the fit's residual ([`crate::confidence`]).
//!
//! Images may have any common gain and offset: they are normalised first. `I1` is the far-focused image.

mod border_fill;
mod check;
mod fast;
mod processor;
#[cfg(test)]
mod reference;

use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};

use crate::fill::{FillBy, Filling, LowTexture};
use crate::operators::Operators;
use crate::optics::Optics;

pub use crate::cubic::MAX_ALPHA;
pub use crate::depth_map::{DepthMap, SwapEvidence, Warning};
pub use crate::simd::Backend;
pub(crate) use border_fill::{extend as extend_border, fill as fill_border, widen as widen_border};
pub(crate) use check::{after as warnings_after, check, check_windows};
pub use processor::Processor;

/// Smallest processable width and height: below, the operators use mostly reflections.
pub const MIN_SIDE_PX: usize = 16;

/// Largest smoothing window.
pub const MAX_SMOOTHING_PX: usize = 63;

/// Why no depth could be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum RunError {
    #[error(
        "the far image is {far_width}x{far_height} and the near image {near_width}x{near_height}: a pair must have one size"
    )]
    SizeMismatch { far_width: usize, far_height: usize, near_width: usize, near_height: usize },
    #[error("images of {width}x{height} px are too small: at least 16x16 are needed")]
    TooSmall { width: usize, height: usize },
    #[error("no pixel has a finite value in both images")]
    NothingFinite,
    #[error("the {which} image is constant ({value}): depth needs texture")]
    Constant { which: &'static str, value: f32 },
    #[error("far and near hold the same image: depth needs one focused far and one focused near")]
    SameImage,
    #[error("{what} window of {size} px: must be odd and from 1 to {largest}")]
    Window { what: &'static str, size: usize, largest: usize },
    #[error(
        "the operators were designed for a largest blur of {operators_px} px, the optics have {optics_px} px: depths \
         would be wrong by {percent:.0} %; design operators for these optics"
    )]
    BlurMismatch { operators_px: f64, optics_px: f64, percent: f64 },
}

/// How a pair is processed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    /// Side of the window over which the cubic's coefficients are summed, odd; 1 = none.
    pub smoothing_px: usize,
    /// Side of the median window over alpha: 1 (none), 3, 5 or 7.
    pub median_px: usize,
    /// Whether regions of low texture are filled ([`crate::fill`]).
    pub fill: bool,
    /// Selection of the holes to fill.
    #[serde(skip_serializing_if = "is_usual")]
    pub low_texture: LowTexture,
    /// Order and surroundings of the filling.
    #[serde(skip_serializing_if = "is_usual")]
    pub fill_by: FillBy,
    /// Number of threads; 0 = as many as the machine has.
    pub threads: usize,
    /// Vector unit; `None` uses the fastest available.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub backend: Option<Backend>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            smoothing_px: 7,
            median_px: 3,
            fill: false,
            low_texture: LowTexture::default(),
            fill_by: FillBy::default(),
            threads: 1,
            backend: None,
        }
    }
}

fn is_usual<T: Default + PartialEq>(setting: &T) -> bool {
    *setting == T::default()
}

impl Settings {
    pub(crate) fn filling(&self) -> Filling {
        Filling { low_texture: self.low_texture, by: self.fill_by, window_px: self.smoothing_px }
    }

    pub(crate) fn thread_count(&self) -> usize {
        match self.threads {
            0 => rayon::current_num_threads(),
            n => n.min(rayon::current_num_threads()),
        }
    }
}

/// Depth of one pair; a [`Processor`] is faster for many. `far` and `near` are (height, width) in any common scale.
/// Returns [`RunError`] for sizes, windows, constant or invalid images, and operators for another blur. Single invalid
/// or saturated pixels give NaN depth and confidence 0 wherever they contribute, with a warning.
pub fn depth_from_pair(
    far: ArrayView2<f32>,
    near: ArrayView2<f32>,
    operators: &Operators,
    optics: &Optics,
    settings: &Settings,
) -> Result<DepthMap, RunError> {
    let mut processor = Processor::new(operators, optics, settings)?;
    processor.run(far, near)?;
    Ok(processor.into_map())
}

#[cfg(test)]
mod tests {
    use ndarray::{Array2, CowArray};

    use super::*;
    use crate::depth_of_alpha::DepthOfAlpha;
    use crate::operators::{Request, design};
    use crate::optics::OpticsFile;

    fn random_pair(height: usize, width: usize) -> [Array2<f32>; 2] {
        let value = |y: usize, x: usize, seed: usize| {
            let mut h = (y * 7919 + x * 104_729 + seed * 1_299_709) as u64;
            h = (h ^ (h >> 13)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            ((h >> 40) as f32) / 16_777_216.0
        };
        [1, 2].map(|seed| {
            Array2::from_shape_fn((height, width), |(y, x)| {
                40.0 + 100.0
                    * (value(y / 2, x / 2, 0) + 0.15 * value(y / 3, x / 2, seed) + 0.05 * value(y, x, seed))
            })
        })
    }

    fn optics() -> Optics {
        let text = "[lens]\nfocal_length_mm = 50.0\nf_number = 3.90625\n[sensor]\npixel_um = 7.4\n\
                    [focus]\nfar_mm = 933.0\nmax_blur_px = 2.703";
        toml::from_str::<OpticsFile>(text).unwrap().check().unwrap()
    }

    #[test]
    fn every_variant_agrees_with_the_plain_run_time() {
        let optics = optics();
        for (height, width, kernel_size, smoothing_px, median_px) in [
            (16, 16, 7, 7, 3),
            (37, 51, 5, 3, 1),
            (23, 1500, 7, 7, 3),
            (130, 40, 11, 9, 5),
            (64, 70, 9, 1, 7),
            (48, 90, 13, 7, 3),
            (64, 70, 7, MAX_SMOOTHING_PX, 3),
        ] {
            let request = Request { kernel_size, ..Request::for_optics(&optics) };
            let operators = design(&request).unwrap();
            let pair = random_pair(height, width);
            let [far, near] = pair.each_ref().map(|i| CowArray::from(i.view()));
            let settings = Settings { smoothing_px, median_px, ..Settings::default() };
            let input = check::check(&far, &near, Backend::best(), 1).unwrap();
            let plain = reference::maps(&input, &operators, &settings);
            for backend in Backend::available() {
                for threads in [1, 2] {
                    let settings = Settings { threads, backend: Some(backend), ..settings };
                    let [mut depth_mm, mut texture, mut misfit] =
                        [(); 3].map(|()| Array2::zeros((height, width)));
                    let depth_of = DepthOfAlpha::new(&operators, &optics);
                    fast::Job {
                        input: &input,
                        operators: &operators,
                        settings: &settings,
                        invalid: None,
                        depth_of,
                        backend,
                    }
                    .run(
                        &mut Vec::new(),
                        fast::Maps {
                            depth_mm: depth_mm.view_mut(),
                            texture: texture.view_mut(),
                            misfit: misfit.view_mut(),
                        },
                    );
                    let scale = plain.texture.iter().copied().fold(0.0, f32::max);
                    let at = format!("{backend:?} {width}x{height} kernel {kernel_size} threads {threads}");
                    for (a, b) in texture.iter().zip(&plain.texture) {
                        assert!((a - b).abs() <= 1e-5 * scale, "texture {a} {b} {at}");
                    }
                    for ((y, x), alpha) in plain.alpha.indexed_iter() {
                        // Low texture magnifies rounding; alpha spans 46 mm of depth over 2.
                        let weight = (plain.texture[(y, x)] / scale).sqrt();
                        let error = weight * (depth_mm[(y, x)] - depth_of.depth_mm(*alpha)).abs() / 23.0;
                        assert!(error < 1e-4, "alpha {error} at ({x}, {y}) {at}");
                    }
                    for ((a, b), c) in misfit.iter().zip(&plain.misfit).zip(&plain.texture) {
                        assert!(c / scale * (a - b).abs() < 1e-4 * (1.0 + b), "misfit {a} {b} {at}");
                    }
                }
            }
        }
    }
}
