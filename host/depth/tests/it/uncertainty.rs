//! Predicted and measured standard deviation over repeated noisy images of textured planes.
#![allow(clippy::unwrap_used)] // Helpers of tests may fail like tests.

use crate::common::{Texture, eight_bit, rig};
use farnear_depth::operators::Operators;
use farnear_depth::pipeline::{Settings, depth_from_pair};
use farnear_depth::uncertainty::{Noise, standard_deviation_mm};
use ndarray::{Array2, s};

fn predicted_and_measured(psf: &str, alpha: f64, settings: &Settings, noise: Noise) -> [f64; 2] {
    const REPEATS: usize = 12;
    const SIDE_PX: usize = 96;
    let optics = rig(psf);
    let operators = Operators::for_optics(&optics).unwrap();
    let [far, near] = Texture::sand(SIDE_PX, 11).pair(optics.psf(), optics.max_blur_px(), alpha);
    let mut sum = Array2::<f64>::zeros(far.dim());
    let mut squares = sum.clone();
    let mut predicted = 0.0;
    for i in 0..REPEATS {
        let [far, near] = [(&far, 0), (&near, 1)].map(|(image, k)| eight_bit(image, (2 * i + k) as u64));
        let map = depth_from_pair(far.view(), near.view(), &operators, &optics, settings).unwrap();
        let depth = map.depth_mm.mapv(f64::from);
        sum += &depth;
        squares += &(&depth * &depth);
        if i < 2 {
            let deviation =
                standard_deviation_mm(far.view(), near.view(), &operators, &optics, settings, noise).unwrap();
            let inner = deviation.slice(s![16..80, 16..80]);
            predicted += inner.iter().map(|d| f64::from(*d).powi(2)).sum::<f64>() / inner.len() as f64 / 2.0;
        }
    }
    let n = REPEATS as f64;
    let variance = (&squares - &(&sum * &sum / n)) / (n - 1.0);
    let inner = variance.slice(s![16..80, 16..80]);
    [predicted.sqrt(), (inner.iter().sum::<f64>() / inner.len() as f64).sqrt()]
}

#[test]
fn the_prediction_is_within_a_quarter_of_what_is_measured() {
    let camera = Noise::camera(20_000.0, 12.0, 255.0);
    let settings = Settings::default();
    let cases = [
        ("pillbox", -0.7, settings, camera),
        ("pillbox", 0.5, Settings { median_px: 1, ..settings }, camera),
        ("gaussian:k=0.4578", 0.0, settings, camera),
        ("gaussian:k=0.4578", 0.8, Settings { smoothing_px: 11, median_px: 5, ..settings }, camera),
        ("generalised:p=1.8,k=0.4802", -0.4, settings, camera),
        ("gaussian:k=0.4578", 0.3, settings, Noise::Estimated),
    ];
    for (psf, alpha, settings, noise) in cases {
        let [predicted, measured] = predicted_and_measured(psf, alpha, &settings, noise);
        let ratio = predicted / measured;
        println!(
            "{psf} alpha {alpha} smoothing {} median {} {noise:?}: predicted {predicted:.3} mm, measured {measured:.3} mm, \
             ratio {ratio:.3}",
            settings.smoothing_px, settings.median_px
        );
        assert!((0.8..1.25).contains(&ratio), "{psf} {alpha}: {ratio}");
    }
}
