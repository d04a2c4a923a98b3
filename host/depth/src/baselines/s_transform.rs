//! Subbarao & Surya's S-transform method (STM), 1994.
//!
//! Blur of a cubic polynomial by any symmetric PSF of second moment `sigma^2` adds `sigma^2 / 4` times its Laplacian.
//! So the sharp image `f = g1 - (sigma1^2 / 4) lap(g1) = g2 - (sigma2^2 / 4) lap(g2)` gives
//! `g1 - g2 = (sigma1^2 - sigma2^2) / 4 * lap(g)`, `lap(g)` the mean of the two Laplacians, solved by least squares
//! over a window of smoothed images. Limits: higher terms shrink the result by some percent at the ends of the range;
//! division by a small Laplacian amplifies noise. Cost: about 90 operations a pixel.

use ndarray::{Array2, Zip};

use super::common::{Along, Evidence, Pair, filter, filter_both, window_sum};
use crate::optics::Optics;
use crate::pipeline::Settings;

/// SD of the smoothing: frequencies above 1 / SD carry most of what a cubic cannot describe.
const SMOOTHING_SD_PX: f32 = 1.6;

/// Second difference, exact to the fourth order.
const SECOND: [f32; 5] = [-1.0 / 12.0, 16.0 / 12.0, -30.0 / 12.0, 16.0 / 12.0, -1.0 / 12.0];

pub(super) fn evidence(pair: &Pair, optics: &Optics, settings: &Settings) -> Evidence {
    let gaussian = gaussian(SMOOTHING_SD_PX);
    let smooth = |image: &Array2<f32>| filter_both(image, &gaussian, &gaussian);
    let (far, near) = (smooth(&pair.far), smooth(&pair.near));
    let difference = &far - &near;
    let mean = (&far + &near) * 0.5;
    let laplacian = filter(&mean, &SECOND, Along::Rows) + filter(&mean, &SECOND, Along::Columns);
    let sum = |image: Array2<f32>| window_sum(&image, settings.smoothing_px);
    let texture = sum(&laplacian * &laplacian);
    let cross = sum(&difference * &laplacian);
    let energy = sum(&difference * &difference);
    // alpha = (sigma1^2 - sigma2^2) / (moment Rmax^2).
    let scale = (4.0 / (optics.psf().second_moment() * optics.max_blur_px().powi(2))) as f32;
    let mut alpha = Array2::from_elem(texture.dim(), f32::NAN);
    let mut misfit = Array2::zeros(texture.dim());
    Zip::from(&mut alpha).and(&mut misfit).and(&texture).and(&cross).and(&energy).for_each(
        |alpha, misfit, texture, cross, energy| {
            if *texture > 0.0 {
                let slope = cross / texture;
                *alpha = scale * slope;
                *misfit = (scale * scale * (energy / texture - slope * slope)).max(0.0);
            }
        },
    );
    let reach_px = gaussian.len() / 2 + SECOND.len() / 2 + settings.smoothing_px / 2;
    Evidence { alpha, texture, misfit, reach_px }
}

fn gaussian(sd: f32) -> Vec<f32> {
    let half = (3.0 * sd).ceil() as i32;
    let taps: Vec<f32> = (-half..=half).map(|i| (-0.5 * (i as f32 / sd).powi(2)).exp()).collect();
    let sum: f32 = taps.iter().sum();
    taps.into_iter().map(|tap| tap / sum).collect()
}
