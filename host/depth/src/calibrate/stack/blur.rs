//! Blur over distance on both sides of focus, from spectra relative to the sharpest slice. With a Gaussian of variance
//! s^2 the cross-spectrum falls as `exp(-w^2 (s^2 - s0^2) / 2)`. The slope of its logarithm over `w^2` is a variance
//! for every profile at low frequencies, where every OTF is a parabola. A pill-box of radius R has `s = R / 2`.

use serde::{Deserialize, Serialize};

use ndarray::Array2;

use super::focus_plane::{FocusPlane, middle};
use crate::calibrate::spectra;
use crate::prepare::{align, warp};

/// Frequencies that are compared, rad/px.
const BAND: [f64; 2] = [0.15, 1.2];

/// Blur of a slice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BlurPoint {
    /// Slices from the focus, negative before it in the stack.
    pub slices: f64,
    /// Radius, px, of the pill-box of the variance beyond the sharpest slice's.
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

    pub(super) fn of(slices: &[Array2<f32>], plane: &FocusPlane) -> Self {
        let (height, width) = slices[0].dim();
        let focus = plane.at(height as f64 / 2.0, width as f64 / 2.0);
        let sharpest = (focus.round().max(0.0) as usize).min(slices.len() - 1);
        let reference = middle(&slices[sharpest]);
        let points: Vec<BlurPoint> = slices
            .iter()
            .enumerate()
            .map(|(index, slice)| {
                let slice = middle(slice);
                let aligned = match align::estimate(
                    reference.view(),
                    slice.view(),
                    align::Model::Similarity,
                    warp::Warp::IDENTITY,
                ) {
                    Some(found) if index != sharpest && found.correlation > 0.3 => {
                        warp::resample(slice.view(), &found.warp)
                            .mapv(|v| if v.is_finite() { v } else { f32::NAN })
                    }
                    _ => slice,
                };
                let mean = aligned.iter().filter(|v| v.is_finite()).sum::<f32>() / aligned.len() as f32;
                let aligned = aligned.mapv(|v| if v.is_finite() { v } else { mean });
                let variance = variance(&reference, &aligned).unwrap_or(f64::NAN).max(0.0);
                BlurPoint { slices: index as f64 - focus, radius_px: 2.0 * variance.sqrt() }
            })
            .collect();
        let side = |before: bool| {
            let sums = points
                .iter()
                .filter(|p| (p.slices < 0.0) == before && p.radius_px.is_finite() && p.radius_px < 5.0)
                // R^2 = g^2 z^2 + the reference's own defocus, which is small.
                .fold([0.0; 2], |[a, b], p| {
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
        Self { points, per_slice_px }
    }
}

/// Variance, px^2, by which `image` is blurred more than `sharp`.
fn variance(sharp: &Array2<f32>, image: &Array2<f32>) -> Option<f64> {
    let [a, b] = [sharp, image].map(|image| spectra::windowed(image.view()).ok());
    let (a, b) = (a?, b?);
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
    for [cross, power, w2, count] in rings.into_iter().filter(|r| r[3] > 0.0) {
        let ratio = cross / power;
        if ratio > 0.15 {
            let (x, y, weight) = (w2 / count, ratio.ln(), ratio * ratio);
            n += weight;
            sx += weight * x;
            sy += weight * y;
            sxx += weight * x * x;
            sxy += weight * x * y;
        }
    }
    let slope = (n * sxy - sx * sy) / (n * sxx - sx * sx);
    slope.is_finite().then_some(-2.0 * slope)
}
