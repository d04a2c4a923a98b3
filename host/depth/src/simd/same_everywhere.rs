//! One small pair through the run time and the adaptive windows: every vector unit must reproduce AVX2's numbers below.
//! To update them, run the test and copy its output.

use ndarray::Array2;

use super::Backend;
use crate::adaptive_window::{Bank, Window, WindowSettings, estimate};
use crate::operators::Operators;
use crate::optics::{Optics, OpticsFile};
use crate::pipeline::{Settings, depth_from_pair};
use crate::prepare::noise::PairNoise;

/// Depth in mm and confidence by the operators, and depth in mm by adaptive windows, at [`places`].
const BY_AVX2: [[f32; 3]; 12] = [
    [911.0976, 0.47497717, 910.9665],
    [911.0176, 0.9499145, 910.9992],
    [911.0276, 0.96233696, 911.0137],
    [911.0431, 0.9627244, 910.9971],
    [911.042, 0.9429028, 911.00134],
    [911.01984, 0.9177246, 911.0005],
    [911.019, 0.96759987, 910.94775],
    [911.0518, 0.95343477, 910.9577],
    [910.9867, 0.95543545, 911.00696],
    [911.0514, 0.95532644, 910.9813],
    [911.05475, 0.9561546, 910.9877],
    [911.1162, 0.48269677, 911.01996],
];

/// Depth is a 32-bit number near 900 with a resolution of 6e-5 mm; the steps add some ten of these.
const DEPTH_TOLERANCE_MM: f32 = 2e-3;
/// Confidences are between 0 and 1.
const CONFIDENCE_TOLERANCE: f32 = 2e-5;

const SIZE: (usize, usize) = (61, 83);

fn places() -> impl Iterator<Item = (usize, usize)> {
    (0..BY_AVX2.len()).map(|i| (2 + 5 * i, 1 + (i * 37) % 81))
}

/// A texture, and the same blurred by three taps each way: a plane beyond the middle.
fn pair() -> [Array2<f32>; 2] {
    let value = |y: usize, x: usize| {
        let mut h = (y * 7919 + x * 104_729 + 1) as u64;
        h = (h ^ (h >> 13)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        60.0 + 100.0 * ((h >> 40) as f32) / 16_777_216.0
    };
    let mean = |y: usize, x: usize, weight: f32| {
        let ring = value(y, x + 1) + value(y + 2, x + 1) + value(y + 1, x) + value(y + 1, x + 2);
        (value(y + 1, x + 1) + weight * ring) / (1.0 + 4.0 * weight)
    };
    [0.1, 0.25].map(|weight| Array2::from_shape_fn(SIZE, |(y, x)| mean(y, x, weight)))
}

fn optics() -> Optics {
    let text = "[lens]\nfocal_length_mm = 50.0\nf_number = 3.90625\n[sensor]\npixel_um = 7.4\n\
                [focus]\nfar_mm = 933.0\nmax_blur_px = 2.703\n[psf]\nmodel = \"gaussian\"\nk = 0.4578";
    toml::from_str::<OpticsFile>(text).unwrap().check().unwrap()
}

#[test]
fn every_processor_gives_what_avx2_gave() {
    let optics = optics();
    let operators = Operators::for_optics(&optics).unwrap();
    let bank = Bank::whitened(&optics).unwrap();
    let [far, near] = pair();
    let noise = PairNoise { constant: 0.25, per_unit: 0.0, mean_variance: 0.25, ..PairNoise::default() };
    for backend in Backend::available() {
        let settings = Settings { backend: Some(backend), ..Settings::default() };
        let map = depth_from_pair(far.view(), near.view(), &operators, &optics, &settings).unwrap();
        let settings =
            WindowSettings { window: Window::Adaptive, median_px: 3, noise, backend: Some(backend) };
        let adaptive = estimate(far.view(), near.view(), &bank, &optics, &settings).unwrap();
        let found: Vec<[f32; 3]> =
            places().map(|at| [map.depth_mm[at], map.confidence[at], adaptive.depth_mm[at]]).collect();
        println!("{backend:?} {found:?}");
        for ((found, recorded), at) in found.iter().zip(&BY_AVX2).zip(places()) {
            for i in [0, 2] {
                let error = (found[i] - recorded[i]).abs();
                assert!(error < DEPTH_TOLERANCE_MM, "{backend:?} {at:?}: {found:?}, recorded {recorded:?}");
            }
            let error = (found[1] - recorded[1]).abs();
            assert!(error < CONFIDENCE_TOLERANCE, "{backend:?} {at:?}: {found:?}, recorded {recorded:?}");
        }
    }
}
