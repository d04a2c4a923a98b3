use super::*;
use crate::{
    optics::{OpticsFile, Stage},
    prepare::{Report, noise::PairNoise},
};

/// Rounding of single precision, over some operations.
const ROUNDING: f32 = 1e-5;

fn optics() -> Optics {
    let file: OpticsFile = toml::from_str(
        "[lens]\nfocal_length_mm = 50.0\naperture_mm = 12.8\n[sensor]\npixel_um = 7.4\n\
         [focus]\nfar_mm = 933.0\nmax_blur_px = 2.703\n[psf]\nmodel = \"gaussian\"\nk = 0.4578\n",
    )
    .unwrap();
    file.check().unwrap()
}

/// A map, its pair and its estimate, to be changed before they are judged.
struct Case {
    optics: Optics,
    map: DepthMap,
    prepared: Prepared,
    estimate: Estimate,
    settings: ValiditySettings,
}

fn outdoors() -> Optics {
    let file: OpticsFile = toml::from_str(
        "[lens]\nfocal_length_mm = 8.0\nf_number = 1.6\n[sensor]\npixel_um = 5.0\n[focus]\nfar_mm = 30000.0\nnear_mm = 1000.0\n",
    )
    .unwrap();
    file.check().unwrap()
}

impl Case {
    /// Every pixel in the middle of the range, with a standard deviation of alpha of 0.01 by noise, which explains all.
    fn new(size: (usize, usize)) -> Self {
        let optics = optics();
        let depth_mm = Array2::from_elem(size, optics.depth_mm(0.0) as f32);
        let slope_mm = optics.depth_per_alpha_mm(0.0).abs() as f32;
        let map = DepthMap {
            depth_mm: depth_mm.clone(),
            confidence: Array2::from_elem(size, 0.5),
            filled: None,
            low_texture_fraction: f64::NAN,
            warnings: Vec::new(),
        };
        let grey = Array2::from_elem(size, 0.5);
        let prepared = Prepared {
            far: grey.clone(),
            near: grey,
            reasons: Array2::zeros(size),
            noise: PairNoise::default(),
            report: Report::default(),
        };
        let estimate = Estimate {
            depth_mm,
            deviation_mm: Array2::from_elem(size, 0.01 * slope_mm),
            misfit: Array2::from_elem(size, 1.0),
            left_over: f64::from(USUAL_LEFT_OVER),
            excess: 1.0,
            noise_part: 0.0,
        };
        Self { optics, map, prepared, estimate, settings: ValiditySettings::default() }
    }

    fn slope_mm(&self) -> f32 {
        self.optics.depth_per_alpha_mm(0.0).abs() as f32
    }

    fn judged(mut self) -> (DepthMap, Validity) {
        let Self { prepared, estimate, optics, settings, .. } = self;
        let validity = assess(&mut self.map, &prepared, estimate, &optics, &settings);
        (self.map, validity)
    }

    /// The standard deviations of alpha of the first row.
    fn deviations(self) -> Vec<f32> {
        let slope_mm = self.slope_mm();
        self.judged().1.deviation_mm.row(0).iter().map(|mm| mm / slope_mm).collect()
    }
}

fn assert_close(found: &[f32], expected: &[f32]) {
    let close = |(a, b): (&f32, &f32)| (a - b).abs() < ROUNDING * b.abs();
    assert!(found.len() == expected.len() && found.iter().zip(expected).all(close), "{found:?} {expected:?}");
}

#[test]
fn a_deviation_grows_with_its_misfit_and_with_what_the_model_leaves_everywhere() {
    let case = |left_over| {
        let mut case = Case::new((1, 3));
        case.estimate.misfit = ndarray::array![[0.5, 1.0, 4.0]];
        case.estimate.left_over = left_over;
        case.deviations()
    };
    // A residual below the noise says nothing, nor does a model better than usual.
    for left_over in [3e-4, 1e-4] {
        assert_close(&case(left_over), &[0.01, 0.01, 0.02]);
    }
    // 1e-4 above the usual is 0.01 squared; its difference has five digits.
    let found = case(4e-4);
    let expected = [0.01_f32, 0.01, 0.02].map(|noise| noise.hypot(0.01));
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3 * b), "{found:?}");
}

#[test]
fn a_learned_deviation_is_the_residual_of_the_target_or_more() {
    let mut case = Case::new((1, 3));
    let stage = Stage { residual: 0.02, usual_unexplained: 1e-4, ..Stage::identity(1, 1) };
    case.optics = case.optics.with_stage(stage);
    // Unexplained: none, the usual, and four times the usual.
    case.estimate.misfit = ndarray::array![[1.0, 2.0, 5.0]];
    let expected = [0.02, 0.02, 0.04].map(|model: f32| model.hypot(0.01));
    assert_close(&case.deviations(), &expected);
}

#[test]
fn filled_pixels_are_kept_only_where_filling_was_requested() {
    let filled = |requested| {
        let mut case = Case::new((1, 3));
        // Filled, filled without success, measured.
        case.map.filled = Some(ndarray::array![[true, true, false]]);
        case.map.depth_mm[(0, 1)] = f32::NAN;
        case.estimate.deviation_mm.slice_mut(ndarray::s![0, ..2]).fill(f32::NAN);
        case.settings.filled = requested;
        let (slope_mm, depth) = (case.slope_mm(), case.map.depth_mm[(0, 0)]);
        let (map, validity) = case.judged();
        assert!(map.depth_mm[(0, 1)].is_nan() && map.depth_mm[(0, 2)] == depth);
        (map, validity.reasons, validity.deviation_mm[(0, 0)] / slope_mm, depth)
    };
    let (map, reasons, deviation, depth) = filled(true);
    assert_eq!((map.depth_mm[(0, 0)], map.confidence[(0, 0)], reasons[(0, 0)]), (depth, 0.5, 0));
    assert_close(&[deviation], &[FILLED_DEVIATION]);
    assert!(map.filled.is_some() && reasons[(0, 1)] == Reason::NoTexture.code());
    let (map, reasons, deviation, _) = filled(false);
    assert!(map.depth_mm[(0, 0)].is_nan() && deviation.is_nan() && map.filled.is_none());
    assert_eq!(reasons[(0, 0)], Reason::NoTexture.code());
}

#[test]
fn depths_are_valid_a_tenth_beyond_either_focus() {
    let mut case = Case::new((1, 4));
    for (depth, alpha) in case.map.depth_mm.iter_mut().zip([-1.11, -1.09, 1.09, 1.11]) {
        *depth = case.optics.depth_mm(alpha) as f32;
    }
    let (map, validity) = case.judged();
    let out = Reason::OutOfRange.code();
    assert_eq!(validity.reasons, ndarray::array![[out, 0, 0, out]]);
    assert_eq!(map.depth_mm.mapv(f32::is_finite), ndarray::array![[false, true, true, false]]);
    assert_eq!(validity.valid_fraction, 0.5);
}

/// A camera outdoors, whose depth changes with alpha 40 times as much near the far focus as in the middle of alpha.
#[test]
fn noise_of_alpha_is_judged_by_the_slope_at_its_depth() {
    let mut case = Case::new((1, 3));
    case.optics = outdoors();
    let slopes = [-0.9, 0.0, 0.9].map(|alpha| case.optics.depth_per_alpha_mm(alpha).abs() as f32);
    assert!(slopes[0] > 30.0 * slopes[1]);
    for (at, alpha) in [-0.9, 0.0, 0.9].into_iter().enumerate() {
        case.map.depth_mm[(0, at)] = case.optics.depth_mm(alpha) as f32;
        case.estimate.deviation_mm[(0, at)] = 0.05 * slopes[at];
    }
    let (map, validity) = case.judged();
    assert_eq!(validity.reasons, ndarray::array![[0, 0, 0]]);
    let confidence = map.confidence[(0, 1)];
    assert!(
        map.confidence.iter().all(|of_other| (of_other / confidence - 1.0).abs() < 1e-3),
        "{:?}",
        map.confidence
    );
}

/// The far focus of a camera outdoors: a tenth beyond it lies beyond infinity, where depths are negative.
#[test]
fn depths_are_valid_up_to_infinity() {
    let mut case = Case::new((1, 4));
    case.optics = outdoors();
    let deviation_mm = 0.01 * case.slope_mm();
    case.estimate.deviation_mm.fill(deviation_mm);
    for (depth, alpha) in case.map.depth_mm.iter_mut().zip([-1.09, -1.0, 0.0, 1.11]) {
        *depth = case.optics.depth_mm(alpha) as f32;
    }
    assert!(case.map.depth_mm[(0, 0)] < 0.0);
    let out = Reason::OutOfRange.code();
    assert_eq!(case.judged().1.reasons, ndarray::array![[out, 0, 0, out]]);
}

#[test]
fn a_hole_has_the_reason_that_is_near_and_the_first_of_several() {
    let [saturated, moved, out] = [Reason::Saturated, Reason::Moved, Reason::OutOfRange].map(Reason::code);
    let mut case = Case::new((8, 100));
    // A pixel with a reason says nothing.
    for (x, code) in [(10, moved), (40, saturated), (90, out)] {
        case.prepared.reasons[(4, x)] = code;
    }
    // Within the search of both, of one each at its end, and of neither.
    let holes = [(20, saturated), (15, moved), (64, saturated), (65, 0), (88, 0)];
    for x in holes.map(|hole| hole.0).into_iter().chain([10, 40, 90]) {
        case.map.depth_mm[(4, x)] = f32::NAN;
    }
    let (map, validity) = case.judged();
    for (x, code) in holes {
        let expected = if code == 0 { Reason::NoTexture.code() } else { code };
        assert_eq!(validity.reasons[(4, x)], expected, "column {x}");
    }
    assert_eq!(validity.reasons.iter().filter(|code| **code != 0).count(), 8, "the others keep their depth");
    assert_eq!(map.low_texture_fraction, 2.0 / 800.0);
}

#[test]
fn lost_pixels_are_counted_by_reason() {
    let [saturated, dark, unsure] = [Reason::Saturated, Reason::Dark, Reason::Unsure].map(Reason::code);
    let reasons = ndarray::array![
        [0, 0, 0, 0, 0],
        [saturated, saturated, 0, 0, 0],
        [saturated, dark, unsure, 0, 0],
        [unsure, 0, 0, 0, 0]
    ];
    let lost = lost_pixels(&reasons);
    let expected = [(Reason::Saturated, 3.0), (Reason::Dark, 1.0), (Reason::Unsure, 2.0)];
    let expected =
        expected.map(|(reason, count)| Lost { reason, code: reason.code(), fraction: count / 20.0 });
    assert_eq!(lost, expected);
    assert_eq!(lost_pixels(&Array2::zeros((3, 4))), []);
}

/// With a slope of 30 mm at 900 mm: 3.6 mm of noise, 10.8 mm with the model's error, misfit 60.
#[test]
fn depths_are_believed_up_to_each_limit_and_no_further() {
    let range = Believed {
        far_mm: 950.0,
        near_mm: 880.0,
        focal_length_mm: 50.0,
        steepness: 30.0 / (850.0 * 850.0),
        largest_deviation: LARGEST_DEVIATION,
        largest_misfit: LARGEST_MISFIT,
    };
    let of_range = |range, depth, [noise, deviation]: [f32; 2], misfit, least| {
        let mut codes = Backend::available().into_iter().map(|backend| {
            let (mut depth, mut deviation, mut confidence, mut reason) = ([depth], [deviation], [0.0], [0]);
            let maps = [&mut depth[..], &mut confidence, &mut deviation];
            simd::believe_row(backend, range, least, &[noise], &[misfit], &mut reason, maps);
            assert_eq!(
                reason == [0],
                depth[0].is_finite() && confidence[0] > 0.0 && deviation[0].is_finite()
            );
            reason[0]
        });
        let first = codes.next().unwrap();
        assert!(codes.all(|code| code == first));
        first
    };
    let verdict = |depth, deviations_mm, misfit| of_range(range, depth, deviations_mm, misfit, 0.0);
    let believed = |code: u8| code == 0;
    let why = |code: u8| Reason::ALL.into_iter().find(|reason| reason.code() == code);
    assert!(believed(verdict(900.0, [0.3, 0.3], 59.0)));
    assert_eq!(why(verdict(900.0, [0.3, 0.3], 61.0)), Some(Reason::Misfit));
    let learned = Believed { largest_misfit: f32::INFINITY, ..range };
    assert!(believed(of_range(learned, 900.0, [0.3, 0.3], 61.0, 0.0)), "the deviation has the model's error");
    assert!(believed(verdict(900.0, [3.5, 3.5], 1.0)));
    assert_eq!(why(verdict(900.0, [3.7, 3.7], 1.0)), Some(Reason::NoTexture));
    assert_eq!(why(verdict(900.0, [f32::NAN, 0.3], 1.0)), Some(Reason::NoTexture));
    assert!(believed(verdict(900.0, [0.3, 10.7], 1.0)));
    assert_eq!(why(verdict(900.0, [0.3, 10.9], 1.0)), Some(Reason::Misfit));
    for depth in [880.0, 950.0] {
        assert!(believed(verdict(depth, [0.3, 0.3], 1.0)), "{depth}");
    }
    for depth in [879.9, 950.1] {
        assert_eq!(why(verdict(depth, [0.3, 0.3], 1.0)), Some(Reason::OutOfRange), "{depth}");
    }
    assert_eq!(why(of_range(range, 900.0, [0.3, 0.3], 1.0, 1.0)), Some(Reason::Unsure));
}
