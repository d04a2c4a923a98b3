//! Corrections of the depth-variant elliptical distortion, learned from depth maps of flat targets.
//!
//! A flat target appears as a bowl whose height depends on the depth (Li 2014, sections 5.3 and 6.2). A series of
//! targets at known depths, [`Pattern`]s, teaches one of these corrections:
//!
//! | method | what | reference |
//! |---|---|---|
//! | [`Method::Clsf`] | third-order polynomial, 10 terms, in each of 3x3 regions; steps at region borders | eq. 6.11 |
//! | [`Method::ClsfBlend`] | the same regions blended bilinearly | |
//! | [`Method::ClsfFull`] | one polynomial with all 20 terms of third order; seamless | |
//! | [`Method::Cdc`] | cancellation by the stored pattern nearest in depth, interpolated twice | eqs. 6.2 to 6.10 |
//! | [`Method::TwoStep`] | offset by a first polynomial, its distortion by a second | eqs. 5.21, 5.22 |
//! | [`Method::Spline`] | smooth surface over field and depth: tensor-product cubic B-spline, penalised; seamless | Eilers & Marx 1996 |
//!
//! Depths are mm, maps (height, width), NaN = no value. `x` and `y` run from -1 to 1 over the map. Depth is normalised
//! over 1.3 times half the patterns' range ([`farnear_maths::clsf::DepthScale`]); beyond it the corrected depth is NaN,
//! because a correction would extrapolate. A new correction is a file of this folder that implements `Learned`, and a
//! line in the table below. Cost of [`Correction::apply_in_place`] on 640x480, one thread: 0.2 ms (`clsf`) to 0.4 ms
//! (`two-step`), CDC (24 patterns, window 1) about 12 ms. [`fit`] takes 0.1 to 1.2 s (`cdc`).

mod board;
mod cdc;
mod clsf;
mod clsf_blend;
mod clsf_full;
mod error;
mod moments;
mod names;
mod pattern;
mod regions;
mod spline;
mod table;
mod two_step;

use farnear_maths::clsf::DepthScale;
use ndarray::{Array2, ArrayView2, ArrayViewMut2, CowArray, Ix2};
use serde::{Deserialize, Serialize};

use self::pattern::Series;
use self::table::{Learned, corrections};
use crate::metrics::is_depth;
use crate::optics::WorkingRange;

pub use board::{BoardCorrection, BoardForm};
pub use cdc::CdcSettings;
pub use error::CorrectionError;
pub use pattern::Pattern;

/// Version of the stored form; other versions are rejected.
pub const FORMAT: u32 = 1;

/// Least part of the working range that the patterns must cover.
const SHARED_RANGE: f64 = 0.25;

// All corrections: what it is in a few words; variant, name, and what learns it.
corrections! {
    /// 3x3 regions
    Clsf = "clsf": clsf::Clsf,
    /// 3x3 regions without steps
    ClsfBlend = "clsf-blend": clsf_blend::ClsfBlend,
    /// one polynomial
    ClsfFull = "clsf-full": clsf_full::ClsfFull,
    /// stored patterns
    Cdc = "cdc": cdc::Cdc,
    /// two polynomials in turn
    TwoStep = "two-step": two_step::TwoStep,
    /// smooth surface over field and depth
    Spline = "spline": spline::Spline,
}

/// A correction, learned or loaded; serde saves it whole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct Correction {
    width: usize,
    height: usize,
    far_mm: f64,
    near_mm: f64,
    scale: DepthScale,
    map: Map,
}

#[derive(Serialize, Deserialize)]
struct Stored {
    format: u32,
    width: usize,
    height: usize,
    far_mm: f64,
    near_mm: f64,
    map: Map,
}

impl From<Correction> for Stored {
    fn from(c: Correction) -> Self {
        let Correction { width, height, far_mm, near_mm, map, .. } = c;
        Self { format: FORMAT, width, height, far_mm, near_mm, map }
    }
}

impl TryFrom<Stored> for Correction {
    type Error = CorrectionError;

    fn try_from(stored: Stored) -> Result<Self, CorrectionError> {
        if stored.format != FORMAT {
            return Err(CorrectionError::Format { found: stored.format });
        }
        let Stored { width, height, far_mm, near_mm, mut map, .. } = stored;
        let scale = pattern::scale(far_mm, near_mm)?;
        map.prepare((height, width))?;
        Ok(Self { width, height, far_mm, near_mm, scale, map })
    }
}

/// Learns a correction. [`CorrectionError`] for too few patterns or valid pixels, and for invalid or repeated depths.
pub fn fit(
    method: Method,
    patterns: &[Pattern<'_>],
    cdc: &CdcSettings,
) -> Result<Correction, CorrectionError> {
    let maps: Vec<CowArray<'_, f32, Ix2>> =
        patterns.iter().map(|pattern| without_invalid(pattern.depth_mm)).collect();
    let patterns: Vec<Pattern<'_>> = maps
        .iter()
        .zip(patterns)
        .map(|(map, pattern)| Pattern { depth_mm: map.view(), true_mm: pattern.true_mm })
        .collect();
    let series = Series::new(method, &patterns)?;
    let map = Map::learn(method, &series, cdc)?;
    let (height, width) = series.dim();
    let (far_mm, near_mm) = series.range_mm();
    Ok(Correction { width, height, far_mm, near_mm, scale: series.scale(), map })
}

/// A copy with NaN for values that are not depths, or the map where all others are NaN.
fn without_invalid(map: ArrayView2<'_, f32>) -> CowArray<'_, f32, Ix2> {
    if map.iter().all(|value| value.is_nan() || is_depth(*value)) {
        return map.into();
    }
    map.mapv(|value| if is_depth(value) { value } else { f32::NAN }).into()
}

impl Correction {
    /// The method of this correction.
    pub fn method(&self) -> Method {
        self.map.method()
    }

    /// (height, width) of the maps it corrects.
    pub fn dim(&self) -> (usize, usize) {
        (self.height, self.width)
    }

    /// True depths of the farthest and the nearest pattern, mm.
    pub fn range_mm(&self) -> (f64, f64) {
        (self.far_mm, self.near_mm)
    }

    /// Checks that this correction covers part of a working range; beyond its own range [`Self::apply`] gives no depth.
    pub fn check_range(&self, range: &WorkingRange) -> Result<(), CorrectionError> {
        let (width, own) = (range.far_mm - range.near_mm, self.far_mm - self.near_mm);
        let shared = range.far_mm.min(self.far_mm) - range.near_mm.max(self.near_mm);
        if shared >= SHARED_RANGE * width && own <= 2.0 * width {
            return Ok(());
        }
        Err(CorrectionError::RangeMismatch {
            correction_far_mm: self.far_mm,
            correction_near_mm: self.near_mm,
            far_mm: range.far_mm,
            near_mm: range.near_mm,
        })
    }

    /// The corrected map; NaN beyond the correction's scale. [`CorrectionError::SizeMismatch`] for another size.
    pub fn apply(&self, depth_mm: ArrayView2<f32>) -> Result<Array2<f32>, CorrectionError> {
        let mut corrected = depth_mm.as_standard_layout().into_owned();
        self.apply_in_place(corrected.view_mut())?;
        Ok(corrected)
    }

    /// As [`Self::apply`], without a second map. A map of another size is left unchanged.
    pub fn apply_in_place(&self, mut depth_mm: ArrayViewMut2<f32>) -> Result<(), CorrectionError> {
        self.check_size(depth_mm.dim())?;
        if !depth_mm.is_standard_layout() {
            let corrected = self.apply(depth_mm.view())?;
            depth_mm.assign(&corrected);
            return Ok(());
        }
        self.map.apply(depth_mm, self.scale);
        Ok(())
    }

    /// As [`Self::apply`] with the board's fixed-point arithmetic: identical bits, within 0.005 mm of [`Self::apply`].
    /// Also fails with [`CorrectionError::NotOnBoard`] or [`CorrectionError::Board`] (number formats).
    pub fn apply_as_board(&self, depth_mm: ArrayView2<f32>) -> Result<Array2<f32>, CorrectionError> {
        self.check_size(depth_mm.dim())?;
        self.for_board()?.apply(depth_mm)
    }

    /// This correction in the board's number formats; errors as [`Self::apply_as_board`].
    pub fn for_board(&self) -> Result<BoardCorrection, CorrectionError> {
        let method = self.method();
        let form = method.board_form().ok_or(CorrectionError::NotOnBoard(method))?;
        let frame = board::frame((self.height, self.width))?;
        Ok(BoardCorrection { method, form, frame, scale: self.scale, coefficients: self.map.quantised()? })
    }

    fn check_size(&self, (height, width): (usize, usize)) -> Result<(), CorrectionError> {
        if (height, width) == (self.height, self.width) {
            return Ok(());
        }
        let (made_for_width, made_for_height) = (self.width, self.height);
        Err(CorrectionError::SizeMismatch { width, height, made_for_width, made_for_height })
    }
}
