//! Polynomials of 3x3 regions blended bilinearly between the regions' centres: no steps (Li 2014, section 6.4).

use std::ops::Range;

use farnear_maths::clsf::{DepthScale, REGION_TERMS, REGIONS};
use ndarray::ArrayViewMut2;
use serde::{Deserialize, Serialize};

use super::board::BoardForm;
use super::pattern::{Series, coordinate, inside};
use super::regions::{Factors, Regions, in_mm, region, support, x_terms, y_terms};
use super::table::Learned;
use super::{CdcSettings, CorrectionError};

/// One fit per region, from the samples up to the neighbouring centres with their blending weights.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct ClsfBlend(Regions);

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

impl Learned for ClsfBlend {
    const PATTERNS_NEEDED: usize = 4;
    const BOARD_FORM: Option<BoardForm> = Some(BoardForm::Blend);

    fn learn(series: &Series<'_>, _: &CdcSettings) -> Result<Self, CorrectionError> {
        Ok(Self(Regions::fit(series, weights)?))
    }

    fn prepare(&mut self, _: (usize, usize)) -> Result<(), CorrectionError> {
        self.0.check()
    }

    fn apply(&self, mut depth_mm: ArrayViewMut2<f32>, scale: DepthScale) {
        let (height, width) = depth_mm.dim();
        let of_columns: Vec<[f64; REGIONS]> = (0..width).map(|column| weights(column, width)).collect();
        // The terms in x blended along x, for each row of regions.
        let along_x: [Vec<f32>; REGIONS] = std::array::from_fn(|i| {
            let blended = |column: usize| {
                let x = coordinate(column, width);
                let sum = (0..REGIONS).map(|j| of_columns[column][j] * x_terms(&self.0.terms[i][j], x));
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
                let column_of = [&self.0.terms[0][j], &self.0.terms[1][j], &self.0.terms[2][j]];
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

    fn quantised(&self) -> Result<Vec<i32>, CorrectionError> {
        self.0.quantised()
    }
}

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
            // The first span begins and the last ends where a single region applies.
            let start = if left == 0 { 0 } else { support(&of_columns, right).start };
            let end = if right == REGIONS - 1 { width } else { support(&of_columns, right + 1).start };
            let of_right = (start..end).map(|column| of_columns[column][right] as f32).collect();
            Span { columns: start..end, left, right, of_right }
        })
        .collect()
}

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
