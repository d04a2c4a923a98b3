//! One polynomial with all twenty terms of third order in x, y and depth. CLSF's ten terms lack the cross terms (a bowl
//! whose height changes with depth is `x^2 U`), which the regions only partly replace. With them one set of
//! coefficients covers the whole map without seams.

use farnear_maths::clsf::{Coefficient, DepthScale, FULL_TERMS};
use ndarray::ArrayViewMut2;
use serde::{Deserialize, Serialize};

use super::board::BoardForm;
use super::moments::{Moments, TWENTY};
use super::pattern::{Series, coordinate, inside, normalise};
use super::table::Learned;
use super::{CdcSettings, CorrectionError};

/// In the order of [`FULL_TERMS`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct ClsfFull {
    terms: [f64; FULL_TERMS],
}

impl Learned for ClsfFull {
    const PATTERNS_NEEDED: usize = 4;
    const BOARD_FORM: Option<BoardForm> = Some(BoardForm::Full);

    fn learn(series: &Series<'_>, _: &CdcSettings) -> Result<Self, CorrectionError> {
        let scale = series.scale();
        let (height, width) = series.dim();
        let x: Vec<f64> = (0..width).map(|column| coordinate(column, width)).collect();
        let mut moments = Moments::new();
        for pattern in series.patterns() {
            let t = normalise(scale, pattern.true_mm);
            for (row, depths) in pattern.depth_mm.outer_iter().enumerate() {
                let samples = x.iter().zip(&depths).filter(|(_, depth)| depth.is_finite());
                let samples = samples.map(|(x, depth)| (*x, normalise(scale, f64::from(*depth)), t, 1.0));
                moments.add_row(coordinate(row, height), samples);
            }
        }
        let terms = moments.solve(&TWENTY).ok_or_else(|| CorrectionError::Underdetermined {
            what: "the polynomial of the whole map".to_owned(),
            samples: moments.samples(),
            terms: TWENTY.len(),
        })?;
        Ok(Self { terms })
    }

    fn prepare(&mut self, _: (usize, usize)) -> Result<(), CorrectionError> {
        if self.terms.iter().all(|c| c.is_finite()) {
            return Ok(());
        }
        Err(CorrectionError::Damaged("a coefficient of clsf-full is not finite".to_owned()))
    }

    fn apply(&self, mut depth_mm: ArrayViewMut2<f32>, scale: DepthScale) {
        let (height, width) = depth_mm.dim();
        let span = f64::from(scale.half_span_mm());
        let x: Vec<f32> = (0..width).map(|column| coordinate(column, width) as f32).collect();
        for (row, mut depths) in depth_mm.outer_iter_mut().enumerate() {
            let c = AlongRow::new(&self.terms, coordinate(row, height), span);
            let Some(depths) = depths.as_slice_mut() else { continue };
            c.correct(depths, &x, scale);
        }
    }

    fn quantised(&self) -> Result<Vec<i32>, CorrectionError> {
        self.terms.iter().map(|term| Ok(Coefficient::from_f64(*term)?.to_bits())).collect()
    }
}

/// Factors of the powers of `d` (mm from the scale's centre) along one row, as polynomials in x, in mm.
struct AlongRow {
    constant: [f32; 4],
    linear: [f32; 3],
    square: [f32; 2],
    cubic: f32,
}

impl AlongRow {
    fn new(c: &[f64; FULL_TERMS], y: f64, span: f64) -> Self {
        let in_mm = |c: f64| (span * c) as f32;
        Self {
            constant: [
                in_mm(c[0] + y * (c[4] + y * (c[7] + y * c[9]))),
                in_mm(c[1] + y * (c[5] + y * c[8])),
                in_mm(c[2] + y * c[6]),
                in_mm(c[3]),
            ],
            linear: [(c[10] + y * (c[13] + y * c[15])) as f32, (c[11] + y * c[14]) as f32, c[12] as f32],
            square: [((c[16] + y * c[18]) / span) as f32, (c[17] / span) as f32],
            cubic: (c[19] / span / span) as f32,
        }
    }

    fn correct(&self, depths: &mut [f32], x: &[f32], scale: DepthScale) {
        let (centre, span) = (scale.centre_mm(), scale.half_span_mm());
        let Self { constant: c, linear: l, square: s, cubic } = self;
        for (depth, x) in depths.iter_mut().zip(x) {
            let d = *depth - centre;
            let constant = centre + (c[0] + x * (c[1] + x * (c[2] + x * c[3])));
            let linear = l[0] + x * (l[1] + x * l[2]);
            let square = s[0] + x * s[1];
            *depth = inside(d, constant + d * (linear + d * (square + d * cubic)), centre, span);
        }
    }
}
