//! Blur over distance on both sides of focus, from spectra relative to the sharpest slice. With a Gaussian of variance
//! s^2 the cross-spectrum falls as `exp(-w^2 (s^2 - s0^2) / 2)`. The slope of its logarithm over `w^2` is a variance
//! for every profile at low frequencies, where every OTF is a parabola. A pill-box of radius R has `s = R / 2`.

use serde::{Deserialize, Serialize};

use ndarray::Array2;
use rayon::prelude::*;

use super::focus_plane::{FocusPlane, middle};
use super::{LEAST_SIDE, StackError};
use crate::calibrate::spectra;
use crate::fourier::Complex64;
use crate::measure::binned;
use crate::prepare::{align, band::without_holes, warp};

/// Frequencies that are compared, rad/px.
const BAND: [f64; 2] = [0.15, 1.2];
/// Largest radius, px, that the band measures well; larger ones are measured in binned images.
const LARGEST_PX: f64 = 5.0;
/// Least rings of frequencies with a ratio for a slope.
const LEAST_RINGS: usize = 3;

/// Blur of a slice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BlurPoint {
    /// Slices from the focus, negative before it in the stack.
    pub slices: f64,
    /// Radius, px, of the pill-box of the variance beyond the sharpest slice's; NaN if the blur leaves no detail.
    pub radius_px: f64,
}

/// Blur over distance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BlurCurve {
    /// One per slice.
    pub points: Vec<BlurPoint>,
    /// Blur radius per slice before and behind the focus in the order of the stack, px.
    pub per_slice_px: [f64; 2],
}

impl BlurCurve {
    /// Mean of both sides.
    pub fn px_per_slice(&self) -> f64 {
        0.5 * (self.per_slice_px[0] + self.per_slice_px[1])
    }

    pub(super) fn of(
        slices: &[Array2<f32>],
        plane: &FocusPlane,
        proceed: &(dyn Fn() -> bool + Sync),
    ) -> Result<Self, StackError> {
        let (height, width) = slices[0].dim();
        let focus = plane.at(height as f64 / 2.0, width as f64 / 2.0);
        let sharpest = (focus.round().max(0.0) as usize).min(slices.len() - 1);
        let reference = middle(&slices[sharpest]);
        let spectra: Vec<(usize, Array2<Complex64>)> = std::iter::successors(Some(1), |bin| Some(2 * bin))
            .take_while(|bin| *bin == 1 || reference.nrows() / bin >= LEAST_SIDE)
            .filter_map(|bin| Some((bin, spectra::windowed(binned(reference.clone(), bin).view()).ok()?)))
            .collect();
        let points: Vec<BlurPoint> = slices
            .par_iter()
            .enumerate()
            .map(|(index, slice)| {
                if !proceed() {
                    return Err(StackError::Stopped);
                }
                let slice = middle(slice);
                let found = (index != sharpest)
                    .then(|| {
                        let [reference, slice] = [reference.view(), slice.view()];
                        align::estimate(reference, slice, align::Model::Similarity, warp::Warp::IDENTITY)
                    })
                    .flatten()
                    .filter(|found| found.correlation > 0.3);
                let aligned = match found {
                    Some(found) => {
                        without_holes(warp::resample(slice.view(), &found.warp).view()).into_owned()
                    }
                    None => slice,
                };
                Ok(BlurPoint { slices: index as f64 - focus, radius_px: radius(&spectra, &aligned) })
            })
            .collect::<Result<_, StackError>>()?;
        let side = |before: bool| {
            let of_side = || {
                let finite = points.iter().filter(|p| p.radius_px.is_finite());
                finite.filter(move |p| (p.slices < 0.0) == before)
            };
            // Steps of more than the usual limit leave the two sharpest.
            let mut radii: Vec<f64> = of_side().map(|p| p.radius_px).collect();
            radii.sort_by(f64::total_cmp);
            let limit = radii.get(1).or(radii.first()).map_or(LARGEST_PX, |r| r.max(LARGEST_PX));
            // R^2 = g^2 z^2 + the reference's own defocus, which is small.
            let sums = of_side().filter(|p| p.radius_px <= limit).fold([0.0; 2], |[a, b], p| {
                let z = p.slices * p.slices;
                [a + z * p.radius_px * p.radius_px, b + z * z]
            });
            (sums[0] / sums[1]).sqrt()
        };
        let mut per_slice_px = [side(true), side(false)];
        for i in 0..2 {
            if !per_slice_px[i].is_finite() {
                per_slice_px[i] = per_slice_px[1 - i];
            }
        }
        Ok(Self { points, per_slice_px })
    }
}

/// Radius in px, in the least binned image in which it is small. `spectra` are those of the sharpest slice by binning.
fn radius(spectra: &[(usize, Array2<Complex64>)], image: &Array2<f32>) -> f64 {
    let mut radius = f64::NAN;
    for (bin, sharp) in spectra {
        let Ok(spectrum) = spectra::windowed(binned(image.clone(), *bin).view()) else { continue };
        let Some(variance) = variance(sharp, &spectrum) else { continue };
        let binned = 2.0 * variance.max(0.0).sqrt();
        radius = binned * *bin as f64;
        if binned <= LARGEST_PX {
            break;
        }
    }
    radius
}

/// Variance, px^2, by which an image is blurred more than the sharp one, from their spectra.
fn variance(a: &Array2<Complex64>, b: &Array2<Complex64>) -> Option<f64> {
    let (height, width) = a.dim();
    const RINGS: usize = 24;
    let mut rings = [[0.0_f64; 4]; RINGS];
    for ((y, x), value) in a.indexed_iter() {
        let of = |i: usize, n: usize| {
            let i = if 2 * i > n { i as f64 - n as f64 } else { i as f64 };
            2.0 * std::f64::consts::PI * i / n as f64
        };
        let w = of(y, height).hypot(of(x, width));
        if !(BAND[0]..BAND[1]).contains(&w) {
            continue;
        }
        let ring = &mut rings[(((w - BAND[0]) / (BAND[1] - BAND[0])) * RINGS as f64) as usize];
        let cross = (value * b[(y, x)].conj()).re;
        *ring = [ring[0] + cross, ring[1] + value.norm_sqr(), ring[2] + w * w, ring[3] + 1.0];
    }
    // Weighted line of ln(ratio) over w^2; ratios near 0 carry little information.
    let [mut n, mut sx, mut sy, mut sxx, mut sxy] = [0.0; 5];
    let mut used = 0;
    for [cross, power, w2, count] in rings.into_iter().filter(|r| r[3] > 0.0) {
        let ratio = cross / power;
        if ratio > 0.15 {
            used += 1;
            let (x, y, weight) = (w2 / count, ratio.ln(), ratio * ratio);
            n += weight;
            sx += weight * x;
            sy += weight * y;
            sxx += weight * x * x;
            sxy += weight * x * y;
        }
    }
    let slope = (n * sxy - sx * sy) / (n * sxx - sx * sx);
    (used >= LEAST_RINGS && slope.is_finite()).then_some(-2.0 * slope)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fourier;

    /// White noise of SD 0.1 behind a Gaussian of standard deviation `sigma_px`.
    fn texture(side: usize, sigma_px: f64) -> Array2<f32> {
        let mut seed = 7_u64;
        let white = Array2::from_shape_simple_fn((side, side), || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            Complex64::new((seed >> 40) as f64 / f64::from(1 << 24) - 0.5, 0.0)
        });
        let mut spectrum = fourier::transform(white);
        for ((y, x), value) in spectrum.indexed_iter_mut() {
            let w = [y, x].map(|i| {
                2.0 * std::f64::consts::PI * (i as f64).min((side - i) as f64) / side as f64 * sigma_px
            });
            // The inverse transform is the transform of the conjugate.
            *value = value.conj() * (-0.5 * (w[0] * w[0] + w[1] * w[1])).exp();
        }
        let scale = 1.0 / (side * side) as f64;
        fourier::transform(spectrum).mapv(|v| (0.5 + 0.3 * v.re * scale) as f32)
    }

    #[test]
    fn blur_of_many_pixels_per_slice_is_measured() {
        for per_slice_px in [0.8, 3.0, 7.0] {
            let blurred = |i: i32| texture(512, 0.5 * per_slice_px * f64::from((i - 6).abs()));
            let slices: Vec<_> = (0..13).map(blurred).collect();
            let plane = FocusPlane { x_per_px: 0.0, y_per_px: 0.0, at_origin: 6.0, spread: 0.0, blocks: 100 };
            let curve = BlurCurve::of(&slices, &plane, &|| true).unwrap();
            for found in curve.per_slice_px {
                assert!((found / per_slice_px - 1.0).abs() < 0.1, "{found} of {per_slice_px}");
            }
            assert_eq!(BlurCurve::of(&slices, &plane, &|| false), Err(StackError::Stopped));
        }
    }

    #[test]
    fn an_image_without_detail_has_an_unknown_blur() {
        let sharp = spectra::windowed(texture(128, 0.0).view()).unwrap();
        assert!(radius(&[(1, sharp)], &texture(128, 30.0)).is_nan());
    }
}
