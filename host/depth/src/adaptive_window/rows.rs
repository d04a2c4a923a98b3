//! One tile: rows stream through filters, window sums, roots, the choice of window and the median. Filtered rows
//! stay in rings as long as windows need them, so that they are read from the cache. Beyond its borders the pair is
//! reflected. Filters and windows are symmetric, so later stages need no border handling.

use ndarray::{Array2, s};

use super::agreement::Agreement;
use super::bank::Filters;
use super::holes::{Holes, Inner};
use super::{ADAPTIVE_PX, Job, LEARNED_PX, Maps, Window};
use crate::border::reflect;
use crate::depth_of_alpha::DepthOfAlpha;
use crate::operators::linearise;
use crate::simd::{self, Contrast, CubicSums, Deviation, Found, MAX_ROWS, OfNoise, Plane, Residual};

/// Columns of a tile: as many as the cache holds.
const COLUMNS: usize = 640;
const MISFIT_PX: [usize; 2] = [7, 21];
/// Border in which filters and windows depend on reflections, which no model explains, px.
const BORDER_PX: usize = 14;
/// Standard deviation of alpha by the operators' own error: 0.003 on noise-free slants.
const FLOOR: f32 = 0.0026;
/// Part of the windows' disagreement beyond noise by which the larger one's variance grows. Chosen on rendered spheres, cones
/// and slants for an error over deviation of 0.8 to 1.25.
const DOUBT: f32 = 0.5;
/// The same for a learned lens: a window of 41 px is off by 1.08 of its difference from one of 11 px where the surface curves
/// evenly.
const LEARNED_DOUBT: f32 = 1.0;
/// Standard deviation of alpha from which a window tells nothing about the surface.
const UNINFORMATIVE: f32 = 0.045;
/// Standard deviation of alpha, at alpha = 0, that is certain enough.
const CERTAIN: f32 = 0.0375;
/// Variance that remains after a median of 1x1, 3x3, 5x5 and 7x7.
const MEDIAN_GAIN: [f32; 4] = [1.0, 0.94, 0.85, 0.74];
const RECOMPUTED: isize = 16;
const WAITING: usize = 8;

fn columns(width: usize) -> usize {
    width.div_ceil(width.div_ceil(COLUMNS))
}

/// Columns of windows, of their products and of the filters' input. Surplus columns on the right make whole vectors.
fn widths(columns: usize, outer: usize, radius: usize, reach: usize) -> [usize; 3] {
    let wide = (columns + 2 * outer).next_multiple_of(simd::MAX_LANES);
    let products = (wide + 2 * radius).next_multiple_of(simd::MAX_LANES);
    [wide, products, products + 2 * reach]
}

pub(super) struct Tile<'a> {
    job: &'a Job<'a>,
    sides: Vec<usize>,
    /// Rows and columns around the tile for the median and the misfit, and with those for the choice of window.
    around: [usize; 2],
    outer: [usize; 2],
    radius: usize,
    ring: usize,
    difference: Plane,
    sum: Plane,
    filters: Filters,
    columns: Vec<Columns>,
    row: Row,
    agreement: Option<Agreement>,
    alpha: Plane,
    residual: Plane,
    work: Plane,
    sorted: Plane,
    depth_of: DepthOfAlpha,
    deviation: Deviation,
    of_residual: Residual,
    of_noise: OfNoise,
    inner: Inner,
}

/// Column sums over a window's rows of `rho_k u`, `u u` and the pair's brightness.
struct Columns {
    side: usize,
    sums: Plane,
}

const ENERGY: usize = 4;
const BRIGHTNESS: usize = 5;

struct Row {
    work: Vec<f32>,
    sums: [Vec<f32>; 5],
    alpha: Vec<f32>,
    variance: Vec<f32>,
    noise: Vec<f32>,
    /// Alpha and variance of the smallest window that is certain enough.
    small: [Vec<f32>; 2],
    /// Variance of the window that was taken.
    taken: Vec<f32>,
}

#[derive(Clone, Copy)]
pub(super) struct Place {
    pub top: usize,
    pub left: usize,
    pub rows: usize,
    pub columns: usize,
}

impl<'a> Tile<'a> {
    pub(super) fn new(job: &'a Job<'a>) -> Self {
        let sides = match job.settings.window {
            Window::Fixed(side) => vec![side],
            Window::Adaptive if job.optics.stage().is_some() => LEARNED_PX.to_vec(),
            Window::Adaptive => ADAPTIVE_PX.to_vec(),
        };
        let radius = sides.iter().copied().max().unwrap_or(1) / 2;
        let median = job.settings.median_px / 2;
        let around = [median.max(MISFIT_PX[0] / 2), median.max(MISFIT_PX[1] / 2)];
        let compared = if job.settings.window == Window::Adaptive { radius } else { 0 };
        let outer = around.map(|around| around + compared);
        let reach = job.bank.reach_px();
        // Window, the row that leaves it, the pixels in the middle of its filters, and a block of new rows.
        let ring = (2 * radius + 2 + reach + MAX_ROWS).next_multiple_of(MAX_ROWS);
        let [wide, products, input] = widths(columns(job.far.ncols()), outer[1], radius, reach);
        let variance_gain = job.bank.variance_gain();
        let [offset, slope] = job.optics.defocus_line_mm();
        let of_residual = Residual {
            gain: job.bank.residual_gain(),
            noise: job.scales.noise,
            least_noise: job.scales.least_noise,
        };
        Self {
            job,
            around,
            outer,
            radius,
            ring,
            difference: Plane::new(ring, input),
            sum: Plane::new(ring, input),
            filters: Filters::new(job.bank, ring, input),
            columns: sides
                .iter()
                .map(|side| Columns { side: *side, sums: Plane::new(6, products) })
                .collect(),
            sides,
            row: Row {
                work: vec![0.0; 2 * products],
                sums: [(); 5].map(|()| vec![0.0; wide]),
                alpha: vec![0.0; wide],
                variance: vec![0.0; wide],
                noise: vec![0.0; wide],
                small: [(); 2].map(|()| vec![0.0; wide]),
                taken: vec![0.0; wide],
            },
            agreement: (compared > 0).then(|| {
                // The model error of a learned lens must not count as a depth step.
                let tolerance = job.optics.stage().map_or(0.0, |stage| stage.window_tolerance as f32).powi(2);
                let doubt = if job.optics.stage().is_some() { LEARNED_DOUBT } else { DOUBT };
                let largest = UNINFORMATIVE.powi(2) + tolerance;
                let of = Contrast { gain: variance_gain, tolerance, largest, doubt };
                Agreement::new(2 * compared + 1, wide, of)
            }),
            alpha: Plane::new(WAITING, wide),
            residual: Plane::new(WAITING, wide),
            work: Plane::new(3, wide),
            sorted: Plane::new(job.settings.median_px, wide),
            depth_of: DepthOfAlpha::linear(job.optics, linearise::IDENTITY),
            deviation: Deviation {
                gain: variance_gain.map(|coefficient| MEDIAN_GAIN[median] * coefficient),
                squared: job.optics.focal_length_mm().powi(2) as f32,
                offset: offset as f32,
                slope: slope as f32,
                floor: FLOOR.powi(2),
            },
            of_residual,
            of_noise: job.bank.of_noise(job.scales.white),
            inner: Inner { size: job.far.dim(), reach },
        }
    }

    /// Fills a band's rows of the maps, from `top` on. Returns sums of squared residual, noise and texture.
    pub(super) fn band(&mut self, top: usize, maps: Maps<'_>) -> [f64; 3] {
        let Maps { mut depth_mm, mut deviation_mm, mut misfit } = maps;
        let (rows, width) = misfit.dim();
        let mut sums = [0.0; 3];
        for left in (0..width).step_by(columns(width)) {
            let columns = columns(width).min(width - left);
            let part = s![.., left..left + columns];
            let maps = Maps {
                depth_mm: depth_mm.as_mut().map(|map| map.slice_mut(part)),
                deviation_mm: deviation_mm.slice_mut(part),
                misfit: misfit.slice_mut(part),
            };
            let of_tile = self.run(Place { top, left, rows, columns }, maps);
            sums.iter_mut().zip(of_tile).for_each(|(sum, value)| *sum += value);
        }
        sums
    }

    fn run(&mut self, place: Place, mut maps: Maps<'_>) -> [f64; 3] {
        let [above, _] = self.around;
        let reach = self.job.bank.reach_px();
        let halo = self.outer.map(|around| around + self.radius + reach);
        let [wide, products, input] = widths(place.columns, self.outer[1], self.radius, reach);
        let inputs = place.rows + 2 * halo[0];
        let Job { far, near, bank, scales, .. } = self.job;
        let around = [bank.reach_px(), self.sides[0]];
        let holes = if scales.whole { None } else { Holes::of([*far, *near], place, halo, around) };
        self.filters.reset();
        let mut sums = [0.0; 3];
        let mut next = 0;
        for begin in (0..inputs).step_by(MAX_ROWS) {
            let count = MAX_ROWS.min(inputs - begin);
            let first = begin % self.ring;
            for y in 0..count {
                let row = (place.top + begin + y) as isize - halo[0] as isize;
                self.load(first + y, row, place.left as isize - halo[1] as isize, input);
            }
            let inputs = [&self.difference, &self.sum];
            self.filters.feed(self.job.backend, inputs, first, count, input);
            for y in 0..count {
                let Some(middle) = (begin + y).checked_sub(reach) else { continue };
                let row = (place.top + middle) as isize - halo[0] as isize;
                let matched = self.filters.matched_mut().row_mut(first + y);
                self.inner.keep(row, place.left as isize + (reach as isize - halo[1] as isize), matched);
            }
            if let Some(Holes { of_filters, .. }) = &holes {
                // A filter across the rim of a hole finds an equally sharp edge in both images: no evidence.
                for y in 0..count {
                    let Some(middle) = (begin + y).checked_sub(reach) else { continue };
                    let of_row = of_filters.row(middle).into_iter().skip(reach);
                    let matched = self.filters.matched_mut().row_mut(first + y);
                    matched.iter_mut().zip(of_row).filter(|(_, hole)| **hole).for_each(|(u, _)| *u = 0.0);
                }
            }
            // A row of windows needs filter input from `radius + 2 reach` rows further down.
            while next < place.rows + 2 * self.outer[0] && next + 2 * self.radius + 2 * reach < begin + count
            {
                self.windows(place, next, wide, products);
                if let Some(row) = next.checked_sub(2 * self.compared()) {
                    self.take(row, wide);
                    self.residual_row(row, place.columns + 2 * self.around[1]);
                    if let Some(y) = row.checked_sub(above).filter(|y| *y < place.rows) {
                        self.own_row(place, y, holes.as_ref().map(|holes| &holes.own), &mut maps, &mut sums);
                    }
                    self.finish(place, row, &mut maps);
                }
                next += 1;
            }
        }
        if let Some(Holes { own, .. }) = holes {
            for (at, _) in own.indexed_iter().filter(|(_, hole)| **hole) {
                maps.deviation_mm[at] = f32::NAN;
                if let Some(depth_mm) = &mut maps.depth_mm {
                    depth_mm[at] = f32::NAN;
                }
            }
        }
        sums
    }

    /// Loads an image row into a ring row from column `left` on; both may lie beyond the image.
    fn load(&mut self, to: usize, row: isize, left: isize, columns: usize) {
        let Job { far, near, scales, backend, .. } = self.job;
        let (height, width) = far.dim();
        let row = reflect(row, height);
        let [difference, sum] = [self.difference.row_mut(to), self.sum.row_mut(to)];
        let inside = (-left).max(0) as usize..(width as isize - left).clamp(0, columns as isize) as usize;
        let from = (left + inside.start as isize) as usize;
        let part = s![row, from..from + inside.len()];
        let [far_part, near_part] = [far.slice(part), near.slice(part)];
        if let (Some(far), Some(near)) = (far_part.as_slice(), near_part.as_slice()) {
            let to = [&mut difference[inside.clone()], &mut sum[inside.clone()]];
            simd::dimensionless_row(*backend, far, near, [scales.mean, scales.gain], to);
        }
        for x in (0..inside.start).chain(inside.end..columns) {
            let column = reflect(left + x as isize, width);
            let at = column as isize - left;
            [difference[x], sum[x]] = if at >= 0 && inside.contains(&(at as usize)) {
                [difference[at as usize], sum[at as usize]]
            } else {
                let [a, b] = [far, near].map(|image| (image[(row, column)] - scales.mean) * scales.gain);
                if a.is_finite() && b.is_finite() { [a - b, a + b] } else { [0.0; 2] }
            };
        }
    }

    fn windows(&mut self, place: Place, row: usize, wide: usize, products: usize) {
        for index in 0..self.columns.len() {
            self.advance(place, index, row, products);
            self.row(place, index, row, wide);
        }
        let Self { job, row: found, agreement, outer, .. } = self;
        let Row { alpha, variance, small, noise, .. } = found;
        for variance in [&mut *variance, &mut small[1]] {
            variance[..wide].iter_mut().zip(&*noise).for_each(|(v, noise)| *v *= noise);
        }
        if let Some(agreement) = agreement {
            let restart = ((place.top + row) as isize - outer[0] as isize).rem_euclid(RECOMPUTED) == 0;
            let small = small.each_ref().map(|small| &small[..wide]);
            agreement.add(job.backend, row, restart, small, [&alpha[..wide], &variance[..wide]]);
        }
    }

    /// Rows and columns on either side over which windows are compared.
    fn compared(&self) -> usize {
        self.agreement.as_ref().map_or(0, |agreement| agreement.half)
    }

    /// Alpha and variance of a row, from the row of windows `compared` before the last one.
    fn take(&mut self, row: usize, wide: usize) {
        let Self { job, row: found, agreement, alpha, .. } = self;
        let to = alpha.row_mut(row % WAITING);
        match agreement {
            Some(agreement) => {
                let to = [&mut to[..wide], &mut found.taken[..wide]];
                agreement.decide(job.backend, row + 2 * agreement.half, wide, to);
            }
            None => {
                to[..wide].copy_from_slice(&found.small[0][..wide]);
                found.taken[..wide].copy_from_slice(&found.small[1][..wide]);
            }
        }
    }

    fn advance(&mut self, place: Place, index: usize, row: usize, products: usize) {
        let Self { job, radius, ring, filters, columns, sum, .. } = self;
        let backend = job.backend;
        let Columns { side, sums } = &mut columns[index];
        let (half, reach) = (*side / 2, job.bank.reach_px());
        let image_row = (place.top + row) as isize - self.outer[0] as isize;
        // Ring rows: a filtered row lies `2 reach` below its first input pixel and `reach` below the middle.
        let filtered = |d: isize| (row as isize + *radius as isize + d + 2 * reach as isize) as usize % *ring;
        let bright = |d: isize| (row as isize + *radius as isize + d + reach as isize) as usize % *ring;
        // The smallest window tells the brightness.
        let with_brightness = index == 0 && job.scales.noise[1] > 0.0;
        let half = half as isize;
        let u = filters.matched();
        let factors = filters.rho().into_iter().chain([u]).enumerate();
        if row == 0 || image_row.rem_euclid(RECOMPUTED) == 0 {
            sums.all_mut().fill(0.0);
            for (k, rho) in factors {
                for d in -half..=half {
                    let [rho, u] = [rho, u].map(|plane| &plane.row(filtered(d))[..products]);
                    simd::add_products(backend, rho, u, &mut sums.row_mut(k)[..products]);
                }
            }
            for d in -half..=half {
                if with_brightness {
                    let from = &sum.row(bright(d))[reach..reach + products];
                    sums.row_mut(BRIGHTNESS).iter_mut().zip(from).for_each(|(to, from)| *to += 0.5 * from);
                }
            }
            return;
        }
        let [gone, come] = [filtered(-half - 1), filtered(half)];
        for (k, rho) in factors {
            let [gone, come] = [gone, come].map(|row| [rho, u].map(|plane| &plane.row(row)[..products]));
            simd::move_products(backend, gone, come, &mut sums.row_mut(k)[..products]);
        }
        if with_brightness {
            let [gone, come] =
                [bright(-half - 1), bright(half)].map(|row| &sum.row(row)[reach..reach + products]);
            let to = sums.row_mut(BRIGHTNESS)[..products].iter_mut();
            to.zip(gone).zip(come).for_each(|((to, gone), come)| *to += 0.5 * come - 0.5 * gone);
        }
    }

    fn row(&mut self, place: Place, index: usize, line: usize, wide: usize) {
        let [above, beside] = self.outer;
        let Self { job, row, radius, inner, of_noise, .. } = self;
        let Columns { side, sums } = &self.columns[index];
        let (side, backend, scales) = (*side, job.backend, job.scales);
        let from = *radius - side / 2;
        let products = row.work.len() / 2;
        let of = |k: usize| &sums.row(k)[from..products];
        for k in 0..=ENERGY {
            simd::row_sums(backend, of(k), side, &mut row.work, &mut row.sums[k][..wide]);
        }
        let noise = &mut row.noise[..wide];
        if index == 0 {
            let area = (side * side) as f32;
            let [constant, per_unit] = scales.noise;
            if per_unit > 0.0 {
                simd::row_sums(backend, of(BRIGHTNESS), side, &mut row.work, noise);
                noise.iter_mut().for_each(|b| *b = (constant + per_unit * *b / area).max(scales.least_noise));
            } else {
                noise.fill(constant.max(scales.least_noise));
            }
        }
        let [c0, c1, c2, c3, energy] = row.sums.each_ref().map(|sums| &sums[..wide]);
        let (alpha, variance) = (&mut row.alpha[..wide], &mut row.variance[..wide]);
        let rows = inner.rows_of_window((place.top + line) as isize - above as isize, side);
        let of_pixels = &mut row.work[..wide];
        inner.share_columns(place.left as isize - beside as isize, side, noise, of_pixels);
        let sums = CubicSums { c: [c0, c1, c2, c3], energy, noise: of_pixels };
        let found = Found { alpha: &mut *alpha, variance: &mut *variance };
        simd::roots(backend, sums, of_noise.times((rows * side) as f32), found);
        let [small, of_small] = row.small.each_mut().map(|values| &mut values[..wide]);
        if index == 0 {
            small.copy_from_slice(alpha);
            of_small.copy_from_slice(variance);
        } else {
            let largest = CERTAIN * CERTAIN;
            simd::choose_certain(backend, alpha, variance, noise, largest, small, of_small);
        }
    }

    fn residual_row(&mut self, row: usize, wide: usize) {
        let compared = self.compared();
        let Self { job, radius, ring, filters, sum, work, of_residual, .. } = self;
        let reach = job.bank.reach_px();
        let middle = row + compared + *radius + reach;
        let left = *radius + compared;
        let rho = filters.rho().map(|plane| &plane.row((middle + reach) % *ring)[left..left + wide]);
        let sum = &sum.row(middle % *ring)[left + reach..left + reach + wide];
        let alpha = &self.alpha.row(row % WAITING)[..wide];
        let stride = work.stride();
        let (squares, rest) = work.all_mut().split_at_mut(stride);
        let to = [&mut self.residual.row_mut(row % WAITING)[..wide], &mut squares[..wide], &mut rest[..wide]];
        simd::residual_row(job.backend, *of_residual, rho, sum, alpha, to);
    }

    fn own_row(
        &mut self,
        place: Place,
        y: usize,
        holes: Option<&Array2<bool>>,
        maps: &mut Maps<'_>,
        sums: &mut [f64; 3],
    ) {
        let [above, beside] = self.around;
        let own = beside..beside + place.columns;
        let row = y + above;
        let alpha = &self.alpha.row(row % WAITING)[own.clone()];
        let variance = &self.row.taken[own.clone()];
        if let Some(to) = maps.deviation_mm.row_mut(y).as_slice_mut() {
            simd::deviation_row(self.job.backend, self.deviation, alpha, variance, to);
        }
        let (height, width) = self.job.far.dim();
        if !(BORDER_PX..height.saturating_sub(BORDER_PX)).contains(&(place.top + y)) {
            return;
        }
        let from = BORDER_PX.saturating_sub(place.left).min(place.columns);
        let to = width.saturating_sub(BORDER_PX).saturating_sub(place.left).clamp(from, place.columns);
        let reach = self.job.bank.reach_px();
        let from_outer = self.radius + self.compared();
        let texture =
            &self.filters.rho()[1].row((row + from_outer + 2 * reach) % self.ring)[from_outer + beside..];
        let [squares, expected] = [0, 1].map(|i| &self.work.row(i)[own.clone()]);
        match holes {
            None => {
                let part = from..to;
                let of_row = [&squares[part.clone()], &expected[part.clone()]].map(simd::sum);
                let texture = simd::sum_of_squares(&texture[part]);
                sums.iter_mut().zip([of_row[0], of_row[1], texture]).for_each(|(sum, value)| *sum += value);
            }
            Some(holes) => {
                for x in (from..to).filter(|x| !holes[(y, *x)]) {
                    let of_pixel = [squares[x], expected[x], texture[x] * texture[x]];
                    sums.iter_mut().zip(of_pixel).for_each(|(sum, value)| *sum += f64::from(value));
                }
            }
        }
    }

    fn finish(&mut self, place: Place, row: usize, maps: &mut Maps<'_>) {
        let [above, beside] = self.around;
        let wide = place.columns + 2 * beside;
        let backend = self.job.backend;
        let side = self.job.settings.median_px;
        let complete = |half: usize| row.checked_sub(above + half).filter(|y| *y < place.rows);
        if let (Some(y), Some(depth_mm)) = (complete(side / 2), &mut maps.depth_mm) {
            let left = beside - side / 2;
            let rows: [&[f32]; 7] = std::array::from_fn(|i| {
                let row = y + above - side / 2 + i.min(side - 1);
                &self.alpha.row(row % WAITING)[left..]
            });
            let depth = self.work.row_mut(2);
            simd::median_row(backend, &rows[..side], &mut self.sorted, self.depth_of, depth, place.columns);
            if let Some(to) = depth_mm.row_mut(y).as_slice_mut() {
                to.copy_from_slice(&depth[..place.columns]);
            }
        }
        let [down, across] = MISFIT_PX;
        if let Some(y) = complete(down / 2) {
            let rows: [&[f32]; MISFIT_PX[0]] =
                std::array::from_fn(|i| &self.residual.row((y + above - down / 2 + i) % WAITING)[..wide]);
            let left = beside - across / 2;
            let stride = self.work.stride();
            let sums = &mut self.work.all_mut()[2 * stride..][..wide];
            simd::sum_rows(backend, rows, sums);
            if let Some(to) = maps.misfit.row_mut(y).as_slice_mut() {
                let seen = &sums[left..left + place.columns + across - 1];
                simd::row_sums(backend, seen, across, &mut self.row.work, to);
                let share = 1.0 / (down * across) as f32;
                to.iter_mut().for_each(|sum| *sum *= share);
            }
        }
    }
}
