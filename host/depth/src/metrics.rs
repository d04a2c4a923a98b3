//! Errors of a depth map against the truth. Pixels count if they lie `border_px` inside the map, the mask allows them,
//! both depths are finite and, if requested, they lie more than `away_from_edges_px` from a step of the true depth.
//! Depths in mm, NaN = no value. Cost: O(pixels); O(pixels x distance) with `away_from_edges_px`.

use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};

use crate::median::median;

/// Difference of neighbouring true depths that is a step, as part of the truth's range.
const STEP: f32 = 0.02;

/// Why two maps cannot be compared.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum CompareError {
    #[error(
        "{what} is {found_width}x{found_height}, the depth map {width}x{height}: they must have one size"
    )]
    Size { what: &'static str, width: usize, height: usize, found_width: usize, found_height: usize },
    #[error("no pixel to compare: border, mask, edges and missing values leave none of {0}")]
    NothingToCompare(usize),
}

/// Selection of pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct CompareSettings {
    /// Width of the border that does not count, px.
    pub border_px: usize,
    /// Least distance, px (rows and columns), from a step of the true depth.
    pub away_from_edges_px: Option<usize>,
}

/// Errors of a depth map: estimated minus true depth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Root-mean-square error, mm.
    pub rmse_mm: f64,
    /// Mean absolute error, mm.
    pub mae_mm: f64,
    /// 95th percentile of the absolute error, mm.
    pub p95_mm: f64,
    /// Mean error, mm; positive = too far.
    pub bias_mm: f64,
    /// Root-mean-square of the error relative to the true depth, percent.
    pub rmse_percent_of_depth: f64,
    /// Number of pixels compared.
    pub pixels: usize,
    /// Part of the selected pixels without a depth.
    pub missing_fraction: f64,
    /// Pixels excluded because the truth has a hole (0, negative or NaN).
    pub pixels_without_truth: usize,
}

/// Compares `depth` with `truth` in mm, where `mask` is true. [`CompareError`] if sizes differ or no pixel is left.
pub fn compare(
    depth: ArrayView2<f32>,
    truth: ArrayView2<f32>,
    mask: Option<ArrayView2<bool>>,
    settings: &CompareSettings,
) -> Result<Comparison, CompareError> {
    let (height, width) = depth.dim();
    let size = |what, (found_height, found_width)| {
        if (found_height, found_width) == (height, width) {
            Ok(())
        } else {
            Err(CompareError::Size { what, width, height, found_width, found_height })
        }
    };
    size("truth", truth.dim())?;
    if let Some(mask) = mask {
        size("mask", mask.dim())?;
    }
    let near_edge = settings.away_from_edges_px.map(|distance| near_steps(truth, distance));
    let border = settings.border_px;
    let [mut errors, mut relative] = [const { Vec::new() }; 2];
    let [mut asked, mut without_truth] = [0_usize; 2];
    for ((y, x), &truth_mm) in truth.indexed_iter() {
        let inside = y >= border && x >= border && y + border < height && x + border < width;
        let allowed = mask.is_none_or(|m| m[(y, x)]) && near_edge.as_ref().is_none_or(|e| !e[(y, x)]);
        if !(inside && allowed) {
            continue;
        }
        if !is_depth(truth_mm) {
            without_truth += 1;
            continue;
        }
        asked += 1;
        let depth_mm = depth[(y, x)];
        if is_depth(depth_mm) {
            let error = f64::from(depth_mm) - f64::from(truth_mm);
            errors.push(error);
            relative.push(error / f64::from(truth_mm));
        }
    }
    summarise(errors, &relative, [asked, without_truth]).ok_or(CompareError::NothingToCompare(height * width))
}

/// Whether a value is a depth; 0, negative values, NaN and infinity are holes in many sources.
pub fn is_depth(value_mm: f32) -> bool {
    value_mm.is_finite() && value_mm > 0.0
}

fn summarise(
    mut errors: Vec<f64>,
    relative: &[f64],
    [asked, without_truth]: [usize; 2],
) -> Option<Comparison> {
    if errors.is_empty() {
        return None;
    }
    let n = errors.len() as f64;
    let mean = |f: fn(f64) -> f64, v: &[f64]| v.iter().map(|e| f(*e)).sum::<f64>() / v.len() as f64;
    let square = |e: f64| e * e;
    let rmse_mm = mean(square, &errors).sqrt();
    let bias_mm = mean(|e| e, &errors);
    errors.iter_mut().for_each(|e| *e = e.abs());
    let rank = ((0.95 * n).ceil() as usize).clamp(1, errors.len()) - 1;
    let (_, p95_mm, _) = errors.select_nth_unstable_by(rank, f64::total_cmp);
    let p95_mm = *p95_mm;
    Some(Comparison {
        rmse_mm,
        mae_mm: mean(|e| e, &errors),
        p95_mm,
        bias_mm,
        rmse_percent_of_depth: 100.0 * mean(square, relative).sqrt(),
        pixels: errors.len(),
        missing_fraction: 1.0 - n / asked as f64,
        pixels_without_truth: without_truth,
    })
}

/// Marks pixels within `distance` rows and columns of a hole or a step of the true depth: neighbours that differ by
/// more than 2 % of the range and four times the median difference, so that slants, cones and spheres have none.
pub fn near_steps(truth: ArrayView2<f32>, distance: usize) -> Array2<bool> {
    let (height, width) = truth.dim();
    let truth = truth.mapv(|t| if is_depth(t) { t } else { f32::NAN });
    let finite = || truth.iter().copied().filter(|t| t.is_finite());
    let range = finite().fold(f32::MIN, f32::max) - finite().fold(f32::MAX, f32::min);
    let neighbours = |(y, x): (usize, usize)| {
        [(y, x + 1), (y + 1, x)].into_iter().filter(move |(y, x)| *y < height && *x < width)
    };
    let difference = |a: (usize, usize), b: (usize, usize)| (truth[a] - truth[b]).abs();
    let slopes = truth
        .indexed_iter()
        .flat_map(|(at, _)| neighbours(at).map(move |next| difference(at, next)))
        .filter(|d| d.is_finite())
        .collect();
    let usual = median(slopes, f32::total_cmp).unwrap_or(0.0);
    let threshold = (STEP * range).max(4.0 * usual);
    let mut steps = Array2::from_elem((height, width), false);
    for (at, _) in truth.indexed_iter() {
        for next in neighbours(at) {
            let step = difference(at, next);
            if truth[at].is_nan() != truth[next].is_nan() || step > threshold {
                steps[at] = true;
                steps[next] = true;
            }
        }
    }
    dilate_square(&steps, distance)
}

pub(crate) fn dilate_square(mask: &Array2<bool>, distance: usize) -> Array2<bool> {
    let (height, width) = mask.dim();
    let mask = mask.as_standard_layout();
    let Some(mask) = mask.as_slice() else { unreachable!("made in standard layout") };
    let mut along = mask.to_vec();
    for (from, to) in mask.chunks(width.max(1)).zip(along.chunks_mut(width.max(1))) {
        spread(from, to, distance);
    }
    // Steps since the last true value, a row at a time, in 16 bits: the loop is done in vectors.
    let mut wider = Array2::from_elem((height, width), false);
    let Some(to) = wider.as_slice_mut() else { unreachable!("made in standard layout") };
    to.copy_from_slice(&along);
    let distance = distance.min(usize::from(u16::MAX - 1)) as u16;
    let mut since = vec![u16::MAX; width];
    let mut pass = |rows: &mut dyn Iterator<Item = usize>| {
        since.fill(u16::MAX);
        for y in rows {
            let row = y * width..(y + 1) * width;
            for ((value, own), since) in to[row.clone()].iter_mut().zip(&along[row]).zip(&mut since) {
                *since = if *own { 0 } else { since.saturating_add(1) };
                *value |= *since <= distance;
            }
        }
    };
    pass(&mut (0..height));
    pass(&mut (0..height).rev());
    wider
}

/// Sets the values of `to` that lie within `distance` of a true one of `from`.
pub(crate) fn spread(from: &[bool], to: &mut [bool], distance: usize) {
    const TOGETHER: usize = 64;
    let mut done = 0;
    for (part, values) in from.chunks(TOGETHER).enumerate().filter(|(_, values)| values.contains(&true)) {
        for (x, _) in values.iter().enumerate().filter(|(_, value)| **value) {
            let x = part * TOGETHER + x;
            let end = (x + distance + 1).min(to.len());
            to[x.saturating_sub(distance).max(done).min(end)..end].fill(true);
            done = end;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn figures_of_a_worked_example() {
        let truth = array![[100.0, 100.0, 200.0, 200.0]];
        let depth = array![[101.0, 99.0, 203.0, f32::NAN]];
        let c = compare(depth.view(), truth.view(), None, &CompareSettings::default()).unwrap();
        assert!((c.rmse_mm - (11.0_f64 / 3.0).sqrt()).abs() < 1e-9);
        assert!((c.mae_mm - 5.0 / 3.0).abs() < 1e-9 && (c.bias_mm - 1.0).abs() < 1e-9 && c.p95_mm == 3.0);
        let relative = ((1e-4 + 1e-4 + 0.015_f64.powi(2)) / 3.0).sqrt();
        assert!((c.rmse_percent_of_depth - 100.0 * relative).abs() < 1e-9);
        assert!(c.pixels == 3 && (c.missing_fraction - 0.25).abs() < 1e-12);
    }

    #[test]
    fn a_mask_spreads_over_squares() {
        let mask = Array2::from_shape_fn((9, 30), |at| [(0, 3), (5, 3), (5, 4), (8, 20)].contains(&at));
        for distance in [0, 1, 2, 40] {
            let wider = dilate_square(&mask, distance);
            for ((y, x), value) in wider.indexed_iter() {
                let near = mask.indexed_iter().any(|((at_y, at_x), set)| {
                    *set && at_y.abs_diff(y) <= distance && at_x.abs_diff(x) <= distance
                });
                assert_eq!(*value, near, "{distance} ({y}, {x})");
            }
        }
    }

    #[test]
    fn zeros_and_negative_values_are_holes_and_counted() {
        let truth = array![[900.0, 0.0, -1.0, f32::NAN, 910.0, 920.0]];
        let depth = array![[901.0, 900.0, 900.0, 900.0, 0.0, 920.0]];
        let c = compare(depth.view(), truth.view(), None, &CompareSettings::default()).unwrap();
        assert_eq!((c.pixels, c.pixels_without_truth), (2, 3));
        assert!(
            (c.rmse_mm - 0.5_f64.sqrt()).abs() < 1e-9 && (c.missing_fraction - 1.0 / 3.0).abs() < 1e-9,
            "{c:?}"
        );
        // A step to a hole is a step, as it is to NaN.
        let steps = near_steps(array![[900.0, 900.0, 0.0, 0.0, 0.0, 0.0]].view(), 0);
        assert_eq!(steps, array![[false, true, true, false, false, false]]);
    }

    #[test]
    fn border_mask_and_edges_restrict_what_counts() {
        let truth = Array2::from_shape_fn((40, 60), |(_, x)| if x < 30 { 900.0 } else { 910.0 });
        // Wrong by 5 mm within 4 px of the step and on the border.
        let depth = Array2::from_shape_fn((40, 60), |(y, x)| {
            let border = y < 2 || x < 2 || y >= 38 || x >= 58;
            truth[(y, x)] + if border || x.abs_diff(30) <= 4 { 5.0 } else { 1.0 }
        });
        let rmse = |border_px, away_from_edges_px| {
            let settings = CompareSettings { border_px, away_from_edges_px };
            compare(depth.view(), truth.view(), None, &settings).unwrap().rmse_mm
        };
        assert!(rmse(0, None) > 2.0 && rmse(2, None) > 1.5);
        assert!((rmse(2, Some(8)) - 1.0).abs() < 1e-6);
        let mask = Array2::from_shape_fn((40, 60), |(y, x)| (5..20).contains(&x) && (5..20).contains(&y));
        let c = compare(depth.view(), truth.view(), Some(mask.view()), &CompareSettings::default()).unwrap();
        assert!(c.pixels == 225 && (c.rmse_mm - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_slant_and_a_plane_have_no_steps() {
        let slant = Array2::from_shape_fn((30, 30), |(_, x)| 900.0 + x as f32);
        assert!(near_steps(slant.view(), 8).iter().all(|s| !s));
        let plane = Array2::from_elem((30, 30), 900.0);
        assert!(near_steps(plane.view(), 8).iter().all(|s| !s));
    }

    #[test]
    fn maps_that_cannot_be_compared_say_why() {
        let [a, b] = [Array2::<f32>::zeros((3, 4)), Array2::<f32>::zeros((4, 3))];
        let error = compare(a.view(), b.view(), None, &CompareSettings::default()).unwrap_err();
        assert_eq!(error.to_string(), "truth is 3x4, the depth map 4x3: they must have one size");
        let empty = Array2::from_elem((3, 4), f32::NAN);
        let error = compare(empty.view(), a.view(), None, &CompareSettings::default()).unwrap_err();
        assert_eq!(error, CompareError::NothingToCompare(12));
    }
}
