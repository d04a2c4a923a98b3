//! Checks before and after a run: sizes, windows, operators, invalid, saturated, constant and swapped images.

use ndarray::{Array2, CowArray, Ix2};
use rayon::prelude::*;

use super::{Backend, DepthMap, MAX_SMOOTHING_PX, MIN_SIDE_PX, RunError, Settings, SwapEvidence, Warning};
use crate::confidence;
use crate::median::median;
use crate::operators::Operators;
use crate::optics::Optics;
use crate::simd::{self, Extremes};

/// Largest relative difference between the operators' and the optics' blur radius.
const BLUR_TOLERANCE: f64 = 0.02;

/// Part of saturated pixels that is reported.
const SATURATED: f64 = 0.002;

/// A checked pair, in consecutive rows.
pub(crate) struct Input<'a> {
    pub far: &'a [f32],
    pub near: &'a [f32],
    pub width: usize,
    pub height: usize,
    pub offset: f32,
    /// Applied after the offset.
    pub gain: f32,
    /// Pixels that are not finite or saturated, if any.
    bad: Option<Array2<bool>>,
    not_finite: usize,
    saturated: usize,
}

pub(crate) fn check_windows(settings: &Settings) -> Result<(), RunError> {
    for (what, size, largest) in
        [("smoothing", settings.smoothing_px, MAX_SMOOTHING_PX), ("median", settings.median_px, 7)]
    {
        if size % 2 == 0 || size > largest {
            return Err(RunError::Window { what, size, largest });
        }
    }
    Ok(())
}

pub(crate) fn check_settings(
    operators: &Operators,
    optics: &Optics,
    settings: &Settings,
) -> Result<(), RunError> {
    check_windows(settings)?;
    let [operators_px, optics_px] = [operators.max_blur_px(), optics.max_blur_px()];
    let difference = (operators_px / optics_px - 1.0).abs();
    if difference > BLUR_TOLERANCE {
        return Err(RunError::BlurMismatch { operators_px, optics_px, percent: 100.0 * difference });
    }
    Ok(())
}

pub(crate) fn check<'a>(
    far: &'a CowArray<'_, f32, Ix2>,
    near: &'a CowArray<'_, f32, Ix2>,
    backend: Backend,
    threads: usize,
) -> Result<Input<'a>, RunError> {
    let (height, width) = far.dim();
    if near.dim() != (height, width) {
        let (near_height, near_width) = near.dim();
        return Err(RunError::SizeMismatch { far_width: width, far_height: height, near_width, near_height });
    }
    if height < MIN_SIDE_PX || width < MIN_SIDE_PX {
        return Err(RunError::TooSmall { width, height });
    }
    let (Some(far), Some(near)) = (far.as_slice(), near.as_slice()) else {
        unreachable!("the images are in standard layout");
    };
    scan(far, near, width, backend, threads)
}

fn range(pixels: &[f32], backend: Backend) -> Extremes {
    let mut range = simd::extremes(backend, pixels);
    if !range.finite {
        let finite = || pixels.iter().copied().filter(|v| v.is_finite());
        range.low = finite().fold(f32::INFINITY, f32::min);
        range.high = finite().fold(f32::NEG_INFINITY, f32::max);
    }
    range
}

/// Rows whose range is found together: amortises the loop's start and end.
const RANGE_ROWS: usize = 8;

fn ranges(images: [&[f32]; 2], width: usize, backend: Backend, threads: usize) -> Vec<[Extremes; 2]> {
    let block = RANGE_ROWS * width;
    let of_blocks = |(far, near)| [range(far, backend), range(near, backend)];
    let [far, near] = images;
    if threads == 1 {
        return far.chunks(block).zip(near.chunks(block)).map(of_blocks).collect();
    }
    let together = far.len().div_ceil(block).div_ceil(threads);
    let blocks = far.par_chunks(block).zip(near.par_chunks(block));
    blocks.with_min_len(together).map(of_blocks).collect()
}

fn scan<'a>(
    far: &'a [f32],
    near: &'a [f32],
    width: usize,
    backend: Backend,
    threads: usize,
) -> Result<Input<'a>, RunError> {
    let height = far.len() / width;
    let of_blocks = ranges([far, near], width, backend, threads);
    let nothing = Extremes { low: f32::INFINITY, high: f32::NEG_INFINITY, finite: true };
    let whole = [0, 1].map(|image| {
        of_blocks.iter().map(|block| block[image]).fold(nothing, |a, b| Extremes {
            low: a.low.min(b.low),
            high: a.high.max(b.high),
            finite: a.finite && b.finite,
        })
    });
    if whole.iter().any(|r| r.low > r.high) {
        return Err(RunError::NothingFinite);
    }
    for (which, range) in ["far", "near"].into_iter().zip(whole) {
        if range.low == range.high {
            return Err(RunError::Constant { which, value: range.low });
        }
    }
    let [low, high] = [whole[0].low.min(whole[1].low), whole[0].high.max(whole[1].high)];
    let not_finite_mask = (!(whole[0].finite && whole[1].finite)).then(|| {
        let mut mask = Array2::from_elem((height, width), false);
        let pixels = mask.iter_mut().zip(far).zip(near);
        pixels.for_each(|((bad, far), near)| *bad = !far.is_finite() | !near.is_finite());
        mask
    });
    let count =
        |mask: &Option<Array2<bool>>| mask.as_ref().map_or(0, |m| m.iter().map(|m| usize::from(*m)).sum());
    let saturated_mask = saturated([far, near], &of_blocks, high, width);
    let [not_finite, saturated] = [count(&not_finite_mask), count(&saturated_mask)];
    let bad = match (not_finite_mask, saturated_mask) {
        (Some(a), Some(b)) => Some(a | b),
        (a, b) => a.or(b),
    };
    // Halves, so that a range near the largest number does not overflow.
    let gain = 0.5 / (0.5 * high - 0.5 * low);
    Ok(Input { far, near, width, height, offset: 0.5 * low + 0.5 * high, gain, bad, not_finite, saturated })
}

/// Pixels of flat patches (2x2 and more) at the largest value, if too many for chance.
fn saturated(
    images: [&[f32]; 2],
    of_blocks: &[[Extremes; 2]],
    high: f32,
    width: usize,
) -> Option<Array2<bool>> {
    let pixels = images[0].len();
    let enough = (SATURATED * pixels as f64).max(4.0) as usize;
    // Only blocks that reach the largest value have such pixels; 32-bit sums vectorise.
    let at_top = |pixels: &[f32]| pixels.iter().map(|v| u32::from(*v >= high)).sum::<u32>() as usize;
    let mut count = 0;
    for (image, pixels_of_image) in images.into_iter().enumerate() {
        let blocks = pixels_of_image.chunks(RANGE_ROWS * width).zip(of_blocks);
        count += blocks.filter(|(_, r)| r[image].high >= high).map(|(block, _)| at_top(block)).sum::<usize>();
    }
    if count < enough {
        return None;
    }
    let mut marked = Array2::from_elem((pixels / width, width), false);
    for image in images {
        for y in 1..marked.nrows() {
            for x in 1..width {
                let patch = [(y - 1, x - 1), (y - 1, x), (y, x - 1), (y, x)];
                if patch.iter().all(|(y, x)| image[y * width + x] >= high) {
                    patch.iter().for_each(|at| marked[*at] = true);
                }
            }
        }
    }
    (marked.iter().filter(|m| **m).count() >= enough).then_some(marked)
}

impl Input<'_> {
    pub(crate) fn pixel_warnings(&self) -> Vec<Warning> {
        let mut warnings = Vec::new();
        if self.not_finite > 0 {
            warnings.push(Warning::NotFinite { pixels: self.not_finite });
        }
        if self.saturated > 0 {
            warnings.push(Warning::Saturated { fraction: self.saturated as f64 / self.far.len() as f64 });
        }
        warnings
    }

    pub(crate) fn warnings(&self, operators: &Operators, optics: &Optics) -> Vec<Warning> {
        let mut warnings = self.pixel_warnings();
        let psf = operators.request().psf;
        if psf != optics.psf() {
            warnings.push(Warning::PsfMismatch { operators: psf.into(), optics: optics.psf().into() });
        }
        warnings
    }

    pub(crate) fn bad(&self) -> Option<&Array2<bool>> {
        self.bad.as_ref()
    }

    /// Normalised `[I2 - I1, I2 + I1]` of one pixel; 0 where it is not finite.
    pub(crate) fn normalised(&self, y: usize, x: usize) -> [f32; 2] {
        let [far, near] = [self.far, self.near].map(|image| image[y * self.width + x]);
        let pair = [(near - far) * self.gain, ((near - self.offset) + (far - self.offset)) * self.gain];
        if pair.iter().all(|v| v.is_finite()) { pair } else { [0.0; 2] }
    }

    /// Pixels whose depth depends on a bad pixel, if any.
    pub(crate) fn invalid(&self, operators: &Operators, settings: &Settings) -> Option<Array2<bool>> {
        let reach = reach_px(operators, settings);
        self.bad().map(|bad| crate::metrics::dilate_square(bad, reach))
    }
}

/// Reach of a pixel's evidence: pre-filter, operator and smoothing window.
pub(crate) fn reach_px(operators: &Operators, settings: &Settings) -> usize {
    2 * (operators.kernel_size() / 2) + settings.smoothing_px / 2
}

/// Confidence from which a pixel counts in the test for a swapped pair.
const CONFIDENT: f32 = 0.7;

/// Part of the working range by which each third must be farther than the one above: only grounds exceed it.
const TILT: f64 = 0.12;

pub(crate) fn after(map: &DepthMap, optics: &Optics) -> Option<Warning> {
    let [far_mm, near_mm] = optics.range_mm(1.1).map(|mm| mm as f32);
    let mut thirds: [Vec<f32>; 3] = Default::default();
    let sample = confidence::sample(map.depth_mm.dim());
    let [depths, confidences] = [map.depth_mm.slice(sample), map.confidence.slice(sample)];
    let height = depths.nrows();
    for (y, (depths, confidences)) in depths.rows().into_iter().zip(confidences.rows()).enumerate() {
        let trusted =
            depths.iter().zip(confidences).filter(|(_, c)| **c > CONFIDENT).map(|(depth, _)| *depth);
        // Outside the working range depth saturates and its order is meaningless.
        thirds[3 * y / height].extend(trusted.filter(|depth| (near_mm..=far_mm).contains(depth)));
    }
    let total: usize = thirds.iter().map(Vec::len).sum();
    if thirds.iter().any(|third| third.len() < total / 6 + 10) {
        return None;
    }
    let [upper, middle, lower] = thirds.map(|third| median(third, f32::total_cmp).map_or(0.0, f64::from));
    let range = optics.working_range();
    let least = TILT * (range.far_mm - range.near_mm);
    (middle - upper > least && lower - middle > least)
        .then_some(Warning::LooksSwapped(SwapEvidence::LowerPartFarther { difference_mm: lower - upper }))
}
