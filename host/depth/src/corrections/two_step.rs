//! The two-step correction (Li 2014, section 5.3), for comparison. A first fit gives the true depth from place and raw
//! depth, `T = f(x, y, Uraw)` (eq. 5.21), a second one the raw depth from place and true depth, `Uc = g(x, y, T)` (eq.
//! 5.22). The corrected depth is `Uraw - Uc + T`. Errors of the first fit enter the second; one fit (CLSF) is better.

use farnear_maths::clsf::DepthScale;
use ndarray::ArrayViewMut2;
use serde::{Deserialize, Serialize};

use super::moments::{Moments, TEN};
use super::pattern::{Series, coordinate, normalise};
use super::table::Learned;
use super::{CdcSettings, CorrectionError};

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct TwoStep {
    true_of_raw: [f64; 10],
    raw_of_true: [f64; 10],
}

impl Learned for TwoStep {
    const PATTERNS_NEEDED: usize = 4;

    fn learn(series: &Series<'_>, _: &CdcSettings) -> Result<Self, CorrectionError> {
        let scale = series.scale();
        let (height, width) = series.dim();
        let (mut forward, mut backward) = (Moments::new(), Moments::new());
        for pattern in series.patterns() {
            let t = normalise(scale, pattern.true_mm);
            for (row, depths) in pattern.depth_mm.outer_iter().enumerate() {
                let y = coordinate(row, height);
                let samples = || {
                    depths.iter().enumerate().filter(|(_, depth)| depth.is_finite()).map(|(column, depth)| {
                        (coordinate(column, width), normalise(scale, f64::from(*depth)))
                    })
                };
                forward.add_row(y, samples().map(|(x, u)| (x, u, t, 1.0)));
                backward.add_row(y, samples().map(|(x, u)| (x, t, u, 1.0)));
            }
        }
        let solve = |what: &str, moments: &Moments| {
            moments.solve(&TEN).ok_or_else(|| CorrectionError::Underdetermined {
                what: what.to_owned(),
                samples: moments.samples(),
                terms: TEN.len(),
            })
        };
        Ok(Self {
            true_of_raw: solve("the first step", &forward)?,
            raw_of_true: solve("the second step", &backward)?,
        })
    }

    fn prepare(&mut self, _: (usize, usize)) -> Result<(), CorrectionError> {
        if self.true_of_raw.iter().chain(&self.raw_of_true).all(|c| c.is_finite()) {
            return Ok(());
        }
        Err(CorrectionError::Damaged("a coefficient of two-step is not finite".to_owned()))
    }

    fn apply(&self, mut depth_mm: ArrayViewMut2<f32>, scale: DepthScale) {
        let (height, width) = depth_mm.dim();
        let (centre, span) = (scale.centre_mm(), scale.half_span_mm());
        let along_x = |c: &[f64; 10]| -> Vec<f32> {
            let x = |column| coordinate(column, width);
            (0..width).map(|column| cubic([c[0], c[1], c[2], c[3]], x(column)) as f32).collect()
        };
        let of_depth = |c: &[f64; 10]| [c[7] as f32, c[8] as f32, c[9] as f32];
        let (first_x, second_x) = (along_x(&self.true_of_raw), along_x(&self.raw_of_true));
        let (first_u, second_t) = (of_depth(&self.true_of_raw), of_depth(&self.raw_of_true));
        for (row, mut depths) in depth_mm.outer_iter_mut().enumerate() {
            let y = coordinate(row, height);
            let along_y = |c: &[f64; 10]| cubic([0.0, c[4], c[5], c[6]], y) as f32;
            let (first_y, second_y) = (along_y(&self.true_of_raw), along_y(&self.raw_of_true));
            let Some(depths) = depths.as_slice_mut() else { continue };
            for ((depth, first_x), second_x) in depths.iter_mut().zip(&first_x).zip(&second_x) {
                let raw = (*depth - centre) / span;
                let t = first_x + first_y + raw * (first_u[0] + raw * (first_u[1] + raw * first_u[2]));
                let uc = second_x + second_y + t * (second_t[0] + t * (second_t[1] + t * second_t[2]));
                let corrected = raw - uc + t;
                let inside = raw.abs() <= 1.0 && corrected.abs() <= 1.0;
                *depth = if inside { centre + span * corrected } else { f32::NAN };
            }
        }
    }
}

fn cubic(c: [f64; 4], v: f64) -> f64 {
    c[0] + v * (c[1] + v * (c[2] + v * c[3]))
}
