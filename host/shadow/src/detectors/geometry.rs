//! Geometry: a standing body is upright, its shadow is on one side; needs no colour (Hsieh, Hu, Chang and
//! Chen, "Shadow elimination for effective moving object detection by Gaussian shadow modeling", Image and
//! Vision Computing 21, 2003).
//!
//! Per region: the tallest columns are the body; the lower part that leans out on the heavier side is the
//! first guess. Its centre, orientation and grey level define a Gaussian; pixels that fit are shadow:
//! ```text
//! exp(-(s^2 / (w sd_s)^2 + t^2 / (w sd_t)^2 + (g - mean_g)^2 / (w sd_g)^2) / 2) >= threshold
//! ```
//! with s and t along and across the guess. Misses shadows under or behind the body's own columns. Linear cost.

use ndarray::Array2;

use super::images::{Images, intensity};
use farnear_silhouettes::mask::{
    Mask,
    regions::{Connectivity, Region, regions},
};

/// Body columns have at least this share of the tallest.
const BODY_SHARE: f32 = 0.5;
/// Lower share of the body's height used by the guess.
const LOWER_SHARE: f32 = 0.5;
const WIDENING: f32 = 1.6;
/// Threshold of the Gaussian, 1 at its centre.
const THRESHOLD: f32 = 0.2;
const SMALLEST_REGION_PX: usize = 50;

pub(super) fn detect(images: &Images<'_>) -> Mask {
    let grey = intensity(images.frame);
    let mut found = Mask::from_elem(images.size(), false);
    for region in regions(images.foreground, true, Connectivity::Eight) {
        if region.area < SMALLEST_REGION_PX {
            continue;
        }
        if let Some(split) = Split::of(&region) {
            split.mark(&region, &grey, &mut found);
        }
    }
    found
}

struct Split {
    /// First and one past the last body column.
    body: (usize, usize),
    /// First row that may have shadow.
    first_row: usize,
    right: bool,
}

impl Split {
    /// `None` if nothing leans out of the body.
    fn of(region: &Region) -> Option<Self> {
        let bounds = region.bounds;
        let mut heights = vec![0_usize; bounds.width()];
        for run in &region.runs {
            heights[run.start - bounds.left..run.end - bounds.left]
                .iter_mut()
                .for_each(|height| *height += 1);
        }
        let (peak, &tallest) = heights.iter().enumerate().max_by_key(|&(_, height)| height)?;
        let tall = |height: &usize| *height as f32 >= BODY_SHARE * tallest as f32;
        let left = heights[..peak].iter().rposition(|height| !tall(height)).map_or(0, |at| at + 1);
        let right =
            heights[peak..].iter().position(|height| !tall(height)).map_or(heights.len(), |at| peak + at);
        let body = (bounds.left + left, bounds.left + right);
        // Row range of the body, then its lower part.
        let rows = region.runs.iter().filter(|run| run.start < body.1 && run.end > body.0).map(|run| run.row);
        let (top, bottom) =
            rows.fold((usize::MAX, 0), |(top, bottom), row| (top.min(row), bottom.max(row + 1)));
        let first_row = bottom - (LOWER_SHARE * (bottom - top) as f32) as usize;
        let outside = |right_side: bool| -> usize {
            let runs = region.runs.iter().filter(|run| run.row >= first_row);
            runs.map(|run| {
                if right_side {
                    run.end.saturating_sub(run.start.max(body.1))
                } else {
                    run.end.min(body.0).saturating_sub(run.start)
                }
            })
            .sum()
        };
        let (left_px, right_px) = (outside(false), outside(true));
        (left_px.max(right_px) > 0).then_some(Self { body, first_row, right: right_px > left_px })
    }

    fn guesses(&self, row: usize, column: usize) -> bool {
        row >= self.first_row && if self.right { column >= self.body.1 } else { column < self.body.0 }
    }

    fn mark(&self, region: &Region, grey: &Array2<f32>, found: &mut Mask) {
        let pixels =
            || region.runs.iter().flat_map(|run| (run.start..run.end).map(|column| (run.row, column)));
        let mut moments = Moments::default();
        for (row, column) in pixels().filter(|&(row, column)| self.guesses(row, column)) {
            moments.add([column as f64, row as f64, f64::from(grey[[row, column]])]);
        }
        let Some(model) = moments.gaussian(f64::from(WIDENING)) else { return };
        for (row, column) in pixels() {
            // No shadow on the far side of the body or above its lower part.
            let beyond = if self.right { column < self.body.0 } else { column >= self.body.1 };
            if beyond || row < self.first_row {
                continue;
            }
            let fit = model.value([column as f64, row as f64, f64::from(grey[[row, column]])]);
            found[[row, column]] = fit >= f64::from(THRESHOLD);
        }
    }
}

#[derive(Default)]
struct Moments {
    count: f64,
    sum: [f64; 3],
    square: [[f64; 3]; 3],
}

struct Gaussian {
    mean: [f64; 3],
    along: [f64; 2],
    /// Widened standard deviations: along, across, grey level.
    sd: [f64; 3],
}

impl Moments {
    fn add(&mut self, values: [f64; 3]) {
        self.count += 1.0;
        for i in 0..3 {
            self.sum[i] += values[i];
            for j in 0..3 {
                self.square[i][j] += values[i] * values[j];
            }
        }
    }

    /// `None` for fewer than three pixels, which have no orientation.
    fn gaussian(&self, widening: f64) -> Option<Gaussian> {
        if self.count < 3.0 {
            return None;
        }
        let mean = self.sum.map(|sum| sum / self.count);
        let covariance = |i: usize, j: usize| self.square[i][j] / self.count - mean[i] * mean[j];
        let (xx, yy, xy) = (covariance(0, 0), covariance(1, 1), covariance(0, 1));
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        let spread = (0.25 * (xx - yy).powi(2) + xy * xy).sqrt();
        let middle = 0.5 * (xx + yy);
        // A line is still a pixel wide, and a camera has about two grey levels of noise.
        let sd = |variance: f64, least: f64| widening * variance.max(0.0).sqrt().max(least);
        Some(Gaussian {
            mean,
            along: [angle.cos(), angle.sin()],
            sd: [sd(middle + spread, 0.5), sd(middle - spread, 0.5), sd(covariance(2, 2), 2.0)],
        })
    }
}

impl Gaussian {
    fn value(&self, [column, row, grey]: [f64; 3]) -> f64 {
        let (x, y) = (column - self.mean[0], row - self.mean[1]);
        let [cos, sin] = self.along;
        let parts = [x * cos + y * sin, y * cos - x * sin, grey - self.mean[2]];
        (-0.5 * parts.iter().zip(self.sd).map(|(part, sd)| (part / sd).powi(2)).sum::<f64>()).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array3, s};

    fn scene(shadow_columns: std::ops::Range<usize>) -> (Array3<u8>, Mask) {
        let mut frame = Array3::from_elem((120, 160, 3), 150);
        let mut mask = Mask::from_elem((120, 160), false);
        frame.slice_mut(s![20..100, 70..90, ..]).fill(200);
        mask.slice_mut(s![20..100, 70..90]).fill(true);
        frame.slice_mut(s![88..100, shadow_columns.clone(), ..]).fill(80);
        mask.slice_mut(s![88..100, shadow_columns]).fill(true);
        (frame, mask)
    }

    #[test]
    fn removes_a_shadow_on_either_side_and_keeps_the_body() {
        for columns in [90..140, 20..70] {
            let (frame, mask) = scene(columns.clone());
            let images = Images::new(frame.view(), frame.view(), mask.view()).unwrap();
            let found = detect(&images);
            let count = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
                found.slice(s![rows, columns]).iter().filter(|&&set| set).count()
            };
            assert!(count(88..100, columns) > 540, "of 600");
            assert_eq!(count(20..100, 70..90), 0);
        }
    }

    #[test]
    fn keeps_a_body_without_shadow() {
        let (frame, mask) = scene(80..80);
        let images = Images::new(frame.view(), frame.view(), mask.view()).unwrap();
        assert!(detect(&images).iter().all(|&set| !set));
    }

    #[test]
    fn the_gaussian_follows_the_orientation_of_its_pixels() {
        let mut moments = Moments::default();
        (0..40).for_each(|i| moments.add([f64::from(i), f64::from(i), 50.0]));
        let model = moments.gaussian(1.0).unwrap();
        assert!(
            (model.along[0] - 0.5_f64.sqrt()).abs() < 1e-9 && (model.along[1] - 0.5_f64.sqrt()).abs() < 1e-9
        );
        assert!(model.value([30.0, 30.0, 50.0]) > model.value([30.0, 9.0, 50.0]));
    }
}
