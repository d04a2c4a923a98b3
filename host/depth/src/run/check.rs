//! What is checked before and after a run: sizes, windows, operators that fit the optics, invalid, saturated and
//! constant images, a pair that looks swapped.

use std::fmt;

use ndarray::{Array2, ArrayView2, Zip};

use super::{MAX_SMOOTHING_PX, MIN_SIDE_PX, RunError, Settings};
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

/// A pair that can be processed.
pub(crate) struct Input<'a> {
    pub far: ArrayView2<'a, f32>,
    pub near: ArrayView2<'a, f32>,
    /// Subtracted from every pixel.
    pub offset: f32,
    /// Then multiplied with every pixel.
    pub gain: f32,
    /// Pixels that are not finite or saturated, if any.
    bad: Option<Array2<bool>>,
    not_finite: usize,
    saturated: usize,
}

/// Checks a pair against operators, optics and settings.
pub(crate) fn check<'a>(
    far: ArrayView2<'a, f32>,
    near: ArrayView2<'a, f32>,
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
    scan(far, near)
}

fn scan<'a>(far: ArrayView2<'a, f32>, near: ArrayView2<'a, f32>) -> Result<Input<'a>, RunError> {
    let extremes = |image: ArrayView2<f32>| {
        image
            .iter()
            .filter(|v| v.is_finite())
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)))
    };
    let [far_range, near_range] = [extremes(far), extremes(near)];
    if far_range.0 > far_range.1 || near_range.0 > near_range.1 {
        return Err(RunError::NothingFinite);
    }
    for (which, (low, high)) in [("far", far_range), ("near", near_range)] {
        if low == high {
            return Err(RunError::Constant { which, value: low });
        }
    }
    let [low, high] = [far_range.0.min(near_range.0), far_range.1.max(near_range.1)];
    let mut bad = Array2::from_elem(far.dim(), false);
    let mut not_finite = 0;
    Zip::from(&mut bad).and(far).and(near).for_each(|bad, a, b| {
        *bad = !(a.is_finite() && b.is_finite());
        not_finite += usize::from(*bad);
    });
    let saturated = mark_saturated(far, near, high, &mut bad);
    let any = not_finite + saturated > 0;
    Ok(Input {
        far,
        near,
        offset: 0.5 * (low + high),
        gain: 1.0 / (high - low),
        bad: any.then_some(bad),
        not_finite,
        saturated,
    })
}

/// Marks pixels of flat patches (2x2 and more) at the largest value, if there are so many that it cannot be chance.
fn mark_saturated(far: ArrayView2<f32>, near: ArrayView2<f32>, high: f32, bad: &mut Array2<bool>) -> usize {
    let (height, width) = far.dim();
    let mut marked = Array2::from_elem((height, width), false);
    for image in [far, near] {
        for y in 1..height {
            for x in 1..width {
                let patch = [(y - 1, x - 1), (y - 1, x), (y, x - 1), (y, x)];
                if patch.iter().all(|at| image[*at] >= high) {
                    patch.iter().for_each(|at| marked[*at] = true);
                }
            }
        }
    }
    let count = marked.iter().filter(|m| **m).count();
    if (count as f64) < SATURATED * (height * width) as f64 {
        return 0;
    }
    Zip::from(bad).and(&marked).for_each(|bad, marked| *bad |= marked);
    count
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

    /// `[I2 - I1, I2 + I1]`, normalised; 0 where a pixel is not finite.
    pub(crate) fn difference_and_sum(&self) -> [Array2<f32>; 2] {
        let normal = |v: f32| if v.is_finite() { (v - self.offset) * self.gain } else { 0.0 };
        let combine =
            |sign: f32| Zip::from(self.far).and(self.near).map_collect(|a, b| normal(*b) + sign * normal(*a));
        [combine(-1.0), combine(1.0)]
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
