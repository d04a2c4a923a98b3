//! Correction of depth for a near image that was resized.

use ndarray::Array2;

use super::OUT_OF_RANGE_ALPHA;
use crate::optics::Optics;
use crate::validity::LARGEST_ALPHA;

/// Scaling the near image to the far one's size scales its blur circle and its pixels by `1 / m`. Depth follows from the
/// difference of the second moments, so the result is `((1 + alpha)^2 - (1 - alpha)^2 / m^2) / 4 + a (1 - 1 / m^2)`, `a`
/// the variance of a square pixel relative to that of the largest blur; solves it for alpha.
pub(super) fn undo_scaled_blur(depth_mm: &mut Array2<f32>, magnification: f64, optics: &Optics) {
    let r = magnification.powi(-2);
    if (r - 1.0).abs() < 1e-4 {
        return;
    }
    let of_pixel = pixel_in_blurs(optics) * (1.0 - r);
    // (1 - r) alpha^2 + 2 (1 + r) alpha + (1 - r) - 4 found = 0, on the branch that stays finite for r = 1.
    let alpha_of = |found: f64| {
        if found.abs() >= LARGEST_ALPHA {
            // Clamped or saturated: means "outside the range", which the range test must detect.
            return found.signum() * OUT_OF_RANGE_ALPHA;
        }
        let (b, c) = (1.0 + r, (1.0 - r) - 4.0 * (found - of_pixel));
        let root = (b * b - (1.0 - r) * c).max(0.0).sqrt();
        -c / (b + root)
    };
    depth_mm.par_mapv_inplace(|depth| {
        if depth.is_finite() {
            optics.depth_mm(alpha_of(optics.alpha(f64::from(depth)))) as f32
        } else {
            depth
        }
    });
}

/// Variance of a square pixel relative to that of the largest blur along an axis.
fn pixel_in_blurs(optics: &Optics) -> f64 {
    (6.0 * optics.psf().second_moment() * optics.max_blur_px().powi(2)).recip()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::{FocusSection, LensSection, OpticsFile, SensorSection};
    use crate::psf::Psf;

    #[test]
    fn a_scaled_blur_is_undone() {
        let optics = OpticsFile {
            lens: LensSection {
                focal_length_mm: 50.0,
                aperture_mm: Some(12.8),
                f_number: None,
                telecentric: None,
            },
            sensor: SensorSection { pixel_um: 7.4 },
            focus: FocusSection { far_mm: 933.0, max_blur_px: Some(2.703), near_mm: None },
            psf: Psf::PillBox,
            distortion: None,
            stage: None,
            light: None,
        }
        .check()
        .unwrap();
        for m in [0.97, 1.003, 1.03_f64] {
            for alpha in [-1.0, -0.3, 0.0, 0.8_f64] {
                let pixel = pixel_in_blurs(&optics) * (1.0 - 1.0 / (m * m));
                let found = 0.25 * ((1.0 + alpha).powi(2) - (1.0 - alpha).powi(2) / (m * m)) + pixel;
                let mut map = Array2::from_elem((1, 1), optics.depth_mm(found) as f32);
                undo_scaled_blur(&mut map, m, &optics);
                assert!((f64::from(map[(0, 0)]) - optics.depth_mm(alpha)).abs() < 1e-3, "{m} {alpha}");
            }
        }
    }
}
