//! What is checked before and after a run: sizes, windows, operators that fit the optics, invalid, saturated and
//! constant images, a pair that looks swapped.

use std::fmt;

use ndarray::{Array2, ArrayView2, CowArray, Ix2, Zip};

use super::simd::{self, Extremes};
use super::{Backend, MAX_SMOOTHING_PX, MIN_SIDE_PX, RunError, Settings};
use crate::operators::Operators;
use crate::optics::Optics;
use crate::psf::Psf;

/// Largest relative difference between the operators' and the optics' blur radius.
const BLUR_TOLERANCE: f64 = 0.02;

/// Part of saturated pixels in an image from which it is reported.
const SATURATED: f64 = 0.002;

/// What a user should know before trusting a map.
#[derive(Debug, Clone, PartialEq)]
pub enum Warning {
    /// Pixels are NaN or infinite.
    NotFinite {
        /// Number of pixels that are so in at least one image.
        pixels: usize,
    },
    /// Pixels share the largest value of the pair in flat patches: they are saturated.
    Saturated {
        /// Part of the pixels that are so in at least one image.
        fraction: f64,
    },
    /// The operators were designed for another PSF than the optics have.
    PsfMismatch {
        /// PSF of the operators.
        operators: Psf,
        /// PSF of the optics.
        optics: Psf,
    },
    /// The far image seems to be the near one: most of the scene would lie nearer than the near focus.
    LooksSwapped {
        /// Part of the confident pixels beyond the near focus.
        beyond_near: f64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite { pixels } => {
                write!(f, "{pixels} pixels are NaN or infinite: there is no depth around them")
            }
            Self::Saturated { fraction } => {
                write!(
                    f,
                    "{:.1} % of the pixels are saturated: there is no depth around them",
                    100.0 * fraction
                )
            }
            Self::PsfMismatch { operators, optics } => write!(
                f,
                "the operators were designed for the PSF {operators}, the optics have {optics}: expect errors of millimetres"
            ),
            Self::LooksSwapped { beyond_near } => write!(
                f,
                "the pair looks swapped: {:.0} % of the scene would lie nearer than the near focus; is FAR really the \
                 far-focused image?",
                100.0 * beyond_near
            ),
        }
    }
}

/// A pair that can be processed: pixels in rows after each other.
pub(crate) struct Input<'a> {
    pub far: &'a [f32],
    pub near: &'a [f32],
    pub width: usize,
    pub height: usize,
    /// Subtracted from every pixel.
    pub offset: f32,
    /// Then multiplied with every pixel.
    pub gain: f32,
    /// Pixels that are not finite or saturated, if any.
    bad: Option<Array2<bool>>,
    not_finite: usize,
    saturated: usize,
}

/// Checks a pair against operators, optics and settings. Both images are contiguous.
pub(crate) fn check<'a>(
    far: &'a CowArray<'_, f32, Ix2>,
    near: &'a CowArray<'_, f32, Ix2>,
    operators: &Operators,
    optics: &Optics,
    settings: &Settings,
) -> Result<Input<'a>, RunError> {
    let (height, width) = far.dim();
    if near.dim() != (height, width) {
        let (near_height, near_width) = near.dim();
        return Err(RunError::SizeMismatch { far_width: width, far_height: height, near_width, near_height });
    }
    if height < MIN_SIDE_PX || width < MIN_SIDE_PX {
        return Err(RunError::TooSmall { width, height });
    }
    for (what, size, largest) in
        [("smoothing", settings.smoothing_px, MAX_SMOOTHING_PX), ("median", settings.median_px, 7)]
    {
        if size % 2 == 0 || size > largest {
            return Err(RunError::Window { what, size, largest });
        }
    }
    let [operators_px, optics_px] = [operators.max_blur_px(), optics.max_blur_px()];
    let difference = (operators_px / optics_px - 1.0).abs();
    if difference > BLUR_TOLERANCE {
        return Err(RunError::BlurMismatch { operators_px, optics_px, percent: 100.0 * difference });
    }
    let backend = settings.backend.unwrap_or_else(Backend::best);
    scan(far.view(), near.view(), backend)
}

/// Smallest and largest finite value of an image, and the number of values that are not finite.
fn range(image: ArrayView2<f32>, backend: Backend) -> Extremes {
    let mut whole = Extremes { low: f32::INFINITY, high: f32::NEG_INFINITY, finite: true };
    for row in image.rows() {
        let mut part = simd::extremes(backend, row.to_slice().unwrap_or(&[]));
        if !part.finite {
            let finite = || row.iter().copied().filter(|v| v.is_finite());
            part.low = finite().fold(f32::INFINITY, f32::min);
            part.high = finite().fold(f32::NEG_INFINITY, f32::max);
        }
        whole.low = whole.low.min(part.low);
        whole.high = whole.high.max(part.high);
        whole.finite &= part.finite;
    }
    whole
}

fn scan<'a>(
    far: ArrayView2<'a, f32>,
    near: ArrayView2<'a, f32>,
    backend: Backend,
) -> Result<Input<'a>, RunError> {
    let (height, width) = far.dim();
    let ranges = [far, near].map(|image| range(image, backend));
    if ranges.iter().any(|r| r.low > r.high) {
        return Err(RunError::NothingFinite);
    }
    for (which, range) in ["far", "near"].into_iter().zip(ranges) {
        if range.low == range.high {
            return Err(RunError::Constant { which, value: range.low });
        }
    }
    let [low, high] = [ranges[0].low.min(ranges[1].low), ranges[0].high.max(ranges[1].high)];
    let not_finite_mask = (!(ranges[0].finite && ranges[1].finite))
        .then(|| Zip::from(far).and(near).map_collect(|a, b| !(a.is_finite() && b.is_finite())));
    let not_finite = not_finite_mask.as_ref().map_or(0, |mask| mask.iter().filter(|m| **m).count());
    let saturated_mask = saturated(far, near, high);
    let saturated = saturated_mask.as_ref().map_or(0, |mask| mask.iter().filter(|m| **m).count());
    let bad = match (not_finite_mask, saturated_mask) {
        (Some(a), Some(b)) => Some(a | b),
        (a, b) => a.or(b),
    };
    let [far, near] = [far, near].map(|image| image.to_slice().unwrap_or(&[]));
    // Halves, so that a range near the largest number does not overflow.
    let gain = 0.5 / (0.5 * high - 0.5 * low);
    Ok(Input { far, near, width, height, offset: 0.5 * low + 0.5 * high, gain, bad, not_finite, saturated })
}

/// The pixels of flat patches (2x2 and more) at the largest value, if there are so many that it cannot be chance.
fn saturated(far: ArrayView2<f32>, near: ArrayView2<f32>, high: f32) -> Option<Array2<bool>> {
    let enough = (SATURATED * far.len() as f64).max(4.0);
    // In 32 bits the loop is done in vectors.
    let in_row = |row: &[f32]| row.iter().map(|v| u32::from(*v >= high)).sum::<u32>() as usize;
    let at_top = |image: ArrayView2<f32>| -> usize {
        image.rows().into_iter().map(|row| in_row(row.to_slice().unwrap_or(&[]))).sum()
    };
    if ((at_top(far) + at_top(near)) as f64) < enough {
        return None;
    }
    let mut marked = Array2::from_elem(far.dim(), false);
    for image in [far, near] {
        for y in 1..image.nrows() {
            for x in 1..image.ncols() {
                let patch = [(y - 1, x - 1), (y - 1, x), (y, x - 1), (y, x)];
                if patch.iter().all(|at| image[*at] >= high) {
                    patch.iter().for_each(|at| marked[*at] = true);
                }
            }
        }
    }
    (marked.iter().filter(|m| **m).count() as f64 >= enough).then_some(marked)
}

impl Input<'_> {
    /// Warnings about the input.
    pub(crate) fn warnings(&self, operators: &Operators, optics: &Optics) -> Vec<Warning> {
        let mut warnings = Vec::new();
        if self.not_finite > 0 {
            warnings.push(Warning::NotFinite { pixels: self.not_finite });
        }
        if self.saturated > 0 {
            warnings.push(Warning::Saturated { fraction: self.saturated as f64 / self.far.len() as f64 });
        }
        let psf = operators.request().psf;
        if psf != optics.psf() {
            warnings.push(Warning::PsfMismatch { operators: psf, optics: optics.psf() });
        }
        warnings
    }

    /// Whether some pixels are not finite or saturated.
    pub(crate) fn has_holes(&self) -> bool {
        self.bad.is_some()
    }

    /// `[I2 - I1, I2 + I1]` of one pixel, normalised; 0 where it is not finite.
    pub(crate) fn normalised(&self, y: usize, x: usize) -> [f32; 2] {
        let [far, near] = [self.far, self.near].map(|image| image[y * self.width + x]);
        let pair = [(near - far) * self.gain, ((near - self.offset) + (far - self.offset)) * self.gain];
        if pair.iter().all(|v| v.is_finite()) { pair } else { [0.0; 2] }
    }

    /// The pixels whose depth a bad pixel takes part in, if there are any.
    pub(crate) fn invalid(&self, operators: &Operators, settings: &Settings) -> Option<Array2<bool>> {
        let reach = 2 * (operators.kernel_size() / 2) + settings.smoothing_px / 2;
        self.bad.as_ref().map(|bad| crate::metrics::dilate_square(bad, reach))
    }
}

/// Confidence from which a pixel has a say in whether the pair looks swapped.
const CONFIDENT: f32 = 0.7;

/// Warnings about the result.
pub(crate) fn after(
    depth_mm: ArrayView2<f32>,
    confidence: ArrayView2<f32>,
    optics: &Optics,
) -> Option<Warning> {
    let [near_mm, far_mm] = [optics.depth_mm(1.1) as f32, optics.depth_mm(-1.1) as f32];
    let [mut total, mut beyond_near, mut beyond_far] = [0_usize; 3];
    Zip::from(depth_mm).and(confidence).for_each(|depth, confidence| {
        if *confidence > CONFIDENT {
            total += 1;
            beyond_near += usize::from(*depth < near_mm);
            beyond_far += usize::from(*depth > far_mm);
        }
    });
    let part = |n: usize| n as f64 / total.max(1) as f64;
    (part(beyond_near) > 0.3 && beyond_near > 4 * beyond_far)
        .then(|| Warning::LooksSwapped { beyond_near: part(beyond_near) })
}
