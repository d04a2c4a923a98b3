//! Standard deviations of a slant: at the border, and of a pair whose near image is darker.
#![allow(clippy::unwrap_used)] // Helpers of tests may fail like tests.

use farnear_depth::adaptive_window::Window;
use farnear_depth::measure::{DepthMethod, Finding, MeasureSettings, Measurement, measure_pair};
use farnear_depth::prepare::PrepareSettings;
use farnear_scene::{Camera, Noise, Scene, View, truth};
use ndarray::{Array2, Axis, s};

use crate::common::rig;
use crate::measure::{PSF, lens, rendered};

fn measured(images: [Array2<f32>; 2]) -> Measurement {
    let prepare = PrepareSettings { limits: Some([0.0, 1.0]), ..PrepareSettings::default() };
    let settings = MeasureSettings { prepare, window: Window::Adaptive, ..MeasureSettings::default() };
    measure_pair(images, &rig(PSF), DepthMethod::Whitened, None, &settings).unwrap()
}

fn median(map: &Array2<f32>) -> f32 {
    let mut values: Vec<f32> = map.iter().copied().filter(|value| value.is_finite()).collect();
    values.sort_by(f32::total_cmp);
    values[values.len() / 2]
}

#[test]
fn a_darker_near_image_has_the_deviation_of_its_noise() {
    let [far, near] = rendered("slant", View::default(), 1);
    let usual = measured([far.clone(), near.clone()]);
    for gain in [0.8, 0.5] {
        let dark = measured([far.clone(), near.mapv(|value| gain * value)]);
        let ratio = median(&dark.validity.deviation_mm) / median(&usual.validity.deviation_mm);
        // 3.7 and 10.4 by the noise of the dark image.
        assert!((0.9..1.4).contains(&ratio), "{gain}: {ratio}");
        let unexplained = |finding: &Finding| matches!(finding, Finding::Unexplained { .. });
        assert!(!dark.findings.iter().any(unexplained), "{gain}: {:?}", dark.findings);
    }
}

#[test]
fn deviations_at_the_border_cover_its_slope() {
    let scene: Scene = "slant".parse().unwrap();
    let depth_mm = truth(&scene, &lens(), &Camera::new(320, 240, Noise::EightBit));
    let found = measured(rendered("slant", View::default(), 2));
    let mut within = found.map.depth_mm.clone();
    ndarray::Zip::from(&mut within).and(&depth_mm).and(&found.validity.deviation_mm).for_each(
        |depth, truth, deviation| *depth = f32::from(u8::from((*depth - truth).abs() < 3.0 * deviation)),
    );
    for side in [s![.., ..3], s![.., -3..]] {
        let part = within.slice(side).mean_axis(Axis(0)).unwrap();
        // By the deviation of the nearest inner pixel alone, a quarter to two thirds.
        assert!(part.iter().all(|part| *part > 0.75), "{part}");
    }
}
