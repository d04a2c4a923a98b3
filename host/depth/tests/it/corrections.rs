//! Corrections learned from a noisy series of flat targets, tested at other depths.
#![allow(clippy::unwrap_used)] // Helpers of tests may fail like tests.

use crate::common::rig;
use farnear_depth::corrections::{CdcSettings, Correction, CorrectionError, Method, Pattern, fit};
use farnear_depth::metrics::{CompareSettings, compare};
use farnear_depth::optics::Optics;
use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const PATTERNS: usize = 24;
const HELD_OUT: usize = 9;
/// Error of a noisy 8-bit pair, Gaussian PSF, 7x7 smoothing, 3x3 median: 0.6 mm of 46.2 mm for alpha -1 to 1.
const NOISE_ALPHA: f64 = 0.6 / 23.1;

/// Bowl around (0.65, 0.6), deeper at the far end, as in Li 2014, fig. 6.1; x and y in [0, 1].
fn distorted(alpha: f64, x: f64, y: f64) -> f64 {
    let rho2 = ((x - 0.65) / 0.75).powi(2) + ((y - 0.6) / 0.6).powi(2);
    alpha - 0.08 + 0.5 * (0.45 - 0.20 * alpha) * rho2
}

fn box_sum(map: &Array2<f64>, n: isize, (down, right): (isize, isize)) -> Array2<f64> {
    let (h, w) = map.dim();
    Array2::from_shape_fn((h, w), |(y, x)| {
        let at = |k: isize| {
            let y = (y as isize + k * down).clamp(0, h as isize - 1) as usize;
            let x = (x as isize + k * right).clamp(0, w as isize - 1) as usize;
            map[(y, x)]
        };
        (-n..=n).map(at).sum()
    })
}

/// Noise of SD 1 with the correlation of 7x7 and 3x3 smoothing.
fn noise(dim: (usize, usize), rng: &mut ChaCha8Rng) -> Array2<f64> {
    // Uniform numbers: sums over 441 of them are normal.
    let mut map = Array2::from_shape_fn(dim, |_| rng.random::<f64>() - 0.5);
    for n in [3, 1] {
        map = box_sum(&box_sum(&map, n, (0, 1)), n, (1, 0));
    }
    let sd = map.mapv(|v| v * v).mean().unwrap().sqrt();
    map / sd
}

fn target(optics: &Optics, true_mm: f64, dim: (usize, usize), rng: &mut ChaCha8Rng) -> Array2<f32> {
    let (h, w) = dim;
    let noise = noise(dim, rng);
    Array2::from_shape_fn(dim, |(row, column)| {
        let (x, y) = (column as f64 / (w - 1) as f64, row as f64 / (h - 1) as f64);
        let alpha = distorted(optics.alpha(true_mm), x, y) + NOISE_ALPHA * noise[(row, column)];
        optics.depth_mm(alpha.clamp(-1.2, 1.2)) as f32
    })
}

struct Series {
    maps: Vec<(f64, Array2<f32>)>,
    held_out: Vec<(f64, Array2<f32>)>,
}

impl Series {
    fn new(dim: (usize, usize), seed: u64) -> Self {
        let optics = rig("pillbox");
        let range = optics.working_range();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut at = |part: f64| {
            let true_mm = range.far_mm + part * (range.near_mm - range.far_mm);
            (true_mm, target(&optics, true_mm, dim, &mut rng))
        };
        let maps = (0..PATTERNS).map(|i| at(i as f64 / (PATTERNS - 1) as f64)).collect();
        let held_out = (0..HELD_OUT).map(|i| at((i as f64 + 0.5) / HELD_OUT as f64)).collect();
        Self { maps, held_out }
    }

    fn patterns(&self) -> Vec<Pattern<'_>> {
        self.maps.iter().map(|(true_mm, map)| Pattern { depth_mm: map.view(), true_mm: *true_mm }).collect()
    }

    fn rmse_mm(&self, correct: impl Fn(&Array2<f32>) -> Array2<f32>) -> f64 {
        let squares = self.held_out.iter().map(|(true_mm, map)| {
            let corrected = correct(map);
            let truth = Array2::from_elem(map.dim(), *true_mm as f32);
            let settings = CompareSettings { border_px: 16, ..CompareSettings::default() };
            let comparison = compare(corrected.view(), truth.view(), None, &settings).unwrap();
            assert!(comparison.missing_fraction < 0.001, "{true_mm}: {comparison:?}");
            comparison.rmse_mm.powi(2)
        });
        (squares.sum::<f64>() / HELD_OUT as f64).sqrt()
    }
}

#[test]
fn held_out_depths_come_out_flat() {
    let series = Series::new((480, 640), 1);
    let raw = series.rmse_mm(Clone::clone);
    assert!((1.5..2.3).contains(&raw), "raw {raw} mm");
    let raw_patterns = CdcSettings { smoothing_px: 0.0, ..CdcSettings::default() };
    for (method, settings, limit) in [
        (Method::TwoStep, CdcSettings::default(), 0.85),
        (Method::Clsf, CdcSettings::default(), 0.72),
        (Method::ClsfBlend, CdcSettings::default(), 0.72),
        (Method::Cdc, CdcSettings::default(), 0.66),
        (Method::Cdc, raw_patterns, 0.85),
        (Method::ClsfFull, CdcSettings::default(), 0.66),
        (Method::Spline, CdcSettings::default(), 0.66),
    ] {
        let correction = fit(method, &series.patterns(), &settings).unwrap();
        let rmse = series.rmse_mm(|map| correction.apply(map.view()).unwrap());
        println!("{method}: {rmse:.3} mm, raw {raw:.3} mm");
        assert!(rmse <= limit, "{method}: {rmse} mm, raw {raw} mm");
    }
}

/// Without noise, the method's own step is left at the seams.
#[test]
fn blending_leaves_no_step_at_the_seams() {
    let series = Series::new((240, 320), 2);
    let optics = rig("pillbox");
    let step_mm = |method| {
        let correction = fit(method, &series.patterns(), &CdcSettings::default()).unwrap();
        let mut largest = 0.0_f32;
        for true_mm in [930.0, 910.0, 890.0] {
            let raw = Array2::from_shape_fn((240, 320), |(row, column)| {
                let (x, y) = (column as f64 / 319.0, row as f64 / 239.0);
                optics.depth_mm(distorted(optics.alpha(true_mm), x, y)) as f32
            });
            let corrected = correction.apply(raw.view()).unwrap();
            // Regions end at a third and two thirds; at the centres the blend changes its pair.
            for column in [53, 106, 160, 213, 266] {
                for row in 0..240 {
                    largest = largest.max((corrected[(row, column)] - corrected[(row, column - 1)]).abs());
                }
            }
            for row in [40, 80, 120, 160, 200] {
                for column in 0..320 {
                    largest = largest.max((corrected[(row, column)] - corrected[(row - 1, column)]).abs());
                }
            }
        }
        largest
    };
    let (regions, blended, full) =
        (step_mm(Method::Clsf), step_mm(Method::ClsfBlend), step_mm(Method::ClsfFull));
    println!("clsf {regions:.3} mm, clsf-blend {blended:.3} mm, clsf-full {full:.3} mm");
    assert!(regions > 0.3, "{regions}");
    assert!(blended <= 0.2, "{blended}");
    assert!(full <= 0.2, "{full}");
}

#[test]
fn the_board_agrees_to_five_micrometres() {
    let series = Series::new((120, 160), 3);
    for method in [Method::Clsf, Method::ClsfBlend, Method::ClsfFull] {
        let correction = fit(method, &series.patterns(), &CdcSettings::default()).unwrap();
        for (_, map) in &series.held_out {
            let mut map = map.clone();
            map[(7, 9)] = f32::NAN;
            let host = correction.apply(map.view()).unwrap();
            let board = correction.apply_as_board(map.view()).unwrap();
            assert!(board[(7, 9)].is_nan() && host[(7, 9)].is_nan());
            for (host, board) in host.iter().zip(&board).filter(|(host, _)| host.is_finite()) {
                assert!((host - board).abs() <= 0.005, "{method}: {host} {board}");
            }
        }
    }
    for method in Method::ALL.into_iter().filter(|method| method.board_form().is_none()) {
        let correction = fit(method, &series.patterns(), &CdcSettings::default()).unwrap();
        let error = correction.apply_as_board(series.maps[0].1.view()).unwrap_err();
        assert_eq!(error, CorrectionError::NotOnBoard(method));
    }
}

/// The board fits with integers on a subsample: equally good as the host's fit.
#[test]
fn the_boards_own_fit_is_as_good() {
    use farnear_maths::clsf::{Columns, DepthScale, Frame, Full, FullFit, RegionFit, Regions};
    let series = Series::new((240, 320), 8);
    let frame = Frame::new(320, 240).unwrap();
    let range = rig("pillbox").working_range();
    let scale = DepthScale::for_range(range.far_mm as f32, range.near_mm as f32).unwrap();
    let (mut regions, mut full) = (RegionFit::new(frame), FullFit::new(frame));
    let columns = Columns { first: 2, step: 4 };
    for (true_mm, map) in &series.maps {
        let truth = scale.encode(*true_mm as f32);
        for row in (2..240).step_by(4) {
            let codes: Vec<i16> =
                map.row(row).iter().skip(2).step_by(4).map(|mm| scale.encode(*mm)).collect();
            regions.add_row(row as u16, columns, &codes, truth).unwrap();
            full.add_row(row as u16, columns, &codes, truth).unwrap();
        }
    }
    let (regions, full) = (regions.solve().unwrap(), full.solve().unwrap());
    let (mut a, mut b) = (vec![0; 320], vec![0; 960]);
    let (mut regions, mut full) =
        (Regions::new(regions, frame, &mut a).unwrap(), Full::new(full, frame, &mut b).unwrap());
    let mut correct = |map: &Array2<f32>, by_regions: bool| {
        let mut corrected = map.clone();
        for (row, mut depths) in (0..).zip(corrected.outer_iter_mut()) {
            let mut codes: Vec<i16> = depths.iter().map(|mm| scale.encode(*mm)).collect();
            let done = if by_regions {
                regions.correct_row(row, &mut codes)
            } else {
                full.correct_row(row, &mut codes)
            };
            done.unwrap();
            depths.iter_mut().zip(codes).for_each(|(mm, code)| *mm = scale.decode(code));
        }
        corrected
    };
    let mut maps =
        series.held_out.iter().map(|(_, map)| [correct(map, true), correct(map, false)]).collect::<Vec<_>>();
    maps.reverse();
    for (method, limit) in [(Method::Clsf, 0.03), (Method::ClsfFull, 0.01)] {
        let host = fit(method, &series.patterns(), &CdcSettings::default()).unwrap();
        let host = series.rmse_mm(|map| host.apply(map.view()).unwrap());
        let next = std::cell::RefCell::new(maps.clone());
        let which = usize::from(method == Method::ClsfFull);
        let board = series.rmse_mm(|_| next.borrow_mut().pop().unwrap()[which].clone());
        println!("{method}: host {host:.4} mm, board {board:.4} mm");
        assert!((board - host).abs() < limit, "{method}: {host} {board}");
    }
}

#[test]
fn corrections_survive_a_round_trip_through_toml() {
    let series = Series::new((60, 80), 4);
    for method in Method::ALL {
        assert_eq!(method.name().parse::<Method>().unwrap(), method);
        let correction = fit(method, &series.patterns(), &CdcSettings::default()).unwrap();
        let text = toml::to_string(&correction).unwrap();
        let loaded: Correction = toml::from_str(&text).unwrap();
        assert_eq!(loaded.method(), method);
        let map = series.held_out[3].1.view();
        assert_eq!(loaded.apply(map).unwrap(), correction.apply(map).unwrap(), "{method}");
        let other = text.replace("format = 1", "format = 9");
        let error = toml::from_str::<Correction>(&other).unwrap_err().to_string();
        assert!(error.contains("format 9"), "{error}");
    }
    let cdc = fit(Method::Cdc, &series.patterns(), &CdcSettings::default()).unwrap();
    let torn = toml::to_string(&cdc).unwrap().replace("width = 80", "width = 90");
    assert!(toml::from_str::<Correction>(&torn).unwrap_err().to_string().contains("grid values"));
}

#[test]
fn holes_stay_holes_and_nothing_is_invented_beyond_the_scale() {
    let series = Series::new((60, 80), 5);
    for method in Method::ALL {
        let correction =
            fit(method, &series.patterns(), &CdcSettings { window: 2, ..CdcSettings::default() }).unwrap();
        let mut map = series.held_out[3].1.clone();
        for (place, value) in
            [((3, 3), f32::NAN), ((4, 70), 1200.0), ((5, 5), 100.0), ((6, 6), f32::INFINITY)]
        {
            map[place] = value;
        }
        let corrected = correction.apply(map.view()).unwrap();
        for place in [(3, 3), (4, 70), (5, 5), (6, 6)] {
            assert!(corrected[place].is_nan(), "{method} {place:?}: {}", corrected[place]);
        }
        assert!(corrected.slice(ndarray::s![20.., ..]).iter().all(|depth| depth.is_finite()), "{method}");
        let mut turned = map.t().to_owned();
        correction.apply_in_place(turned.view_mut().reversed_axes()).unwrap();
        assert!(
            turned
                .t()
                .iter()
                .zip(&corrected)
                .all(|(a, b)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan())
        );
    }
}

#[test]
fn patterns_with_holes_still_teach() {
    let mut series = Series::new((120, 160), 6);
    for (i, (_, map)) in series.maps.iter_mut().enumerate() {
        map.slice_mut(ndarray::s![5..15, (i * 5)..(i * 5 + 12)]).fill(f32::NAN);
    }
    for method in Method::ALL {
        let correction = fit(method, &series.patterns(), &CdcSettings::default()).unwrap();
        let rmse = series.rmse_mm(|map| correction.apply(map.view()).unwrap());
        assert!(rmse < 0.9, "{method}: {rmse} mm");
        // Other programs mark holes by 0 or -1.
        for hole in [0.0, -1.0] {
            let marked: Vec<_> = series
                .maps
                .iter()
                .map(|(true_mm, map)| (*true_mm, map.mapv(|z| if z.is_nan() { hole } else { z })))
                .collect();
            let patterns: Vec<Pattern<'_>> = marked
                .iter()
                .map(|(true_mm, map)| Pattern { depth_mm: map.view(), true_mm: *true_mm })
                .collect();
            assert_eq!(fit(method, &patterns, &CdcSettings::default()).unwrap(), correction, "{method}");
        }
    }
}

#[test]
fn unusable_patterns_and_corrections_are_rejected_with_a_reason() {
    let series = Series::new((60, 80), 7);
    let patterns = series.patterns();
    let settings = CdcSettings::default();
    for method in Method::ALL {
        let needed = method.patterns_needed();
        let error = fit(method, &patterns[..needed - 1], &settings).unwrap_err();
        assert_eq!(error, CorrectionError::TooFewPatterns { method, given: needed - 1, needed });
        assert!(fit(method, &[], &settings).is_err());
    }
    let with = |change: &dyn Fn(&mut Vec<Pattern<'_>>)| {
        let mut patterns = series.patterns();
        change(&mut patterns);
        fit(Method::Clsf, &patterns, &settings).unwrap_err()
    };
    assert!(matches!(with(&|p| p[3].true_mm = f64::NAN), CorrectionError::TrueDepth { index: 3, .. }));
    assert!(matches!(with(&|p| p[3].true_mm = p[4].true_mm), CorrectionError::RepeatedDepth(_)));
    assert!(matches!(
        with(&|p| p[2].depth_mm = p[2].depth_mm.slice_move(ndarray::s![1.., ..])),
        CorrectionError::PatternSize { index: 2, found_height: 59, height: 60, .. }
    ));
    let empty = Array2::from_elem((60, 80), f32::NAN);
    let patterns: Vec<_> =
        (0..5).map(|i| Pattern { depth_mm: empty.view(), true_mm: 900.0 + f64::from(i) }).collect();
    for method in Method::ALL {
        let error = fit(method, &patterns, &settings).unwrap_err();
        let expected = matches!(
            error,
            CorrectionError::Underdetermined { samples: 0, .. } | CorrectionError::PatternHole { .. }
        );
        assert!(expected, "{method}: {error}");
    }
    let strange = CdcSettings { smoothing_px: -1.0, ..settings };
    assert!(matches!(fit(Method::Cdc, &series.patterns(), &strange), Err(CorrectionError::Setting { .. })));

    let correction = fit(Method::Clsf, &series.patterns(), &settings).unwrap();
    let error = correction.apply(Array2::zeros((60, 81)).view()).unwrap_err();
    assert!(error.to_string().contains("81x60") && error.to_string().contains("80x60"), "{error}");
    correction.check_range(&rig("pillbox").working_range()).unwrap();
    let range = rig("pillbox").working_range();
    let mut wider = range;
    wider.far_mm += 0.8 * (range.far_mm - range.near_mm);
    correction.check_range(&wider).unwrap();
    let mut other = range;
    (other.far_mm, other.near_mm) = (range.far_mm + 100.0, range.near_mm + 100.0);
    assert!(matches!(correction.check_range(&other), Err(CorrectionError::RangeMismatch { .. })));
    assert!("clfs".parse::<Method>().is_err());
}
