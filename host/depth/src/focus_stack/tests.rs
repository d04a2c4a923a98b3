use super::{tip::place_of, *};

#[test]
fn the_tip_of_a_gaussian_curve_is_found_between_the_images() {
    for (tip_at, width, floor) in [(7.3_f32, 2.0_f32, 0.0_f32), (4.45, 3.0, 0.0), (8.0, 1.2, 0.02)] {
        let curve: Vec<f32> =
            (0..16).map(|i| floor + 3.0 * (-0.5 * ((i as f32 - tip_at) / width).powi(2)).exp()).collect();
        let found = tip(&curve, &even(curve.len()), 11);
        assert!((found.place - tip_at).abs() < 0.02, "{found:?} for {tip_at}");
        assert!(found.reliability > 0.4, "{found:?}");
    }
}

fn even(count: usize) -> Vec<f64> {
    (0..count).map(|index| index as f64).collect()
}

#[test]
fn the_tip_is_fitted_over_uneven_positions() {
    let positions = [0.0, 1.0, 2.0, 4.0, 5.0, 5.5, 6.0, 8.0, 11.0, 12.0];
    for sign in [1.0, -1.0] {
        let positions = positions.map(|p| sign * p);
        for tip_at in [3.1, 4.6, 5.2, 7.3, 9.0] {
            let value = |p: &f64| (1.0 / (1.0 + ((p - sign * tip_at) / 2.0).powi(2))) as f32;
            let curve: Vec<f32> = positions.iter().map(value).collect();
            let found = tip(&curve, &positions, 11);
            let place = place_of(&positions, sign * tip_at);
            assert!((f64::from(found.place) - place).abs() < 1e-5, "{found:?} for {tip_at}, {place}");
        }
    }
}

/// Expected: numpy's `polyfit` with the square roots of the weights of `tip`.
#[test]
fn place_and_reliability_are_those_of_weighted_least_squares() {
    let positions = [0.0, 1.0, 2.5, 3.0, 5.0, 6.5, 7.5];
    let curve = [0.2, 0.5, 0.9, 1.0, 0.7, 0.3, 0.1];
    let gap = [0.2, 0.5, 0.9, 1.0, 0.7, f32::NAN, 0.1];
    for (curve, fit_points, position, reliability) in [
        (curve, 5, 3.379_715_1, 0.470_045_5),
        (curve, 7, 3.403_125_5, 0.468_764_5),
        (gap, 5, 3.397_404_5, 0.432_171_9),
        (gap, 7, 3.416_134_2, 0.431_725_1),
        ([0.3, f32::NAN, 0.9, 1.0, 0.4, 0.5, 0.2], 7, 3.503_071_1, 0.341_238_8),
    ] {
        let found = tip(&curve, &positions, fit_points);
        assert!((f64::from(found.place) - place_of(&positions, position)).abs() < 1e-5, "{found:?}");
        assert!((found.reliability - reliability).abs() < 1e-5 && found.sharpness == 1.0, "{found:?}");
    }
}

#[test]
fn a_curve_with_two_peaks_or_a_minimum_is_unreliable_but_rises() {
    // Its parabola has a maximum 3.5 images from the largest value; then none at all.
    let positions = [0.0, 1.0, 2.5, 3.0, 5.0, 6.5, 7.5];
    let far = [0.3, f32::NAN, 0.9, 1.0, 0.4, 0.5, 0.2];
    let two = [0.1, 0.2, 0.95, 0.9, 0.93, 1.0, 0.97, 0.1, 0.1];
    for (found, largest, rise) in
        [(tip(&far, &positions, 5), 3.0, 0.45), (tip(&two, &even(9), 7), 5.0, 0.416_666)]
    {
        assert_eq!((found.place, found.reliability), (largest, 0.0));
        assert!((found.rise - rise).abs() < 1e-5, "{found:?}");
    }
}

#[test]
fn a_curve_without_a_tip_says_how_far_it_rises_where_it_was_seen() {
    let unseen = f32::NAN;
    let rise = |curve: &[f32]| tip(curve, &even(curve.len()), 5).rise;
    assert_eq!(rise(&[0.0; 5]), 0.0);
    // Sharpest at either end.
    assert_eq!((rise(&[1.0, 0.5, 0.5, 0.0]), rise(&[0.5, 0.5, 0.0, 1.0])), (0.5, 0.5));
    // Seen by fewer than half, by half, but not next to the sharpest image.
    assert_eq!(rise(&[unseen, unseen, unseen, 0.25, 1.0, 0.25, unseen]), 0.0);
    assert_eq!(rise(&[unseen, unseen, unseen, 0.25, 1.0, 0.25]), 0.5);
    assert_eq!(rise(&[0.1, 0.2, 1.0, unseen, 0.3, 0.1]), 0.0);
    assert_eq!(rise(&[0.1, unseen, 1.0, 0.2, 0.3, 0.1]), 0.0);
}

#[test]
fn images_that_did_not_see_a_pixel_do_not_count() {
    let unseen = f32::NAN;
    let curve = [unseen, 0.1, 0.4, 0.9, 0.8, 0.3, 0.1, unseen];
    let found = tip(&curve, &even(8), 11);
    assert!((found.place - 3.4).abs() < 0.2 && found.reliability > 0.3, "{found:?}");
    // Five of nine are enough.
    let half = [unseen, unseen, unseen, unseen, 0.1, 0.3, 0.9, 0.3, 0.1];
    assert!(tip(&half, &even(9), 11).reliability > 0.3);
    // The sharpest image's neighbour did not see it; too few did.
    assert_eq!(tip(&[0.1, 0.2, 0.9, unseen, 0.3, 0.1], &even(6), 11).reliability, 0.0);
    assert_eq!(tip(&[unseen, unseen, unseen, unseen, 0.3, 0.9, 0.3], &even(7), 11).reliability, 0.0);
    assert_eq!(tip(&[unseen; 5], &even(5), 11).reliability, 0.0);
}

#[test]
fn a_border_that_few_images_saw_has_no_depth() {
    let image = |number: usize| {
        Array2::from_shape_fn((40, 60), |(y, x)| {
            let noise = ((x * 7919 + y * 104_729 + x * y * 13) % 101) as f32 / 101.0;
            let seen = x >= 5 || number < 2;
            if seen { 0.4 + 0.3 * noise / (1.0 + (number as f32 - 3.0).powi(2)) } else { f32::NAN }
        })
    };
    let images: Vec<_> = (0..7).map(image).collect();
    let views: Vec<_> = images.iter().map(|image| image.view()).collect();
    let map = depth_from_positions(&views[..], &even(7), &StackSettings::default()).unwrap();
    assert!(map.place.slice(s![.., ..5]).iter().all(|place| place.is_nan()));
    assert!(map.place.slice(s![4..36, 45..56]).iter().all(|place| (place - 3.0).abs() < 0.5));
    assert!(map.all_in_focus.iter().all(|value| value.is_finite()));
    let wrong =
        |positions: &[f64]| depth_from_positions(&views[..], positions, &StackSettings::default()).is_err();
    assert!(wrong(&[0.0, 1.0, 2.0]) && wrong(&[0.0, 1.0, 2.0, 3.0, 3.0, 4.0, 5.0]));
    assert!(wrong(&[1.0; 7]) && wrong(&[0.0, 2.0, 1.0, 3.0, 2.0, 4.0, 3.0]));
}

#[test]
fn curves_with_a_maximum_at_an_end_or_without_one_are_unreliable() {
    let rising: Vec<f32> = (1..12).map(|i| i as f32).collect();
    let at_the_end = tip(&rising, &even(11), 11);
    assert_eq!((at_the_end.place, at_the_end.reliability), (10.0, 0.0));
    assert_eq!(tip(&[0.0; 9], &even(9), 11).reliability, 0.0);
    assert!(tip(&[1.0, 1.01, 0.99, 1.02, 1.0, 1.01, 0.98], &even(7), 7).reliability < 0.05);
}

#[test]
fn bands_make_no_seams() {
    const BAND: usize = 48;
    let image = |number: usize| {
        Array2::from_shape_fn((3 * BAND + 5, 40), |(y, x)| {
            let noise = ((x * 7919 + y * 104_729 + number * 31 + x * y * 13) % 101) as f32 / 101.0;
            0.4 + 0.3 * noise / (1.0 + (number as f32 - 3.0).abs())
        })
    };
    let images: Vec<_> = (0..7).map(image).collect();
    let views: Vec<_> = images.iter().map(|image| image.view()).collect();
    for measure in
        [Sharpness::ModifiedLaplacian, Sharpness::GaussianDerivative, Sharpness::VarianceOfVariance]
    {
        let settings = StackSettings { measure, ..StackSettings::default() };
        let all = curves(&views[..], &even(7), &settings, BAND).unwrap();
        let whole: Vec<_> =
            images.iter().map(|image| measured_over_windows(image.view(), &settings)).collect();
        for at in [(BAND - 1, 20), (BAND, 20), (2 * BAND, 3), (3 * BAND + 4, 39)] {
            let curve: Vec<f32> = whole.iter().map(|map| map[at]).collect();
            let expected = tip(&curve, &even(curve.len()), settings.fit_points).place;
            assert!((all.place[at] - expected).abs() < 1e-2, "{measure} at {at:?}");
        }
    }
}

#[test]
fn weak_texture_under_noise_is_found_by_blurring_first_and_a_median_after() {
    // Coarse texture that fades away from image 4, under noise of single pixels.
    let (size, mut state) = ((60, 80), 11_u32);
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0 - 0.5
    };
    let images: Vec<Array2<f32>> = (0..9)
        .map(|number: i32| {
            let fade = (-0.15 * (number - 4).pow(2) as f32).exp();
            Array2::from_shape_fn(size, |(y, x)| {
                let texture = (0.9 * x as f32).sin() * (0.8 * y as f32).cos();
                0.5 + 0.02 * fade * texture + 0.03 * noise()
            })
        })
        .collect();
    let views: Vec<_> = images.iter().map(|image| image.view()).collect();
    let error = |smoothing_px, median_px| {
        let settings =
            StackSettings { smoothing_px, median_px, min_reliability: 0.0, ..StackSettings::default() };
        let place = depth_from_stack(&views, &settings).unwrap().place;
        place.iter().map(|p| (p - 4.0).abs()).sum::<f32>() / place.len() as f32
    };
    let [plain, blurred, both] = [error(0.0, 1), error(1.0, 1), error(1.0, 9)];
    // The median has little left to do behind the blur.
    assert!(blurred < 0.6 * plain && both < 0.95 * blurred, "{plain} {blurred} {both}");
}

#[test]
fn invalid_stacks_are_rejected_with_the_image_number() {
    let image = Array2::from_elem((32, 40), 0.5_f32);
    let other = Array2::from_elem((32, 41), 0.5_f32);
    let mut broken = image.clone();
    broken[(3, 4)] = f32::NAN;
    let of = |images: &[&Array2<f32>], settings: &StackSettings| {
        let views: Vec<_> = images.iter().map(|image| image.view()).collect();
        depth_from_stack(&views, settings).unwrap_err().to_string()
    };
    let usual = StackSettings::default();
    assert!(of(&[&image, &image], &usual).contains("2 images"));
    assert!(of(&[&image, &image, &other], &usual).contains("image 3 has 41x32 px and the first one 40x32"));
    assert!(of(&[&image, &broken, &image], &usual).contains("image 2: the pixel in column 4, row 3"));
    let even = StackSettings { window_px: 8, ..usual };
    assert!(of(&[&image, &image, &image], &even).contains("the window is 8: an odd number from 3"));
    let blurred = StackSettings { smoothing_px: f32::NAN, ..usual };
    assert!(of(&[&image, &image, &image], &blurred).contains("blurred by NaN px: 0 to 10"));
    let narrow = StackSettings { guided_px: 0.5, ..usual };
    assert!(of(&[&image, &image, &image], &narrow).contains("within 0.5 px: 0 (off) or 1 to 100"));
    let wide = StackSettings { window_px: 33, ..usual };
    assert!(of(&[&image, &image, &image], &wide).contains("smaller than the window of 33"));
}

#[test]
fn points_beyond_the_fit_do_not_move_the_tip() {
    let curve = [0.1, 0.15, 0.3, 0.9, 1.0, 0.6, 0.2, 0.1, 0.1];
    let place = |points, changed: Option<usize>| {
        let mut curve = curve;
        if let Some(at) = changed {
            curve[at] += 0.05;
        }
        tip(&curve, &even(9), points).place
    };
    for (points, reach) in [(3, 1), (5, 2), (7, 3)] {
        let whole = place(points, None);
        for at in (0..9).filter(|at| *at != 4) {
            assert_eq!(
                place(points, Some(at)) == whole,
                at.abs_diff(4) > reach,
                "{points} points, image {at}"
            );
        }
    }
}

#[test]
fn places_end_with_the_stack() {
    for sign in [1.0, -1.0] {
        let positions = [0.0, 1.0, 2.0, 4.0].map(|p| sign * p);
        for (position, place) in [(-1.0, 0.0), (0.0, 0.0), (0.5, 0.5), (3.0, 2.5), (4.0, 3.0), (9.0, 3.0)] {
            assert_eq!(place_of(&positions, sign * position), place, "{position}");
        }
    }
}

#[test]
fn a_pixel_is_mixed_of_two_images_or_is_the_nearest_that_was_seen() {
    let mixed = |values: [f32; 4], place| {
        let images = values.map(|value| Array2::from_elem((1, 1), value));
        let views: Vec<_> = images.iter().map(|image| image.view()).collect();
        between(&views, place, (0, 0))
    };
    for (place, value) in [(0.0, 1.0), (0.25, 1.25), (1.75, 3.5), (2.0, 4.0), (3.0, 8.0)] {
        assert_eq!(mixed([1.0, 2.0, 4.0, 8.0], place), value, "{place}");
    }
    let unseen = f32::NAN;
    for (place, value) in [(0.9, 1.0), (2.2, 8.0), (1.4, 1.0)] {
        assert_eq!(mixed([1.0, unseen, unseen, 8.0], place), value, "{place}");
    }
    assert_eq!(mixed([unseen; 4], 1.0), 0.0);
}

#[test]
fn what_depends_on_a_pixel_that_was_not_seen_has_no_sharpness() {
    // Twice half a window of 9, the measure's own reach of 4 and three standard deviations of the blur.
    for (smoothing_px, reach) in [(1.0, 15), (0.0, 12)] {
        let settings = StackSettings { smoothing_px, ..StackSettings::default() };
        let mut image =
            Array2::from_shape_fn((50, 60), |(y, x)| ((x * 7919 + y * 104_729) % 101) as f32 / 101.0);
        image[(20, 30)] = f32::NAN;
        for ((y, x), value) in measured_over_windows(image.view(), &settings).indexed_iter() {
            assert_eq!(value.is_nan(), y.abs_diff(20).max(x.abs_diff(30)) <= reach, "{x}, {y}");
        }
    }
}

#[test]
fn the_noise_of_a_code_has_its_standard_deviation() {
    // The expected squared difference of independent pixels is twice their variance.
    let settings =
        StackSettings { measure: Sharpness::SquaredGradient, smoothing_px: 0.0, ..StackSettings::default() };
    for step in [0.01_f32, 0.1] {
        let found = noise_floor(step, &settings) / (2.0 * step * step);
        // 4096 pixels give 3 %.
        assert!((found - 1.0).abs() < 0.1, "{found}");
    }
    assert_eq!(noise_floor(0.0, &settings), 0.0);
}

/// Images whose step between codes is known.
struct Coded(Vec<Array2<f32>>, f32);

impl Slices for Coded {
    type Error = StackError;

    fn count(&self) -> usize {
        self.0.len()
    }

    fn dim(&self, index: usize) -> (usize, usize) {
        self.0[index].dim()
    }

    fn rows(
        &self,
        index: usize,
        rows: Range<usize>,
    ) -> Result<ndarray::CowArray<'_, f32, ndarray::Ix2>, StackError> {
        Ok(self.0[index].slice(s![rows, ..]).into())
    }

    fn code_step(&self) -> f32 {
        self.1
    }
}

#[test]
fn detail_below_a_code_is_not_reliable() {
    let image = |number: usize| {
        Array2::from_shape_fn((30, 40), |(y, x)| {
            let mixed = ((y * 40 + x + 1) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let texture = (mixed >> 40) as f32 / (1 << 24) as f32 - 0.5;
            0.5 + 0.1 * texture / (1.0 + (number as f32 - 3.0).powi(2))
        })
    };
    let settings = StackSettings { min_reliability: 0.0, ..StackSettings::default() };
    let reliability = |step| {
        let stack = Coded((0..7).map(image).collect(), step);
        depth_from_positions(&stack, &even(7), &settings).unwrap().reliability[(15, 20)]
    };
    // The texture is uniform over 0.1, its standard deviation 0.03.
    let [all, half, none] = [0.0, 0.015, 0.06].map(reliability);
    assert!(all > 0.5 && none == 0.0, "{all} {none}");
    // The measure of the pixel itself is off by some tens of percent from that of independent noise.
    assert!((0.3..0.7).contains(&(half / all)), "{half} of {all}");
}

#[test]
fn settings_are_valid_up_to_their_limits() {
    let image = Array2::from_elem((120, 120), 0.5_f32);
    let views = [image.view(), image.view(), image.view()];
    let valid = |change: fn(&mut StackSettings)| {
        let mut settings = StackSettings::default();
        change(&mut settings);
        check(&views[..], &settings).is_ok()
    };
    assert!(valid(|s| s.window_px = 3) && valid(|s| s.window_px = 101));
    assert!(!valid(|s| s.window_px = 1) && !valid(|s| s.window_px = 103) && !valid(|s| s.window_px = 10));
    assert!(valid(|s| s.fit_points = 3) && valid(|s| s.fit_points = 31));
    assert!(!valid(|s| s.fit_points = 1) && !valid(|s| s.fit_points = 33));
    assert!(valid(|s| s.median_px = 1) && valid(|s| s.median_px = 31) && !valid(|s| s.median_px = 33));
    assert!(valid(|s| s.smoothing_px = 0.0) && valid(|s| s.smoothing_px = 10.0));
    assert!(!valid(|s| s.smoothing_px = -0.1) && !valid(|s| s.smoothing_px = 10.1));
    assert!(valid(|s| s.guided_px = 0.0) && valid(|s| s.guided_px = 1.0) && valid(|s| s.guided_px = 100.0));
    assert!(!valid(|s| s.guided_px = 0.9) && !valid(|s| s.guided_px = 101.0));
    let small = Array2::from_elem((8, 120), 0.5_f32);
    let views = [small.view(), small.view(), small.view()];
    assert!(check(&views[..], &StackSettings::default()).is_err());
    assert!(check(&views[..], &StackSettings { window_px: 7, ..StackSettings::default() }).is_ok());
}

#[test]
fn the_sharp_image_is_put_together_across_bands() {
    let images: Vec<_> = [0.0, 100.0, 200.0]
        .map(|base| Array2::from_shape_fn((7, 3), |(y, x)| base + (3 * y + x) as f32))
        .into();
    let views: Vec<_> = images.iter().map(|image| image.view()).collect();
    let place = Array2::from_shape_fn((7, 3), |(y, _)| (y % 3) as f32);
    let sharp = sharp_everywhere(&views[..], &place, 2).unwrap();
    assert_eq!(sharp, Array2::from_shape_fn((7, 3), |(y, x)| (100 * (y % 3) + 3 * y + x) as f32));
}
