//! Registers the near-focused image on the far-focused one: shift, magnification and rotation, or any affine map.
//!
//! Both images are reduced to their common band (`band`), from coarse to fine. The coarsest level tries every shift.
//! From there Gauss-Newton steps minimise the squared difference (Lucas & Kanade 1981, in the inverse compositional
//! form of Baker & Matthews 2004: the far image's gradients serve all steps). Cauchy's weights suppress motion between
//! the exposures. A symmetric PSF moves nothing, so different blur does not shift the minimum. Large images are reduced
//! to at most 800,000 pixels (`thinned`). If the images are already aligned, one level confirms it (`displaced`). Cost:
//! `cargo bench -p farnear-depth --bench registration`.

mod step;

use std::ops::Range;

use ndarray::{Array2, ArrayView2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::band::{band, halved, normalised};
use super::thinned::Thinned;
use super::warp::Warp;
use crate::simd::{self, Backend};
use step::{LEAST_SCALE, Step};

/// Most pixels of the level that rules out a displacement.
const CHECKED_PX: usize = 200_000;
/// Correlation from which the nearest alignment is accepted without a search.
const SURE: f64 = 0.6;
/// Most pixels of a level that a step uses; of larger levels every few rows.
const STEP_PX: usize = 100_000;
/// Shortest side of the coarsest level.
const COARSEST_PX: usize = 24;
/// Most steps per level.
const STEPS: usize = 12;
/// Convergence: a step that moves no corner farther is the last, px.
const SETTLED_PX: f64 = 2e-3;
/// The same on levels that only start the next finer one.
const COARSELY_SETTLED_PX: f64 = 2e-2;
/// Part of the correlation from which the alignment nearest to the start is as good, as on stripes and repeated patterns.
const ALIKE: f64 = 0.95;
/// Ignored border of a level, px.
const BORDER_PX: usize = 3;

/// Free parameters of the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Model {
    /// A shift.
    Shift,
    /// Shift, magnification and rotation.
    Similarity,
    /// Any affine map.
    Affine,
}

impl Model {
    fn parameters(self) -> usize {
        match self {
            Self::Shift => 2,
            Self::Similarity => 4,
            Self::Affine => 6,
        }
    }

    /// Derivatives of the place `(x, y)` by each parameter.
    fn basis(self, x: f64, y: f64) -> [[f64; 2]; 6] {
        let shifts = [[1.0, 0.0], [0.0, 1.0]];
        let [a, b, c, d] = match self {
            Self::Shift => [[0.0; 2]; 4],
            Self::Similarity => [[x, y], [-y, x], [0.0; 2], [0.0; 2]],
            Self::Affine => [[x, 0.0], [y, 0.0], [0.0, x], [0.0, y]],
        };
        [shifts[0], shifts[1], a, b, c, d]
    }

    /// The map with these parameters about `centre`; places are in units of `unit` px.
    fn warp(self, p: &[f64], centre: [f64; 2], unit: f64) -> Warp {
        let get = |i: usize| p.get(i).copied().unwrap_or(0.0) / unit;
        let matrix = match self {
            Self::Shift => Warp::IDENTITY.matrix,
            Self::Similarity => [[1.0 + get(2), -get(3)], [get(3), 1.0 + get(2)]],
            Self::Affine => [[1.0 + get(2), get(3)], [get(4), 1.0 + get(5)]],
        };
        Warp::linear_about(centre, matrix, [p[0], p[1]])
    }
}

/// Result of the registration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Alignment {
    /// From a place in the far image to the corresponding one in the near image.
    pub warp: Warp,
    /// Correlation of the common band in the overlap, -1 to 1; about 0 for unrelated images.
    pub correlation: f64,
    /// The same at the start.
    pub correlation_before: f64,
    /// Standard error of the map, RMS over the image, px.
    pub standard_error_px: f64,
}

struct Level {
    far: Array2<f32>,
    near: Array2<f32>,
}

/// Registers the near image on the far one, both (height, width) of one size, starting at `start`. The image's mean
/// replaces holes (NaN). `None` for images below 48 px, without any detail, or without overlap.
pub fn estimate(far: ArrayView2<f32>, near: ArrayView2<f32>, model: Model, start: Warp) -> Option<Alignment> {
    if far.dim() != near.dim() || far.nrows().min(far.ncols()) < 2 * COARSEST_PX {
        return None;
    }
    estimate_thinned(&Thinned::new(far, near), model, start)
}

/// [`estimate`] of a pair that is thinned already.
pub(super) fn estimate_thinned(pair: &Thinned, model: Model, start: Warp) -> Option<Alignment> {
    let (levels, skipped) = (levels(pair)?, pair.halvings);
    let mut warp = start;
    for _ in 0..skipped + levels.len() - 1 {
        warp = warp.halved();
    }
    let coarsest = levels.last()?;
    warp = best_shift(coarsest, warp);
    let mut found = None;
    for (index, level) in levels.iter().enumerate().rev() {
        // The coarsest levels determine little except the shift.
        let of_level = if index + 1 == levels.len() && levels.len() > 2 { Model::Shift } else { model };
        let settled = if index == 0 { SETTLED_PX } else { COARSELY_SETTLED_PX };
        let refined = refine(level, of_level, warp, settled)?;
        warp = refined.0;
        found = Some(refined);
        if index > 0 {
            warp = warp.doubled();
        }
    }
    let (_, mut standard_error) = found?;
    let mut first = start;
    for _ in 0..skipped {
        first = first.halved();
    }
    let of = |warp: &Warp| correlation(&levels[0], warp);
    let mut correlation = of(&warp);
    if let Some((nearest, error)) = refine(&levels[0], model, first, SETTLED_PX)
        && of(&nearest) >= ALIKE * correlation
        && moved_px(&nearest, &first, &levels[0]) < moved_px(&warp, &first, &levels[0])
    {
        (warp, standard_error, correlation) = (nearest, error, of(&nearest));
    }
    let correlation_before = of(&first);
    let mut scale = 1.0;
    for _ in 0..skipped {
        warp = warp.doubled();
        scale *= 2.0;
    }
    Some(Alignment { warp, correlation, correlation_before, standard_error_px: scale * standard_error })
}

fn moved_px(warp: &Warp, start: &Warp, level: &Level) -> f64 {
    start.inverse().map_or(f64::INFINITY, |back| warp.after(&back).rms_px(level.far.dim()))
}

/// Displacement from `start`, RMS with its standard error, px: a few steps on one level, without a search. `None` if
/// the images differ too much at `start` for the nearest alignment to be certain.
pub(super) fn displaced(pair: &Thinned, model: Model, start: Warp, size: (usize, usize)) -> Option<f64> {
    let (level, halvings) = checked_level(pair)?;
    let mut first = start;
    for _ in 0..halvings {
        first = first.halved();
    }
    let (mut warp, mut error) = refine(&level, model, first, SETTLED_PX)?;
    if correlation(&level, &warp) < SURE {
        return None;
    }
    for _ in 0..halvings {
        warp = warp.doubled();
        error *= 2.0;
    }
    Some(warp.after(&start.inverse()?).rms_px(size) + error)
}

/// Whether a pair lies on each other to `within` px, RMS with its standard error: two steps at no displacement, the
/// second one robust.
pub(super) fn stays(pair: &Thinned, model: Model, size: (usize, usize), within: f64) -> bool {
    let displaced = || {
        let (level, halvings) = checked_level(pair)?;
        let Step { scale, .. } = Step::new(&level, model, &Warp::IDENTITY, f64::INFINITY)?;
        let Step { mut warp, error, .. } = Step::new(&level, model, &Warp::IDENTITY, scale.max(LEAST_SCALE))?;
        for _ in 0..halvings {
            warp = warp.doubled();
        }
        Some(warp.rms_px(size) + error * f64::from(1 << halvings))
    };
    displaced().is_some_and(|px| px < within)
}

/// The level that rules out a displacement, and its number of halvings; `None` for images that are too small.
fn checked_level(pair: &Thinned) -> Option<(Level, usize)> {
    let [far, near] = [&pair.far, &pair.near];
    if far.image.nrows().min(far.image.ncols()) < 4 * COARSEST_PX {
        return None;
    }
    if far.image.len() > CHECKED_PX {
        let [far, near] = [far, near].map(|small| normalised(&band(halved(small.image.view()).view())));
        return Some((Level { far, near }, pair.halvings + 1));
    }
    let [far, near] = [far, near].map(|small| normalised(&small.band));
    Some((Level { far, near }, pair.halvings))
}

/// The bands of both images from fine to coarse; `None` for images that are too small.
fn levels(pair: &Thinned) -> Option<Vec<Level>> {
    let [far, near] = [&pair.far, &pair.near];
    if far.image.nrows().min(far.image.ncols()) < 2 * COARSEST_PX {
        return None;
    }
    let mut levels = vec![Level { far: normalised(&far.band), near: normalised(&near.band) }];
    let [mut far, mut near] = [far, near].map(|small| halved(small.image.view()));
    loop {
        if far.nrows().min(far.ncols()) < COARSEST_PX {
            return Some(levels);
        }
        let [a, b] = [&far, &near].map(|image| normalised(&band(image.view())));
        levels.push(Level { far: a, near: b });
        [far, near] = [&far, &near].map(|image| halved(image.view()));
    }
}

/// Writes the near image's bilinear values at the places of the far one's row `y` to `to`. Returns the columns whose places lie
/// within the near image's border; only these are written.
fn moved_row(near: &Array2<f32>, warp: &Warp, y: usize, to: &mut [f32]) -> Range<usize> {
    let (height, width) = near.dim();
    let pixels = near.as_slice().unwrap_or_default();
    let place = |column: usize| warp.at([column as f64, y as f64]);
    let is_inside = |column: &usize| {
        let ([x, y], border) = (place(*column), BORDER_PX as f64);
        let [right, bottom] = [width, height].map(|n| (n - 1) as f64 - border);
        x >= border && y >= border && x < right && y < bottom
    };
    // An affine map sends one stretch of a row into the image.
    let columns = BORDER_PX..width - BORDER_PX;
    let start = columns.clone().find(is_inside).unwrap_or(columns.end);
    let end = (start..columns.end).rev().find(is_inside).map_or(start, |last| last + 1);
    let (backend, [[a, _], [c, _]]) = (Backend::best(), warp.matrix);
    let mut from = start;
    while from < end {
        let [x, y] = place(from);
        let (left, top) = (x as usize, y as usize);
        // The columns between the same two rows whose places follow each other: an interval but for rounding.
        let (mut last, mut beyond) = (from, end);
        while last + 1 < beyond {
            let column = last.midpoint(beyond);
            let [x, y] = place(column);
            if (x as usize, y as usize) == (left + (column - from), top) {
                last = column;
            } else {
                beyond = column;
            }
        }
        let rows = [top, top + 1].map(|row| &pixels[row * width + left..][..=beyond - from]);
        let at = [x - left as f64, y - top as f64].map(|part| part as f32);
        simd::between_rows(backend, rows, at, [(a - 1.0) as f32, c as f32], &mut to[from..beyond]);
        from = beyond;
    }
    start..end
}

/// The best shift of all up to a quarter of the image.
fn best_shift(level: &Level, start: Warp) -> Warp {
    let (height, width) = level.far.dim();
    let reach = (height.min(width) / 4) as isize;
    let shifts: Vec<[isize; 2]> =
        (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| [x, y])).collect();
    let moved =
        |[x, y]: [isize; 2]| Warp { shift: [start.shift[0] + x as f64, start.shift[1] + y as f64], ..start };
    let best = shifts
        .into_par_iter()
        .map(|shift| (correlation(level, &moved(shift)), shift))
        // Equal ones: the smaller shift, independent of the threads' order.
        .max_by(|(a, [ax, ay]), (b, [bx, by])| {
            a.total_cmp(b)
                .then_with(|| (bx * bx + by * by).cmp(&(ax * ax + ay * ay)))
                .then_with(|| (bx, by).cmp(&(ax, ay)))
        });
    best.map_or(start, |(_, shift)| moved(shift))
}

/// Correlation of the far image with the near one resampled by `warp`; 0 if too little overlaps.
fn correlation(level: &Level, warp: &Warp) -> f64 {
    let (height, width) = level.far.dim();
    let (mut sums, mut count, mut near) = ([0.0_f64; 3], 0.0, vec![0.0; width]);
    let step = (level.far.len() / STEP_PX).max(1);
    let far = level.far.as_slice().unwrap_or_default();
    for y in (BORDER_PX..height - BORDER_PX).step_by(step) {
        let inside = moved_row(&level.near, warp, y, &mut near);
        let of_row =
            simd::products(Backend::best(), &far[y * width..][inside.clone()], &near[inside.clone()]);
        sums.iter_mut().zip(of_row).for_each(|(sum, value)| *sum += value);
        count += inside.len() as f64;
    }
    let [product, of_far, of_near] = sums;
    let enough = count * step as f64 > 0.25 * level.far.len() as f64;
    if enough && of_far > 0.0 && of_near > 0.0 { product / (of_far * of_near).sqrt() } else { 0.0 }
}

/// Gauss-Newton steps on one level: the map, and its standard error in the level's pixels.
fn refine(level: &Level, model: Model, start: Warp, settled_px: f64) -> Option<(Warp, f64)> {
    let mut warp = start;
    // At the start no difference is an outlier.
    let mut scale = f64::INFINITY;
    let mut error = f64::INFINITY;
    for _ in 0..STEPS {
        let step = Step::new(level, model, &warp, scale)?;
        (warp, scale, error) = (step.warp, step.scale, step.error);
        if step.largest_px < settled_px {
            break;
        }
    }
    Some((warp, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture(shift: f64) -> Array2<f32> {
        let wave = |x: f64, y: f64, k: f64| (k * x + 1.7 * k * y + 40.0 * (k * k)).sin();
        Array2::from_shape_fn((240, 320), |(y, x)| {
            let (x, y) = (x as f64 + shift, y as f64);
            (1..30).map(|i| wave(x, y, 0.04 * f64::from(i))).sum::<f64>() as f32
        })
    }

    #[test]
    fn measures_how_far_a_pair_lies_from_the_start_without_a_search() {
        let far = texture(0.0);
        for shift in [0.0, 0.03, 0.5] {
            let pair = Thinned::new(far.view(), texture(shift).view());
            let px = displaced(&pair, Model::Similarity, Warp::IDENTITY, far.dim()).unwrap();
            // With its standard error, some hundredths here.
            assert!((shift - 0.01..shift + 0.04).contains(&px), "{shift}: {px}");
        }
    }

    #[test]
    fn a_moved_row_is_bilinear_at_each_place() {
        let image = Array2::from_shape_fn((61, 83), |(y, x)| ((y * 7919 + x * x * 31) % 101) as f32 / 101.0);
        let size = image.dim();
        let about = |magnification: f64, degrees: f64, shift: [f64; 2]| {
            Warp::about_middle(size, magnification, degrees, shift)
        };
        let warps = [
            Warp::IDENTITY,
            about(1.0, 0.0, [2.0, -1.0]),
            about(1.0, 0.0, [1e9, 0.0]),
            about(1.02, 0.7, [0.4, 1.3]),
            about(0.98, -3.0, [-5.5, 0.0]),
            about(1.0, 90.0, [0.0; 2]),
            about(1.0, 180.0, [0.3; 2]),
            about(0.1, 5.0, [0.0; 2]),
            about(10.0, 0.0, [0.0; 2]),
        ];
        let mut columns = 0;
        for (warp, y) in warps.iter().flat_map(|warp| (BORDER_PX..size.0 - BORDER_PX).map(move |y| (warp, y)))
        {
            let mut found = vec![0.0; size.1];
            let inside = moved_row(&image, warp, y, &mut found);
            columns += inside.len();
            for x in inside {
                let [px, py] = warp.at([x as f64, y as f64]);
                let (left, top) = (px as usize, py as usize);
                let [fx, fy] = [px - left as f64, py - top as f64].map(|part| part as f32);
                let along = |row: usize| image[(row, left)] * (1.0 - fx) + image[(row, left + 1)] * fx;
                let expected = along(top) * (1.0 - fy) + along(top + 1) * fy;
                assert!((found[x] - expected).abs() < 1e-4, "{warp:?} {x} {y}: {} {expected}", found[x]);
            }
        }
        assert!(columns > 20_000, "{columns}");
    }

    #[test]
    fn a_pair_stays_within_what_matters() {
        let far = texture(0.0);
        for (shift, expected) in [(0.0, true), (0.02, true), (0.1, false), (0.5, false), (25.0, false)] {
            let pair = Thinned::new(far.view(), texture(shift).view());
            assert_eq!(stays(&pair, Model::Similarity, far.dim(), 0.06), expected, "{shift}");
        }
    }

    /// Cells of 8 px and stripes without detail along them look the same in many places.
    #[test]
    fn of_equal_alignments_the_nearest_is_found() {
        let stripe = |x: usize| [0.2, 0.8][(x * x * 7 / 13 + x / 3) % 2];
        let chessboard = |x: usize, y: usize| [0.2, 0.8][(x / 8 + y / 8) % 2];
        let image = |value: &dyn Fn(usize, usize) -> f32, seed: u32| {
            let mut noise = seed;
            Array2::from_shape_fn((240, 320), |(y, x)| {
                noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                value(x, y) + 0.02 * (noise >> 16) as f32 / 65_536.0
            })
        };
        for shift in [0, 3] {
            let patterns: [&dyn Fn(usize, usize) -> f32; 2] =
                [&|x, y| chessboard(x + shift, y), &|x, _| stripe((x + shift) / 4)];
            let still: [&dyn Fn(usize, usize) -> f32; 2] = [&chessboard, &|x, _| stripe(x / 4)];
            for (still, moved) in still.into_iter().zip(patterns) {
                let [far, near] = [image(still, 1), image(moved, 2)];
                let found = estimate(far.view(), near.view(), Model::Similarity, Warp::IDENTITY).unwrap();
                let [x, y] = found.warp.shift_of_middle_px(far.dim());
                assert!((x + shift as f64).abs() < 0.3 && y.abs() < 2.0, "{shift}: {x} {y}");
            }
        }
    }

    #[test]
    fn leaves_a_pair_that_lies_far_from_the_start_to_the_search() {
        let far = texture(0.0);
        let pair = Thinned::new(far.view(), texture(25.0).view());
        assert_eq!(displaced(&pair, Model::Similarity, Warp::IDENTITY, far.dim()), None);
    }
}
