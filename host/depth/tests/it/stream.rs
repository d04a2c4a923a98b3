//! Pair after pair of one rig.
#![allow(clippy::unwrap_used)] // Helpers of tests may fail like tests.

use farnear_depth::adaptive_window::Window;
use farnear_depth::measure::{DepthMethod, MeasureError, MeasureSettings, Measurement, measure_pair};
use farnear_depth::prepare::{PrepareError, PrepareSettings};
use farnear_depth::stream::Stream;
use farnear_scene::View;
use ndarray::Array2;

use crate::common::rig;
use crate::measure::{PSF, rendered};

type Pair = [Array2<f32>; 2];

fn settings() -> MeasureSettings {
    let prepare = PrepareSettings { limits: Some([0.0, 1.0]), ..PrepareSettings::default() };
    MeasureSettings { prepare, window: Window::Adaptive, ..MeasureSettings::default() }
}

fn seen(scene: &str, shift_px: [f64; 2], seed: u64) -> Pair {
    rendered(scene, View { shift_px, ..View::default() }, seed)
}

fn alone(pair: &Pair, settings: &MeasureSettings) -> Measurement {
    measure_pair(pair.clone(), &rig(PSF), DepthMethod::Whitened, None, settings).unwrap()
}

fn assert_same(a: &Measurement, b: &Measurement) {
    let maps = [
        (&a.map.depth_mm, &b.map.depth_mm, 1e-3),
        (&a.map.confidence, &b.map.confidence, 1e-3),
        (&a.validity.deviation_mm, &b.validity.deviation_mm, 1e-3),
    ];
    for (a, b, rounding) in maps {
        let same = |(a, b): (&f32, &f32)| (a.is_nan() && b.is_nan()) || (a - b).abs() < rounding;
        assert!(a.iter().zip(b).all(same));
    }
    assert_eq!(a.validity.reasons, b.validity.reasons);
    assert_eq!(a.report.aligned.is_some(), b.report.aligned.is_some());
}

#[test]
fn a_pair_of_a_stream_is_measured_as_alone() {
    for (shift, magnification) in [(0.0, 1.0), (0.7, 1.0), (0.7, 1.02)] {
        let view = View { shift_px: [shift, 0.0], magnification, ..View::default() };
        let pairs = [3, 4].map(|seed| rendered("staircase", view, seed));
        let mut stream = Stream::new(&rig(PSF), &settings()).unwrap();
        let found = [&pairs[0], &pairs[1], &pairs[0]].map(|pair| stream.measure(pair.clone()).unwrap());
        let first = alone(&pairs[0], &settings());
        assert_eq!(first.report.aligned.is_some(), shift > 0.0);
        for found in [&found[0], &found[2]] {
            assert_same(found, &first);
        }
        // The second pair is laid as the first, and has its noise.
        assert_eq!(found[1].report.aligned, first.report.aligned);
        assert_eq!(found[1].prepared.noise, first.prepared.noise);
        if shift == 0.0 {
            let mut known = settings();
            known.prepare.noise = Some(first.prepared.noise);
            assert_same(&found[1], &alone(&pairs[1], &known));
        }
    }
}

#[test]
fn a_rig_that_was_pushed_is_aligned_anew() {
    let shifts = [[0.0, 0.0], [2.5, -1.0], [0.3, 0.0]];
    let mut stream = Stream::new(&rig(PSF), &settings()).unwrap();
    for (seed, shift) in (3..).zip(shifts) {
        let found = stream.measure(seen("cone", shift, seed)).unwrap().report.aligned;
        let measured = found.map_or([0.0; 2], |aligned| aligned.shift_px);
        assert!((measured[0] - shift[0]).hypot(measured[1] - shift[1]) < 0.1, "{shift:?}: {found:?}");
    }
}

#[test]
fn a_pair_that_is_none_does_not_end_the_stream() {
    let [far, near] = seen("cone", [0.0; 2], 3);
    let [other, _] = seen("cone", [0.0; 2], 4);
    let mut stream = Stream::new(&rig(PSF), &settings()).unwrap();
    let error = stream.measure([far.clone(), other]).unwrap_err();
    assert!(matches!(error, MeasureError::Prepare(PrepareError::Unrelated { .. })), "{error}");
    assert!(stream.measure([far.clone(), near.clone()]).unwrap().validity.valid_fraction > 0.8);
    let half = [far, near].map(|image| image.slice(ndarray::s![..120, ..]).to_owned());
    assert_eq!(stream.measure(half).unwrap().map.depth_mm.nrows(), 120);
}
