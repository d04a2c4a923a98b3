//! Shared by the baselines: check and normalisation of a pair, separable filters, maps from evidence.

use ndarray::{Array2, ArrayView2, CowArray, Ix2, Zip};

use crate::border::reflect;
use crate::confidence;
use crate::fill;
use crate::median::medians;
use crate::metrics::dilate_square;
use crate::optics::Optics;
use crate::pipeline::{
    Backend, DepthMap, MAX_ALPHA, RunError, Settings, Warning, check, check_windows, warnings_after,
};

/// A checked pair, each image divided by its mean; pixels without a value hold the mean.
pub(super) struct Pair {
    pub far: Array2<f32>,
    pub near: Array2<f32>,
    holes: Option<Array2<bool>>,
    warnings: Vec<Warning>,
}

pub(super) struct Evidence {
    pub alpha: Array2<f32>,
    pub texture: Array2<f32>,
    /// Part of the evidence that contradicts the depth, 0 = none.
    pub misfit: Array2<f32>,
    /// Radius of the input of a result.
    pub reach_px: usize,
}

impl Pair {
    pub(super) fn new(
        far: ArrayView2<f32>,
        near: ArrayView2<f32>,
        settings: &Settings,
    ) -> Result<Self, RunError> {
        check_windows(settings)?;
        let [far, near] = [&far, &near].map(|image| image.as_standard_layout());
        let input = check(&far, &near, Backend::best(), 1)?;
        let (holes, warnings) = (input.bad().cloned(), input.pixel_warnings());
        let valid_at = |at: usize| !holes.as_ref().and_then(|holes| holes.as_slice()).is_some_and(|h| h[at]);
        let normalise = |which, image: &CowArray<'_, f32, Ix2>| {
            let valid = || image.iter().enumerate().filter(|(at, _)| valid_at(*at)).map(|(_, value)| *value);
            let Some(first) = valid().next() else { return Err(RunError::NothingFinite) };
            if valid().all(|value| value == first) {
                return Err(RunError::Constant { which, value: first });
            }
            let count = valid().count() as f64;
            let mean = valid().map(f64::from).sum::<f64>() / count;
            // An image may be centred on 0; then its spread is the scale.
            let spread = (valid().map(|v| (f64::from(v) - mean).powi(2)).sum::<f64>() / count).sqrt();
            let scale = if mean.abs() > spread { mean } else { spread };
            let mut normalised = image.mapv(|value| ((f64::from(value) - mean) / scale) as f32);
            if let Some(holes) = &holes {
                Zip::from(&mut normalised).and(holes).for_each(|value, hole| {
                    if *hole {
                        *value = 0.0;
                    }
                });
            }
            Ok(normalised)
        };
        let (far, near) = (normalise("far", &far)?, normalise("near", &near)?);
        Ok(Self { far, near, holes, warnings })
    }

    pub(super) fn finish(&self, evidence: Evidence, optics: &Optics, settings: &Settings) -> DepthMap {
        let Evidence { alpha, mut texture, misfit, reach_px } = evidence;
        let mut alpha = alpha;
        let mut energy = settings.fill.then(|| texture.clone());
        if let Some(holes) = &self.holes {
            let near_holes = dilate_square(holes, reach_px);
            Zip::from(&mut alpha).and(&mut texture).and(&near_holes).for_each(|alpha, texture, near_hole| {
                if *near_hole {
                    (*alpha, *texture) = (f32::NAN, 0.0);
                }
            });
            if let Some(energy) = &mut energy {
                confidence::withhold(energy, &near_holes);
            }
        }
        let scale = confidence::texture_scale(texture.view());
        let low = texture.iter().filter(|t| **t < confidence::LOW_TEXTURE * scale).count();
        let low_texture_fraction = low as f64 / texture.len() as f64;
        let mut depth_mm = medians(alpha, settings.median_px);
        let mut values = texture;
        Zip::from(&mut depth_mm).and(&mut values).and(&misfit).for_each(|depth, value, misfit| {
            *value =
                if depth.is_nan() { 0.0 } else { confidence::confidence(*value, misfit.max(0.0), scale) };
            let alpha = depth.clamp(-MAX_ALPHA, MAX_ALPHA);
            *depth = if *value > 0.0 { optics.depth_mm(f64::from(alpha)) as f32 } else { f32::NAN };
        });
        let warnings = self.warnings.clone();
        let mut map = DepthMap { depth_mm, confidence: values, filled: None, low_texture_fraction, warnings };
        if let Some(energy) = energy {
            let pair = [&self.far, &self.near].map(|image| image.mapv(|value| 1.0 + value));
            let pair = pair.each_ref().map(|image| image.view());
            fill::fill(&mut map, energy.view(), pair, reach_px, settings.filling());
        }
        map.warnings.extend(warnings_after(&map, optics));
        map
    }
}

#[derive(Clone, Copy)]
pub(super) enum Along {
    Rows,
    Columns,
}

/// `image` filtered along one direction by an odd number of taps, centred; borders are reflected.
pub(super) fn filter(image: &Array2<f32>, taps: &[f32], along: Along) -> Array2<f32> {
    let half = taps.len() / 2;
    let (height, width) = image.dim();
    let mut out = Array2::zeros((height, width));
    match along {
        Along::Rows => {
            let mut padded = vec![0.0; width + 2 * half];
            for (row, mut out) in image.outer_iter().zip(out.outer_iter_mut()) {
                for (i, value) in padded.iter_mut().enumerate() {
                    *value = row[reflect(i as isize - half as isize, width)];
                }
                for (i, tap) in taps.iter().enumerate() {
                    for (out, value) in out.iter_mut().zip(&padded[i..i + width]) {
                        *out += tap * value;
                    }
                }
            }
        }
        Along::Columns => {
            for (y, mut out) in out.outer_iter_mut().enumerate() {
                for (i, tap) in taps.iter().enumerate() {
                    let row = image.row(reflect((y + i) as isize - half as isize, height));
                    for (out, value) in out.iter_mut().zip(row) {
                        *out += tap * value;
                    }
                }
            }
        }
    }
    out
}

pub(super) fn filter_both(image: &Array2<f32>, along_rows: &[f32], along_columns: &[f32]) -> Array2<f32> {
    filter(&filter(image, along_rows, Along::Rows), along_columns, Along::Columns)
}

pub(super) fn window_sum(image: &Array2<f32>, side: usize) -> Array2<f32> {
    let taps = vec![1.0; side];
    filter_both(image, &taps, &taps)
}
