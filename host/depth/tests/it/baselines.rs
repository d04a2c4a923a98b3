//! Baselines on planes rendered in the Fourier domain, and on invalid input.
#![allow(clippy::unwrap_used)] // Helpers of tests may fail like tests.

use crate::common::{Texture, eight_bit, rig};
use farnear_depth::baselines::{BaselineError, Favaro, FavaroSettings, Method, depth_from_pair};
use farnear_depth::fill::FILLED_CONFIDENCE;
use farnear_depth::optics::Optics;
use farnear_depth::pipeline::{RunError, Settings, Warning};
use ndarray::{Array2, Axis, concatenate, s};

const SIDE: usize = 128;
const BORDER: usize = 16;

fn rmse_mm(method: Method, optics: &Optics, favaro: &Favaro, noise: bool) -> f64 {
    let alphas = [-1.0, -0.6, -0.2, 0.3, 0.7, 1.0];
    let squares = (0..).zip(alphas).map(|(seed, alpha)| {
        let [far, near] = Texture::sand(SIDE, seed).pair(optics.psf(), optics.max_blur_px(), alpha);
        let [far, near] =
            if noise { [eight_bit(&far, seed), eight_bit(&near, 50 + seed)] } else { [far, near] };
        let settings = Settings::default();
        let map = match method {
            Method::Favaro => favaro.depth_from_pair(far.view(), near.view(), optics, &settings).unwrap(),
            _ => depth_from_pair(method, far.view(), near.view(), optics, &settings).unwrap(),
        };
        assert!(map.warnings.is_empty());
        assert!(map.confidence.iter().all(|c| (0.0..=1.0).contains(c)));
        let inner = map.depth_mm.slice(s![BORDER..SIDE - BORDER, BORDER..SIDE - BORDER]);
        let truth = optics.depth_mm(alpha);
        inner.iter().map(|d| (f64::from(*d) - truth).powi(2)).sum::<f64>() / inner.len() as f64
    });
    (squares.sum::<f64>() / alphas.len() as f64).sqrt()
}

/// Limits are about 1.3 times the measured values. Subbarao's methods use only the PSF's second moment, hence their
/// error without noise; for Gaussians the Fourier form is limited by its short window.
#[test]
fn planes_come_out_at_their_depths() {
    for (psf, [moment, ratio, projector], [noisy_moment, noisy_ratio, noisy_projector]) in [
        ("gaussian:k=0.4578", [0.8, 1.6, 0.2], [1.8, 1.8, 0.6]),
        ("pillbox", [1.8, 1.9, 0.3], [2.3, 1.9, 0.6]),
        ("generalised:p=1.8,k=0.4802", [1.5, 2.2, 0.2], [1.9, 2.3, 0.7]),
    ] {
        let optics = rig(psf);
        let favaro = Favaro::learn(&optics, &FavaroSettings::default()).unwrap();
        for (method, clean, noisy) in [
            (Method::Subbarao, moment, noisy_moment),
            (Method::SubbaraoFourier, ratio, noisy_ratio),
            (Method::Favaro, projector, noisy_projector),
        ] {
            let found = [false, true].map(|noise| rmse_mm(method, &optics, &favaro, noise));
            println!("{psf}, {method}: clean {:.3} mm, 8 bit {:.3} mm", found[0], found[1]);
            assert!(found[0] < clean && found[1] < noisy, "{psf} {method}: {found:?}");
        }
    }
}

#[test]
fn a_gain_and_an_offset_in_common_change_nothing_much() {
    let optics = rig("gaussian:k=0.4578");
    let [far, near] = Texture::sand(64, 3).pair(optics.psf(), optics.max_blur_px(), 0.4);
    for method in [Method::Subbarao, Method::SubbaraoFourier] {
        let depth = |gain: f32| {
            let (far, near) = (&far * gain, &near * gain);
            depth_from_pair(method, far.view(), near.view(), &optics, &Settings::default()).unwrap().depth_mm
        };
        let (one, many) = (depth(1.0), depth(180.0));
        assert!(one.iter().zip(&many).all(|(a, b)| (a - b).abs() < 0.02), "{method}");
    }
}

#[test]
fn holes_and_blank_regions_are_marked() {
    let optics = rig("gaussian:k=0.4578");
    let [mut far, mut near] = Texture::sand(SIDE, 3).pair(optics.psf(), optics.max_blur_px(), 0.4);
    far[(20, 20)] = f32::NAN;
    near[(100, 30)] = f32::INFINITY;
    for image in [&mut far, &mut near] {
        image.slice_mut(s![70..118, 70..118]).fill(1.0);
    }
    let favaro = Favaro::learn(&optics, &FavaroSettings { depths: 17, ..FavaroSettings::default() }).unwrap();
    for method in Method::ALL {
        let settings = Settings::default();
        let map = match method {
            Method::Favaro => favaro.depth_from_pair(far.view(), near.view(), &optics, &settings).unwrap(),
            _ => depth_from_pair(method, far.view(), near.view(), &optics, &settings).unwrap(),
        };
        assert_eq!(map.warnings, [Warning::NotFinite { pixels: 2 }]);
        for place in [(20, 20), (22, 19), (100, 30)] {
            assert!(map.depth_mm[place].is_nan() && map.confidence[place] == 0.0, "{method} {place:?}");
        }
        let (blank, textured) = (map.confidence[(94, 94)], map.confidence[(40, 94)]);
        assert!(blank < 0.1 * textured, "{method}: {blank} {textured}");
        assert!(map.low_texture_fraction > 0.02, "{method}: {}", map.low_texture_fraction);
        let depth = map.depth_mm[(48, 40)];
        assert!((f64::from(depth) - optics.depth_mm(0.4)).abs() < 2.5, "{method}: {depth}");
    }
}

#[test]
fn checks_and_filling_are_those_of_the_rational_operators() {
    let optics = rig("gaussian:k=0.4578");
    let [mut far, mut near] = Texture::sand(SIDE, 3).pair(optics.psf(), optics.max_blur_px(), 0.4);
    let top = far.iter().chain(&near).copied().fold(0.0, f32::max);
    far.slice_mut(s![90..100, 80..90]).fill(top);
    for image in [&mut far, &mut near] {
        image.slice_mut(s![12..72, 12..72]).fill(1.0);
    }
    for method in [Method::Subbarao, Method::SubbaraoFourier] {
        let settings = Settings { fill: true, ..Settings::default() };
        let map = depth_from_pair(method, far.view(), near.view(), &optics, &settings).unwrap();
        let [Warning::Saturated { fraction }] = map.warnings[..] else {
            panic!("{method}: {:?}", map.warnings)
        };
        assert!((fraction - 100.0 / (SIDE * SIDE) as f64).abs() < 1e-4, "{method}: {fraction}");
        assert!(map.depth_mm[(95, 85)].is_nan() && map.confidence[(95, 85)] == 0.0, "{method}");
        assert_eq!(map.confidence[(42, 42)], FILLED_CONFIDENCE, "{method}");
        let depth = f64::from(map.depth_mm[(42, 42)]);
        assert!((depth - optics.depth_mm(0.4)).abs() < 2.5, "{method}: {depth}");
    }
    // The lower half is nearer; swapped, it is farther.
    let texture = Texture::sand(SIDE, 3);
    let [[far, near], [lower_far, lower_near]] =
        [-0.7, 0.7].map(|alpha| texture.pair(optics.psf(), optics.max_blur_px(), alpha));
    let halves = |upper: &Array2<f32>, lower: &Array2<f32>| {
        concatenate![Axis(0), upper.slice(s![..SIDE / 2, ..]), lower.slice(s![SIDE / 2.., ..])]
    };
    let [far, near] = [halves(&far, &lower_far), halves(&near, &lower_near)];
    let map =
        depth_from_pair(Method::Subbarao, near.view(), far.view(), &optics, &Settings::default()).unwrap();
    assert!(matches!(map.warnings[..], [Warning::LooksSwapped(_)]), "{:?}", map.warnings);
}

#[test]
fn invalid_settings_are_rejected() {
    let optics = rig("gaussian:k=0.4578");
    let [far, near] = Texture::sand(32, 3).pair(optics.psf(), optics.max_blur_px(), 0.4);
    let settings = Settings::default();
    for method in [Method::Subbarao, Method::SubbaraoFourier] {
        assert_eq!(method.name().parse::<Method>().unwrap(), method);
        let run = |far: &Array2<f32>, near: &Array2<f32>, settings: &Settings| {
            depth_from_pair(method, far.view(), near.view(), &optics, settings).unwrap_err()
        };
        let narrow = near.slice(s![.., 1..]).to_owned();
        let size = RunError::SizeMismatch { far_width: 32, far_height: 32, near_width: 31, near_height: 32 };
        assert_eq!(run(&far, &narrow, &settings), BaselineError::Pair(size));
        let flat = Array2::from_elem((32, 32), 7.0);
        let constant = RunError::Constant { which: "near", value: 7.0 };
        assert_eq!(run(&far, &flat, &settings), BaselineError::Pair(constant));
        let empty = Array2::from_elem((32, 32), f32::NAN);
        assert_eq!(run(&empty, &near, &settings), BaselineError::Pair(RunError::NothingFinite));
        let even = Settings { smoothing_px: 4, ..settings };
        assert!(matches!(run(&far, &near, &even), BaselineError::Pair(RunError::Window { size: 4, .. })));
    }
    let wrong = FavaroSettings { rank: 98, ..FavaroSettings::default() };
    let error = Favaro::learn(&optics, &wrong).unwrap_err();
    assert_eq!(error, BaselineError::Setting { name: "rank", value: 98, least: 10, most: 90 });
    let favaro = Favaro::learn(&optics, &FavaroSettings { depths: 9, ..FavaroSettings::default() }).unwrap();
    let error = favaro.depth_from_pair(far.view(), near.view(), &rig("pillbox"), &settings).unwrap_err();
    assert!(error.to_string().contains("pillbox and 2.703 px"), "{error}");
    assert!("subarao".parse::<Method>().is_err());
}
