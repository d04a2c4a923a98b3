//! Where both images show the same: motion between the exposures, and images of different scenes.
//!
//! In the band that defocus leaves to both images (`band`) these are correlated by nearly 1 wherever they show
//! the same surface, less what noise takes. A window in which they are not, although both have detail far above the noise, either
//! moved or is blurred more than the band allows for: much blur turns the sign of detail. Coarse detail tells them apart, because
//! blur leaves it alone; so does a shift that brings the detail of both images together.
//!
//! Cost: three box means per pixel of the small images (`thinned`), and 49 more where something differs.

use ndarray::{Array2, Zip};

use super::band::{band, band_noise_gain, box_mean, halved, halving_noise_gain};
use super::noise::PairNoise;
use super::thinned::Thinned;

/// Side of the window.
const WINDOW_PX: usize = 21;
/// Part of the energy that must be detail, in both images, for a window to say anything.
const DETAIL: f32 = 0.6;
/// Correlation relative to what noise allows below which a window shows different things.
const DIFFERENT: f32 = 0.5;

/// Halvings down to coarse detail.
const COARSER: usize = 2;
/// Correlation of coarse detail from which a window shows the same thing, blurred.
const SAME_COARSE: f32 = 0.7;
/// Correlation at a shift from which a window shows the same thing, moved.
const SAME_SHIFTED: f32 = 0.6;
/// Shifts that are tried along both axes, px.
const SHIFTS_PX: [isize; 7] = [-6, -4, -2, 0, 2, 4, 6];

/// What the comparison of a pair says.
#[derive(Debug, Clone)]
pub struct Agreement {
    /// Correlation over the whole image of those windows that have detail, relative to what noise allows; `None` where
    /// none has.
    pub correlation: Option<f64>,
    /// Part of the windows that have detail in both images.
    pub detailed: f64,
    /// Pixels that show different things, (height, width) of the images; `None` without any.
    pub moved: Option<Array2<bool>>,
    /// Pixels that show the same thing with more blur than a pair has.
    pub too_blurred: Option<Array2<bool>>,
}

/// Compares a pair that lies on each other and has `size` at full size.
pub(super) fn compare(pair: &Thinned, size: (usize, usize), noise: &PairNoise) -> Agreement {
    let factor = 1 << pair.halvings;
    let variance = noise.mean_variance * band_noise_gain() * halving_noise_gain().powi(pair.halvings as i32);
    let [a, b] = [&pair.far.band, &pair.near.band];
    let mean = |x: &Array2<f32>, y: &Array2<f32>| box_mean((x * y).view(), WINDOW_PX);
    let [product, of_a, of_b] = [mean(a, b), mean(a, a), mean(b, b)];
    let noise = variance as f32;
    let [mut sum, mut expected, mut windows] = [0.0_f64; 3];
    let mut different = Array2::from_elem(a.dim(), false);
    Zip::from(&mut different).and(&product).and(&of_a).and(&of_b).for_each(|different, product, a, b| {
        let detail = [a, b].map(|energy| 1.0 - noise / energy.max(f32::MIN_POSITIVE));
        if detail.iter().all(|part| *part > DETAIL) {
            let allowed = (detail[0] * detail[1]).sqrt();
            let correlation = product / (a * b).sqrt();
            *different = correlation < DIFFERENT * allowed;
            sum += f64::from(correlation);
            expected += f64::from(allowed);
            windows += 1.0;
        }
    });
    let detailed = windows / different.len() as f64;
    let mut too_blurred = Array2::from_elem(different.dim(), false);
    if different.iter().any(|d| *d) {
        let coarse = coarse_correlation(pair);
        let mut unmoved = coarse.mapv(|correlation| correlation > SAME_COARSE);
        let limit = Zip::from(&of_a).and(&of_b).map_collect(|a, b| SAME_SHIFTED * (a * b).sqrt());
        for (down, right) in SHIFTS_PX.into_iter().flat_map(|down| SHIFTS_PX.map(|right| (down, right))) {
            let shifted = product_at(a, b, down, right);
            Zip::from(&mut unmoved)
                .and(&shifted)
                .and(&limit)
                .for_each(|unmoved, product, limit| *unmoved &= product < limit);
        }
        Zip::from(&mut too_blurred).and(&mut different).and(&unmoved).for_each(|blurred, moved, unmoved| {
            *blurred = *moved && *unmoved;
            *moved &= !*unmoved;
        });
    }
    let mask = |mask: &Array2<bool>| mask.iter().any(|d| *d).then(|| enlarged(mask, factor, size));
    Agreement {
        correlation: (windows > 0.0).then(|| sum / expected),
        detailed,
        moved: mask(&different),
        too_blurred: mask(&too_blurred),
    }
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

/// Mean product of `a` and `b` around each pixel, `b` moved by this many pixels down and to the right.
fn product_at(a: &Array2<f32>, b: &Array2<f32>, down: isize, right: isize) -> Array2<f32> {
    let (height, width) = a.dim();
    let inside = |i: usize, by: isize, n: usize| (i as isize + by).clamp(0, n as isize - 1) as usize;
    let product = Array2::from_shape_fn((height, width), |(y, x)| {
        a[(y, x)] * b[(inside(y, down, height), inside(x, right, width))]
    });
    box_mean(product.view(), WINDOW_PX)
}

/// A mask of a level in the pixels of the image.
fn enlarged(mask: &Array2<bool>, factor: usize, size: (usize, usize)) -> Array2<bool> {
    let (height, width) = mask.dim();
    Array2::from_shape_fn(size, |(y, x)| mask[((y / factor).min(height - 1), (x / factor).min(width - 1))])
}
