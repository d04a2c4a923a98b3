//! Correction by distortion cancellation (CDC; Li 2014, section 6.3, eqs. 6.2 to 6.10).
//!
//! Every pixel is compared with the stored patterns: the residual of pattern `v` is
//! `r(v) = sum |Ui(x - i, y - j) - Uc(x - i, y - j, v)|` over a window of (2N + 1) x (2N + 1) (6.3, 6.4, 6.6, 6.7 and
//! 6.10 print `Uo(x, y)` for the distorted depth `Ui` under the window). A V through the least residual and its two
//! neighbours gives a fractional pattern index. The index gives a fractional pattern value and true depth, and
//! `Uo = Ui - Uc + w`. Noise of the patterns would enter every result: they are smoothed (SD 8 px) and kept on a grid
//! of 4 px, in whole micrometres as in a file. Cost: M (2N + 1 + about 12) operations per pixel.

mod scan;
mod smooth;

use farnear_maths::clsf::DepthScale;
use ndarray::ArrayViewMut2;
use serde::{Deserialize, Serialize};

use super::CorrectionError;
use super::pattern::Series;
use super::table::Learned;

/// Widest window: beyond, the "local" residual spans a tenth of a 640x480 map.
const MAX_WINDOW: usize = 24;

const MAX_SMOOTHING_PX: f64 = 64.0;

/// Settings of learning CDC.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct CdcSettings {
    /// N of eq. 6.4: the window is 2N + 1 pixels wide and high.
    pub window: usize,
    /// SD of the Gaussian that smooths the patterns, px; 0 = as measured.
    pub smoothing_px: f64,
}

impl Default for CdcSettings {
    fn default() -> Self {
        Self { window: 1, smoothing_px: 8.0 }
    }
}

impl CdcSettings {
    fn check(&self) -> Result<(), CorrectionError> {
        let setting = |name, value, most| Err(CorrectionError::Setting { name, value, least: 0.0, most });
        if self.window > MAX_WINDOW {
            return setting("window", self.window as f64, MAX_WINDOW as f64);
        }
        if !(0.0..=MAX_SMOOTHING_PX).contains(&self.smoothing_px) {
            return setting("smoothing_px", self.smoothing_px, MAX_SMOOTHING_PX);
        }
        Ok(())
    }

    /// Grid spacing, px: a Gaussian is smooth over half its SD.
    fn grid_px(&self) -> usize {
        (self.smoothing_px / 2.0).clamp(1.0, 4.0) as usize
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Cdc {
    window: usize,
    grid_px: usize,
    true_mm: Vec<f64>,
    /// Measured minus true depth in micrometres on the grid, `[pattern][row][column]`.
    distortion_um: Vec<i32>,
    #[serde(skip)]
    expanded: Expanded,
}

#[derive(Debug, Clone, PartialEq, Default)]
struct Expanded {
    values: Vec<f32>,
    width: usize,
    rows: usize,
}

impl Learned for Cdc {
    const PATTERNS_NEEDED: usize = 3;

    fn learn(series: &Series<'_>, settings: &CdcSettings) -> Result<Self, CorrectionError> {
        settings.check()?;
        let (height, width) = series.dim();
        let grid_px = settings.grid_px();
        let mut distortion_um = Vec::new();
        for (index, pattern) in series.patterns().iter().enumerate() {
            let smoothed = smooth::on_grid(pattern.depth_mm, settings.smoothing_px, grid_px);
            if let Some(((row, column), _)) = smoothed.indexed_iter().find(|(_, v)| !v.is_finite()) {
                let (row, column) = ((row * grid_px).min(height - 1), (column * grid_px).min(width - 1));
                let (index, true_mm) = (series.given(index), pattern.true_mm);
                return Err(CorrectionError::PatternHole { index, true_mm, column, row });
            }
            distortion_um.extend(smoothed.iter().map(|v| ((v - pattern.true_mm) * 1e3).round() as i32));
        }
        let true_mm = series.patterns().iter().map(|pattern| pattern.true_mm).collect();
        let window = settings.window;
        let mut cdc = Self { window, grid_px, true_mm, distortion_um, expanded: Expanded::default() };
        cdc.prepare((height, width))?;
        Ok(cdc)
    }

    fn prepare(&mut self, (height, width): (usize, usize)) -> Result<(), CorrectionError> {
        let damaged = |what: String| Err(CorrectionError::Damaged(what));
        if !(1..=MAX_SMOOTHING_PX as usize).contains(&self.grid_px) || self.window > MAX_WINDOW {
            return damaged(format!("grid of {} px, window {}", self.grid_px, self.window));
        }
        if self.true_mm.len() < 3 || !self.true_mm.is_sorted_by(|a, b| a > b) {
            return damaged("fewer than 3 true depths, or not from far to near".to_owned());
        }
        let points = |length: usize| smooth::grid_points(length, self.grid_px);
        let (rows, columns) = (points(height), points(width));
        let expected = self.true_mm.len() * rows * columns;
        if width < 2 || height < 2 || self.distortion_um.len() != expected {
            return damaged(format!("{} grid values where {expected} are needed", self.distortion_um.len()));
        }
        let mut values = Vec::with_capacity(self.true_mm.len() * rows * width);
        for (index, grid_row) in self.distortion_um.chunks_exact(columns).enumerate() {
            let true_mm = self.true_mm[index / rows];
            let mm = |point: usize| true_mm + 1e-3 * f64::from(grid_row[point]);
            values.extend((0..width).map(|x| {
                let (point, part) = (x / self.grid_px, (x % self.grid_px) as f64 / self.grid_px as f64);
                let next = mm((point + 1).min(columns - 1));
                (mm(point) + part * (next - mm(point))) as f32
            }));
        }
        self.expanded = Expanded { values, width, rows };
        Ok(())
    }

    fn apply(&self, depth_mm: ArrayViewMut2<f32>, scale: DepthScale) {
        let true_mm: Vec<f32> = self.true_mm.iter().map(|mm| *mm as f32).collect();
        let patterns = scan::Patterns {
            values: &self.expanded.values,
            true_mm: &true_mm,
            width: self.expanded.width,
            rows: self.expanded.rows,
            grid_px: self.grid_px,
        };
        scan::correct(depth_mm, &patterns, self.window, scale);
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::corrections::{Method, Pattern, fit};

    #[test]
    fn a_pattern_with_a_hole_is_named_by_its_place_in_the_list() {
        let depths = [900.0, 905.0, 910.0, 915.0];
        let mut maps = depths.map(|depth| Array2::from_elem((24, 24), depth as f32));
        maps[1].fill(f32::NAN);
        let patterns: Vec<Pattern<'_>> =
            maps.iter().zip(depths).map(|(map, true_mm)| Pattern { depth_mm: map.view(), true_mm }).collect();
        let error = fit(Method::Cdc, &patterns, &CdcSettings::default()).unwrap_err();
        assert!(matches!(error, CorrectionError::PatternHole { index: 1, .. }), "{error}");
        assert!(error.to_string().starts_with("pattern 2 (905 mm)"), "{error}");
    }
}
