//! Depth correction on the board: sends a correction and rows of a depth map, or flat targets for a fit on the board. A
//! row of 640 pixels takes 19 requests of [`CODES_MAX`] codes, some 25 ms.

use farnear_depth::corrections::{BoardCorrection, BoardForm, CorrectionError, Method};
use farnear_maths::clsf::{DepthScale, Frame};
use farnear_protocol::{
    Request, Response,
    message::{CODES_MAX, COEFFICIENTS_MAX, Codes, CoefficientBits, CorrectionForm, CorrectionInfo},
};
use ndarray::{Array2, ArrayView2};

use crate::{client::Client, error::ClientError, owner::nonsense};

#[derive(Debug, thiserror::Error)]
pub enum BoardCorrectionError {
    #[error(transparent)]
    Board(#[from] ClientError),
    #[error(transparent)]
    Correction(#[from] CorrectionError),
    #[error("the depth map is {width} px wide, the board's row buffer holds {max}")]
    TooWide { width: usize, max: u16 },
    #[error(
        "the depth map has {width}x{height} px, the correction is for {made_for_width}x{made_for_height}"
    )]
    Size { width: usize, height: usize, made_for_width: u16, made_for_height: u16 },
    #[error("interrupted at row {row}")]
    Interrupted { row: u16 },
}

#[derive(Clone, Debug)]
pub struct CodedTarget {
    /// Depth codes, (height, width).
    pub codes: Array2<i16>,
    /// Code of the true depth.
    pub truth: i16,
}

fn info(method: Method, frame: Frame, scale: DepthScale) -> Result<CorrectionInfo, CorrectionError> {
    let form = match method.board_form().ok_or(CorrectionError::NotOnBoard(method))? {
        BoardForm::Regions => CorrectionForm::Regions,
        BoardForm::Blend => CorrectionForm::Blend,
        BoardForm::Full => CorrectionForm::Full,
    };
    let micrometres = |mm: f32| (f64::from(mm) * 1e3).round() as i32;
    Ok(CorrectionInfo {
        form,
        width: frame.width(),
        height: frame.height(),
        centre_um: micrometres(scale.centre_mm()),
        half_span_um: micrometres(scale.half_span_mm()),
    })
}

pub fn encode(depth_mm: ArrayView2<f32>, scale: DepthScale) -> Array2<i16> {
    depth_mm.mapv(|depth| scale.encode(depth))
}

pub fn decode(codes: ArrayView2<i16>, scale: DepthScale) -> Array2<f32> {
    codes.mapv(|code| scale.decode(code))
}

impl Client {
    /// Sends a correction and opens it on the board.
    pub fn send_correction(&self, correction: &BoardCorrection) -> Result<(), BoardCorrectionError> {
        let BoardCorrection { method, frame, scale, coefficients, .. } = correction;
        let during = "sending a depth correction";
        let open = Request::OpenCorrection(info(*method, *frame, *scale)?);
        self.expect_accepted(&open, during)?;
        for (chunk, bits) in coefficients.chunks(COEFFICIENTS_MAX).enumerate() {
            let first = (chunk * COEFFICIENTS_MAX) as u8;
            let bits: CoefficientBits = bits.iter().copied().collect();
            self.expect_accepted(&Request::PutCoefficients { first, bits }, during)?;
        }
        Ok(())
    }

    /// Coefficients of the open correction, in the order of [`BoardCorrection::coefficients`].
    pub fn read_coefficients(&self, form: CorrectionForm) -> Result<Vec<i32>, ClientError> {
        let during = "reading the depth correction";
        let mut coefficients = Vec::new();
        while coefficients.len() < usize::from(form.coefficients()) {
            let first = coefficients.len() as u8;
            let count = (form.coefficients() - first).min(COEFFICIENTS_MAX as u8);
            match self.request(&Request::GetCoefficients { first, count }, during)? {
                (_, Response::Coefficients(bits)) if bits.len() == usize::from(count) => {
                    coefficients.extend(bits);
                }
                (_, other) => return Err(nonsense(during, &other)),
            }
        }
        Ok(coefficients)
    }

    pub fn store_correction(&self) -> Result<(), ClientError> {
        self.expect_accepted(&Request::StoreCorrection, "storing the depth correction")
    }

    /// Corrects coded depths on the board; calls `progress` per row.
    pub fn correct_codes(
        &self,
        codes: ArrayView2<i16>,
        progress: &mut dyn FnMut(usize),
    ) -> Result<Array2<i16>, BoardCorrectionError> {
        self.check_width(codes.ncols())?;
        let during = "correcting depths on the board";
        let mut corrected = Array2::zeros(codes.dim());
        for ((row, codes), mut out) in (0_u16..).zip(codes.outer_iter()).zip(corrected.outer_iter_mut()) {
            if self.interrupted() {
                return Err(BoardCorrectionError::Interrupted { row });
            }
            let line = codes.to_vec();
            for (chunk, codes) in line.chunks(CODES_MAX).enumerate() {
                let codes: Codes = codes.iter().copied().collect();
                self.expect_accepted(&Request::PutRow { first: (chunk * CODES_MAX) as u16, codes }, during)?;
            }
            self.expect_accepted(&Request::CorrectRow { row }, during)?;
            let mut line = Vec::with_capacity(out.len());
            while line.len() < out.len() {
                let count = (out.len() - line.len()).min(CODES_MAX) as u8;
                match self.request(&Request::GetRow { first: line.len() as u16, count }, during)? {
                    (_, Response::Row(codes)) if codes.len() == usize::from(count) => line.extend(codes),
                    (_, other) => return Err(nonsense(during, &other).into()),
                }
            }
            out.iter_mut().zip(line).for_each(|(to, from)| *to = from);
            progress(usize::from(row) + 1);
        }
        Ok(corrected)
    }

    /// Fits, opens and returns a correction from every `step`th pixel and row; calls `progress` per row.
    pub fn fit_correction(
        &self,
        method: Method,
        frame: Frame,
        scale: DepthScale,
        targets: &[CodedTarget],
        step: u16,
        progress: &mut dyn FnMut(usize),
    ) -> Result<Vec<i32>, BoardCorrectionError> {
        let during = "fitting a depth correction on the board";
        self.check_width(usize::from(frame.width()))?;
        let info = info(method, frame, scale)?;
        self.expect_accepted(&Request::OpenCorrection(info), during)?;
        let mut rows = 0;
        for target in targets {
            let (height, width) = target.codes.dim();
            if (width, height) != (usize::from(frame.width()), usize::from(frame.height())) {
                let (made_for_width, made_for_height) = (frame.width(), frame.height());
                return Err(BoardCorrectionError::Size { width, height, made_for_width, made_for_height });
            }
            for row in (0..frame.height()).step_by(usize::from(step.max(1))) {
                if self.interrupted() {
                    return Err(BoardCorrectionError::Interrupted { row });
                }
                let line: Vec<i16> = target
                    .codes
                    .row(usize::from(row))
                    .iter()
                    .copied()
                    .step_by(usize::from(step.max(1)))
                    .collect();
                for (chunk, codes) in line.chunks(CODES_MAX).enumerate() {
                    let first = (chunk * CODES_MAX) as u16 * step;
                    let codes: Codes = codes.iter().copied().collect();
                    let samples = Request::FitSamples { row, first, step, truth: target.truth, codes };
                    self.expect_accepted(&samples, during)?;
                }
                rows += 1;
                progress(rows);
            }
        }
        self.expect_accepted(&Request::SolveFit, during)?;
        Ok(self.read_coefficients(info.form)?)
    }

    fn check_width(&self, width: usize) -> Result<(), BoardCorrectionError> {
        let max = self.hello().limits.row_pixels_max;
        if width > usize::from(max) {
            return Err(BoardCorrectionError::TooWide { width, max });
        }
        Ok(())
    }
}
