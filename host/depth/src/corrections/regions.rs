//! Ten-term polynomials in 3x3 regions, shared by `clsf` and `clsf-blend` (Li 2014, eq. 6.11).

use std::ops::Range;

use farnear_maths::clsf::{Coefficient, DepthScale, REGION_TERMS, REGIONS};
use serde::{Deserialize, Serialize};

use super::CorrectionError;
use super::moments::{Moments, TEN};
use super::pattern::{Series, coordinate, normalise};

/// The coefficients of all regions, `[region row][region column][term]`, terms as in [`TEN`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Regions {
    pub terms: [[[f64; REGION_TERMS]; REGIONS]; REGIONS],
}

/// Pixels of a region along an axis; the same split as on the board.
pub(super) fn region(region: usize, length: usize) -> Range<usize> {
    length * region / REGIONS..length * (region + 1) / REGIONS
}

impl Regions {
    /// One fit per region, with the region's weight at each column and row (index, length).
    pub fn fit(
        series: &Series<'_>,
        weights: fn(usize, usize) -> [f64; REGIONS],
    ) -> Result<Self, CorrectionError> {
        let scale = series.scale();
        let (height, width) = series.dim();
        let of_columns: Vec<[f64; REGIONS]> = (0..width).map(|column| weights(column, width)).collect();
        let x: Vec<f64> = (0..width).map(|column| coordinate(column, width)).collect();
        let mut moments = vec![Moments::new(); REGIONS * REGIONS];
        for pattern in series.patterns() {
            let t = normalise(scale, pattern.true_mm);
            for (row, depths) in pattern.depth_mm.outer_iter().enumerate() {
                let of_row = weights(row, height);
                for (index, moments) in moments.iter_mut().enumerate() {
                    let (i, j) = (index / REGIONS, index % REGIONS);
                    if of_row[i] == 0.0 {
                        continue;
                    }
                    let columns = support(&of_columns, j);
                    let samples = columns.filter(|&column| depths[column].is_finite()).map(|column| {
                        let u = normalise(scale, f64::from(depths[column]));
                        (x[column], u, t, of_row[i] * of_columns[column][j])
                    });
                    moments.add_row(coordinate(row, height), samples);
                }
            }
        }
        let mut terms = [[[0.0; REGION_TERMS]; REGIONS]; REGIONS];
        for (index, moments) in moments.iter().enumerate() {
            let (i, j) = (index / REGIONS, index % REGIONS);
            terms[i][j] = moments.solve(&TEN).ok_or_else(|| CorrectionError::Underdetermined {
                what: format!("the region in row {i}, column {j} of 3x3"),
                samples: moments.samples(),
                terms: TEN.len(),
            })?;
        }
        Ok(Self { terms })
    }

    pub fn check(&self) -> Result<(), CorrectionError> {
        if self.terms.iter().flatten().flatten().all(|c| c.is_finite()) {
            return Ok(());
        }
        Err(CorrectionError::Damaged("a coefficient of a region is not finite".to_owned()))
    }

    pub fn quantised(&self) -> Result<Vec<i32>, CorrectionError> {
        let terms = self.terms.as_flattened().as_flattened();
        terms.iter().map(|term| Ok(Coefficient::from_f64(*term)?.to_bits())).collect()
    }
}

pub(super) fn support(of_columns: &[[f64; REGIONS]], j: usize) -> Range<usize> {
    let start = of_columns.iter().position(|w| w[j] > 0.0).unwrap_or(0);
    let end = of_columns.iter().rposition(|w| w[j] > 0.0).map_or(0, |last| last + 1);
    start..end
}

pub(super) fn x_terms(c: &[f64; REGION_TERMS], x: f64) -> f64 {
    c[0] + x * (c[1] + x * (c[2] + x * c[3]))
}

pub(super) fn y_terms(c: &[f64; REGION_TERMS], y: f64) -> f64 {
    y * (c[4] + y * (c[5] + y * c[6]))
}

pub(super) fn in_mm(scale: DepthScale, normalised: f64) -> f32 {
    (f64::from(scale.half_span_mm()) * normalised) as f32
}

/// Factors of `d`, `d^2` and `d^3`, `d` the distance in mm of the raw depth from the scale's centre.
#[derive(Clone, Copy)]
pub(super) struct Factors {
    pub linear: f32,
    pub square: f32,
    pub cubic: f32,
}

impl Factors {
    pub fn new(c: &[f64; REGION_TERMS], scale: DepthScale) -> Self {
        let span = f64::from(scale.half_span_mm());
        Self { linear: c[7] as f32, square: (c[8] / span) as f32, cubic: (c[9] / span / span) as f32 }
    }
}
