//! Depth correction over the link by `farnear_maths::clsf`: rows in and out, fit of coefficients. One is open, one
//! stored. RAM: 15 KiB for coefficients, a row, and a table or a fit's sums. Instructions: 9,000 to 15,000 per row of
//! 640 pixels, up to 160,000 more for a region's first row, 742,000 for a solution. Rejected while a stepper moves.

use farnear_maths::clsf::{
    Blend, Coefficient, Columns, Error, FULL_TERMS, Frame, Full, FullFit, REGION_TERMS, REGIONS,
    RegionCoefficients, RegionFit, Regions, TableState,
};
use farnear_protocol::message::{Codes, CoefficientBits, CorrectionFault, CorrectionForm, CorrectionInfo};

pub const ROW_PIXELS_MAX: u16 = 1024;
/// Of the largest form.
pub(crate) const COEFFICIENTS: usize = REGIONS * REGIONS * REGION_TERMS;
const TABLE_WORDS: usize = Full::table_words(ROW_PIXELS_MAX);

#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct StoredCorrection {
    info: CorrectionInfo,
    bits: [i32; COEFFICIENTS],
}

impl StoredCorrection {
    pub(crate) fn restored(info: CorrectionInfo, bits: [i32; COEFFICIENTS]) -> Option<Self> {
        frame(&info).ok()?;
        Some(Self { info, bits })
    }

    pub(crate) const fn info(&self) -> &CorrectionInfo {
        &self.info
    }

    pub(crate) const fn bits(&self) -> &[i32; COEFFICIENTS] {
        &self.bits
    }

    fn coefficient(&self, index: usize) -> Coefficient {
        // Checked on input.
        Coefficient::from_bits(self.bits[index]).unwrap_or_default()
    }

    fn of_regions(&self) -> RegionCoefficients {
        core::array::from_fn(|row| {
            core::array::from_fn(|column| {
                core::array::from_fn(|term| self.coefficient((row * REGIONS + column) * REGION_TERMS + term))
            })
        })
    }

    fn set(&mut self, coefficients: &[Coefficient]) {
        for (bits, coefficient) in self.bits.iter_mut().zip(coefficients) {
            *bits = coefficient.to_bits();
        }
    }

    /// Index range of coefficients within the form.
    fn places(&self, first: u8, count: usize) -> Result<core::ops::Range<usize>, CorrectionFault> {
        let (start, end) = (usize::from(first), usize::from(first) + count);
        if end > usize::from(self.info.form.coefficients()) {
            return Err(CorrectionFault::Coefficient);
        }
        Ok(start..end)
    }

    /// Index range of pixels within a row.
    fn pixels(&self, first: u16, count: usize) -> Result<core::ops::Range<usize>, CorrectionFault> {
        let (start, end) = (usize::from(first), usize::from(first) + count);
        if end > usize::from(self.info.width) {
            return Err(CorrectionFault::Place);
        }
        Ok(start..end)
    }
}

fn frame(info: &CorrectionInfo) -> Result<Frame, CorrectionFault> {
    match Frame::new(info.width, info.height) {
        Ok(frame) if info.width <= ROW_PIXELS_MAX => Ok(frame),
        _ => Err(CorrectionFault::Size),
    }
}

#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "one place for all, there is no heap to put the large one on")]
enum Scratch {
    Empty,
    Table { words: [i32; TABLE_WORDS], state: TableState },
    RegionFit(RegionFit),
    FullFit(FullFit),
}

#[derive(Clone, Debug)]
pub(crate) struct Correction {
    stored: Option<StoredCorrection>,
    open: Option<StoredCorrection>,
    row: [i16; ROW_PIXELS_MAX as usize],
    scratch: Scratch,
}

impl Correction {
    /// Inlined, so that its 15 KiB are built in place.
    #[inline(always)]
    pub(crate) const fn new(stored: Option<StoredCorrection>) -> Self {
        Self { stored, open: None, row: [0; ROW_PIXELS_MAX as usize], scratch: Scratch::Empty }
    }

    pub(crate) const fn stored(&self) -> Option<&StoredCorrection> {
        self.stored.as_ref()
    }

    pub(crate) fn open(&mut self, info: CorrectionInfo) -> Result<(), CorrectionFault> {
        frame(&info)?;
        if info.half_span_um <= 0 {
            return Err(CorrectionFault::Size);
        }
        self.open = Some(StoredCorrection { info, bits: [0; COEFFICIENTS] });
        self.scratch = Scratch::Empty;
        Ok(())
    }

    pub(crate) fn load(&mut self) -> Result<CorrectionInfo, CorrectionFault> {
        let stored = self.stored.as_ref().ok_or(CorrectionFault::None)?;
        self.open = Some(stored.clone());
        self.scratch = Scratch::Empty;
        Ok(stored.info)
    }

    /// The caller marks the record.
    pub(crate) fn store(&mut self) -> Result<(), CorrectionFault> {
        self.stored = Some(self.open.clone().ok_or(CorrectionFault::None)?);
        Ok(())
    }

    pub(crate) fn put(&mut self, first: u8, bits: &CoefficientBits) -> Result<(), CorrectionFault> {
        let open = self.open.as_mut().ok_or(CorrectionFault::None)?;
        let places = open.places(first, bits.len())?;
        if bits.iter().any(|bits| Coefficient::from_bits(*bits).is_err()) {
            return Err(CorrectionFault::Coefficient);
        }
        open.bits[places].copy_from_slice(bits);
        self.scratch = Scratch::Empty;
        Ok(())
    }

    pub(crate) fn get(&self, first: u8, count: u8) -> Result<CoefficientBits, CorrectionFault> {
        let open = self.open.as_ref().ok_or(CorrectionFault::None)?;
        let places = open.places(first, usize::from(count))?;
        CoefficientBits::from_slice(&open.bits[places]).map_err(|_| CorrectionFault::Coefficient)
    }

    /// Adds samples; starts a fit if none is active.
    pub(crate) fn add_samples(
        &mut self,
        row: u16,
        columns: Columns,
        codes: &Codes,
        truth: i16,
    ) -> Result<(), CorrectionFault> {
        let open = self.open.as_ref().ok_or(CorrectionFault::None)?;
        let frame = frame(&open.info)?;
        if !matches!(self.scratch, Scratch::RegionFit(_) | Scratch::FullFit(_)) {
            self.scratch = match open.info.form {
                CorrectionForm::Regions | CorrectionForm::Blend => Scratch::RegionFit(RegionFit::new(frame)),
                CorrectionForm::Full => Scratch::FullFit(FullFit::new(frame)),
            };
        }
        match &mut self.scratch {
            Scratch::RegionFit(fit) => fit.add_row(row, columns, codes, truth),
            Scratch::FullFit(fit) => fit.add_row(row, columns, codes, truth),
            Scratch::Empty | Scratch::Table { .. } => Ok(()), // was replaced above
        }
        .map_err(fault)
    }

    /// Solves the fit; more samples may follow.
    pub(crate) fn solve(&mut self) -> Result<(), CorrectionFault> {
        let open = self.open.as_mut().ok_or(CorrectionFault::None)?;
        match &self.scratch {
            Scratch::RegionFit(fit) => {
                open.set(fit.solve().map_err(fault)?.as_flattened().as_flattened());
            }
            Scratch::FullFit(fit) => open.set(&fit.solve().map_err(fault)?),
            Scratch::Empty | Scratch::Table { .. } => return Err(CorrectionFault::Underdetermined),
        }
        Ok(())
    }

    pub(crate) fn put_row(&mut self, first: u16, codes: &Codes) -> Result<(), CorrectionFault> {
        let open = self.open.as_ref().ok_or(CorrectionFault::None)?;
        let pixels = open.pixels(first, codes.len())?;
        self.row[pixels].copy_from_slice(codes);
        Ok(())
    }

    /// Corrects the row buffer. Ends a fit.
    pub(crate) fn correct_row(&mut self, row: u16) -> Result<(), CorrectionFault> {
        let open = self.open.as_ref().ok_or(CorrectionFault::None)?;
        let frame = frame(&open.info)?;
        if row >= frame.height() {
            return Err(CorrectionFault::Place);
        }
        if !matches!(self.scratch, Scratch::Table { .. }) {
            self.scratch = Scratch::Table { words: [0; TABLE_WORDS], state: TableState::EMPTY };
        }
        let Scratch::Table { words, state } = &mut self.scratch else { return Ok(()) }; // was put there just now
        let pixels = &mut self.row[..usize::from(open.info.width)];
        match open.info.form {
            CorrectionForm::Regions => {
                let mut form = Regions::resume(open.of_regions(), frame, words, *state).map_err(fault)?;
                form.correct_row(row, pixels).map_err(fault)?;
                *state = form.table_state();
            }
            CorrectionForm::Blend => {
                let mut form = Blend::resume(open.of_regions(), frame, words, *state).map_err(fault)?;
                form.correct_row(row, pixels).map_err(fault)?;
                *state = form.table_state();
            }
            CorrectionForm::Full => {
                let terms = core::array::from_fn::<_, FULL_TERMS, _>(|term| open.coefficient(term));
                let mut form = Full::resume(terms, frame, words, *state).map_err(fault)?;
                form.correct_row(row, pixels).map_err(fault)?;
                *state = form.table_state();
            }
        }
        Ok(())
    }

    pub(crate) fn get_row(&self, first: u16, count: u8) -> Result<Codes, CorrectionFault> {
        let open = self.open.as_ref().ok_or(CorrectionFault::None)?;
        let pixels = open.pixels(first, usize::from(count))?;
        Codes::from_slice(&self.row[pixels]).map_err(|_| CorrectionFault::Place)
    }
}

fn fault(error: Error) -> CorrectionFault {
    match error {
        Error::NoSuchRow { .. } | Error::RowLength { .. } => CorrectionFault::Place,
        Error::Underdetermined { .. } => CorrectionFault::Underdetermined,
        Error::TooManySamples { .. } => CorrectionFault::TooManySamples,
        Error::CoefficientTooLarge { .. } => CorrectionFault::CoefficientTooLarge,
        _ => CorrectionFault::Size,
    }
}
