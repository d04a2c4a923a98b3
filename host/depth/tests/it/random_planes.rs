//! Random planes in and out of the range, with resized near images: no confident wrong depth.
#![allow(clippy::unwrap_used)] // Helpers of tests may fail like tests.

use crate::common::rig;
use farnear_depth::adaptive_window::Window;
use farnear_depth::measure::{DepthMethod, MeasureSettings, measure_pair_of_views};
use farnear_depth::operators::Operators;
use farnear_depth::prepare::PrepareSettings;
use farnear_scene::{Camera, Lens, Noise, OpticsFile, Renderer, Scene, View, standard};
use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SIZE: (usize, usize) = (128, 96);
const PSF: &str = "gaussian:k=0.4578";
/// Combinations without `FARNEAR_RANDOM_PLANES`.
const USUAL: u64 = 24;
/// Combinations that were wrong along the rim of the resampled near image.
const RIM: [u64; 5] = [28, 206, 682, 904, 938];
const CONFIDENT: f32 = 0.5;
/// Negligible error even with a smaller predicted deviation, mm.
const NEGLIGIBLE_MM: f32 = 1.5;

/// Set `FARNEAR_RANDOM_PLANES=1000` for the campaign.
#[test]
fn random_planes_and_magnifications_give_no_confident_wrong_plateau() {
    let count = std::env::var("FARNEAR_RANDOM_PLANES").map_or(USUAL, |text| text.parse().unwrap());
    let optics = rig(PSF);
    let operators = Operators::for_optics(&optics).unwrap();
    let lens = Lens::from_optics(&OpticsFile::parse(standard::OPTICS).unwrap()).unwrap();
    let mut broken = Vec::new();
    let only: Option<Vec<u64>> =
        std::env::var("ONLY").ok().map(|t| t.split(',').map(|n| n.parse().unwrap()).collect());
    let from: u64 = std::env::var("FROM").map_or(0, |t| t.parse().unwrap());
    for number in only
        .unwrap_or_else(|| (from..from + count).collect())
        .into_iter()
        .chain(RIM.into_iter().filter(|number| *number >= count))
    {
        let mut random = ChaCha8Rng::seed_from_u64(number);
        // Half of the planes in and near the range of 887 to 933 mm, half anywhere.
        let depth: f64 = if number % 2 == 0 {
            random.random_range(870.0..950.0)
        } else {
            random.random_range(600.0..1500.0)
        };
        let magnification: f64 = random.random_range(0.9..1.1);
        let magnification = std::env::var("MAG").map_or(magnification, |t| t.parse().unwrap());
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
            if std::env::var("STAT").is_ok() {
                let (mut n, mut e, mut ee, mut r, mut w, mut mm) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
                for (at, f) in found.map.depth_mm.indexed_iter().filter(|(_, f)| f.is_finite()) {
                    let d = f64::from(*f) - depth;
                    let sd = f64::from(found.validity.deviation_mm[at]);
                    n += 1.0;
                    e += d;
                    ee += d * d;
                    r += (d / sd).powi(2);
                    w += f64::from(u8::from(d.abs() > 3.0 * sd));
                    mm += sd;
                }
                println!(
                    "{number} {depth:.1} {magnification:.4} {window}: n {:.3} mean {:.3} sd {:.3} rel {:.2} beyond {:.4} pred {:.3} left {:.2e} excess {:.3} noise {:.3e}",
                    n / (SIZE.0 * SIZE.1) as f64,
                    e / n,
                    (ee / n - (e / n).powi(2)).sqrt(),
                    (r / n).sqrt(),
                    w / n,
                    mm / n,
                    found.left_over,
                    found.excess,
                    found.prepared.noise.mean_variance
                );
            }
            let list: Vec<_> = wrong.clone().collect();
            if std::env::var("DIAG").is_ok() && list.len() > 120 {
                let mut bins = std::collections::BTreeMap::new();
                let (mut e, mut sd) = (0.0, 0.0);
                for (at, f) in &list {
                    let edge = at.0.min(at.1).min(SIZE.1 - 1 - at.0).min(SIZE.0 - 1 - at.1);
                    *bins.entry(edge).or_insert(0) += 1;
                    e += **f - depth as f32;
                    sd += found.validity.deviation_mm[*at];
                }
                let n = list.len() as f32;
                println!(
                    "{number} {depth:.1} {magnification:.3} {window}: mean error {:.2} sd {:.2} aligned {:?} bins {bins:?}",
                    e / n,
                    sd / n,
                    found.report.aligned.map(|a| a.magnification)
                );
                let seen: std::collections::HashSet<_> = list.iter().map(|(at, _)| *at).collect();
                for y in (0..SIZE.1).step_by(2) {
                    println!(
                        "{}",
                        (0..SIZE.0)
                            .step_by(2)
                            .map(|x| if seen.contains(&(y, x)) {
                                '#'
                            } else if found.map.depth_mm[(y, x)].is_finite() {
                                '.'
                            } else {
                                ' '
                            })
                            .collect::<String>()
                    );
                }
            }
            let part = wrong.count() as f64 / (SIZE.0 * SIZE.1) as f64;
            if part >= 0.02 {
                broken.push(format!("{number}: {depth:.1} mm, size {magnification:.3}, {window}: {part:.3}"));
            }
        }
    }
    assert!(broken.is_empty(), "{} of {count}:\n{}", broken.len(), broken.join("\n"));
}
