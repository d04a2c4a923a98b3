//! Validity of each depth: whether there is one, why not, its standard deviation and confidence. A depth is removed
//! beyond the working range (where the estimate stays near the range's end), where its standard deviation is so large
//! that noise may have made it, and where the model leaves far more than noise. The others get a standard deviation
//! widened by the residual, and a confidence: the probability of an error below three of these.

use ndarray::{Array2, Zip};
use serde::{Deserialize, Serialize};

use crate::adaptive_window::Estimate;
use crate::depth_map::DepthMap;
use crate::metrics::dilate_square;
use crate::optics::{Optics, unexplained};
use crate::prepare::Prepared;
use crate::reason::Reason;

/// Largest valid |alpha|: a tenth beyond either focus the operators are accurate to 1 mm.
pub const LARGEST_ALPHA: f64 = 1.1;
/// Standard deviation of alpha from which noise may have made a depth.
const LARGEST_DEVIATION: f32 = 0.12;
/// Systematic error of alpha per root of the unexplained part of the texture: a residual that is all depth has 1.
const MODEL_ERROR: f32 = 1.0;
/// Mean square residual of right models (`Estimate::left_over`).
const USUAL_LEFT_OVER: f32 = 3e-4;
/// Standard deviation of alpha of a filled pixel: larger than any measured one.
const FILLED_DEVIATION: f32 = 0.25;
/// Mean square residual relative to the noise from which the model is invalid.
const LARGEST_MISFIT: f32 = 60.0;
const SEARCH_PX: usize = 24;

/// Settings of [`assess`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ValiditySettings {
    /// Confidence below which a depth is removed.
    pub least_confidence: f32,
    /// Whether regions without texture were filled; filled pixels are kept.
    pub filled: bool,
}

/// Validity of each pixel.
#[derive(Debug, Clone)]
pub struct Validity {
    /// Code of the [`Reason`] for each pixel without a depth, else 0.
    pub reasons: Array2<u8>,
    /// Standard deviation of each depth, mm; NaN without a depth.
    pub deviation_mm: Array2<f32>,
    /// Pixels without a depth, by reason.
    pub lost: Vec<Lost>,
    /// Part of the pixels that have a depth.
    pub valid_fraction: f64,
}

/// Pixels without depth for one reason.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Lost {
    /// The reason.
    pub reason: Reason,
    /// Its number in `reason.png`.
    pub code: u8,
    /// Part of all pixels.
    pub fraction: f64,
}

/// Removes invalid depths from a map and sets each confidence to its probability. `estimate` is of the same pair.
pub fn assess(
    map: &mut DepthMap,
    prepared: &Prepared,
    estimate: Estimate,
    optics: &Optics,
    settings: &ValiditySettings,
) -> Validity {
    let size = map.depth_mm.dim();
    let mut reasons = prepared.reasons.clone();
    let Estimate { mut deviation_mm, misfit, left_over, .. } = estimate;
    let range = Range::new(optics);
    let stage =
        optics.stage().map(|stage| [stage.residual, stage.usual_unexplained].map(|value| value as f32));
    let of_model =
        MODEL_ERROR.powi(2) * (left_over as f32 - USUAL_LEFT_OVER).max(0.0) * range.slope_mm.powi(2);
    let filled = map.filled.take().filter(|_| settings.filled);
    let is_filled = |at: (usize, usize)| filled.as_ref().is_some_and(|filled| filled[at]);
    Zip::indexed(&mut reasons)
        .and(&mut map.depth_mm)
        .and(&mut map.confidence)
        .and(&mut deviation_mm)
        .and(&misfit)
        .par_for_each(|at, reason, depth, confidence, deviation, misfit| {
            if is_filled(at) && depth.is_finite() {
                (*reason, *deviation) = (0, FILLED_DEVIATION * range.slope_mm);
                return;
            }
            let noise = *deviation;
            let mut misfit = *misfit;
            *deviation = match stage {
                Some([residual, usual]) => {
                    // Relative to the target that the lens was learned from.
                    misfit = unexplained(misfit, noise / range.slope_mm) / usual;
                    noise.hypot(model_error(residual, misfit) * range.slope_mm)
                }
                None => (noise * noise * misfit.max(1.0) + of_model).sqrt(),
            };
            let verdict = if *reason != 0 || !depth.is_finite() {
                None
            } else {
                range.verdict(*depth, [noise, *deviation], misfit, settings.least_confidence)
            };
            match verdict {
                Some(Ok(probability)) => *confidence = probability,
                Some(Err(why)) => *reason = why.code(),
                None => {}
            }
            if !matches!(verdict, Some(Ok(_))) {
                (*depth, *confidence, *deviation) = (f32::NAN, 0.0, f32::NAN);
            }
        });
    map.filled = filled;
    drop(misfit); // a map is large, and what follows needs one more
    explain_holes(&mut reasons, map);
    let lost = lost_pixels(&reasons);
    let valid = map.depth_mm.iter().filter(|depth| depth.is_finite()).count();
    map.low_texture_fraction =
        lost.iter().find(|lost| lost.reason == Reason::NoTexture).map_or(0.0, |lost| lost.fraction);
    Validity { reasons, deviation_mm, lost, valid_fraction: valid as f64 / (size.0 * size.1) as f64 }
}

/// Standard deviation of normalised depth by model error, for a residual `ratio` times the learned target's.
pub(crate) fn model_error(residual: f32, ratio: f32) -> f32 {
    residual * ratio.max(1.0).sqrt()
}

/// Pixels without a depth by reason, from the map of reasons.
pub fn lost_pixels(reasons: &Array2<u8>) -> Vec<Lost> {
    let total = reasons.len() as f64;
    Reason::ALL
        .into_iter()
        .map(|reason| (reason, reasons.iter().filter(|code| **code == reason.code()).count()))
        .filter(|(_, count)| *count > 0)
        .map(|(reason, count)| Lost { reason, code: reason.code(), fraction: count as f64 / total })
        .collect()
}

struct Range {
    far_mm: f32,
    near_mm: f32,
    /// Magnitude of the change of depth with alpha, mm, at alpha 0.
    slope_mm: f32,
    /// Whether the model error was learned; the deviation then includes it.
    learned: bool,
}

impl Range {
    fn new(optics: &Optics) -> Self {
        let [far_mm, near_mm] = [-LARGEST_ALPHA, LARGEST_ALPHA].map(|alpha| optics.depth_mm(alpha) as f32);
        Self {
            far_mm,
            near_mm,
            slope_mm: optics.depth_per_alpha_mm(0.0).abs() as f32,
            learned: optics.stage().is_some(),
        }
    }

    /// The confidence of a depth, or the reason for its absence. `deviations_mm` are by noise, and with the residual.
    fn verdict(
        &self,
        depth: f32,
        deviations_mm: [f32; 2],
        misfit: f32,
        least: f32,
    ) -> Option<Result<f32, Reason>> {
        let [of_noise, of_alpha] = deviations_mm.map(|deviation| deviation / self.slope_mm);
        if of_noise.is_nan() || of_noise >= LARGEST_DEVIATION {
            return Some(Err(Reason::NoTexture));
        }
        if !(self.near_mm..=self.far_mm).contains(&depth) {
            return Some(Err(Reason::OutOfRange));
        }
        if (!self.learned && misfit > LARGEST_MISFIT) || of_alpha > 3.0 * LARGEST_DEVIATION {
            return Some(Err(Reason::Misfit));
        }
        let probability = probability(of_alpha, misfit);
        Some(if probability < least { Err(Reason::Unsure) } else { Ok(probability) })
    }
}

/// Probability of an error below three standard deviations: 0.997, less for large deviations or residuals.
fn probability(deviation_of_alpha: f32, misfit: f32) -> f32 {
    let noisy = (deviation_of_alpha / LARGEST_DEVIATION).powi(2);
    let unexplained = (misfit - 1.5).max(0.0);
    0.997 / ((1.0 + 0.3 * noisy) * (1.0 + 0.02 * unexplained))
}

fn explain_holes(reasons: &mut Array2<u8>, map: &DepthMap) {
    let unexplained = |reasons: &Array2<u8>| {
        reasons
            .indexed_iter()
            .filter(|(at, code)| **code == 0 && !map.depth_mm[*at].is_finite())
            .map(|(at, _)| at)
            .collect::<Vec<_>>()
    };
    let mut left = unexplained(reasons);
    if left.is_empty() {
        return;
    }
    // Reasons that make holes around them, checked first.
    let spreading = [
        Reason::Saturated,
        Reason::Dark,
        Reason::Edge,
        Reason::Moved,
        Reason::Misfit,
        Reason::BadPixel,
        Reason::NotFinite,
    ];
    let original = reasons.clone();
    for reason in spreading {
        if left.is_empty() {
            return;
        }
        let own = original.mapv(|code| code == reason.code());
        if own.iter().any(|own| *own) {
            let near = dilate_square(&own, SEARCH_PX);
            left.retain(|at| {
                if near[*at] {
                    reasons[*at] = reason.code();
                }
                !near[*at]
            });
        }
    }
    for at in left {
        reasons[at] = Reason::NoTexture.code();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With a slope of 30 mm: 3.6 mm of noise, 10.8 mm with the model's error, misfit 60.
    #[test]
    fn depths_are_believed_up_to_each_limit_and_no_further() {
        let range = Range { far_mm: 950.0, near_mm: 880.0, slope_mm: 30.0, learned: false };
        let verdict = |depth, deviations_mm, misfit| range.verdict(depth, deviations_mm, misfit, 0.0);
        let believed = |verdict: Option<Result<f32, Reason>>| matches!(verdict, Some(Ok(_)));
        let why = |verdict: Option<Result<f32, Reason>>| verdict.and_then(Result::err);
        assert!(believed(verdict(900.0, [0.3, 0.3], 59.0)));
        assert_eq!(why(verdict(900.0, [0.3, 0.3], 61.0)), Some(Reason::Misfit));
        let learned = Range { learned: true, far_mm: 950.0, near_mm: 880.0, slope_mm: 30.0 };
        assert!(
            believed(learned.verdict(900.0, [0.3, 0.3], 61.0, 0.0)),
            "the deviation has the model's error"
        );
        assert!(believed(verdict(900.0, [3.5, 3.5], 1.0)));
        assert_eq!(why(verdict(900.0, [3.7, 3.7], 1.0)), Some(Reason::NoTexture));
        assert_eq!(why(verdict(900.0, [f32::NAN, 0.3], 1.0)), Some(Reason::NoTexture));
        assert!(believed(verdict(900.0, [0.3, 10.7], 1.0)));
        assert_eq!(why(verdict(900.0, [0.3, 10.9], 1.0)), Some(Reason::Misfit));
        for depth in [880.0, 950.0] {
            assert!(believed(verdict(depth, [0.3, 0.3], 1.0)), "{depth}");
        }
        for depth in [879.9, 950.1] {
            assert_eq!(why(verdict(depth, [0.3, 0.3], 1.0)), Some(Reason::OutOfRange), "{depth}");
        }
        assert_eq!(why(range.verdict(900.0, [0.3, 0.3], 1.0, 1.0)), Some(Reason::Unsure));
    }
}
