//! Results of a z-stack of a flat target in the optics: binning, response, and model error.

use serde::{Deserialize, Serialize};

/// Points of the response, evenly spaced over the measured range.
pub const RESPONSE_POINTS: usize = 17;

/// `[stage]` of an optics file, written by `farnear calibrate stack`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// Pixels per side averaged into one; `pixel_um` and `max_blur_px` are those of the result.
    pub bin: usize,
    /// Slices from the far to the near image of the learned pairs.
    pub pair_step: usize,
    /// Width and height of the slices.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image_px: Option<[usize; 2]>,
    /// Whether focal length and pixel pitch give the side of a pixel at the target.
    #[serde(default)]
    pub scale_known: bool,
    /// Least and largest learned measured normalised depth.
    pub measured: [f64; 2],
    /// True normalised depth at evenly spaced measured ones, rising.
    pub response: [f64; RESPONSE_POINTS],
    /// Least blur radius of the lens (diffraction, aberration), binned px: radii are `sqrt(geometric^2 + floor^2)`.
    #[serde(default)]
    pub blur_floor_px: f64,
    /// Tolerance of measured normalised depth between windows of several sizes.
    #[serde(default)]
    pub window_tolerance: f64,
    /// Standard deviation of normalised depth beyond noise, on held-out parts of the target.
    pub residual: f64,
    /// Median over the target of [`unexplained`].
    pub usual_unexplained: f64,
    /// Coarseness (logarithm, see `coarseness.rs`) that 90 % of the target's pixels have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coarseness: Option<[f64; 2]>,
    /// Response to coarser texture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coarser: Option<Coarser>,
    /// Shift of depth by the direction of the texture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub astigmatism: Option<Astigmatism>,
}

/// No profile fits a real lens at all frequencies, so depth depends on the spectrum of the texture. All values are at the
/// measured depths of [`Stage::response`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coarser {
    /// True normalised depth with the coarser texture.
    pub response: [f64; RESPONSE_POINTS],
    /// Coarseness (logarithm, see `coarseness.rs`) of the target.
    pub of_target: [f64; RESPONSE_POINTS],
    /// Coarseness of the coarser texture; larger.
    pub coarseness: [f64; RESPONSE_POINTS],
}

/// An astigmatic lens has lines of one direction in focus nearer than those across.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Astigmatism {
    /// Normalised depth that the texture's anisotropy (see `direction.rs`) adds, per unit, in the middle of the field.
    pub shift_per_anisotropy: [f64; 2],
    /// Standard deviation of the shift: over the field, and by its measurement.
    pub spread: f64,
    /// Anisotropy of the target, as seen through the lens, at the measured depths of [`Stage::response`].
    pub of_target: [[f64; RESPONSE_POINTS]; 2],
}

/// Standard deviation of a shift by astigmatism relative to it: the frequencies that give the direction are not weighted
/// exactly as those that give depth. Chosen on one lens by wave optics.
const DIRECTION_ERROR: f64 = 0.3;
/// Extrapolation between the textures.
const MIXED: [f64; 2] = [-0.3, 1.3];
/// Standard deviation of a mixture `p` of two responses, relative to `4 p (1 - p)` of their difference: depth need not change
/// evenly from one texture to the other. Chosen on one lens by wave optics.
const MIXING_ERROR: f64 = 0.15;

/// Unexplained texture as a variance of normalised depth: `misfit` is the residual's mean square relative to the noise,
/// `deviation` the standard deviation of normalised depth by noise.
pub fn unexplained(misfit: f32, deviation: f32) -> f32 {
    (misfit - 1.0).max(0.0) * deviation * deviation
}

impl Stage {
    /// Largest [`bin`](Self::bin).
    pub const LARGEST_BIN: usize = 64;

    /// A neutral stage, to learn from.
    pub fn identity(bin: usize, pair_step: usize) -> Self {
        let measured = [-1.19, 1.19];
        let response = places(measured);
        Self {
            bin,
            pair_step,
            image_px: None,
            scale_known: false,
            measured,
            response,
            blur_floor_px: 0.0,
            window_tolerance: 0.0,
            residual: 0.0,
            usual_unexplained: 1.0,
            coarseness: None,
            coarser: None,
            astigmatism: None,
        }
    }

    /// Measured and true normalised depth, row by row.
    pub fn curve(&self) -> [[f64; 2]; RESPONSE_POINTS] {
        let measured = places(self.measured);
        std::array::from_fn(|i| [measured[i], self.response[i]])
    }

    /// True normalised depth, slope, and deviation by the texture's coarseness, at a measured depth; `None` outside the
    /// learned range.
    pub fn respond(&self, measured: f64, coarseness: f64) -> Option<[f64; 3]> {
        let [value, slope] = interpolated(self.measured, &self.response, measured)?;
        let Some(coarser) = &self.coarser else { return Some([value, slope, 0.0]) };
        let [[other, its_slope], [fine, _], [coarse, _]] = [
            interpolated(self.measured, &coarser.response, measured)?,
            interpolated(self.measured, &coarser.of_target, measured)?,
            interpolated(self.measured, &coarser.coarseness, measured)?,
        ];
        let place = (coarseness - fine) / (coarse - fine);
        let place = if place.is_finite() { place } else { 0.0 };
        let part = place.clamp(MIXED[0], MIXED[1]);
        // Beyond the textures that were learned the response is not known.
        let unknown = MIXING_ERROR * (4.0 * part * (1.0 - part)).abs() + (place - part).abs();
        let mixed = unknown * (other - value).abs();
        Some([value + part * (other - value), slope + part * (its_slope - slope), mixed])
    }

    /// Normalised depth that astigmatism adds to texture of an anisotropy, relative to the target, and its standard deviation.
    pub fn shift(&self, measured: f64, anisotropy: [f64; 2]) -> [f64; 2] {
        let Some(Astigmatism { shift_per_anisotropy, spread, of_target }) = &self.astigmatism else {
            return [0.0; 2];
        };
        let [cos, sin] = [0, 1].map(|i| {
            let usual = interpolated(self.measured, &of_target[i], measured);
            usual.map_or(f64::NAN, |[usual, _]| anisotropy[i] - usual)
        });
        let away = cos.hypot(sin);
        if !away.is_finite() {
            return [0.0; 2];
        }
        let by = shift_per_anisotropy[0] * cos + shift_per_anisotropy[1] * sin;
        [by, (DIRECTION_ERROR * by).hypot(spread * away)]
    }

    pub(super) fn problem(&self) -> Option<&'static str> {
        let finite = self.response.iter().chain(&self.measured).all(|v| v.is_finite() && v.abs() < 2.0);
        if !(1..=Self::LARGEST_BIN).contains(&self.bin) {
            return Some("bin must be 1 to 64");
        }
        if !finite || self.measured[0] >= self.measured[1] {
            return Some("measured and response must be finite and measured must rise");
        }
        if let Some(Coarser { response, of_target, coarseness }) = &self.coarser {
            let apart = of_target.iter().zip(coarseness).all(|(fine, coarse)| coarse > fine);
            let all = response.iter().chain(of_target).chain(coarseness);
            if !(apart && all.clone().all(|v| v.is_finite() && v.abs() < 20.0)) {
                return Some("coarser must have finite values and a larger coarseness than of_target");
            }
        }
        if let Some(Astigmatism { shift_per_anisotropy, spread, of_target }) = &self.astigmatism {
            let all = shift_per_anisotropy.iter().chain(of_target.as_flattened()).chain([spread]);
            if !all.clone().all(|v| v.is_finite() && v.abs() < 20.0) || *spread < 0.0 {
                return Some("astigmatism must have values within -20 to 20 and a spread of 0 or more");
            }
        }
        if self.coarseness.is_some_and(|[fine, coarse]| !(fine.is_finite() && coarse >= fine)) {
            return Some("coarseness must be finite and rise");
        }
        if self.response.windows(2).any(|pair| pair[1] < pair[0]) {
            return Some("response must rise");
        }
        if !(0.0..=8.0).contains(&self.blur_floor_px) {
            return Some("blur_floor_px must be 0 to 8");
        }
        if !(0.0..=0.5).contains(&self.window_tolerance) {
            return Some("window_tolerance must be 0 to 0.5");
        }
        let positive = self.residual >= 0.0
            && self.residual < 2.0
            && self.usual_unexplained > 0.0
            && self.usual_unexplained.is_finite();
        (!positive).then_some("residual must be 0 to 2 and usual_unexplained above 0")
    }
}

/// Evenly spaced measured depths of the response.
fn places([low, high]: [f64; 2]) -> [f64; RESPONSE_POINTS] {
    std::array::from_fn(|i| low + (high - low) * i as f64 / (RESPONSE_POINTS - 1) as f64)
}

/// Value and slope of a response at a measured depth; `None` outside the range of its points.
fn interpolated([low, high]: [f64; 2], response: &[f64; RESPONSE_POINTS], measured: f64) -> Option<[f64; 2]> {
    if !(low..=high).contains(&measured) {
        return None;
    }
    let unit = (high - low) / (RESPONSE_POINTS - 1) as f64;
    let place = (measured - low) / unit;
    let index = (place as usize).min(RESPONSE_POINTS - 2);
    let [a, b] = [response[index], response[index + 1]];
    Some([a + (b - a) * (place - index as f64), (b - a) / unit])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identity_changes_nothing_and_ends_at_its_range() {
        let stage = Stage::identity(2, 3);
        for alpha in [-1.19, -0.4, 0.0, 0.77, 1.18] {
            let [value, slope, _] = stage.respond(alpha, f64::NAN).unwrap();
            assert!((value - alpha).abs() < 1e-12 && (slope - 1.0).abs() < 1e-9);
        }
        assert!(stage.respond(1.3, 0.0).is_none() && stage.respond(f64::NAN, 0.0).is_none());
        assert_eq!(stage.problem(), None);
        let coarser = Coarser {
            response: stage.response.map(|v| v + 0.1),
            of_target: [1.0; RESPONSE_POINTS],
            coarseness: [2.0; RESPONSE_POINTS],
        };
        let mixed = Stage { coarser: Some(coarser), ..stage };
        for (coarseness, more) in [(1.0, 0.0), (1.5, 0.05), (2.0, 0.1), (9.0, 0.13), (f64::NAN, 0.0)] {
            let [value, _, deviation] = mixed.respond(0.2, coarseness).unwrap();
            assert!((value - 0.2 - more).abs() < 1e-9, "{coarseness} {value}");
            assert_eq!(deviation > 0.0, coarseness != 1.0 && coarseness != 2.0 && !coarseness.is_nan());
        }
        let of_target = [0.2, 0.0].map(|usual| [usual; RESPONSE_POINTS]);
        let astigmatism = Astigmatism { shift_per_anisotropy: [0.5, 0.0], spread: 0.1, of_target };
        let astigmatic = Stage { astigmatism: Some(astigmatism), ..stage };
        assert_eq!(astigmatic.problem(), None);
        let [by, deviation] = astigmatic.shift(0.3, [1.2, 0.0]);
        assert!((by - 0.5).abs() < 1e-12 && (deviation - 0.15_f64.hypot(0.1)).abs() < 1e-12);
        assert_eq!(astigmatic.shift(0.3, [f64::NAN, 0.0]), [0.0; 2]);
        assert_eq!((astigmatic.shift(0.3, [0.2, 0.0]), stage.shift(0.3, [1.0, 0.0])), ([0.0; 2], [0.0; 2]));
        let mut falling = stage;
        falling.response[4] = -1.1;
        assert_eq!(falling.problem(), Some("response must rise"));
    }
}
