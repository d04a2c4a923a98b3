//! Validity of each depth: whether there is one, why not, its standard deviation and confidence. A depth is removed
//! beyond the working range (where the estimate stays near the range's end), where its standard deviation is so large
//! that noise may have made it, and where the model leaves far more than noise. The others get a standard deviation
//! widened by the residual, and a confidence: the probability of an error below three of these.

use ndarray::{Array2, ArrayView1, Axis, Zip};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::adaptive_window::Estimate;
use crate::depth_map::DepthMap;
use crate::metrics::dilate_square;
use crate::optics::{Optics, unexplained};
use crate::prepare::{Prepared, noise::PairNoise};
use crate::reason::Reason;
use crate::simd::{self, Backend, Believed};

/// Largest valid |alpha|: a tenth beyond either focus the operators are accurate to 1 mm.
pub const LARGEST_ALPHA: f64 = 1.1;
/// Standard deviation of alpha from which noise may have made a depth.
const LARGEST_DEVIATION: f32 = 0.12;
/// Systematic error of alpha per root of the unexplained part of the texture: a residual that is all depth has 1.
const MODEL_ERROR: f32 = 1.0;
/// Error of depth, relative to its distance from the middle of the range, per root of the part of the texture that
/// lossy compression changed: rounding to zero favours the sharper image.
const CODING_ERROR: f32 = 0.15;
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
    let mut reasons = prepared.reasons.clone();
    let Estimate { mut deviation_mm, misfit, left_over, noise_part, .. } = estimate;
    let range = range(optics);
    let backend = Backend::best();
    let stage =
        optics.stage().map(|stage| [stage.residual, stage.usual_unexplained].map(|value| value as f32));
    let of_model = MODEL_ERROR.powi(2) * (left_over as f32 - USUAL_LEFT_OVER).max(0.0);
    let of_coding = match prepared.noise {
        PairNoise { coding, mean_variance, .. } if coding > 0.0 => {
            CODING_ERROR * ((coding / mean_variance * noise_part) as f32).sqrt()
        }
        _ => 0.0,
    };
    let middle_mm = optics.depth_mm(0.0) as f32;
    let filled = map.filled.take().filter(|_| settings.filled);
    let least = settings.least_confidence;
    Zip::indexed(map.depth_mm.rows_mut())
        .and(map.confidence.rows_mut())
        .and(deviation_mm.rows_mut())
        .and(misfit.rows())
        .and(reasons.rows_mut())
        .par_for_each(|y, mut depth, mut confidence, mut deviation, misfit, mut reasons| {
            let rows = [&mut depth, &mut confidence, &mut deviation].map(|row| row.as_slice_mut());
            let ([Some(depth), Some(confidence), Some(deviation)], Some(reasons)) =
                (rows, reasons.as_slice_mut())
            else {
                unreachable!("maps are made in standard layout")
            };
            let measured = filled.is_some().then(|| (depth.to_vec(), confidence.to_vec()));
            let noise = deviation.to_vec();
            let mut misfit = misfit.to_vec();
            for (((deviation, noise), misfit), depth) in
                deviation.iter_mut().zip(&noise).zip(&mut misfit).zip(&*depth)
            {
                let slope_mm = range.slope_mm(*depth);
                *deviation = match stage {
                    Some([residual, usual]) => {
                        // Relative to the target that the lens was learned from.
                        *misfit = unexplained(*misfit, noise / slope_mm) / usual;
                        noise.hypot(model_error(residual, *misfit) * slope_mm)
                    }
                    None => (noise * noise * misfit.max(1.0) + of_model * slope_mm * slope_mm).sqrt(),
                };
            }
            if of_coding > 0.0 {
                for (deviation, depth) in deviation.iter_mut().zip(&*depth) {
                    *deviation = deviation.hypot(of_coding * (depth - middle_mm));
                }
            }
            simd::believe_row(
                backend,
                range,
                least,
                &noise,
                &misfit,
                reasons,
                [depth, confidence, deviation],
            );
            if let (Some((depths, confidences)), Some(filled)) = (measured, &filled) {
                for (x, _) in filled.row(y).iter().enumerate().filter(|(_, filled)| **filled) {
                    if depths[x].is_finite() {
                        (depth[x], confidence[x], reasons[x]) = (depths[x], confidences[x], 0);
                        deviation[x] = FILLED_DEVIATION * range.slope_mm(depth[x]);
                    }
                }
            }
        });
    map.filled = filled;
    drop(misfit); // a map is large, and what follows needs one more
    explain_holes(&mut reasons, map);
    let lost = lost_pixels(&reasons);
    map.low_texture_fraction =
        lost.iter().find(|lost| lost.reason == Reason::NoTexture).map_or(0.0, |lost| lost.fraction);
    Validity { reasons, deviation_mm, lost, valid_fraction: map.valid_fraction() }
}

/// Standard deviation of normalised depth by model error, for a residual `ratio` times the learned target's.
pub(crate) fn model_error(residual: f32, ratio: f32) -> f32 {
    residual * ratio.max(1.0).sqrt()
}

/// Pixels without a depth by reason, from the map of reasons.
pub fn lost_pixels(reasons: &Array2<u8>) -> Vec<Lost> {
    let total = reasons.len() as f64;
    let mut counts = [0_usize; 256];
    for row in reasons.rows() {
        // Rows without a reason, which are most, are counted in vectors.
        if row.iter().fold(0, |all, code| all | code) != 0 {
            row.iter().for_each(|code| counts[usize::from(*code)] += 1);
        }
    }
    Reason::ALL
        .into_iter()
        .map(|reason| (reason, counts[usize::from(reason.code())]))
        .filter(|(_, count)| *count > 0)
        .map(|(reason, count)| Lost { reason, code: reason.code(), fraction: count as f64 / total })
        .collect()
}

fn range(optics: &Optics) -> Believed {
    let [far_mm, near_mm] = optics.range_mm(LARGEST_ALPHA).map(|mm| mm as f32);
    Believed {
        far_mm,
        near_mm,
        focal_length_mm: optics.focal_length_mm() as f32,
        steepness: optics.steepness() as f32,
        largest_deviation: LARGEST_DEVIATION,
        // A learned deviation includes the model's error.
        largest_misfit: if optics.stage().is_some() { f32::INFINITY } else { LARGEST_MISFIT },
    }
}

fn explain_holes(reasons: &mut Array2<u8>, map: &DepthMap) {
    let unexplained = |(y, row): (usize, ArrayView1<f32>)| {
        let codes = reasons.row(y);
        // In vectors; in most rows every pixel has a depth.
        let present = row.iter().map(|depth| u32::from(depth.is_finite())).sum::<u32>() as usize;
        let pixels = if present == row.len() { 0..0 } else { 0..row.len() };
        pixels.filter(|x| codes[*x] == 0 && !row[*x].is_finite()).map(|x| (y, x)).collect::<Vec<_>>()
    };
    let mut left: Vec<(usize, usize)> =
        map.depth_mm.axis_iter(Axis(0)).into_par_iter().enumerate().flat_map_iter(unexplained).collect();
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
    let present = lost_pixels(&original);
    for reason in spreading {
        if left.is_empty() {
            return;
        }
        if !present.iter().any(|lost| lost.reason == reason) {
            continue;
        }
        let near = dilate_square(&original.mapv(|code| code == reason.code()), SEARCH_PX);
        left.retain(|at| {
            if near[*at] {
                reasons[*at] = reason.code();
            }
            !near[*at]
        });
    }
    for at in left {
        reasons[at] = Reason::NoTexture.code();
    }
}

#[cfg(test)]
mod tests;
