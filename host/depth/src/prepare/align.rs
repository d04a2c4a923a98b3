//! Registers the near-focused image on the far-focused one: shift, magnification and rotation, or any affine map.
//!
//! Both images are reduced to their common band (`band`), from coarse to fine. The coarsest level tries every shift.
//! From there Gauss-Newton steps minimise the squared difference (Lucas & Kanade 1981, in the inverse compositional
//! form of Baker & Matthews 2004: the far image's gradients serve all steps). Cauchy's weights suppress motion between
//! the exposures. A symmetric PSF moves nothing, so different blur does not shift the minimum. Large images are reduced
//! to at most 800,000 pixels (`thinned`). If the images are already aligned, one level confirms it (`displaced`). Cost:
//! `cargo bench -p farnear-depth --bench registration`.

use nalgebra::{DMatrix, DVector};
use ndarray::{Array2, ArrayView2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::band::{band, halved, normalised};
use super::thinned::Thinned;
use super::warp::{Warp, middle};

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
/// Least RMS difference of the bands for the outlier limit: that of equal images is 0.
const LEAST_SCALE: f64 = 1e-6;
/// Correlation area of the band, px.
const CORRELATED_PX: f64 = 12.0;
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
    let (_, standard_error) = found?;
    let mut first = start;
    for _ in 0..skipped {
        first = first.halved();
    }
    let [correlation, correlation_before] = [&warp, &first].map(|warp| correlation(&levels[0], warp));
    let mut scale = 1.0;
    for _ in 0..skipped {
        warp = warp.doubled();
        scale *= 2.0;
    }
    Some(Alignment { warp, correlation, correlation_before, standard_error_px: scale * standard_error })
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

/// Interpolated value; `None` in the border and outside.
fn between(image: &Array2<f32>, [x, y]: [f64; 2]) -> Option<f32> {
    let (height, width) = image.dim();
    let border = BORDER_PX as f64;
    if !(x >= border && y >= border && x < (width - 1) as f64 - border && y < (height - 1) as f64 - border) {
        return None;
    }
    let (column, row) = (x as usize, y as usize);
    let (fx, fy) = ((x - column as f64) as f32, (y - row as f64) as f32);
    let pixels = image.as_slice()?;
    let at = row * width + column;
    let upper = pixels[at] + fx * (pixels[at + 1] - pixels[at]);
    let lower = pixels[at + width] + fx * (pixels[at + width + 1] - pixels[at + width]);
    Some(upper + fy * (lower - upper))
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
    let [mut product, mut of_far, mut of_near, mut count] = [0.0_f64; 4];
    let step = (level.far.len() / STEP_PX).max(1);
    for y in (BORDER_PX..height - BORDER_PX).step_by(step) {
        for x in BORDER_PX..width - BORDER_PX {
            if let Some(near) = between(&level.near, warp.at([x as f64, y as f64])) {
                let [far, near] = [level.far[(y, x)], near].map(f64::from);
                product += far * near;
                of_far += far * far;
                of_near += near * near;
                count += 1.0;
            }
        }
    }
    let enough = count * step as f64 > 0.25 * level.far.len() as f64;
    if enough && of_far > 0.0 && of_near > 0.0 { product / (of_far * of_near).sqrt() } else { 0.0 }
}

#[derive(Clone)]
struct Sums {
    normal: [[f64; 6]; 6],
    right: [f64; 6],
    squares: f64,
    count: f64,
}

impl Sums {
    const NONE: Self = Self { normal: [[0.0; 6]; 6], right: [0.0; 6], squares: 0.0, count: 0.0 };

    fn plus(mut self, other: Self) -> Self {
        for (row, others) in self.normal.iter_mut().zip(other.normal) {
            row.iter_mut().zip(others).for_each(|(a, b)| *a += b);
        }
        self.right.iter_mut().zip(other.right).for_each(|(a, b)| *a += b);
        self.squares += other.squares;
        self.count += other.count;
        self
    }
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

/// A Gauss-Newton step.
struct Step {
    warp: Warp,
    /// RMS difference before the step.
    scale: f64,
    error: f64,
    largest_px: f64,
}

impl Step {
    fn new(level: &Level, model: Model, warp: &Warp, scale: f64) -> Option<Self> {
        let (height, width) = level.far.dim();
        let centre = middle((height, width));
        let unit = 0.5 * (height as f64).hypot(width as f64);
        let n = model.parameters();
        let sums = match model {
            Model::Shift => sums::<2>(level, warp, scale, centre, unit),
            Model::Similarity => sums::<4>(level, warp, scale, centre, unit),
            Model::Affine => sums::<6>(level, warp, scale, centre, unit),
        };
        if sums.count < 8.0 * n as f64 {
            return None;
        }
        let variance = sums.squares / sums.count;
        let normal = DMatrix::from_fn(n, n, |i, j| sums.normal[i][j]);
        let right = DVector::from_fn(n, |i, _| sums.right[i]);
        let factor = normal.cholesky()?;
        let step = factor.solve(&right);
        let covariance = factor.inverse() * (variance * CORRELATED_PX);
        if !step.iter().all(|p| p.is_finite()) {
            return None;
        }
        Some(Self {
            warp: warp.after(&model.warp(step.as_slice(), centre, unit).inverse()?),
            scale: variance.sqrt(),
            error: rms_over_field(model, &covariance, unit, (height, width)),
            largest_px: step.iter().map(|p| p.abs()).fold(0.0, f64::max),
        })
    }
}

/// RMS over the field of the displacement's standard error.
fn rms_over_field(model: Model, covariance: &DMatrix<f64>, unit: f64, size: (usize, usize)) -> f64 {
    let [x2, y2] = [size.1, size.0].map(|n| (n as f64 / unit).powi(2) / 12.0);
    let place = [x2.sqrt(), y2.sqrt()];
    let basis = model.basis(place[0], place[1]);
    let along = |axis: usize| -> f64 {
        (0..covariance.nrows()).map(|i| covariance[(i, i)] * basis[i][axis].powi(2)).sum()
    };
    (along(0) + along(1)).sqrt()
}

/// Pixels that are summed in parallel: the compiler vectorises them.
const SIDE_BY_SIDE: usize = 8;

/// Derivatives of the far image by each of `N` parameters at pixels with these gradients and places ([`Model::basis`]).
#[inline(always)]
fn jacobian<const N: usize>(
    [gx, gy]: [&[f32; SIDE_BY_SIDE]; 2],
    x: &[f32; SIDE_BY_SIDE],
    y: f32,
) -> [[f32; SIDE_BY_SIDE]; N] {
    std::array::from_fn(|parameter| {
        std::array::from_fn(|i| match (N, parameter) {
            (_, 0) => gx[i],
            (_, 1) => gy[i],
            (4, 2) => gx[i] * x[i] + gy[i] * y,
            (4, _) => gy[i] * x[i] - gx[i] * y,
            (_, 2) => gx[i] * x[i],
            (_, 3) => gx[i] * y,
            (_, 4) => gy[i] * x[i],
            (_, _) => gy[i] * y,
        })
    })
}

/// The sums of a step for a model of `N` parameters.
fn sums<const N: usize>(level: &Level, warp: &Warp, scale: f64, centre: [f64; 2], unit: f64) -> Sums {
    let (height, width) = level.far.dim();
    let step = (level.far.len() / STEP_PX).max(1);
    let rows: Vec<usize> = (BORDER_PX..height - BORDER_PX).step_by(step).collect();
    let Some(far) = level.far.as_slice() else { return Sums::NONE };
    let of_scale = (2.4 * scale).recip() as f32;
    let of_rows = rows.par_chunks(16).map(|rows| {
        let mut sums = Sums::NONE;
        for &y in rows {
            sums = sums.plus(sums_of_row::<N>(far, width, y, level, warp, of_scale, centre, unit));
        }
        sums
    });
    // In order, so that the sum does not depend on the threads.
    let parts: Vec<Sums> = of_rows.collect();
    parts.into_iter().fold(Sums::NONE, Sums::plus)
}

#[allow(clippy::too_many_arguments)] // the innermost loop
fn sums_of_row<const N: usize>(
    far: &[f32],
    width: usize,
    y: usize,
    level: &Level,
    warp: &Warp,
    of_scale: f32,
    centre: [f64; 2],
    unit: f64,
) -> Sums {
    const NONE: [f32; SIDE_BY_SIDE] = [0.0; SIDE_BY_SIDE];
    let mut normal = [[NONE; N]; N];
    let (mut right, mut squares, mut count) = ([NONE; N], NONE, 0_usize);
    let row_of_field = ((y as f64 - centre[1]) / unit) as f32;
    let [above, here, below] = [y - 1, y, y + 1].map(|y| &far[y * width..(y + 1) * width]);
    // Where nothing is displaced nothing is interpolated.
    let in_place = match level.near.as_slice() {
        Some(near) if *warp == Warp::IDENTITY && y + 1 + BORDER_PX < level.near.nrows() => {
            &near[y * width..(y + 1) * width - 1 - BORDER_PX]
        }
        _ => &[],
    };
    for left in (BORDER_PX..width - BORDER_PX).step_by(SIDE_BY_SIDE) {
        let (mut gx, mut gy, mut difference, mut present, mut column) = (NONE, NONE, NONE, NONE, NONE);
        if let Some(near) = in_place.get(left..left + SIDE_BY_SIDE) {
            for i in 0..SIDE_BY_SIDE {
                let x = left + i;
                gx[i] = 0.5 * (here[x + 1] - here[x - 1]);
                gy[i] = 0.5 * (below[x] - above[x]);
                difference[i] = near[i] - here[x];
                column[i] = ((x as f64 - centre[0]) / unit) as f32;
            }
            present = [1.0; SIDE_BY_SIDE];
            count += SIDE_BY_SIDE;
        }
        let first = if present[0] > 0.0 { SIDE_BY_SIDE } else { 0 };
        for i in first..SIDE_BY_SIDE.min(width - BORDER_PX - left) {
            let x = left + i;
            if let Some(near) = between(&level.near, warp.at([x as f64, y as f64])) {
                gx[i] = 0.5 * (here[x + 1] - here[x - 1]);
                gy[i] = 0.5 * (below[x] - above[x]);
                difference[i] = near - here[x];
                present[i] = 1.0;
                column[i] = ((x as f64 - centre[0]) / unit) as f32;
                count += 1;
            }
        }
        let weight: [f32; SIDE_BY_SIDE] = std::array::from_fn(|i| {
            let relative = difference[i] * of_scale;
            present[i] / (1.0 + relative * relative)
        });
        let jacobian = jacobian::<N>([&gx, &gy], &column, row_of_field);
        for i in 0..N {
            let weighted: [f32; SIDE_BY_SIDE] = std::array::from_fn(|x| weight[x] * jacobian[i][x]);
            for x in 0..SIDE_BY_SIDE {
                right[i][x] += weighted[x] * difference[x];
            }
            for j in i..N {
                for x in 0..SIDE_BY_SIDE {
                    normal[i][j][x] += weighted[x] * jacobian[j][x];
                }
            }
        }
        for x in 0..SIDE_BY_SIDE {
            squares[x] += weight[x] * difference[x] * difference[x];
        }
    }
    let whole = |parts: [f32; SIDE_BY_SIDE]| parts.into_iter().map(f64::from).sum::<f64>();
    let mut sums = Sums { squares: whole(squares), count: count as f64, ..Sums::NONE };
    for i in 0..N {
        sums.right[i] = whole(right[i]);
        for (j, parts) in normal[i].iter().enumerate().skip(i) {
            sums.normal[i][j] = whole(*parts);
            sums.normal[j][i] = sums.normal[i][j];
        }
    }
    sums
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
    fn a_pair_stays_within_what_matters() {
        let far = texture(0.0);
        for (shift, expected) in [(0.0, true), (0.02, true), (0.1, false), (0.5, false), (25.0, false)] {
            let pair = Thinned::new(far.view(), texture(shift).view());
            assert_eq!(stays(&pair, Model::Similarity, far.dim(), 0.06), expected, "{shift}");
        }
    }

    #[test]
    fn leaves_a_pair_that_lies_far_from_the_start_to_the_search() {
        let far = texture(0.0);
        let pair = Thinned::new(far.view(), texture(25.0).view());
        assert_eq!(displaced(&pair, Model::Similarity, Warp::IDENTITY, far.dim()), None);
    }
}
