//! Minimum and median times of corrections, calibration, focus measures and baselines on 640x480, one thread, in ms.
//! `cargo bench -p farnear-depth --bench corrections [-- FILTER]`; `FARNEAR_JSON=1` prints one JSON object per line.
//! The images are random. Timings are not tests: nothing here can fail.
#![allow(clippy::unwrap_used, missing_docs)] // A benchmark may stop; it has no users.

use std::hint::black_box;
use std::time::Instant;

use farnear_depth::baselines::{self, Favaro, FavaroSettings};
use farnear_depth::calibrate::{CapturedPair, Model, fit_psf};
use farnear_depth::corrections::{CdcSettings, Method, Pattern, fit};
use farnear_depth::focus_measure::FocusMeasure;
use farnear_depth::optics::{Optics, OpticsFile};
use farnear_depth::pipeline::Settings;
use farnear_scene::standard;
use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const DIM: (usize, usize) = (480, 640);

fn optics() -> Optics {
    let mut file: OpticsFile = toml::from_str(standard::OPTICS).unwrap();
    file.psf = "gaussian:k=0.4578".parse().unwrap();
    file.check().unwrap()
}

fn random(low: f32, high: f32, seed: u64) -> Array2<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    Array2::from_shape_simple_fn(DIM, || rng.random_range(low..high))
}

fn time<T>(runs: usize, mut run: impl FnMut() -> T) -> [f64; 2] {
    let mut ms: Vec<f64> = (0..runs + 2)
        .map(|_| {
            let start = Instant::now();
            black_box(run());
            1e3 * start.elapsed().as_secs_f64()
        })
        .skip(2)
        .collect();
    ms.sort_by(f64::total_cmp);
    [ms[0], ms[ms.len() / 2]]
}

struct Report {
    filter: Option<String>,
}

impl Report {
    fn line<T>(&self, name: &str, runs: usize, run: impl FnMut() -> T) {
        if self.filter.as_ref().is_some_and(|filter| !name.contains(filter.as_str())) {
            return;
        }
        let [min, median] = time(runs, run);
        if std::env::var_os("FARNEAR_JSON").is_some() {
            println!(
                "{{\"name\": \"{name}\", \"threads\": 1, \"min_ms\": {min:.4}, \"median_ms\": {median:.4}}}"
            );
        } else {
            println!("{name:<28} threads 1  min {min:9.3} ms  median {median:9.3} ms");
        }
    }
}

fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().unwrap();
    let filter = std::env::args().skip(1).find(|argument| !argument.starts_with("--"));
    let report = Report { filter };
    let depths: Vec<f64> = (0..24).map(|i| 933.0 - 2.0 * f64::from(i)).collect();
    let maps: Vec<_> =
        (0..).zip(&depths).map(|(seed, mm)| random(*mm as f32 - 2.0, *mm as f32 + 2.0, seed)).collect();
    let patterns: Vec<_> =
        maps.iter().zip(&depths).map(|(map, mm)| Pattern { depth_mm: map.view(), true_mm: *mm }).collect();
    // A curved surface with noise: neighbours have nearly one depth, as in a real map.
    let mut raw = random(-1.0, 1.0, 99);
    raw.indexed_iter_mut().for_each(|((row, column), depth)| {
        *depth += 910.0 + 18.0 * (0.01 * row as f32).sin() * (0.008 * column as f32).cos();
    });
    let mut map = raw.clone();
    for method in Method::ALL {
        let correction = fit(method, &patterns, &CdcSettings::default()).unwrap();
        report.line(&format!("correct {method}"), 40, || {
            map.assign(&raw);
            correction.apply_in_place(map.view_mut()).unwrap();
        });
        report
            .line(&format!("learn {method} from 24"), 3, || fit(method, &patterns, &CdcSettings::default()));
    }
    let optics = optics();
    let (far, near) = (random(50.0, 150.0, 1), random(80.0, 120.0, 2));
    let settings = Settings::default();
    for method in [baselines::Method::Subbarao, baselines::Method::SubbaraoFourier] {
        report.line(&format!("depth {method}"), 3, || {
            baselines::depth_from_pair(method, far.view(), near.view(), &optics, &settings).unwrap()
        });
    }
    let favaro = Favaro::learn(&optics, &FavaroSettings::default()).unwrap();
    report.line("learn favaro", 3, || Favaro::learn(&optics, &FavaroSettings::default()).unwrap());
    report.line("depth favaro", 3, || {
        favaro.depth_from_pair(far.view(), near.view(), &optics, &settings).unwrap()
    });
    let pair = CapturedPair { far: far.view(), near: near.view(), alpha: Some(-1.0) };
    for model in [Model::Gaussian, Model::Generalised] {
        report.line(&format!("calibrate {model}"), 3, || fit_psf(&[pair], &optics, model));
    }
    for measure in FocusMeasure::ALL {
        report.line(&format!("focus {measure}"), 10, || measure.of(far.view()).unwrap());
    }
}
