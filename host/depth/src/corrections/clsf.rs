//! Ten-term polynomials in 3x3 regions, as they are or blended (Li 2014, eq. 6.11 and section 6.4).

use std::ops::Range;

use farnear_maths::clsf::{self as board, Coefficient, DepthScale, REGION_TERMS, REGIONS};
use ndarray::{Array2, ArrayView2, ArrayViewMut2};
use serde::{Deserialize, Serialize};

use super::{
    CorrectionError, coordinate,
    moments::{Moments, TEN},
    pattern::{Series, normalise},
};

/// The coefficients of all regions, `[region row][region column][term]`, terms as in [`board::REGION_TERMS`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Regions {
    terms: [[[f64; REGION_TERMS]; REGIONS]; REGIONS],
}

/// Each pixel of an axis belongs to one region; the same split as on the board.
fn region(region: usize, length: usize) -> Range<usize> {
    length * region / REGIONS..length * (region + 1) / REGIONS
}

/// The weight of each region at a pixel when neighbours are blended between their centres.
fn weights(index: usize, length: usize) -> [f64; REGIONS] {
    let centre = |r: usize| (region(r, length).start + region(r, length).end - 1) as f64 / 2.0;
    let mut weights = [0.0; REGIONS];
    let place = index as f64;
    let later = (1..REGIONS).find(|&r| place < centre(r)).unwrap_or(REGIONS);
    if later == REGIONS || place <= centre(0) {
        weights[if later == REGIONS { REGIONS - 1 } else { 0 }] = 1.0;
    } else {
        let of_later = (place - centre(later - 1)) / (centre(later) - centre(later - 1));
        weights[later] = of_later;
        weights[later - 1] = 1.0 - of_later;
    }
    weights
}

/// Whether `index` lies in each region, as weights.
fn membership(index: usize, length: usize) -> [f64; REGIONS] {
    std::array::from_fn(|r| if region(r, length).contains(&index) { 1.0 } else { 0.0 })
}

impl Regions {
    /// One fit per region, from the samples inside it.
    pub(super) fn fit(series: &Series<'_>) -> Result<Self, CorrectionError> {
        Self::fit_weighted(series, membership)
    }

    /// One fit per region, from the samples up to the neighbouring centres, each with the weight that the region has
    /// there when it is blended: what a region's polynomial is used for is what it is fitted to.
    pub(super) fn fit_blended(series: &Series<'_>) -> Result<Self, CorrectionError> {
        Self::fit_weighted(series, weights)
    }

    fn fit_weighted(
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

    pub(super) fn check(&self) -> Result<(), CorrectionError> {
        if self.terms.iter().flatten().flatten().all(|c| c.is_finite()) {
            return Ok(());
        }
        Err(CorrectionError::Damaged("a coefficient of a region is not finite".to_owned()))
    }

    pub(super) fn apply(&self, mut depth_mm: ArrayViewMut2<f32>, scale: DepthScale) {
        let (height, width) = depth_mm.dim();
        for (i, regions) in self.terms.iter().enumerate() {
            for (j, terms) in regions.iter().enumerate() {
                let columns = region(j, width);
                let of_columns: Vec<f32> = columns
                    .clone()
                    .map(|column| scale.centre_mm() + in_mm(scale, x_terms(terms, coordinate(column, width))))
                    .collect();
                let factors = Factors::new(terms, scale);
                for row in region(i, height) {
                    let of_row = in_mm(scale, y_terms(terms, coordinate(row, height)));
                    let mut depths = depth_mm.row_mut(row);
                    if let Some(depths) = depths.as_slice_mut() {
                        uniform(&mut depths[columns.clone()], &of_columns, of_row, factors, scale);
                    }
                }
            }
        }
    }

    pub(super) fn apply_blended(&self, mut depth_mm: ArrayViewMut2<f32>, scale: DepthScale) {
        let (height, width) = depth_mm.dim();
        let of_columns: Vec<[f64; REGIONS]> = (0..width).map(|column| weights(column, width)).collect();
        // The terms in x blended along x, for each row of regions.
        let along_x: [Vec<f32>; REGIONS] = std::array::from_fn(|i| {
            let blended = |column: usize| {
                let x = coordinate(column, width);
                let sum = (0..REGIONS).map(|j| of_columns[column][j] * x_terms(&self.terms[i][j], x));
                scale.centre_mm() + in_mm(scale, sum.sum())
            };
            (0..width).map(blended).collect()
        });
        // Between two centres the weight of the right region; elsewhere 0.
        let spans = spans(width);
        for (row, mut depths) in depth_mm.outer_iter_mut().enumerate() {
            let Some(depths) = depths.as_slice_mut() else { continue };
            let (y, of_rows) = (coordinate(row, height), weights(row, height));
            let factors: [Blended; REGIONS] = std::array::from_fn(|j| {
                let column_of = [&self.terms[0][j], &self.terms[1][j], &self.terms[2][j]];
                Blended::new(column_of, of_rows, y, scale)
            });
            let upper = of_rows.iter().position(|w| *w > 0.0).unwrap_or(0);
            let lower = (upper + 1).min(REGIONS - 1);
            let of_lower = if lower == upper { 0.0 } else { of_rows[lower] as f32 };
            for span in &spans {
                let columns = span.columns.clone();
                let tables = [&along_x[upper][columns.clone()], &along_x[lower][columns.clone()]];
                let ends = [factors[span.left], factors[span.right]];
                mixed(&mut depths[columns], tables, of_lower, &span.of_right, ends, scale);
            }
        }
    }

    pub(super) fn apply_as_board(
        &self,
        depth_mm: ArrayView2<f32>,
        scale: DepthScale,
    ) -> Result<Array2<f32>, CorrectionError> {
        let frame = super::board::frame(depth_mm.dim())?;
        let mut table = vec![0; board::Regions::table_words(frame.width())];
        let mut regions = board::Regions::new(self.quantised()?, frame, &mut table)?;
        super::board::apply(depth_mm, scale, |row, codes| regions.correct_row(row, codes))
    }

    pub(super) fn apply_blended_as_board(
        &self,
        depth_mm: ArrayView2<f32>,
        scale: DepthScale,
    ) -> Result<Array2<f32>, CorrectionError> {
        let frame = super::board::frame(depth_mm.dim())?;
        let mut table = vec![0; board::Blend::table_words(frame.width())];
        let mut blend = board::Blend::new(self.quantised()?, frame, &mut table)?;
        super::board::apply(depth_mm, scale, |row, codes| blend.correct_row(row, codes))
    }

    /// The coefficients as the board stores them.
    pub(super) fn quantised(&self) -> Result<board::RegionCoefficients, CorrectionError> {
        let mut quantised = board::RegionCoefficients::default();
        for (to, from) in quantised.as_flattened_mut().iter_mut().zip(self.terms.as_flattened()) {
            for (to, from) in to.iter_mut().zip(from) {
                *to = Coefficient::from_f64(*from)?;
            }
        }
        Ok(quantised)
    }
}

/// The columns in which region `j` has any weight.
fn support(of_columns: &[[f64; REGIONS]], j: usize) -> Range<usize> {
    let start = of_columns.iter().position(|w| w[j] > 0.0).unwrap_or(0);
    let end = of_columns.iter().rposition(|w| w[j] > 0.0).map_or(0, |last| last + 1);
    start..end
}

/// Columns on which the same two regions mix, and the weight of the right one.
struct Span {
    columns: Range<usize>,
    left: usize,
    right: usize,
    of_right: Vec<f32>,
}

fn spans(width: usize) -> Vec<Span> {
    let of_columns: Vec<[f64; REGIONS]> = (0..width).map(|column| weights(column, width)).collect();
    (0..REGIONS - 1)
        .map(|left| {
            let right = left + 1;
            // The first span begins, the last one ends with the part where one region holds alone.
            let start = if left == 0 { 0 } else { support(&of_columns, right).start };
            let end = if right == REGIONS - 1 { width } else { support(&of_columns, right + 1).start };
            let of_right = (start..end).map(|column| of_columns[column][right] as f32).collect();
            Span { columns: start..end, left, right, of_right }
        })
        .collect()
}

fn x_terms(c: &[f64; REGION_TERMS], x: f64) -> f64 {
    c[0] + x * (c[1] + x * (c[2] + x * c[3]))
}

fn y_terms(c: &[f64; REGION_TERMS], y: f64) -> f64 {
    y * (c[4] + y * (c[5] + y * c[6]))
}

fn in_mm(scale: DepthScale, normalised: f64) -> f32 {
    (f64::from(scale.half_span_mm()) * normalised) as f32
}

/// Factors of `d`, `d^2` and `d^3`, `d` the distance in mm of the raw depth from the scale's centre.
#[derive(Clone, Copy)]
struct Factors {
    linear: f32,
    square: f32,
    cubic: f32,
}

impl Factors {
    fn new(c: &[f64; REGION_TERMS], scale: DepthScale) -> Self {
        let span = f64::from(scale.half_span_mm());
        Self { linear: c[7] as f32, square: (c[8] / span) as f32, cubic: (c[9] / span / span) as f32 }
    }
}

/// [`Factors`] and the terms in y, blended along y.
#[derive(Clone, Copy)]
struct Blended {
    factors: Factors,
    of_row: f32,
}

impl Blended {
    fn new(c: [&[f64; REGION_TERMS]; REGIONS], weights: [f64; REGIONS], y: f64, scale: DepthScale) -> Self {
        let terms: [f64; REGION_TERMS] =
            std::array::from_fn(|term| c.iter().zip(weights).map(|(c, w)| w * c[term]).sum());
        Self { factors: Factors::new(&terms, scale), of_row: in_mm(scale, y_terms(&terms, y)) }
    }
}

/// The hot loop of `clsf`; vectorised by the compiler.
fn uniform(depths: &mut [f32], of_columns: &[f32], of_row: f32, f: Factors, scale: DepthScale) {
    let (centre, span) = (scale.centre_mm(), scale.half_span_mm());
    for (depth, of_column) in depths.iter_mut().zip(of_columns) {
        let d = *depth - centre;
        let corrected = of_column + of_row + d * (f.linear + d * (f.square + d * f.cubic));
        *depth = inside(d, corrected, centre, span);
    }
}

/// The hot loop of `clsf-blend`.
fn mixed(
    depths: &mut [f32],
    [upper, lower]: [&[f32]; 2],
    of_lower: f32,
    of_right: &[f32],
    [left, right]: [Blended; 2],
    scale: DepthScale,
) {
    let (centre, span) = (scale.centre_mm(), scale.half_span_mm());
    let (l, r) = (left.factors, right.factors);
    for (((depth, upper), lower), w) in depths.iter_mut().zip(upper).zip(lower).zip(of_right) {
        let d = *depth - centre;
        let linear = l.linear + w * (r.linear - l.linear);
        let square = l.square + w * (r.square - l.square);
        let cubic = l.cubic + w * (r.cubic - l.cubic);
        let constant = upper + of_lower * (lower - upper) + (left.of_row + w * (right.of_row - left.of_row));
        *depth = inside(d, constant + d * (linear + d * (square + d * cubic)), centre, span);
    }
}

/// The corrected depth, or NaN where it or the raw one (`d` from the centre) lies beyond the scale.
#[inline(always)]
pub(super) fn inside(d: f32, corrected: f32, centre: f32, span: f32) -> f32 {
    // Not `&&`: no branch, and NaN compares false.
    if (d.abs() <= span) & ((corrected - centre).abs() <= span) { corrected } else { f32::NAN }
}
