//! Removal of lens distortion.

use ndarray::{Array2, ArrayView2};

use super::warp::resample_by;
use crate::optics::Distortion;
use crate::reason::Reason;

/// An image as a lens without distortion would have taken it; NaN where the lens recorded nothing. Cost: up to 42
/// multiply-adds and the map, some 30 operations, per pixel; on all threads.
pub fn straightened(image: ArrayView2<f32>, distortion: &Distortion) -> Array2<f32> {
    resample_by(image, |place| distortion.distorted(place))
}

/// Moves the reasons of pixels like the pixels; [`Reason::Edge`] outside the recorded field.
pub(super) fn reasons(
    marks: Option<&Array2<u8>>,
    (height, width): (usize, usize),
    distortion: &Distortion,
) -> Array2<u8> {
    Array2::from_shape_fn((height, width), |(y, x)| {
        let [from_x, from_y] = distortion.distorted([x as f64, y as f64]).map(f64::round);
        let inside = from_x >= 0.0 && from_y >= 0.0 && from_x < width as f64 && from_y < height as f64;
        match marks {
            _ if !inside => Reason::Edge.code(),
            Some(marks) => marks[(from_y as usize, from_x as usize)],
            None => 0,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::DistortionSection;

    fn distortion() -> Distortion {
        DistortionSection {
            camera_matrix: [[160.0, 0.0, 41.5], [0.0, 158.0, 29.0], [0.0, 0.0, 1.0]],
            coefficients: vec![-0.3, 0.1, 0.002, -0.001],
        }
        .check()
        .unwrap()
    }

    /// A recorded wave: each pixel has the wave's value at its origin by the model, inverted iteratively.
    #[test]
    fn a_wave_is_straight_again() {
        let distortion = distortion();
        let wave = |x: f64, y: f64| (0.9 * x + 0.3 * y).sin() + 0.5 * (0.7 * y).cos();
        let ideal = |x: f64, y: f64| {
            let mut place = [x, y];
            for _ in 0..20 {
                let there = distortion.distorted(place);
                place = [place[0] + x - there[0], place[1] + y - there[1]];
            }
            place
        };
        let record = Array2::from_shape_fn((60, 84), |(y, x)| {
            let [x, y] = ideal(x as f64, y as f64);
            wave(x, y) as f32
        });
        let seen = straightened(record.view(), &distortion);
        let (mut largest_shift, mut judged) = (0.0_f64, 0);
        for ((y, x), value) in seen.indexed_iter() {
            let [px, py] = distortion.distorted([x as f64, y as f64]);
            if (4.0..79.0).contains(&px) && (4.0..55.0).contains(&py) {
                // Lanczos' kernel keeps waves of 0.95 rad/px within some percent.
                assert!((f64::from(*value) - wave(x as f64, y as f64)).abs() < 0.03, "({x}, {y})");
                largest_shift = largest_shift.max((px - x as f64).hypot(py - y as f64));
                judged += 1;
            }
        }
        assert!(judged > 3000 && largest_shift > 1.0, "{judged} pixels, moved by up to {largest_shift} px");
    }

    #[test]
    fn reasons_go_with_their_pixels() {
        let (distortion, size) = (distortion(), (60, 84));
        let mut marks = Array2::zeros(size);
        let to @ [x, y] = [82_usize, 57];
        let [from_x, from_y] = distortion.distorted(to.map(|v| v as f64)).map(|v| v.round() as usize);
        assert_ne!([from_x, from_y], to);
        marks[(from_y, from_x)] = Reason::Saturated.code();
        assert_eq!(reasons(Some(&marks), size, &distortion)[(y, x)], Reason::Saturated.code());
        let wide = DistortionSection { coefficients: vec![0.4, 0.0, 0.0, 0.0], ..distortion.into() };
        assert_eq!(reasons(None, size, &wide.check().unwrap())[(0, 0)], Reason::Edge.code());
    }
}
