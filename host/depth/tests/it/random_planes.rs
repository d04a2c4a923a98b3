//! Random planes in and out of the range, with resized near images: no confident wrong depth.
#![allow(clippy::unwrap_used)] // Helpers of tests may fail like tests.

use crate::common::rig;
use crate::measure::{PSF, lens};
use farnear_depth::adaptive_window::Window;
use farnear_depth::measure::{DepthMethod, MeasureSettings, measure_pair_of_views};
use farnear_depth::operators::Operators;
use farnear_depth::prepare::PrepareSettings;
use farnear_scene::{Camera, Noise, Renderer, Scene, View};
use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SIZE: (usize, usize) = (128, 96);
/// Combinations without `FARNEAR_RANDOM_PLANES`.
const USUAL: u64 = 24;
/// Combinations that were wrong along the rim of the resampled near image, along the border of the image, and by the
/// pixels' share in the blur of a near image that was made much smaller.
const WRONG_BEFORE: [u64; 17] =
    [28, 206, 682, 904, 938, 400, 454, 522, 608, 638, 723, 724, 806, 826, 349, 586, 737];
const CONFIDENT: f32 = 0.5;
/// Negligible error even with a smaller predicted deviation, mm.
const NEGLIGIBLE_MM: f32 = 1.5;

/// Set `FARNEAR_RANDOM_PLANES=1000` for the campaign, or `5000..6000` for other combinations.
#[test]
fn random_planes_and_magnifications_give_no_confident_wrong_plateau() {
    let numbers = std::env::var("FARNEAR_RANDOM_PLANES").map_or(0..USUAL, |text| {
        let (first, end) = text.split_once("..").unwrap_or(("0", &text));
        first.parse().unwrap()..end.parse().unwrap()
    });
    let before = WRONG_BEFORE.into_iter().filter(|number| !numbers.contains(number));
    let count = numbers.clone().count() + before.clone().count();
    let optics = rig(PSF);
    let operators = Operators::for_optics(&optics).unwrap();
    let lens = lens();
    let mut broken: Vec<String> = Vec::new();
    for number in numbers.clone().chain(before) {
        let mut random = ChaCha8Rng::seed_from_u64(number);
        // Half of the planes in and near the range of 887 to 933 mm, half anywhere.
        let depth: f64 = if number % 2 == 0 {
            random.random_range(870.0..950.0)
        } else {
            random.random_range(600.0..1500.0)
        };
        let magnification: f64 = random.random_range(0.9..1.1);
        let scene: Scene = format!("plane:{depth:.2}").parse().unwrap();
        let camera = Camera::new(SIZE.0, SIZE.1, Noise::EightBit);
        let renderer = Renderer::new(&scene, &lens, &PSF.parse().unwrap(), &camera, number).unwrap();
        let scaled = |codes: Array2<u16>| codes.mapv(|code| f32::from(code) / 255.0);
        let far = scaled(renderer.expose(lens.sensor_far_mm, 0).unwrap());
        let view = View { magnification, ..View::default() };
        let near = scaled(renderer.seen_by(view).expose(lens.sensor_near_mm, 1).unwrap());
        for (method, window) in
            [(DepthMethod::Rational(&operators), Window::Fixed(7)), (DepthMethod::Whitened, Window::Adaptive)]
        {
            let prepare = PrepareSettings { limits: Some([0.0, 1.0]), ..PrepareSettings::default() };
            let settings = MeasureSettings { prepare, window, ..MeasureSettings::default() };
            let Ok(found) = measure_pair_of_views(far.view(), near.view(), &optics, method, None, &settings)
            else {
                continue; // A refused pair is not a wrong depth.
            };
            let wrong = found.map.depth_mm.indexed_iter().filter(|(at, found_mm)| {
                let off = (**found_mm - depth as f32).abs();
                off > NEGLIGIBLE_MM
                    && off > 3.0 * found.validity.deviation_mm[*at]
                    && found.map.confidence[*at] >= CONFIDENT
            });
            let part = wrong.count() as f64 / (SIZE.0 * SIZE.1) as f64;
            if part >= 0.02 {
                broken.push(format!("{number}: {depth:.1} mm, size {magnification:.3}, {window}: {part:.3}"));
            }
        }
    }
    assert!(broken.is_empty(), "{} of {count}:\n{}", broken.len(), broken.join("\n"));
}
