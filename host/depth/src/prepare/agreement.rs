//! Detects motion between the exposures and images of different scenes.
//!
//! In their common band (`band`) both images of a surface are correlated by nearly 1, reduced by noise. A window with
//! detail far above the noise in both images and a low correlation shows motion, or blur beyond the band's limit: large
//! blur inverts the sign of detail. Coarse detail separates the two, because blur preserves it; so does a shift that
//! restores the correlation.
//!
//! Cost: three box means per pixel of the small images (`thinned`), and 49 more around the pixels whose coarse detail
//! alone agrees.

use ndarray::{Array2, ArrayViewMut2, Axis, Zip, s};
use rayon::prelude::*;

use super::band::{
    RollingMean, band, band_noise_gain, box_mean, halved, halving_noise_gain, product, rows_of_part,
};
use super::noise::PairNoise;
use super::thinned::Thinned;
use crate::simd::{self, Backend};

/// Side of the window.
const WINDOW_PX: usize = 21;
/// Least part of a window's energy above the noise, in both images, for a comparison.
const DETAIL: f32 = 0.6;
/// Correlation relative to the largest that noise permits, below which a window differs.
const DIFFERENT: f32 = 0.5;

/// Variance of the difference of both images, relative to noise, up to which noise explains it.
const DIFFERENCE: f64 = 1.2;
/// Variance of detail relative to noise, from which another focus would show.
const CLEAR: f64 = 25.0;

/// Halvings from the small images to coarse detail.
const COARSER: usize = 2;
/// Correlation of coarse detail from which a difference may be blur.
const SAME_COARSE: f32 = 0.7;
/// Correlation at a shift from which a difference is motion.
const SAME_SHIFTED: f32 = 0.6;
/// Tested shifts along both axes, px.
const SHIFTS_PX: [isize; 7] = [-6, -4, -2, 0, 2, 4, 6];
/// Side of the tiles in which shifts are tried.
const TILE_PX: usize = 64;

/// Comparison of a pair.
#[derive(Debug, Clone)]
pub struct Agreement {
    /// Mean correlation of the windows with detail, relative to the largest that noise permits; `None` without any.
    pub correlation: Option<f64>,
    /// Part of the windows that have detail in both images.
    pub detailed: f64,
    /// Both images differ by noise alone, although their detail is far above it.
    pub equally_sharp: bool,
    /// Pixels with motion or different objects, (height, width) of the images; `None` without any.
    pub moved: Option<Array2<bool>>,
    /// Pixels with blur beyond the common band.
    pub too_blurred: Option<Array2<bool>>,
}

/// Compares an aligned pair of `size` (height, width) before thinning.
pub(super) fn compare(pair: &Thinned, size: (usize, usize), noise: &PairNoise) -> Agreement {
    let factor = 1 << pair.halvings;
    let variance = noise.mean_variance * band_noise_gain() * halving_noise_gain().powi(pair.halvings as i32);
    let [a, b] = [&pair.far.band, &pair.near.band];
    let noise = variance as f32;
    let mut different = Array2::from_elem(a.dim(), false);
    let (backend, limits) = (Backend::best(), [DETAIL, DIFFERENT]);
    let rows = rows_of_part(a.nrows());
    let of_part = |(part, mut different): (usize, ArrayViewMut2<bool>)| {
        let mut sums = [0.0_f64; 3];
        let mut rolling = [(); 3].map(|()| RollingMean::new(a.dim(), WINDOW_PX));
        let mut means = [(); 3].map(|()| vec![0.0_f32; a.ncols()]);
        for (i, mut different) in different.axis_iter_mut(Axis(0)).enumerate() {
            let factors = [(a, b), (a, a), (b, b)];
            for ((rolling, mean), (a, b)) in rolling.iter_mut().zip(&mut means).zip(factors) {
                rolling.mean(part * rows + i, |y, row| product(a, b, y, row), mean);
            }
            let Some(different) = different.as_slice_mut() else { unreachable!("made in standard layout") };
            let of_row =
                simd::compare_row(backend, noise, limits, means.each_ref().map(|row| &row[..]), different);
            sums.iter_mut().zip(of_row).for_each(|(sum, value)| *sum += f64::from(value));
        }
        sums
    };
    let of_parts: Vec<[f64; 3]> =
        different.axis_chunks_iter_mut(Axis(0), rows).into_par_iter().enumerate().map(of_part).collect();
    let [sum, expected, windows] =
        of_parts.into_iter().fold([0.0; 3], |a, b| [a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
    let detailed = windows / different.len() as f64;
    let mut too_blurred = Array2::from_elem(different.dim(), false);
    if different.iter().any(|d| *d) {
        let coarse = coarse_correlation(pair);
        Zip::from(&mut too_blurred).and(&different).and(&coarse).for_each(|blurred, different, coarse| {
            *blurred = *different && *coarse > SAME_COARSE;
        });
        let bands = too_blurred.axis_chunks_iter_mut(Axis(0), TILE_PX).into_par_iter().enumerate();
        bands.for_each(|(row, mut band)| {
            for (column, tile) in band.axis_chunks_iter_mut(Axis(1), TILE_PX).enumerate() {
                remove_moved(tile, [row * TILE_PX, column * TILE_PX], [a, b]);
            }
        });
        Zip::from(&mut different).and(&too_blurred).for_each(|moved, blurred| *moved &= !*blurred);
    }
    let mask = |mask: &Array2<bool>| mask.iter().any(|d| *d).then(|| enlarged(mask, factor, size));
    Agreement {
        correlation: (windows > 0.0).then(|| sum / expected),
        detailed,
        equally_sharp: equally_sharp([a, b], variance),
        moved: mask(&different),
        too_blurred: mask(&too_blurred),
    }
}

/// Whether the bands of both images, whose noise has this variance, differ by noise alone.
fn equally_sharp([a, b]: [&Array2<f32>; 2], variance: f64) -> bool {
    let (mut detail, mut difference, mut pixels) = (0.0, 0.0, 0.0);
    let all_pixels = a.len() as f64;
    let limit = |pixels: f64| DIFFERENCE * 2.0 * variance * pixels;
    let (backend, mut apart) = (Backend::best(), vec![0.0_f32; a.ncols()]);
    for (a, b) in a.rows().into_iter().zip(b.rows()) {
        let (Some(a), Some(b)) = (a.as_slice(), b.as_slice()) else {
            unreachable!("made in standard layout")
        };
        apart.iter_mut().zip(a).zip(b).for_each(|((apart, a), b)| *apart = a - b);
        let ([in_both, ..], of_row) = (simd::products(backend, a, b), simd::sum_of_squares(&apart));
        // A band has no holes; a row that overflows is passed over.
        if !(in_both.is_finite() && of_row.is_finite()) {
            continue;
        }
        detail += in_both;
        difference += of_row;
        pixels += a.len() as f64;
        // Most pairs differ clearly within a few rows.
        if difference > limit(all_pixels) {
            return false;
        }
    }
    difference < limit(pixels) && detail > CLEAR * variance * pixels
}

/// Correlation of coarse detail around each pixel of the small images.
fn coarse_correlation(pair: &Thinned) -> Array2<f32> {
    let size = pair.far.image.dim();
    let [a, b] = [&pair.far.image, &pair.near.image].map(|image| {
        let mut small = image.clone();
        for _ in 0..COARSER {
            small = halved(small.view());
        }
        band(small.view())
    });
    let window = WINDOW_PX / 2 + 1;
    let mean = |x: &Array2<f32>, y: &Array2<f32>| box_mean((x * y).view(), window);
    let [product, of_a, of_b] = [mean(&a, &b), mean(&a, &a), mean(&b, &b)];
    let correlation = Zip::from(&product)
        .and(&of_a)
        .and(&of_b)
        .map_collect(|product, a, b| product / (a * b).sqrt().max(f32::MIN_POSITIVE));
    let (height, width) = correlation.dim();
    let factor = 1 << COARSER;
    Array2::from_shape_fn(size, |(y, x)| {
        correlation[((y / factor).min(height - 1), (x / factor).min(width - 1))]
    })
}

/// Unmarks the pixels of a tile at row `top` and column `left` whose correlation reaches [`SAME_SHIFTED`] at a shift.
fn remove_moved(mut tile: ArrayViewMut2<bool>, [top, left]: [usize; 2], [a, b]: [&Array2<f32>; 2]) {
    let mut marked: Vec<_> = tile.indexed_iter().filter(|(_, marked)| **marked).map(|(at, _)| at).collect();
    let (height, width) = a.dim();
    // The part of the images that the windows of these pixels cover.
    let cover = |first: usize, of: &dyn Fn(&(usize, usize)) -> usize, n: usize| {
        let places = || marked.iter().map(of);
        let reach = WINDOW_PX / 2;
        Some((first + places().min()?).saturating_sub(reach)..(first + places().max()? + reach + 1).min(n))
    };
    let Some((rows, columns)) = cover(top, &|at| at.0, height).zip(cover(left, &|at| at.1, width)) else {
        return;
    };
    let [of_a, of_b] = [a, b].map(|band| {
        let part = band.slice(s![rows.clone(), columns.clone()]);
        box_mean((&part * &part).view(), WINDOW_PX)
    });
    let limit = Zip::from(&of_a).and(&of_b).map_collect(|a, b| SAME_SHIFTED * (a * b).sqrt());
    let inside = |i: usize, by: isize, n: usize| (i as isize + by).clamp(0, n as isize - 1) as usize;
    for (down, right) in SHIFTS_PX.into_iter().flat_map(|down| SHIFTS_PX.map(|right| (down, right))) {
        let product = Array2::from_shape_fn((rows.len(), columns.len()), |(y, x)| {
            let (y, x) = (rows.start + y, columns.start + x);
            a[(y, x)] * b[(inside(y, down, height), inside(x, right, width))]
        });
        let mean = box_mean(product.view(), WINDOW_PX);
        marked.retain(|at| {
            let place = (top + at.0 - rows.start, left + at.1 - columns.start);
            tile[*at] = mean[place] < limit[place];
            tile[*at]
        });
        if marked.is_empty() {
            return;
        }
    }
}

/// Enlarges a mask of the small images to the pixels of the image.
fn enlarged(mask: &Array2<bool>, factor: usize, size: (usize, usize)) -> Array2<bool> {
    let (height, width) = mask.dim();
    let mut large = Array2::from_elem(size, false);
    large.axis_iter_mut(Axis(0)).into_par_iter().enumerate().for_each(|(y, mut row)| {
        let from = mask.row((y / factor).min(height - 1));
        let Some(row) = row.as_slice_mut() else { unreachable!("made in standard layout") };
        for (x, pixels) in row.chunks_mut(factor).enumerate() {
            pixels.fill(from[x.min(width - 1)]);
        }
    });
    large
}
