//! One band of rows: filters, products, window sums, roots, the choice among windows, median.

use ndarray::{Array2, ArrayView2, ArrayViewMut2, s};

use super::bank::{Bank, Filtered};
use super::{ADAPTIVE_PX, SAFE_PX, Window, WindowSettings};
use crate::border::reflect;
use crate::optics::Optics;
use crate::prepare::noise::PairNoise;
use crate::simd::{self, Backend, Choice, CubicSums, Found, Plane, Weighing};

/// Rows of a band: its halo of some 20 rows on either side is computed twice.
const ROWS: usize = 128;
/// Rows and columns over which the misfit is averaged.
const MISFIT_PX: [usize; 2] = [7, 21];
/// Rim in which filters and windows see reflections, which no model explains, px.
const BORDER_PX: usize = 14;
/// How far windows must agree, in standard deviations.
const GAMMA: f32 = 2.0;
/// Part of the energy that counts as evidence at least.
const LEAST_EVIDENCE: f32 = 0.02;
/// What no window is exacter than, in alpha.
const FLOOR: f32 = 0.002;
/// Standard deviation of alpha from which a window forbids nothing.
const SAYS_NOTHING: f32 = 0.045;
/// Standard deviation of alpha that is certain enough for [`Window::Safe`].
const CERTAIN: f32 = 0.035;
/// What the median of 3x3 leaves of the variance, and wider ones.
const MEDIAN_GAIN: [f32; 4] = [1.0, 0.94, 0.85, 0.74];

/// Rows of a band for an image of this size: enough bands for all threads.
pub(super) fn rows((height, _): (usize, usize)) -> usize {
    let threads = rayon::current_num_threads().max(1);
    height.div_ceil(height.div_ceil(ROWS).next_multiple_of(threads)).max(32)
}

/// What makes pixels dimensionless: their mean, and the noise in its units.
pub(super) struct Scales {
    mean: f32,
    gain: f32,
    /// Variance of a pixel of brightness b (in means): `constant + per_unit b`.
    noise: [f32; 2],
    least_noise: f32,
}

impl Scales {
    pub(super) fn new(far: ArrayView2<f32>, near: ArrayView2<f32>, noise: PairNoise) -> Self {
        let both = far.iter().chain(near.iter()).filter(|v| v.is_finite());
        let [sum, squares, count] = both.fold([0.0_f64; 3], |[sum, squares, count], v| {
            let v = f64::from(*v);
            [sum + v, squares + v * v, count + 1.0]
        });
        let mean = sum / count;
        let spread = (squares / count - mean * mean).max(0.0).sqrt();
        // An image may be centred on 0; then its spread is the scale.
        let scale = if mean.abs() > spread { mean.abs() } else { spread }.max(f64::MIN_POSITIVE);
        let square = scale * scale;
        Self {
            mean: mean as f32,
            gain: scale.recip() as f32,
            noise: [
                ((noise.constant + noise.per_unit * mean) / square) as f32,
                (noise.per_unit * scale / square) as f32,
            ],
            least_noise: (noise.variance(mean) / square * 0.1).max(1e-14) as f32,
        }
    }
}

/// A band of rows that begins at `top`.
pub(super) struct Band<'a> {
    pub far: ArrayView2<'a, f32>,
    pub near: ArrayView2<'a, f32>,
    pub bank: &'a Bank,
    pub optics: &'a Optics,
    pub settings: &'a WindowSettings,
    pub scales: &'a Scales,
    pub backend: Backend,
    pub top: usize,
}

/// The filtered rows that a band needs, and the index of the first in the image.
struct Source {
    first: usize,
    /// `rho_k u` for k = 0..4, `u u`, and the pair's mean brightness; `None` is 0 everywhere.
    products: [Option<Array2<f32>>; 6],
    filtered: Filtered,
    holes: Option<Array2<bool>>,
}

/// What a row of windows has in the making.
struct Row {
    values: Vec<f32>,
    work: Vec<f32>,
    sums: [Vec<f32>; 5],
    alpha: Vec<f32>,
    variance: Vec<f32>,
    noise: Vec<f32>,
    chosen: [Vec<f32>; 5],
}

impl Band<'_> {
    /// Fills the band's rows of the maps. Gives the sums over their pixels of the residual's square, of what noise
    /// leaves of it, and of the texture's.
    pub(super) fn run(
        &self,
        mut depth_mm: ArrayViewMut2<f32>,
        mut deviation_mm: ArrayViewMut2<f32>,
        mut misfit: ArrayViewMut2<f32>,
    ) -> [f64; 3] {
        let (height, width) = self.far.dim();
        let rows = depth_mm.nrows();
        let around = (self.settings.median_px / 2).max(MISFIT_PX[0] / 2);
        let [from, to] = [self.top.saturating_sub(around), (self.top + rows + around).min(height)];
        let source = self.source(from, to);
        let [mut alpha, mut variance] = [(); 2].map(|()| Array2::<f32>::zeros((to - from, width)));
        self.windows(&source, from, &mut alpha, &mut variance);
        self.depth(&alpha, from, &mut depth_mm);
        let wide = source
            .holes
            .as_ref()
            .map(|holes| crate::metrics::dilate_square(holes, self.bank.reach_px() + self.settings_reach()));
        let (residual, sums) = self.residual(&source, from, rows, &alpha, wide.as_ref());
        let gain = MEDIAN_GAIN[self.settings.median_px / 2] * self.bank.variance_factor();
        let of_residual = self.bank.residual_gain();
        let slope = SlopeOfDepth::new(self);
        for y in 0..rows {
            let at = self.top + y - from;
            for x in 0..width {
                let a = alpha[(at, x)];
                let noise = polynomial(of_residual, a * a);
                deviation_mm[(y, x)] = (gain * noise * variance[(at, x)]).sqrt() * slope.at(a);
            }
        }
        self.misfit(&residual, from, &mut misfit);
        if let Some(wide) = &wide {
            for y in 0..rows {
                for x in 0..width {
                    if wide[(self.top + y - source.first, x)] {
                        depth_mm[(y, x)] = f32::NAN;
                        deviation_mm[(y, x)] = f32::NAN;
                    }
                }
            }
        }
        sums
    }

    fn sides(&self) -> Vec<usize> {
        match self.settings.window {
            Window::Fixed(side) => vec![side],
            Window::Adaptive => ADAPTIVE_PX.to_vec(),
            Window::Safe => SAFE_PX.to_vec(),
        }
    }

    /// Half the smallest window: larger ones that contain a hole see it as mean brightness, a seventh of their pixels.
    fn settings_reach(&self) -> usize {
        self.sides()[0] / 2
    }

    /// Filters the rows that windows around `from..to` see.
    fn source(&self, from: usize, to: usize) -> Source {
        let height = self.far.nrows();
        let largest = self.sides().into_iter().max().unwrap_or(1);
        let halo = self.bank.reach_px() + largest / 2;
        let [first, last] = [from.saturating_sub(halo), (to + halo).min(height)];
        let part = s![first..last, ..];
        let mut any = false;
        let Scales { mean, gain, .. } = *self.scales;
        let mut normal = |image: ArrayView2<f32>| {
            image.slice(part).mapv(|v| {
                any |= !v.is_finite();
                if v.is_finite() { (v - mean) * gain } else { 0.0 }
            })
        };
        let [mut far, mut near] = [normal(self.far), normal(self.near)];
        let holes = any.then(|| {
            let mut holes = Array2::from_elem(far.dim(), false);
            let (of_far, of_near) = (self.far.slice(part), self.near.slice(part));
            for (at, hole) in holes.indexed_iter_mut() {
                *hole = !(of_far[at].is_finite() && of_near[at].is_finite());
                if *hole {
                    (far[at], near[at]) = (0.0, 0.0);
                }
            }
            holes
        });
        let filtered = self.bank.filter(far.view(), near.view(), self.backend);
        let u = &filtered.matched;
        let [p0, p1, p2, p3] = filtered.rho.each_ref().map(|rho| rho.as_ref().map(|rho| rho * u));
        let per_unit = self.scales.noise[1];
        let brightness = (per_unit > 0.0).then(|| (&far + &near) * 0.5);
        let products = [p0, p1, p2, p3, Some(u * u), brightness];
        Source { first, products, filtered, holes }
    }

    /// Alpha and its variance (without the factors of bank and median) for the rows of `alpha`, which begin at `from`.
    fn windows(&self, source: &Source, from: usize, alpha: &mut Array2<f32>, variance: &mut Array2<f32>) {
        let (rows, width) = alpha.dim();
        let sides = self.sides();
        let mut columns: Vec<Columns> =
            sides.iter().map(|side| Columns::new(*side, width, self.far.nrows())).collect();
        let largest = sides.iter().copied().max().unwrap_or(1);
        let padded = width + largest;
        let mut row = Row {
            values: vec![0.0; padded],
            work: vec![0.0; 2 * padded],
            sums: [(); 5].map(|()| vec![0.0; width]),
            alpha: vec![0.0; width],
            variance: vec![0.0; width],
            noise: vec![0.0; width],
            chosen: [(); 5].map(|()| vec![0.0; width]),
        };
        for y in 0..rows {
            for (index, columns) in columns.iter_mut().enumerate() {
                columns.advance(source, from + y);
                self.row(columns, index, &mut row);
            }
            for ((a, v), x) in row.chosen[0].iter().zip(&row.chosen[1]).zip(0..width) {
                alpha[(y, x)] = *a;
                variance[(y, x)] = v * row.noise[x];
            }
        }
    }

    /// One row of windows of one size, and what of it is chosen.
    fn row(&self, columns: &Columns, index: usize, row: &mut Row) {
        let (side, width) = (columns.side, row.alpha.len());
        let of = |sums: &[f32], values: &mut [f32], work: &mut [f32], result: &mut [f32]| {
            let r = side / 2;
            values[r..r + width].copy_from_slice(sums);
            for d in 1..=r as isize {
                values[r - d as usize] = sums[reflect(-d, width)];
                values[r + width - 1 + d as usize] = sums[reflect(width as isize - 1 + d, width)];
            }
            simd::row_sums(self.backend, &values[..width + side - 1], side, work, result);
        };
        for (sums, result) in columns.sums.iter().zip(&mut row.sums) {
            match sums {
                Some(sums) => of(sums, &mut row.values, &mut row.work, result),
                None => result.fill(0.0),
            }
        }
        if index == 0 {
            let area = (side * side) as f32;
            let [constant, per_unit] = self.scales.noise;
            match &columns.sums[5] {
                Some(sums) => {
                    of(sums, &mut row.values, &mut row.work, &mut row.noise);
                    let least = self.scales.least_noise;
                    row.noise.iter_mut().for_each(|b| *b = (constant + per_unit * *b / area).max(least));
                }
                None => row.noise.fill(constant.max(self.scales.least_noise)),
            }
        }
        let [c0, c1, c2, c3, energy] = &row.sums;
        let sums = CubicSums { c: [c0, c1, c2, c3], energy };
        let found = Found { alpha: &mut row.alpha, variance: &mut row.variance };
        simd::roots(self.backend, sums, self.bank.least_slope(), found);
        // Energy that is noise is no evidence.
        let of_noise = self.bank.noise_energy() * (side * side) as f32;
        for ((variance, energy), noise) in row.variance.iter_mut().zip(energy).zip(&row.noise) {
            let evidence = (energy - of_noise * noise).max(LEAST_EVIDENCE * energy).max(f32::MIN_POSITIVE);
            *variance *= (energy / evidence).powi(2);
        }
        let [chosen, of_chosen, low, high, open] = &mut row.chosen;
        if index == 0 {
            chosen.copy_from_slice(&row.alpha);
            of_chosen.copy_from_slice(&row.variance);
            low.fill(-10.0);
            high.fill(10.0);
            open.fill(1.0);
        }
        match self.settings.window {
            Window::Fixed(_) => {}
            Window::Adaptive => {
                let factor = self.bank.weighing_factor();
                let weighing = Weighing {
                    gamma: GAMMA,
                    floor: FLOOR * FLOOR / factor,
                    largest: SAYS_NOTHING * SAYS_NOTHING / factor,
                };
                let weighing = Weighing { gamma: weighing.gamma * factor.sqrt(), ..weighing };
                let choice = Choice { alpha: chosen, variance: of_chosen, low, high, open };
                simd::choose(self.backend, &row.alpha, &row.variance, &row.noise, weighing, choice);
            }
            Window::Safe if index > 0 => {
                let largest = CERTAIN * CERTAIN / self.bank.weighing_factor();
                simd::choose_safe(
                    self.backend,
                    &row.alpha,
                    &row.variance,
                    &row.noise,
                    largest,
                    chosen,
                    of_chosen,
                );
            }
            Window::Safe => {}
        }
    }

    /// Median of alpha, as depth.
    fn depth(&self, alpha: &Array2<f32>, from: usize, depth_mm: &mut ArrayViewMut2<f32>) {
        let (height, width) = self.far.dim();
        let side = self.settings.median_px;
        let r = side / 2;
        let full = width + 2 * r;
        let (mut window, mut sorted) = (Plane::new(side, full), Plane::new(side, full));
        let depth_of = self.bank.depth_of(self.optics);
        let mut depth = vec![0.0; full + Plane::PADDING];
        for (y, mut row) in depth_mm.rows_mut().into_iter().enumerate() {
            for i in 0..side {
                let at = reflect((self.top + y + i) as isize - r as isize, height) - from;
                let to = window.row_mut(i);
                for (x, to) in to[..full].iter_mut().enumerate() {
                    *to = alpha[(at, reflect(x as isize - r as isize, width))];
                }
            }
            let rows: [&[f32]; 7] = std::array::from_fn(|i| window.row(i.min(side - 1)));
            simd::median_row(self.backend, &rows[..side], &mut sorted, depth_of, &mut depth, width);
            row.iter_mut().zip(&depth).for_each(|(to, value)| *to = *value);
        }
    }

    /// Square of the residual at each pixel's alpha, relative to what noise alone leaves; and the band's own sums.
    fn residual(
        &self,
        source: &Source,
        from: usize,
        rows: usize,
        alpha: &Array2<f32>,
        wide: Option<&Array2<bool>>,
    ) -> (Array2<f32>, [f64; 3]) {
        let gain = self.bank.residual_gain();
        let [constant, per_unit] = self.scales.noise;
        let least = self.scales.least_noise;
        let mut sums = [0.0_f64; 3];
        let (height, width) = self.far.dim();
        let own = self.top - from..self.top - from + rows;
        let residual = Array2::from_shape_fn(alpha.dim(), |(y, x)| {
            let at = (from + y - source.first, x);
            let a = alpha[(y, x)];
            let rho = source.filtered.rho.each_ref().map(|rho| rho.as_ref().map_or(0.0, |rho| rho[at]));
            let left = ((rho[3] * a + rho[2]) * a + rho[1]) * a + rho[0];
            let brightness = source.products[5].as_ref().map_or(0.0, |b| b[at]);
            let noise = (constant + per_unit * brightness).max(least);
            let gain = polynomial(gain, a * a);
            let inside = (BORDER_PX..height.saturating_sub(BORDER_PX)).contains(&(from + y))
                && (BORDER_PX..width.saturating_sub(BORDER_PX)).contains(&x);
            if inside && own.contains(&y) && wide.is_none_or(|wide| !wide[at]) {
                let of_pixel = [left * left, gain * noise, rho[1] * rho[1]];
                sums.iter_mut().zip(of_pixel).for_each(|(sum, value)| *sum += f64::from(value));
            }
            left * left / (gain * noise)
        });
        (residual, sums)
    }

    fn misfit(&self, residual: &Array2<f32>, from: usize, misfit: &mut ArrayViewMut2<f32>) {
        let (height, width) = self.far.dim();
        let [down, across] = MISFIT_PX;
        let (r, share) = ((down / 2) as isize, 1.0 / (down * across) as f32);
        let mut padded = vec![0.0_f32; width + across - 1];
        let mut work = vec![0.0_f32; 2 * padded.len()];
        let mut sums = vec![0.0_f32; width];
        for (y, mut row) in misfit.rows_mut().into_iter().enumerate() {
            padded.fill(0.0);
            for d in -r..=r {
                let at = reflect((self.top + y) as isize + d, height) - from;
                for (x, sum) in padded.iter_mut().enumerate() {
                    *sum += residual[(at, reflect(x as isize - (across / 2) as isize, width))];
                }
            }
            simd::row_sums(self.backend, &padded, across, &mut work, &mut sums);
            row.iter_mut().zip(&sums).for_each(|(to, sum)| *to = sum * share);
        }
    }
}

/// `g0 + g1 x + g2 x^2 + g3 x^3`.
fn polynomial(gain: [f32; 4], x: f32) -> f32 {
    ((gain[3] * x + gain[2]) * x + gain[1]) * x + gain[0]
}

/// Sums over a window's rows, for each column and product.
struct Columns {
    side: usize,
    height: usize,
    sums: [Option<Vec<f32>>; 6],
    next: Option<usize>,
}

impl Columns {
    fn new(side: usize, width: usize, height: usize) -> Self {
        Self { side, height, sums: [(); 6].map(|()| Some(vec![0.0; width])), next: None }
    }

    /// Moves the windows to the row `y` of the image; rows come one after the other. Every sixteenth row is summed anew, so that
    /// rounding does not grow.
    fn advance(&mut self, source: &Source, y: usize) {
        let r = (self.side / 2) as isize;
        let row = |d: isize| reflect(y as isize + d, self.height) - source.first;
        let anew = self.next != Some(y) || y.is_multiple_of(16);
        for (sums, product) in self.sums.iter_mut().zip(&source.products) {
            let Some(product) = product else {
                *sums = None;
                continue;
            };
            let Some(sums) = sums else { continue };
            if anew {
                sums.fill(0.0);
                for d in -r..=r {
                    sums.iter_mut().zip(product.row(row(d))).for_each(|(sum, value)| *sum += value);
                }
            } else {
                let (gone, come) = (product.row(row(-r - 1)), product.row(row(r)));
                sums.iter_mut().zip(gone).zip(come).for_each(|((sum, gone), come)| *sum += come - gone);
            }
        }
        self.next = Some(y + 1);
    }
}

/// Magnitude of the change of depth with alpha.
struct SlopeOfDepth {
    squared: f32,
    offset: f32,
    slope: f32,
}

impl SlopeOfDepth {
    fn new(band: &Band<'_>) -> Self {
        let [offset, slope] = band.optics.defocus_line_mm();
        Self {
            squared: band.optics.focal_length_mm().powi(2) as f32,
            offset: offset as f32,
            slope: slope as f32,
        }
    }

    fn at(&self, alpha: f32) -> f32 {
        let w = self.offset + self.slope * alpha;
        self.squared * self.slope / (w * w)
    }
}
