//! A polynomial of ten terms in each of 3x3 regions (Li 2014, eq. 6.11), with steps at the regions' borders.

use farnear_maths::clsf::{DepthScale, REGIONS};
use ndarray::ArrayViewMut2;
use serde::{Deserialize, Serialize};

use super::board::BoardForm;
use super::pattern::{Series, coordinate, inside};
use super::regions::{Factors, Regions, in_mm, region, x_terms, y_terms};
use super::table::Learned;
use super::{CdcSettings, CorrectionError};

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Clsf(Regions);

fn membership(index: usize, length: usize) -> [f64; REGIONS] {
    std::array::from_fn(|r| if region(r, length).contains(&index) { 1.0 } else { 0.0 })
}

impl Learned for Clsf {
    // Fewer cannot distinguish 1, U, U^2 and U^3.
    const PATTERNS_NEEDED: usize = 4;
    const BOARD_FORM: Option<BoardForm> = Some(BoardForm::Regions);

    fn learn(series: &Series<'_>, _: &CdcSettings) -> Result<Self, CorrectionError> {
        Ok(Self(Regions::fit(series, membership)?))
    }

    fn prepare(&mut self, _: (usize, usize)) -> Result<(), CorrectionError> {
        self.0.check()
    }

    fn apply(&self, mut depth_mm: ArrayViewMut2<f32>, scale: DepthScale) {
        let (height, width) = depth_mm.dim();
        for (i, regions) in self.0.terms.iter().enumerate() {
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

    fn quantised(&self) -> Result<Vec<i32>, CorrectionError> {
        self.0.quantised()
    }
}

fn uniform(depths: &mut [f32], of_columns: &[f32], of_row: f32, f: Factors, scale: DepthScale) {
    let (centre, span) = (scale.centre_mm(), scale.half_span_mm());
    for (depth, of_column) in depths.iter_mut().zip(of_columns) {
        let d = *depth - centre;
        let corrected = of_column + of_row + d * (f.linear + d * (f.square + d * f.cubic));
        *depth = inside(d, corrected, centre, span);
    }
}
