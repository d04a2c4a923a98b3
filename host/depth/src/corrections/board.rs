//! Corrections in the board's row-wise fixed-point arithmetic.

use farnear_maths::clsf::{
    Blend, Coefficient, DepthScale, Error, Frame, Full, REGION_TERMS, REGIONS, RegionCoefficients, Regions,
};
use ndarray::{Array2, ArrayView2};

use super::{CorrectionError, Method};

/// How a board computes a correction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BoardForm {
    /// Ten terms in each of 3x3 regions.
    Regions,
    /// The same, blended bilinearly.
    Blend,
    /// Twenty terms for the whole map.
    Full,
}

/// A correction as sent to a board; see [`Correction::apply_as_board`](super::Correction::apply_as_board).
#[derive(Debug, Clone, PartialEq)]
pub struct BoardCorrection {
    /// Name of the correction.
    pub method: Method,
    /// How the board computes it.
    pub form: BoardForm,
    /// Size of the depth maps.
    pub frame: Frame,
    /// The codes of depths.
    pub scale: DepthScale,
    /// Q2.29 bits: 3x3 regions of ten terms, row by row, or twenty terms.
    pub coefficients: Vec<i32>,
}

pub(super) fn frame((height, width): (usize, usize)) -> Result<Frame, CorrectionError> {
    let side = |length: usize| u16::try_from(length).unwrap_or(u16::MAX);
    Ok(Frame::new(side(width), side(height))?)
}

impl BoardCorrection {
    /// Corrects a map in mm, (height, width), as the board does. [`CorrectionError::Board`] if rows do not fit.
    pub fn apply(&self, depth_mm: ArrayView2<f32>) -> Result<Array2<f32>, CorrectionError> {
        let (frame, width) = (self.frame, self.frame.width());
        match self.form {
            BoardForm::Regions => {
                let mut table = vec![0; Regions::table_words(width)];
                let mut regions = Regions::new(self.regions()?, frame, &mut table)?;
                self.rows(depth_mm, |row, codes| regions.correct_row(row, codes))
            }
            BoardForm::Blend => {
                let mut table = vec![0; Blend::table_words(width)];
                let mut blend = Blend::new(self.regions()?, frame, &mut table)?;
                self.rows(depth_mm, |row, codes| blend.correct_row(row, codes))
            }
            BoardForm::Full => {
                let mut table = vec![0; Full::table_words(width)];
                let mut full = Full::new(self.numbers()?, frame, &mut table)?;
                self.rows(depth_mm, |row, codes| full.correct_row(row, codes))
            }
        }
    }

    fn numbers<const N: usize>(&self) -> Result<[Coefficient; N], CorrectionError> {
        let found = self.coefficients.len();
        let wrong = || CorrectionError::Damaged(format!("{found} coefficients where {N} are needed"));
        let bits: &[i32; N] = self.coefficients.as_slice().try_into().map_err(|_| wrong())?;
        let mut numbers = [Coefficient::default(); N];
        for (number, bits) in numbers.iter_mut().zip(bits) {
            *number = Coefficient::from_bits(*bits)?;
        }
        Ok(numbers)
    }

    fn regions(&self) -> Result<RegionCoefficients, CorrectionError> {
        let numbers = self.numbers::<{ REGIONS * REGIONS * REGION_TERMS }>()?;
        let mut regions = RegionCoefficients::default();
        regions.as_flattened_mut().as_flattened_mut().copy_from_slice(&numbers);
        Ok(regions)
    }

    fn rows(
        &self,
        depth_mm: ArrayView2<f32>,
        mut correct_row: impl FnMut(u16, &mut [i16]) -> Result<(), Error>,
    ) -> Result<Array2<f32>, CorrectionError> {
        let mut corrected = Array2::zeros(depth_mm.dim());
        let mut codes = vec![0; depth_mm.ncols()];
        for ((row, raw), mut out) in (0_u16..).zip(depth_mm.outer_iter()).zip(corrected.outer_iter_mut()) {
            for (code, depth) in codes.iter_mut().zip(raw) {
                *code = self.scale.encode(*depth);
            }
            correct_row(row, &mut codes)?;
            for (depth, code) in out.iter_mut().zip(&codes) {
                *depth = self.scale.decode(*code);
            }
        }
        Ok(corrected)
    }
}
