//! Rejected input, invalid pixels, and irrelevant differences.

#![allow(clippy::unwrap_used)] // Helpers of tests may fail like tests.

use crate::common::{Texture, eight_bit, rig};
use farnear_depth::measure::{DepthMethod, MeasureError, MeasureSettings, measure_pair};
use farnear_depth::operators::{Operators, Request, design};
use farnear_depth::optics::{Optics, Stage};
use farnear_depth::pipeline::{DepthMap, RunError, Settings, Warning, depth_from_pair};
use farnear_depth::prepare::CameraFrames;
use ndarray::{Array2, s};

const ALPHA: f64 = 0.4;

struct Bench {
    optics: Optics,
    operators: Operators,
    pair: [Array2<f32>; 2],
}

impl Bench {
    fn new(side_px: usize) -> Self {
        let optics = rig("gaussian:k=0.4578");
        let operators = Operators::for_optics(&optics).unwrap();
        let pair = Texture::sand(side_px, 7).pair(optics.psf(), optics.max_blur_px(), ALPHA);
        Self { optics, operators, pair }
    }

    fn run(&self, far: &Array2<f32>, near: &Array2<f32>) -> Result<DepthMap, RunError> {
        depth_from_pair(far.view(), near.view(), &self.operators, &self.optics, &Settings::default())
    }
}

#[test]
fn pairs_that_cannot_be_processed_are_refused_with_the_values() {
    let bench = Bench::new(32);
    let [far, near] = &bench.pair;
    let error = bench.run(far, &near.slice(s![..30, ..]).to_owned()).unwrap_err();
    assert!(error.to_string().contains("32x32") && error.to_string().contains("32x30"), "{error}");
    let [small_far, small_near] = bench.pair.each_ref().map(|i| i.slice(s![..15, ..]).to_owned());
    assert_eq!(bench.run(&small_far, &small_near).unwrap_err(), RunError::TooSmall { width: 32, height: 15 });
    let constant = Array2::from_elem(far.dim(), 255.0);
    assert_eq!(bench.run(far, &constant).unwrap_err(), RunError::Constant { which: "near", value: 255.0 });
    assert_eq!(bench.run(&(far * f32::NAN), near).unwrap_err(), RunError::NothingFinite);
    // Both clipped: more than one image given twice.
    let (both, settings) = ([constant.clone(), constant], MeasureSettings::default());
    let error = measure_pair(both, &bench.optics, DepthMethod::Whitened, None, &settings).unwrap_err();
    assert_eq!(error, MeasureError::Run(RunError::Constant { which: "far", value: 255.0 }));
    for settings in [
        Settings { smoothing_px: 4, ..Settings::default() },
        Settings { smoothing_px: 101, ..Settings::default() },
        Settings { median_px: 9, ..Settings::default() },
    ] {
        let error =
            depth_from_pair(far.view(), near.view(), &bench.operators, &bench.optics, &settings).unwrap_err();
        assert!(matches!(error, RunError::Window { .. }), "{error}");
    }
}

#[test]
fn operators_for_another_blur_or_psf_are_noticed() {
    let bench = Bench::new(32);
    let [far, near] = &bench.pair;
    let request = Request { max_blur_px: 2.0, ..*bench.operators.request() };
    let operators = design(&request).unwrap();
    let error = depth_from_pair(far.view(), near.view(), &operators, &bench.optics, &Settings::default())
        .unwrap_err();
    assert!(matches!(error, RunError::BlurMismatch { .. }), "{error}");
    let optics = rig("pillbox");
    let map =
        depth_from_pair(far.view(), near.view(), &bench.operators, &optics, &Settings::default()).unwrap();
    assert!(matches!(map.warnings[..], [Warning::PsfMismatch { .. }]), "{:?}", map.warnings);
}

#[test]
fn the_smallest_image_gives_a_depth() {
    let bench = Bench::new(16);
    let [far, near] = &bench.pair;
    let map = bench.run(far, near).unwrap();
    let truth = bench.optics.depth_mm(ALPHA) as f32;
    // The middle only: the image repeats at its borders, the run time reflects them.
    for depth in map.depth_mm.slice(s![6..10, 6..10]) {
        assert!((depth - truth).abs() < 8.0, "{depth} for {truth}");
    }
}

#[test]
fn a_common_gain_and_offset_do_not_matter() {
    let bench = Bench::new(64);
    let [far, near] = &bench.pair;
    let plain = bench.run(far, near).unwrap();
    for (gain, offset) in [(255.0, 0.0), (65_535.0, 100.0), (1e-12, 0.0), (1e12, 0.0)] {
        let [far, near] = bench.pair.each_ref().map(|i| i.mapv(|v| v * gain + offset));
        let map = bench.run(&far, &near).unwrap();
        for (a, b) in plain.depth_mm.iter().zip(&map.depth_mm) {
            // Rounding of the input alone: 2^-24 of values whose texture is a few hundredths of them.
            assert!((a - b).abs() < 0.02, "{a} {b} at gain {gain}");
        }
        for (a, b) in plain.confidence.iter().zip(&map.confidence) {
            assert!((a - b).abs() < 1e-3);
        }
    }
}

/// Squares of 2^64 and of 2^-75 are beyond f32.
#[test]
fn magnitudes_whose_squares_are_beyond_f32_do_not_matter() {
    let Bench { optics, pair, .. } = Bench::new(64);
    let depth = |factor: f32| {
        let pair = pair.each_ref().map(|image| image * factor);
        let settings = MeasureSettings::default();
        measure_pair(pair, &optics, DepthMethod::Whitened, None, &settings).unwrap().map.depth_mm
    };
    let plain = depth(1.0);
    assert!(plain.iter().filter(|depth| depth.is_finite()).count() > 2000);
    for exponent in [64.0_f32, 90.0, -90.0] {
        for (a, b) in plain.iter().zip(&depth(exponent.exp2())) {
            assert!(a.is_nan() && b.is_nan() || (a - b).abs() < 0.02, "{a} {b} at 2^{exponent}");
        }
    }
}

#[test]
fn around_an_invalid_pixel_there_is_no_depth_and_no_confidence() {
    let bench = Bench::new(64);
    let [mut far, near] = bench.pair.clone();
    let clean = bench.run(&far, &near).unwrap();
    far[(30, 20)] = f32::NAN;
    far[(5, 60)] = f32::INFINITY;
    let map = bench.run(&far, &near).unwrap();
    assert!(matches!(map.warnings[..], [Warning::NotFinite { pixels: 2 }]), "{:?}", map.warnings);
    // Two 7x7 kernels and a 7x7 window reach 9 px; the median one more.
    for ((y, x), depth) in map.depth_mm.indexed_iter() {
        let distance = |(py, px): (usize, usize)| y.abs_diff(py).max(x.abs_diff(px));
        let nearest = distance((30, 20)).min(distance((5, 60)));
        assert_eq!(depth.is_nan(), nearest <= 9, "({x}, {y})");
        assert_eq!(depth.is_nan(), map.confidence[(y, x)] == 0.0);
        if nearest > 10 {
            assert!((depth - clean.depth_mm[(y, x)]).abs() < 0.02);
        }
    }
}

#[test]
fn saturated_patches_have_no_depth() {
    let bench = Bench::new(64);
    let [mut far, mut near] = bench.pair.clone();
    for image in [&mut far, &mut near] {
        image.slice_mut(s![20..32, 20..32]).fill(3.0);
    }
    let map = bench.run(&far, &near).unwrap();
    assert!(matches!(map.warnings[..], [Warning::Saturated { .. }]), "{:?}", map.warnings);
    assert!(map.depth_mm.slice(s![20..32, 20..32]).iter().all(|d| d.is_nan()));
    assert!(map.confidence.slice(s![20..32, 20..32]).iter().all(|c| *c == 0.0));
    assert!(map.depth_mm[(50, 50)].is_finite());
}

#[test]
fn a_textureless_patch_has_no_confidence_and_counts_as_low_texture() {
    let bench = Bench::new(96);
    let [far, near] = bench.pair.each_ref().map(|i| {
        let mut image = i.clone();
        image.slice_mut(s![20..60, 20..60]).fill(1.0);
        image
    });
    let map = bench.run(&far, &near).unwrap();
    // The patch without the reach of 9 px around it: 22 x 22 px.
    assert!(map.confidence.slice(s![29..51, 29..51]).iter().all(|c| *c < 1e-3));
    assert!(
        map.depth_mm.slice(s![29..51, 29..51]).iter().all(|d| d.is_nan()),
        "a textureless pixel has no depth"
    );
    let whole = (96 * 96) as f64;
    assert!(
        (400.0 / whole..1_600.0 / whole).contains(&map.low_texture_fraction),
        "{}",
        map.low_texture_fraction
    );
    assert!(map.confidence[(80, 80)] > 0.5);
}

#[test]
fn a_textureless_disc_is_filled_from_its_surroundings() {
    let bench = Bench::new(32);
    let truth = bench.optics.depth_mm(ALPHA) as f32;
    let texture = Texture::sand(160, 7).with_even_disc(30.0);
    let pair = texture.pair(bench.optics.psf(), bench.optics.max_blur_px(), ALPHA);
    for noisy in [false, true] {
        let [far, near] =
            [0, 1].map(|i| if noisy { eight_bit(&pair[i], 5 + i as u64) } else { pair[i].clone() });
        let settings = Settings { fill: true, ..Settings::default() };
        let map =
            depth_from_pair(far.view(), near.view(), &bench.operators, &bench.optics, &settings).unwrap();
        let inner = map.depth_mm.slice(s![65..95, 65..95]);
        let rmse = (inner.iter().map(|d| (d - truth).powi(2)).sum::<f32>() / inner.len() as f32).sqrt();
        println!("noisy {noisy}: RMSE inside the disc {rmse:.3} mm");
        assert!(rmse < 0.25, "noisy {noisy}: {rmse}");
        assert!(map.confidence.slice(s![65..95, 65..95]).iter().all(|c| *c > 0.0 && *c < 0.5));
    }
}

#[test]
fn a_learned_lens_averages_pixels_of_a_corrected_camera() {
    let Bench { optics, pair, .. } = Bench::new(96);
    let lens = optics.with_stage(Stage::identity(2, 1));
    let fine = |image: &Array2<f32>| Array2::from_shape_fn((192, 192), |(y, x)| 0.5 * image[(y / 2, x / 2)]);
    let response = Array2::from_shape_fn((192, 192), |(y, x)| 1.0 + ((y * 131 + x * 71) % 17) as f32 / 160.0);
    let hot = Array2::from_shape_fn((192, 192), |at| at == (90, 101));
    let frames = CameraFrames::new(Array2::zeros((192, 192)), response.clone(), hot.clone()).unwrap();
    let depth = |images: [Array2<f32>; 2], camera: Option<&CameraFrames>| {
        let mut settings = MeasureSettings::default();
        settings.prepare.limits = Some([0.0, 1.0]);
        measure_pair(images, &lens, DepthMethod::Whitened, camera, &settings).unwrap().map.depth_mm
    };
    let even = depth(pair.each_ref().map(fine), None);
    let recorded = |image: &Array2<f32>| {
        let mut seen = fine(image) * &response;
        seen.zip_mut_with(&hot, |value, hot| *value = if *hot { 1.0 } else { *value });
        seen
    };
    let corrected = depth(pair.each_ref().map(recorded), Some(&frames));
    assert_eq!(corrected.dim(), (96, 96));
    let apart = (&corrected - &even).fold(0.0_f32, |most, apart| most.max(apart.abs()));
    assert!(apart < 0.1, "{apart} mm");
    assert!(even.iter().filter(|depth| depth.is_finite()).count() > 8000);
    assert!(even.iter().zip(&corrected).all(|(a, b)| a.is_finite() == b.is_finite()));
}

#[test]
fn a_texture_unlike_the_target_s_is_reported() {
    let Bench { optics, pair, .. } = Bench::new(64);
    for (coarseness, expected) in [
        (None, None),
        (Some([-2.0, 4.0]), None),
        (Some([3.0, 4.0]), Some("texture is finer")),
        (Some([-3.0, -2.0]), Some("texture is coarser")),
    ] {
        let lens = optics.with_stage(Stage { coarseness, ..Stage::identity(1, 1) });
        let settings = MeasureSettings::default();
        let found = measure_pair(pair.clone(), &lens, DepthMethod::Whitened, None, &settings).unwrap();
        let findings = found.findings.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
        assert_eq!(
            findings.contains("most of the texture"),
            expected.is_some(),
            "{coarseness:?}: {findings}"
        );
        assert!(findings.contains(expected.unwrap_or_default()), "{coarseness:?}: {findings}");
    }
}
