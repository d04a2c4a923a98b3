//! Where both images show the same: what moved between the exposures, and pairs that are none.
//!
//! In the band that defocus leaves to both images (`band`) these are correlated by nearly 1 wherever they show
//! the same surface, less what noise takes. A window in which they are not, although both have detail far above the noise,
//! shows something else in each: it moved.
//!
//! Cost: three box means per pixel of the small images (`thinned`).

use ndarray::{Array2, Zip};

use super::band::{band_noise_gain, box_mean, halving_noise_gain};
use super::noise::PairNoise;
use super::thinned::Thinned;

/// Side of the window.
const WINDOW_PX: usize = 21;
/// Part of the energy that must be detail, in both images, for a window to say anything.
const DETAIL: f32 = 0.6;
/// Correlation relative to what noise allows below which a window shows different things.
const DIFFERENT: f32 = 0.5;

/// What the comparison of a pair says.
#[derive(Debug, Clone)]
pub struct Agreement {
    /// Correlation over the whole image of those windows that have detail, relative to what noise allows; `None` where
    /// none has.
    pub correlation: Option<f64>,
    /// Part of the windows that have detail in both images.
    pub detailed: f64,
    /// Pixels that show different things, (height, width) of the images; `None` where there are none.
    pub moved: Option<Array2<bool>>,
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
    let any = different.iter().any(|d| *d);
    Agreement {
        correlation: (windows > 0.0).then(|| sum / expected),
        detailed,
        moved: any.then(|| enlarged(&different, factor, size)),
    }
}

/// A mask of a level in the pixels of the image.
fn enlarged(mask: &Array2<bool>, factor: usize, size: (usize, usize)) -> Array2<bool> {
    let (height, width) = mask.dim();
    Array2::from_shape_fn(size, |(y, x)| mask[((y / factor).min(height - 1), (x / factor).min(width - 1))])
}
