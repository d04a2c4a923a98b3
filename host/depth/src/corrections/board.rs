//! A depth map through the board's row-wise fixed-point arithmetic.

use farnear_maths::clsf::{DepthScale, Error, Frame};
use ndarray::{Array2, ArrayView2};

use super::{CorrectionError, Method};

/// A correction in the board's number formats: what is sent to a board so that it corrects like
/// [`Correction::apply_as_board`](super::Correction::apply_as_board).
#[derive(Debug, Clone, PartialEq)]
pub struct BoardCorrection {
    /// `Clsf`, `ClsfBlend` or `ClsfFull`.
    pub method: Method,
    /// Size of the depth maps.
    pub frame: Frame,
    /// The codes of depths.
    pub scale: DepthScale,
    /// Q2.29 bits: 3x3 regions of ten terms each, row by row, or twenty terms.
    pub coefficients: Vec<i32>,
}

/// The board's frame for a map of (height, width).
pub(super) fn frame((height, width): (usize, usize)) -> Result<Frame, CorrectionError> {
    let side = |length: usize| u16::try_from(length).unwrap_or(u16::MAX);
    Ok(Frame::new(side(width), side(height))?)
}

/// Encodes, corrects and decodes row after row.
pub(super) fn apply(
    depth_mm: ArrayView2<f32>,
    scale: DepthScale,
    mut correct_row: impl FnMut(u16, &mut [i16]) -> Result<(), Error>,
) -> Result<Array2<f32>, CorrectionError> {
    let mut corrected = Array2::zeros(depth_mm.dim());
    let mut codes = vec![0; depth_mm.ncols()];
    for ((row, raw), mut out) in (0_u16..).zip(depth_mm.outer_iter()).zip(corrected.outer_iter_mut()) {
        for (code, depth) in codes.iter_mut().zip(raw) {
            *code = scale.encode(*depth);
        }
        correct_row(row, &mut codes)?;
        for (depth, code) in out.iter_mut().zip(&codes) {
            *depth = scale.decode(*code);
        }
    }
    Ok(corrected)
}
