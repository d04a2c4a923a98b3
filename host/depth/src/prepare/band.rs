//! The common band of both images of a pair, normalised by its local RMS, for registration.
//!
//! Defocus removes the finest detail from one image only, by an amount that depends on the place; lamp, aperture and
//! vignetting change the brightness of one image. A band of middle frequencies, divided by its RMS around each pixel, is
//! equal in both images of an object. Point spread functions are symmetric, so different blur does not bias a shift.

use ndarray::{Array2, ArrayView2, Axis, CowArray, Ix2};
use rayon::prelude::*;

use crate::border::reflect;
use crate::simd::{self, Backend};

/// Side of the window whose mean is subtracted: the band's lower end.
const MEAN_PX: usize = 9;
/// Side of the window of the RMS.
const STRENGTH_PX: usize = 15;
/// Part of the image's mean square that is added everywhere, so that noise is not amplified in areas without texture.
const FLOOR: f32 = 0.1;

/// An image of half the size; binomial weights remove frequencies beyond the smaller grid.
pub(crate) fn halved(image: ArrayView2<f32>) -> Array2<f32> {
    const WEIGHTS: [f32; 4] = [0.125, 0.375, 0.375, 0.125];
    let (height, width) = image.dim();
    let (rows, columns) = (height / 2, width / 2);
    let (image, backend) = (image.as_standard_layout(), Backend::best());
    let mut half = Array2::zeros((rows, columns));
    half.axis_iter_mut(Axis(0)).into_par_iter().enumerate().for_each_init(
        || vec![0.0_f32; width + 2],
        |across, (y, mut row)| {
            // One reflected pixel on either side, so that every output has its four taps in a slice.
            let taps = [0, 1, 2, 3].map(|tap| image.row(reflect(2 * y as isize + tap - 1, height)));
            let taps = taps.each_ref().map(|row| row.as_slice().unwrap_or_default());
            simd::weigh_rows(backend, taps, WEIGHTS, &mut across[1..=width]);
            across[0] = across[1 + reflect(-1, width)];
            across[width + 1] = across[1 + reflect(width as isize, width)];
            let Some(row) = row.as_slice_mut() else { unreachable!("made in standard layout") };
            simd::halve_row(backend, across, WEIGHTS, row);
        },
    );
    half
}

/// The image with its NaN pixels set to the mean of the others; borrowed without NaN pixels.
pub(crate) fn without_holes(image: ArrayView2<'_, f32>) -> CowArray<'_, f32, Ix2> {
    // 32-bit sums are vectorised.
    let whole = |row: ndarray::ArrayView1<f32>| {
        row.iter().map(|v| u32::from(v.is_finite())).sum::<u32>() as usize == row.len()
    };
    if image.axis_iter(Axis(0)).into_par_iter().all(whole) {
        return image.into();
    }
    let of_row = |row: ndarray::ArrayView1<f32>| {
        row.iter().filter(|v| v.is_finite()).fold((0.0, 0.0), |(sum, n), v| (sum + f64::from(*v), n + 1.0))
    };
    let of_rows: Vec<(f64, f64)> = image.axis_iter(Axis(0)).into_par_iter().map(of_row).collect();
    let (sum, count) = of_rows.into_iter().fold((0.0, 0.0), |(sum, n), row| (sum + row.0, n + row.1));
    let mean = if count > 0.0 { (sum / count) as f32 } else { 0.0 };
    let mut filled = image.into_owned();
    filled.par_mapv_inplace(|v| if v.is_finite() { v } else { mean });
    filled.into()
}

/// The band: the image blurred by a binomial of five taps, minus its mean over [`MEAN_PX`]. Each blurred row is kept while a
/// window contains it.
pub(crate) fn band(image: ArrayView2<f32>) -> Array2<f32> {
    let (size, width) = (image.dim(), image.ncols());
    let image = image.as_standard_layout();
    let mut result = Array2::zeros(size);
    let rows = rows_of_part(size.0);
    result.axis_chunks_iter_mut(Axis(0), rows).into_par_iter().enumerate().for_each(|(part, mut band)| {
        let mut rolling = RollingMean::new(size, MEAN_PX);
        let (mut fine, mut across) = (vec![0.0_f32; MEAN_PX * width], vec![0.0_f32; width + 4]);
        let place = |y: usize| (y % MEAN_PX) * width..(y % MEAN_PX + 1) * width;
        for (i, mut row) in band.axis_iter_mut(Axis(0)).enumerate() {
            let (y, row) = (part * rows + i, row.as_slice_mut().unwrap_or_default());
            let blurred = |y: usize, row: &mut [f32]| {
                binomial_row(&image, y, &mut across, row);
                fine[place(y)].copy_from_slice(row);
            };
            rolling.mean(y, blurred, row);
            row.iter_mut().zip(&fine[place(y)]).for_each(|(value, fine)| *value = fine - *value);
        }
    });
    result
}

/// Factor of [`band`] on the variance of white noise: the sum of its squared taps.
pub(crate) fn band_noise_gain() -> f64 {
    let taps = [1.0, 4.0, 6.0, 4.0, 1.0].map(|t| t / 16.0);
    let n = MEAN_PX as f64;
    let own: f64 = taps.iter().map(|t| t * t).sum::<f64>().powi(2);
    // The box contains the binomial, so the mixed term is the box's weight; the blurred box is slightly wider.
    own - 2.0 / (n * n) + 1.0 / (n * n)
}

/// Factor of [`halved`] on the variance of white noise.
pub(crate) fn halving_noise_gain() -> f64 {
    (2.0 * (0.125_f64.powi(2) + 0.375_f64.powi(2))).powi(2)
}

/// The band divided by its RMS around each pixel.
pub(crate) fn normalised(band: &Array2<f32>) -> Array2<f32> {
    let of_rows: Vec<f64> = band
        .axis_iter(Axis(0))
        .into_par_iter()
        .map(|row| row.as_slice().map_or(0.0, simd::sum_of_squares))
        .collect();
    let mean = of_rows.iter().sum::<f64>() / band.len() as f64;
    let floor = (FLOOR * mean as f32).max(f32::MIN_POSITIVE);
    let backend = Backend::best();
    means_of(
        band.dim(),
        STRENGTH_PX,
        |y, row| product(band, band, y, row),
        |y, row| {
            simd::divide_by_root(backend, band.row(y).to_slice().unwrap_or_default(), floor, row);
        },
    )
}

/// Row `y` of a product.
pub(crate) fn product(a: &Array2<f32>, b: &Array2<f32>, y: usize, row: &mut [f32]) {
    let [a, b] = [a, b].map(|image| image.row(y).to_slice().unwrap_or_default());
    row.iter_mut().zip(a).zip(b).for_each(|((to, a), b)| *to = a * b);
}

/// The image blurred by a binomial of five taps along both axes; borders reflected.
pub(crate) fn binomial(image: ArrayView2<f32>) -> Array2<f32> {
    let (size, width) = (image.dim(), image.ncols());
    let image = image.as_standard_layout();
    let mut result = Array2::zeros(size);
    result.axis_iter_mut(Axis(0)).into_par_iter().enumerate().for_each_init(
        || vec![0.0_f32; width + 4],
        |across, (y, mut row)| binomial_row(&image, y, across, row.as_slice_mut().unwrap_or_default()),
    );
    result
}

/// Row `y` of [`binomial`]. `across` has four columns more.
fn binomial_row(image: &CowArray<f32, Ix2>, y: usize, across: &mut [f32], to: &mut [f32]) {
    const WEIGHTS: [f32; 5] = [0.0625, 0.25, 0.375, 0.25, 0.0625];
    let ((height, width), backend) = (image.dim(), Backend::best());
    let rows = [-2, -1, 0, 1, 2].map(|tap| image.row(reflect(y as isize + tap, height)));
    let rows = rows.each_ref().map(|row| row.as_slice().unwrap_or_default());
    simd::weigh_rows(backend, rows, WEIGHTS, &mut across[2..2 + width]);
    for d in 1..=2_isize {
        across[(2 - d) as usize] = across[2 + reflect(-d, width)];
        across[(width as isize + 1 + d) as usize] = across[2 + reflect(width as isize - 1 + d, width)];
    }
    simd::weigh_rows(backend, [0, 1, 2, 3, 4].map(|tap| &across[tap..]), WEIGHTS, to);
}

/// Mean over a window of odd side around each pixel, fewer pixels at the borders.
pub(crate) fn box_mean(image: ArrayView2<f32>, side: usize) -> Array2<f32> {
    let source = |y: usize, row: &mut [f32]| match image.row(y).as_slice() {
        Some(from) => row.copy_from_slice(from),
        None => row.iter_mut().zip(image.row(y)).for_each(|(to, from)| *to = *from),
    };
    means_of(image.dim(), side, source, |_, _| ())
}

/// [`box_mean`] of the rows that `source` writes, of (height, width). `finish` changes each row of means.
fn means_of(
    size: (usize, usize),
    side: usize,
    source: impl Fn(usize, &mut [f32]) + Sync,
    finish: impl Fn(usize, &mut [f32]) + Sync,
) -> Array2<f32> {
    let mut result = Array2::zeros(size);
    let rows = rows_of_part(size.0);
    result.axis_chunks_iter_mut(Axis(0), rows).into_par_iter().enumerate().for_each(|(part, mut means)| {
        let mut rolling = RollingMean::new(size, side);
        for (i, mut row) in means.axis_iter_mut(Axis(0)).enumerate() {
            let (y, row) = (part * rows + i, row.as_slice_mut().unwrap_or_default());
            rolling.mean(y, &source, row);
            finish(y, row);
        }
    });
    result
}

/// Rows of an image per thread: each part also sums the rows of its windows beyond it.
pub(crate) fn rows_of_part(height: usize) -> usize {
    height.div_ceil(rayon::current_num_threads().max(1)).max(32)
}

/// [`box_mean`] row by row: each row is computed once and kept while a window contains it.
pub(crate) struct RollingMean {
    backend: Backend,
    height: usize,
    reach: usize,
    /// Sums over the window's rows.
    sums: Vec<f64>,
    /// Means along the rows of a window and of the row that leaves it.
    kept: Vec<f32>,
    row: Vec<f32>,
    work: Vec<f32>,
    /// Summed rows; `None` before the first.
    summed: Option<std::ops::Range<usize>>,
}

impl RollingMean {
    pub(crate) fn new((height, width): (usize, usize), side: usize) -> Self {
        Self {
            backend: Backend::best(),
            height,
            reach: side / 2,
            sums: vec![0.0; width],
            kept: vec![0.0; (side + 1) * width],
            row: vec![0.0; width],
            work: vec![0.0; 2 * width],
            summed: None,
        }
    }

    /// Means around the pixels of row `y`, which follows the one before.
    pub(crate) fn mean(&mut self, y: usize, mut source: impl FnMut(usize, &mut [f32]), to: &mut [f32]) {
        let Self { backend, height, reach: r, sums, kept, row, work, summed } = self;
        let width = row.len();
        let place = |y: usize| (y % (2 * *r + 2)) * width..(y % (2 * *r + 2) + 1) * width;
        let rows = summed.get_or_insert(y.saturating_sub(*r)..y.saturating_sub(*r));
        let (first, end) = (y.saturating_sub(*r), (y + *r + 1).min(*height));
        let mut along = |kept: &mut [f32], y: usize| {
            source(y, row);
            means_along(*backend, row, *r, work, &mut kept[place(y)]);
        };
        if rows.end + 1 == end && rows.start + 1 == first {
            along(kept, rows.end);
            let share = 1.0 / (end - first) as f64;
            simd::roll_row(*backend, [rows.end, rows.start].map(|y| &kept[place(y)]), sums, share, to);
            *rows = first..end;
            return;
        }
        while rows.end < end {
            along(kept, rows.end);
            sums.iter_mut().zip(&kept[place(rows.end)]).for_each(|(sum, value)| *sum += f64::from(*value));
            rows.end += 1;
        }
        while rows.start < first {
            sums.iter_mut().zip(&kept[place(rows.start)]).for_each(|(sum, value)| *sum -= f64::from(*value));
            rows.start += 1;
        }
        let share = 1.0 / rows.len() as f64;
        to.iter_mut().zip(sums).for_each(|(value, sum)| *value = (*sum * share) as f32);
    }
}

/// Mean over `2 r + 1` columns.
fn means_along(backend: Backend, from: &[f32], r: usize, work: &mut [f32], to: &mut [f32]) {
    let width = from.len();
    let inner = r.min(width)..width.saturating_sub(r).max(r.min(width));
    let mut sum: f32 = from[..inner.start].iter().sum();
    for (x, mean) in to[..inner.start].iter_mut().enumerate() {
        sum += from.get(x + r).unwrap_or(&0.0);
        *mean = sum / (x + r + 1).min(width) as f32;
    }
    let mut sum: f32 = from[width.saturating_sub(r)..].iter().sum();
    for x in (inner.end..width).rev() {
        sum += from[x - r];
        to[x] = sum / (width - (x - r)) as f32;
    }
    if width > 2 * r {
        let share = 1.0 / (2 * r + 1) as f32;
        let to = &mut to[inner];
        simd::row_sums(backend, from, 2 * r + 1, work, to);
        to.iter_mut().for_each(|sum| *sum *= share);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_those_of_the_window() {
        for width in [1, 3, 4, 5, 8, 9, 23] {
            let image = Array2::from_shape_fn((70, width), |(y, x)| ((y * 31 + x * 17) % 23) as f32);
            for ((y, x), found) in box_mean(image.view(), 9).indexed_iter() {
                let rows = y.saturating_sub(4)..(y + 5).min(70);
                let columns = x.saturating_sub(4)..(x + 5).min(width);
                let window = image.slice(ndarray::s![rows, columns]);
                assert!((found - window.sum() / window.len() as f32).abs() < 1e-4, "{width} {x} {y}");
            }
        }
    }

    #[test]
    fn the_gain_of_noise_is_that_of_an_impulse() {
        let mut image = Array2::zeros((41, 41));
        image[(20, 20)] = 1.0;
        let energy: f64 = band(image.view()).iter().map(|v| f64::from(*v).powi(2)).sum();
        assert!((energy / band_noise_gain() - 1.0).abs() < 0.05, "{energy} {}", band_noise_gain());
        let energies = [(20, 20), (20, 21), (21, 20), (21, 21)].map(|at| {
            let mut image = Array2::zeros((42, 42));
            image[at] = 1.0;
            halved(image.view()).iter().map(|v| f64::from(*v).powi(2)).sum::<f64>()
        });
        // Each position represents a quarter of the pixels, so the energies add up to that of one output pixel's taps.
        assert!((energies.iter().sum::<f64>() - halving_noise_gain()).abs() < 1e-6);
    }

    #[test]
    fn normalisation_removes_the_contrast() {
        let image = Array2::from_shape_fn((60, 80), |(y, x)| {
            let strength = if x < 40 { 1.0 } else { 2.0 };
            strength * ((y * 7 + x * x * 3) % 11) as f32
        });
        let band = normalised(&band(image.view()));
        let rms = |columns: std::ops::Range<usize>| {
            let part = band.slice(ndarray::s![.., columns]);
            (part.mapv(|v| v * v).sum() / part.len() as f32).sqrt()
        };
        assert!((rms(5..30) / rms(50..75) - 1.0).abs() < 0.2, "{} {}", rms(5..30), rms(50..75));
    }
}
