//! A series of flat targets, checked.

use farnear_maths::clsf::DepthScale;
use ndarray::ArrayView2;

use super::{CorrectionError, Method};

/// Smallest side of a correctable map: a few pixels per region.
const SMALLEST_PX: usize = 12;

/// Depth map and true depth of a flat target.
#[derive(Debug, Clone, Copy)]
pub struct Pattern<'a> {
    /// Measured depth, mm, (height, width); NaN, 0, negative = no value.
    pub depth_mm: ArrayView2<'a, f32>,
    /// True depth, mm.
    pub true_mm: f64,
}

pub(super) struct Series<'a> {
    /// From far to near.
    patterns: Vec<Pattern<'a>>,
    /// Index of each among the given ones.
    order: Vec<usize>,
    scale: DepthScale,
}

impl<'a> Series<'a> {
    pub(super) fn new(method: Method, patterns: &[Pattern<'a>]) -> Result<Self, CorrectionError> {
        for (index, pattern) in patterns.iter().enumerate() {
            if !(pattern.true_mm.is_finite() && pattern.true_mm > 0.0) {
                return Err(CorrectionError::TrueDepth { index, true_mm: pattern.true_mm });
            }
            let (height, width) = patterns[0].depth_mm.dim();
            let (found_height, found_width) = pattern.depth_mm.dim();
            if (found_height, found_width) != (height, width) {
                return Err(CorrectionError::PatternSize { index, width, height, found_width, found_height });
            }
        }
        let (given, needed) = (patterns.len(), method.patterns_needed());
        if given < needed {
            return Err(CorrectionError::TooFewPatterns { method, given, needed });
        }
        let (height, width) = patterns[0].depth_mm.dim();
        if height < SMALLEST_PX || width < SMALLEST_PX {
            return Err(CorrectionError::TooSmall { width, height, least: SMALLEST_PX });
        }
        let mut order: Vec<usize> = (0..given).collect();
        order.sort_by(|a, b| patterns[*b].true_mm.total_cmp(&patterns[*a].true_mm));
        let sorted: Vec<Pattern<'a>> = order.iter().map(|index| patterns[*index]).collect();
        if let Some(pair) = sorted.windows(2).find(|pair| pair[0].true_mm == pair[1].true_mm) {
            return Err(CorrectionError::RepeatedDepth(pair[0].true_mm));
        }
        let scale = scale(sorted[0].true_mm, sorted[given - 1].true_mm)?;
        Ok(Self { patterns: sorted, order, scale })
    }

    /// The index among the given patterns of one of [`Self::patterns`].
    pub(super) fn given(&self, index: usize) -> usize {
        self.order[index]
    }

    pub(super) fn patterns(&self) -> &[Pattern<'a>] {
        &self.patterns
    }

    pub(super) fn dim(&self) -> (usize, usize) {
        self.patterns[0].depth_mm.dim()
    }

    pub(super) fn range_mm(&self) -> (f64, f64) {
        (self.patterns[0].true_mm, self.patterns[self.patterns.len() - 1].true_mm)
    }

    pub(super) fn scale(&self) -> DepthScale {
        self.scale
    }
}

pub(super) fn scale(far_mm: f64, near_mm: f64) -> Result<DepthScale, CorrectionError> {
    Ok(DepthScale::for_range(far_mm as f32, near_mm as f32)?)
}

pub(super) fn normalise(scale: DepthScale, depth_mm: f64) -> f64 {
    (depth_mm - f64::from(scale.centre_mm())) / f64::from(scale.half_span_mm())
}

pub(super) fn coordinate(index: usize, length: usize) -> f64 {
    2.0 * index as f64 / (length as f64 - 1.0) - 1.0
}

/// The corrected depth; NaN where it or the raw one (`d` from the centre) lies beyond the scale.
#[inline(always)]
pub(super) fn inside(d: f32, corrected: f32, centre: f32, span: f32) -> f32 {
    // Not `&&`: no branch, and NaN compares false.
    if (d.abs() <= span) & ((corrected - centre).abs() <= span) { corrected } else { f32::NAN }
}
