//! Direction of the texture around each pixel, by which an astigmatic lens shifts depth: the means of `cos 2t` and `sin 2t`
//! over the directions `t` of its spatial frequencies. Frequencies count by their fourth power, as they count for depth
//! where the blur changes little. Lines along y have `[1, 0]`, round texture `[0, 0]`.

use ndarray::{Array2, Zip};

use crate::adaptive_window::LEARNED_PX;
use crate::border::reflect;
use crate::prepare::{Prepared, band::box_mean};

/// Part of the second differences that must be texture.
const TELLING: f32 = 0.2;
/// Variance of the sum of both axes' second differences, per variance of a pixel: squares of -4 and four times 1.
const NOISE: f32 = 20.0;

/// NaN where noise hides the texture.
pub(crate) fn anisotropy(pair: &Prepared) -> [Array2<f32>; 2] {
    let sum = &pair.far + &pair.near;
    let (height, width) = sum.dim();
    let [mut energy, mut along, mut diagonal] = [(); 3].map(|()| Array2::<f32>::zeros((height, width)));
    Zip::indexed(&mut energy).and(&mut along).and(&mut diagonal).par_for_each(
        |(y, x), energy, along, diagonal| {
            let second = |down: isize, right: isize| {
                let at = |sign: isize| {
                    let y = reflect(y as isize + sign * down, height);
                    sum[(y, reflect(x as isize + sign * right, width))]
                };
                at(-1) - 2.0 * sum[(y, x)] + at(1)
            };
            // Two pixels along the axes and one along the diagonals: both have the same response to a diagonal frequency.
            let [across, down, falling, rising] = [second(0, 2), second(2, 0), second(1, 1), second(-1, 1)];
            if (across + down + falling + rising).is_finite() {
                *energy = (across + down).powi(2);
                *along = across * across - down * down;
                *diagonal = 4.0 * (falling * falling - rising * rising);
            }
        },
    );
    let [mut energy, along, diagonal] =
        [energy, along, diagonal].map(|values| box_mean(values.view(), LEARNED_PX[2]));
    let noise = 2.0 * NOISE * pair.noise.mean_variance as f32;
    energy.mapv_inplace(|energy| {
        let texture = energy - noise;
        if texture > TELLING * energy { texture } else { f32::NAN }
    });
    let relative = |mut difference: Array2<f32>| {
        Zip::from(&mut difference).and(&energy).for_each(|difference, energy| *difference /= energy);
        difference
    };
    [along, diagonal].map(relative)
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::prepare::{Report, noise::PairNoise};

    const SIZE: (usize, usize) = (96, 96);

    /// In the middle of the image.
    fn of(image: &Array2<f32>, mean_variance: f64) -> [f32; 2] {
        let half = image / 2.0;
        let maps = anisotropy(&Prepared {
            far: half.clone(),
            near: half,
            reasons: Array2::zeros(SIZE),
            noise: PairNoise { mean_variance, ..PairNoise::default() },
            report: Report::default(),
        });
        maps.map(|map| map[(48, 48)])
    }

    #[test]
    fn lines_have_their_direction_and_noise_has_none() {
        let lines = |down: f32, right: f32| {
            Array2::from_shape_fn(SIZE, |(y, x)| (down * y as f32 + right * x as f32).sin())
        };
        for ((down, right), expected) in [
            ((0.0, 0.9), [1.0, 0.0]),
            ((0.9, 0.0), [-1.0, 0.0]),
            ((0.6, 0.6), [0.0, 1.0]),
            ((-0.6, 0.6), [0.0, -1.0]),
        ] {
            let found = of(&lines(down, right), 0.0);
            let error = found.iter().zip(expected).fold(0.0_f32, |most, (a, b)| most.max((a - b).abs()));
            assert!(error < 0.01, "{down} {right}: {found:?}");
        }
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let white = Array2::from_shape_simple_fn(SIZE, || rng.random::<f32>() - 0.5);
        assert!(of(&white, 0.0).iter().all(|value| value.abs() < 0.15));
        // Of a variance of 1/12 in the sum of two images.
        assert!(of(&white, 1.0 / 24.0).iter().all(|value| value.is_nan()), "noise hides the texture");
    }
}
