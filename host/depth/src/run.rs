//! Run time: a defocused pair and operators to a depth map with its confidence.
//!
//! 1. `M = Q * (I2 - I1)`, `P = Q * (I2 + I1)`; `m = Gm1 * M`, `p1 = Gp1 * P`, `p2 = Gp2 * P` (Li 2014, eqs. 1.7 to
//!    1.9), borders reflected without repeating the edge pixel.
//! 2. Coefficient smoothing: window sums of the cross products `p1 p1`, `p1 p2`, `p1 m` (and `m m` for the residual).
//! 3. `c1 alpha + c3 alpha^3 = c0` solved on the branch through 0 ([`cubic`]), median, alpha to mm.
//! 4. Confidence in [0, 1] from the texture energy `c1` and the residual of the window's fit ([`confidence`]).
//!
//! Images may have any common gain and offset: they are normalised first. `I1` is the far-focused image.

mod check;
pub mod confidence;
mod cubic;
mod plain;

use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};

use crate::operators::Operators;
use crate::optics::Optics;

pub use check::Warning;

/// Smallest width and height that can be processed: below, the operators see little but reflections.
pub const MIN_SIDE_PX: usize = 16;

/// Largest smoothing window.
pub const MAX_SMOOTHING_PX: usize = 63;

/// The largest |alpha| that is reported; a little beyond the working range, where the cubic still holds.
pub const MAX_ALPHA: f32 = 1.2;

/// Why no depth could be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RunError {
    /// The images differ in size.
    #[error(
        "the far image is {far_width}x{far_height} and the near image {near_width}x{near_height}: a pair must have one size"
    )]
    SizeMismatch {
        /// Width of the far-focused image.
        far_width: usize,
        /// Height of the far-focused image.
        far_height: usize,
        /// Width of the near-focused image.
        near_width: usize,
        /// Height of the near-focused image.
        near_height: usize,
    },
    /// The images are too small.
    #[error("images of {width}x{height} px are too small: at least 16x16 are needed")]
    TooSmall {
        /// Width.
        width: usize,
        /// Height.
        height: usize,
    },
    /// No pixel has a finite value in both images.
    #[error("no pixel has a finite value in both images")]
    NothingFinite,
    /// An image has the same value everywhere.
    #[error("the {which} image is constant ({value}): without texture there is no depth")]
    Constant {
        /// `far` or `near`.
        which: &'static str,
        /// The value.
        value: f32,
    },
    /// The smoothing or median window is unusable.
    #[error("{what} window of {size} px: must be odd and from 1 to {largest}")]
    Window {
        /// Which window.
        what: &'static str,
        /// The size asked for.
        size: usize,
        /// The largest allowed.
        largest: usize,
    },
    /// The operators were designed for another blur.
    #[error(
        "the operators were designed for a largest blur of {operators_px} px, the optics have {optics_px} px: depths \
         would be wrong by {percent:.0} %; design operators for these optics"
    )]
    BlurMismatch {
        /// Blur radius of the operators.
        operators_px: f64,
        /// Blur radius of the optics.
        optics_px: f64,
        /// Difference in percent.
        percent: f64,
    },
}

/// How a pair is processed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    /// Side of the window over which the cubic's coefficients are summed, odd; 1 = none.
    pub smoothing_px: usize,
    /// Side of the median window over alpha: 1 (none), 3, 5 or 7.
    pub median_px: usize,
    /// Number of threads; 0 = as many as the machine has.
    pub threads: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { smoothing_px: 7, median_px: 3, threads: 1 }
    }
}

/// A depth map and what is known about it.
#[derive(Debug, Clone)]
pub struct DepthMap {
    /// Object distance in mm, (height, width); NaN = no value.
    pub depth_mm: Array2<f32>,
    /// Confidence, 0 (none) to 1; 0 exactly where the depth is NaN.
    pub confidence: Array2<f32>,
    /// Part of the pixels whose texture energy is below [`confidence::LOW_TEXTURE`] times its median.
    pub low_texture_fraction: f64,
    /// What a user should know before trusting the map.
    pub warnings: Vec<Warning>,
}

/// Depth of a pair: `far` and `near` are the far- and near-focused images, (height, width), of any common scale.
///
/// # Errors
/// [`RunError`]: sizes, windows, constant or wholly invalid images, operators for another blur. Single invalid or
/// saturated pixels are no error: depth is NaN and confidence 0 wherever they take part, and a warning says so.
pub fn depth_from_pair(
    far: ArrayView2<f32>,
    near: ArrayView2<f32>,
    operators: &Operators,
    optics: &Optics,
    settings: &Settings,
) -> Result<DepthMap, RunError> {
    let input = check::check(far, near, operators, optics, settings)?;
    let mut warnings = input.warnings(operators, optics);
    let maps = plain::maps(&input, operators, settings);
    let depth_of = DepthOfAlpha::new(optics);
    let scale = confidence::texture_scale(maps.texture.view());
    let low_texture_fraction = confidence::low_texture_fraction(maps.texture.view(), scale);
    let mut depth_mm = maps.alpha;
    let mut confidence = maps.texture;
    ndarray::Zip::from(&mut depth_mm).and(&mut confidence).and(&maps.misfit).for_each(
        |depth, value, misfit| {
            *value = if depth.is_nan() { 0.0 } else { confidence::confidence(*value, *misfit, scale) };
            *depth = if *value > 0.0 { depth_of.depth_mm(*depth) } else { f32::NAN };
        },
    );
    warnings.extend(check::after(depth_mm.view(), confidence.view(), optics));
    Ok(DepthMap { depth_mm, confidence, low_texture_fraction, warnings })
}

/// Alpha to mm in single precision without cancellation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DepthOfAlpha {
    focal_length_mm: f32,
    focal_length_squared: f32,
    offset: f32,
    slope: f32,
}

impl DepthOfAlpha {
    pub(crate) fn new(optics: &Optics) -> Self {
        let [offset, slope] = optics.defocus_line_mm();
        let f = optics.focal_length_mm();
        Self {
            focal_length_mm: f as f32,
            focal_length_squared: (f * f) as f32,
            offset: offset as f32,
            slope: slope as f32,
        }
    }

    #[inline(always)]
    pub(crate) fn depth_mm(self, alpha: f32) -> f32 {
        self.focal_length_mm + self.focal_length_squared / (self.offset + self.slope * alpha)
    }
}
