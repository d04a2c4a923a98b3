//! Lens distortion is corrected in both images, and a shift between them is still found.
#![allow(clippy::unwrap_used)] // Helpers of tests may fail like tests.

use farnear_depth::optics::{Distortion, Optics, OpticsFile};
use farnear_depth::prepare::{PrepareSettings, prepare};
use ndarray::Array2;

const SIZE: (usize, usize) = (160, 200);
/// Shift of the near image without distortion, px.
const SHIFT: [f64; 2] = [0.6, -0.4];

fn optics(cx: f64) -> Optics {
    let text = format!(
        "[lens]\nfocal_length_mm = 50.0\nf_number = 3.90625\n[sensor]\npixel_um = 7.4\n\
         [focus]\nfar_mm = 933.0\nmax_blur_px = 2.703\n\
         [distortion]\ncamera_matrix = [[400.0, 0, {cx:?}], [0, 402.0, 81.0], [0, 0, 1]]\n\
         coefficients = [-0.3, 0.1, 0.001, -0.002, 0.0]"
    );
    toml::from_str::<OpticsFile>(&text).unwrap().check().unwrap()
}

fn scene([x, y]: [f64; 2]) -> f64 {
    let wave = |i: f64| {
        let (direction, frequency) = (2.4 * i, 0.25 + 0.011 * i);
        0.03 * (frequency * (x * direction.cos() + y * direction.sin()) + 1.7 * i * i).sin()
    };
    (0..60).map(|i| wave(f64::from(i))).sum::<f64>() + 0.5
}

/// Position without distortion: the model inverted by iteration.
fn straight(distortion: &Distortion, pixel: [f64; 2]) -> [f64; 2] {
    let mut place = pixel;
    for _ in 0..20 {
        let there = distortion.distorted(place);
        place = [place[0] + pixel[0] - there[0], place[1] + pixel[1] - there[1]];
    }
    place
}

#[test]
fn a_distorted_and_shifted_pair_is_straight_and_aligned() {
    let optics = optics(98.5);
    let distortion = optics.distortion().unwrap();
    let record = |[dx, dy]: [f64; 2]| {
        Array2::from_shape_fn(SIZE, |(y, x)| {
            let [x, y] = straight(&distortion, [x as f64, y as f64]);
            scene([x - dx, y - dy]) as f32
        })
    };
    let [far, near] = [record([0.0; 2]), record(SHIFT)];
    let corner = distortion.distorted([0.0; 2]);
    assert!(corner[0].hypot(corner[1]) > 2.0, "the lens hardly bends: {corner:?}");
    let ready = prepare([far, near], &optics, None, &PrepareSettings::default()).unwrap();
    let found = ready.report.aligned.unwrap().shift_px;
    assert!((found[0] - SHIFT[0]).abs() < 0.02 && (found[1] - SHIFT[1]).abs() < 0.02, "{found:?}");
    for image in [&ready.far, &ready.near] {
        let mut squares = 0.0;
        let middle = || (20..SIZE.0 - 20).flat_map(|y| (20..SIZE.1 - 20).map(move |x| (y, x)));
        for (y, x) in middle() {
            squares += (f64::from(image[(y, x)]) - scene([x as f64, y as f64])).powi(2);
        }
        let rms = (squares / middle().count() as f64).sqrt();
        // The texture's own is 0.16. Interpolation and alignment error leave about a hundredth of it.
        assert!(rms < 0.004, "{rms}");
    }
}

#[test]
fn a_camera_matrix_that_leaves_no_pixel_is_refused() {
    let image = Array2::from_shape_fn(SIZE, |(y, x)| scene([x as f64, y as f64]) as f32);
    let prepared =
        |cx: f64| prepare([image.clone(), image.clone()], &optics(cx), None, &PrepareSettings::default());
    let error = prepared(4000.0).unwrap_err().to_string();
    for phrase in ["[distortion] leaves no pixel", "cx = 4000, cy = 81", "200x160 px"] {
        assert!(error.contains(phrase), "{error}");
    }
    // A part of the sensor away from its middle.
    assert!(prepared(-100.0).is_ok());
}
