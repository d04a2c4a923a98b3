//! Coarseness of the texture around each pixel: the logarithm of the mean square difference of pixels 3 px apart relative
//! to neighbours', without noise. White texture has 0, a slope of brightness `ln 9`; blur raises it.

use ndarray::{Array2, Zip};

use crate::adaptive_window::LEARNED_PX;
use crate::prepare::{Prepared, band::box_mean};

const APART_PX: usize = 3;
/// Part of the neighbours' difference that must be texture.
const TELLING: f32 = 0.2;

/// NaN where noise hides the texture.
pub(crate) fn coarseness(pair: &Prepared) -> Array2<f32> {
    let sum = &pair.far + &pair.near;
    let (height, width) = sum.dim();
    let energy = |apart: usize| {
        let squares = Array2::from_shape_fn((height, width), |(y, x)| {
            let other = |i: usize, n: usize| if i + apart < n { i + apart } else { i - apart };
            let here = sum[(y, x)];
            let [down, right] = [sum[(other(y, height), x)] - here, sum[(y, other(x, width))] - here];
            let square = down * down + right * right;
            if square.is_finite() { square } else { 0.0 }
        });
        box_mean(squares.view(), LEARNED_PX[2])
    };
    // Two differences of sums of two images.
    let noise = 8.0 * pair.noise.mean_variance as f32;
    Zip::from(&energy(1)).and(&energy(APART_PX)).map_collect(|near, apart| {
        let [near_texture, apart_texture] = [near - noise, apart - noise];
        let told = near_texture > TELLING * near && apart_texture > 0.0;
        if told { (apart_texture / near_texture).ln() } else { f32::NAN }
    })
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::prepare::{Report, noise::PairNoise};

    const SIZE: (usize, usize) = (96, 96);

    fn of(image: &Array2<f32>, mean_variance: f64) -> Array2<f32> {
        let half = image / 2.0;
        coarseness(&Prepared {
            far: half.clone(),
            near: half,
            reasons: Array2::zeros(SIZE),
            noise: PairNoise { mean_variance, ..PairNoise::default() },
            report: Report::default(),
        })
    }

    fn white() -> Array2<f32> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        Array2::from_shape_simple_fn(SIZE, || rng.random::<f32>())
    }

    #[test]
    fn a_slope_is_coarse_and_white_texture_is_not() {
        let slope = of(&Array2::from_shape_fn(SIZE, |(y, x)| (x + 2 * y) as f32 / 500.0), 0.0);
        // Away from the border, where differences look back. In f32, of values up to 0.6 and differences of 0.002.
        assert!((slope[(48, 48)] - 9_f32.ln()).abs() < 1e-3, "{}", slope[(48, 48)]);
        // 3362 squares a window, of a relative standard deviation of about one: four standard deviations of the ratio.
        let largest = of(&white(), 0.0).iter().fold(0.0_f32, |largest, value| largest.max(value.abs()));
        assert!(largest < 0.12, "{largest}");
    }

    #[test]
    fn noise_is_subtracted_and_hides_fine_texture() {
        // A slope of 0.1 a pixel and noise of a variance of 1/12 in the sum of both images: its mean square difference is 1/3
        // across both directions, the slope's 0.01 and 0.09.
        let noisy = white() + Array2::from_shape_fn(SIZE, |(_, x)| x as f32 * 0.1);
        let half_variance = 1.0 / 24.0;
        assert!(of(&noisy, half_variance).iter().all(|value| value.is_nan()), "noise hides the texture");
        // Without a noise level it counts as texture: (1/3 + 0.09) / (1/3 + 0.01).
        let centre = of(&noisy, 0.0)[(48, 48)];
        assert!((centre - (0.4233_f32 / 0.3433).ln()).abs() < 0.1, "{centre}");
    }
}
