//! Depth quality from pairs of a flat target, recorded to follow a rig over weeks.

use std::{
    io::ErrorKind,
    path::{Path, PathBuf},
};

use farnear_depth::measure::{DepthMethod, MeasureSettings, measure_pair_of_views};
use farnear_files::{
    mesh::{Lateral, Projection},
    staging::write_file,
};
use ndarray::{Array2, s};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{RigAddress, camera::CameraSettings, pair::take};
use crate::{
    clock,
    context::Context,
    error::{Result, WorkflowError},
    figures::{rounded, rounded_for},
    measure::{Rectangle, assumed_projection, fit},
    optics::GivenOptics,
    quantile,
    request::{PathKind, Request},
    text_file,
};

const PAIRS: std::ops::RangeInclusive<usize> = 2..=50;
/// Measured part of the image along each side: the border has less light and more distortion.
const MIDDLE: f64 = 0.8;
/// Distance from the plane, relative to the noise, from which a warning is given.
const BENT: f64 = 5.0;

/// Measure fill rate, plane fit, noise and accuracy of depth on a flat target, and append them to a record.
///
/// Put a flat, textured target square before the rig, inside the working range.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear rig quality --port sim --scene plane:920 --optics optics.toml --true-mm 920 --record quality.toml"
    )
)]
#[serde(default)]
pub struct QualityRequest {
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub rig: RigAddress,
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub camera: CameraSettings,
    /// The optics file.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub optics: PathBuf,
    /// Number of pairs, 2 to 50.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().pairs))]
    pub pairs: usize,
    /// The target's distance from the lens, for the accuracy.
    #[cfg_attr(feature = "clap", arg(long, value_name = "MM"))]
    pub true_mm: Option<f64>,
    /// The record to append to; created if missing.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub record: PathBuf,
}

impl Default for QualityRequest {
    fn default() -> Self {
        Self {
            rig: RigAddress::default(),
            camera: CameraSettings::default(),
            optics: PathBuf::new(),
            pairs: 10,
            true_mm: None,
            record: PathBuf::new(),
        }
    }
}

impl Request for QualityRequest {
    const NAME: &'static str = "rig quality";
    const REQUIRED: &'static [&'static str] = &["optics", "record"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("optics", PathKind::Input), ("record", PathKind::OutputFile)];
    type Figures = QualityFigures;

    fn check(&self) -> Result<()> {
        if !PAIRS.contains(&self.pairs) {
            return Err(WorkflowError::parameter("pairs", self.pairs, "expected 2 to 50"));
        }
        match self.true_mm.filter(|mm| !(*mm > 0.0 && mm.is_finite())) {
            Some(mm) => Err(WorkflowError::parameter("true-mm", mm, "expected a positive number of mm")),
            None => Ok(()),
        }
    }

    fn run(&self, context: &Context<'_>) -> Result<QualityFigures> {
        measure(self, context)
    }
}

crate::request::camera_request!(QualityRequest);

#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct QualityFigures {
    /// Only for real hardware.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    pub pairs: usize,
    pub fill_rate: f64,
    pub mean_mm: f64,
    /// Root-mean-square distance of the mean map from its plane.
    pub plane_rms_mm: f64,
    /// Angle between the plane and the sensor plane.
    pub tilt_deg: f64,
    /// Median over the pixels of the standard deviation over the pairs.
    pub temporal_noise_mm: f64,
    /// Median of the standard deviations predicted for the first pair.
    pub predicted_noise_mm: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accuracy_mm: Option<f64>,
}

impl QualityFigures {
    fn warning(&self) -> Option<String> {
        let Self { plane_rms_mm, tilt_deg, .. } = self;
        let noise_mm = self.temporal_noise_mm.max(self.predicted_noise_mm);
        (*plane_rms_mm > BENT * noise_mm).then(|| {
            format!(
                "the map is {plane_rms_mm} mm (RMS) from a plane tilted by {tilt_deg} degrees, with a noise of {noise_mm} mm: the target \
                 is not flat, or the optics are not those of this lens"
            )
        })
    }
}

#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct QualityRecord {
    #[serde(default, rename = "measurement")]
    pub measurements: Vec<QualityFigures>,
}

/// Reads a record; empty if there is no file.
pub fn read_record(path: &Path) -> Result<QualityRecord> {
    match text_file::read(path) {
        Ok(text) => toml::from_str(&text).map_err(WorkflowError::file(path, "a record of depth quality")),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(QualityRecord::default()),
        Err(error) => Err(WorkflowError::read("the record", path)(error)),
    }
}

/// Captures the pairs, computes depth and appends the figures. The record changes only at the end.
pub fn measure(request: &QualityRequest, context: &Context<'_>) -> Result<QualityFigures> {
    request.check()?;
    let optics = GivenOptics::read(&request.optics)?;
    read_record(&request.record)?;
    let method = DepthMethod::Whitened;
    let computation = MeasureSettings { window: method.usual_window(), ..MeasureSettings::default() };
    let mut rig = request.camera.connect(&request.rig, Some(&optics), context)?;
    let emulated = rig.rig.client.hello().emulated;
    let mut maps = Vec::new();
    let mut predicted = None;
    for index in 0..request.pairs {
        context.cancel.check("measuring the depth quality")?;
        let (pair, _) = take(&mut rig, &optics, &request.camera, context)?;
        let (far, near) = (pair.far.image.grey(), pair.near.image.grey());
        let found =
            measure_pair_of_views(far.view(), near.view(), &optics.optics, method, None, &computation)?;
        predicted.get_or_insert(found.validity.deviation_mm);
        maps.push(found.map.depth_mm);
        context.progress.advance("pairs", index + 1, Some(request.pairs));
    }
    let projection = assumed_projection(&optics.optics, None);
    let found = figures(&maps, predicted.as_ref(), projection, request.true_mm)?;
    let found = QualityFigures { time: (!emulated).then(clock::now_rfc3339).flatten(), ..found };
    if let Some(warning) = found.warning() {
        context.progress.warn(&warning);
    }
    append(&request.record, found.clone())?;
    Ok(found)
}

/// Reads the record again: another run may have appended to it since.
fn append(path: &Path, found: QualityFigures) -> Result<()> {
    let mut record = read_record(path)?;
    record.measurements.push(found);
    Ok(write_file(path, toml::to_string(&record)?.as_bytes())?)
}

fn figures(
    maps: &[Array2<f32>],
    predicted: Option<&Array2<f32>>,
    projection: Projection,
    true_mm: Option<f64>,
) -> Result<QualityFigures> {
    let (height, width) = maps.first().map_or((0, 0), Array2::dim);
    let rim = |size: usize| ((1.0 - MIDDLE) / 2.0 * size as f64) as usize;
    let (top, left) = (rim(height), rim(width));
    let window = s![top..height - top, left..width - left];
    let middles: Vec<_> = maps.iter().map(|map| map.slice(window)).collect();
    let (mut mean, mut noise, mut filled) =
        (Array2::from_elem((height, width), f32::NAN), Vec::new(), 0usize);
    let pixels = middles.first().map_or(0, |map| map.len());
    for row in 0..height - 2 * top {
        for column in 0..width - 2 * left {
            let depths: Vec<f64> =
                middles.iter().map(|map| f64::from(map[[row, column]])).filter(|z| z.is_finite()).collect();
            filled += depths.len();
            if depths.len() < maps.len() {
                continue; // a pixel that is there now and then says nothing about the noise of depth
            }
            let (middle, deviation) = spread(&depths);
            mean[[row + top, column + left]] = middle as f32;
            noise.push(deviation);
        }
    }
    let whole = Rectangle { x: 0, y: 0, width, height };
    let plane = fit(mean.view(), Lateral::Lens(projection), whole).ok_or_else(|| {
        WorkflowError::parameter(
            "target",
            format!("{} pixels with a depth", noise.len()),
            "expected a textured plane within the working range",
        )
    })?;
    let predicted_mm = predicted.and_then(|map| quantile::of_map(map.slice(window), 0.5)).unwrap_or_default();
    let noise_mm = quantile::of_values(noise, 0.5).unwrap_or_default();
    let of_noise = |mm: f64| rounded_for(noise_mm.max(predicted_mm), mm, 4);
    Ok(QualityFigures {
        time: None,
        pairs: maps.len(),
        fill_rate: rounded(filled as f64 / (pixels * maps.len()).max(1) as f64, 6),
        mean_mm: of_noise(plane.z_mm),
        plane_rms_mm: of_noise(plane.rms_mm),
        tilt_deg: rounded(plane.tilt_deg, 3),
        temporal_noise_mm: of_noise(noise_mm),
        predicted_noise_mm: of_noise(predicted_mm),
        accuracy_mm: true_mm.map(|true_mm| of_noise(plane.z_mm - true_mm)),
    })
}

/// Mean and sample standard deviation of at least two values.
fn spread(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROJECTION: Projection =
        Projection { centre_mm: 50.0, distance_mm: 50.0, pixel_um: 7.4, axis_px: None };

    /// Maps of a plane at 900 mm that differ by `noise` from pair to pair.
    fn maps(noise: f32) -> Vec<Array2<f32>> {
        let sign = |index: usize| if index.is_multiple_of(2) { 1.0 } else { -1.0 };
        (0..4).map(|index| Array2::from_shape_fn((50, 60), |_| 900.0 + noise * sign(index))).collect()
    }

    #[test]
    fn a_target_that_is_not_flat_is_reported() {
        let stair = |map: &mut Array2<f32>| map.slice_mut(s![.., 30..]).mapv_inplace(|z| z + 10.0);
        for is_flat in [true, false] {
            let mut maps = maps(0.2);
            if !is_flat {
                maps.iter_mut().for_each(stair);
            }
            let found = figures(&maps, None, PROJECTION, None).unwrap();
            assert_eq!(found.warning().is_none(), is_flat, "{found:?}");
        }
    }

    #[test]
    fn noise_over_time_and_accuracy_are_measured() {
        let predicted = Array2::from_elem((50, 60), 2.5f32);
        let found = figures(&maps(2.0), Some(&predicted), PROJECTION, Some(899.0)).unwrap();
        // +2, -2, +2, -2: the sample's deviation is sqrt(16 / 3).
        assert!((found.temporal_noise_mm - (16.0f64 / 3.0).sqrt()).abs() < 1e-3, "{found:?}");
        assert_eq!((found.fill_rate, found.plane_rms_mm, found.tilt_deg), (1.0, 0.0, 0.0));
        assert_eq!((found.mean_mm, found.accuracy_mm, found.predicted_noise_mm), (900.0, Some(1.0), 2.5));
    }

    #[test]
    fn the_noise_of_a_microscope_keeps_its_digits() {
        let mm = |index: u16| if index.is_multiple_of(2) { 47.49996_f32 } else { 47.50004 };
        let maps: Vec<_> = (0..4).map(|index| Array2::from_elem((50, 60), mm(index))).collect();
        let found = figures(&maps, None, PROJECTION, None).unwrap();
        // Four values 40 nm from their mean: the sample's deviation is 46 nm.
        assert!((found.temporal_noise_mm - 46e-6).abs() < 5e-6, "{found:?}");
    }

    #[test]
    fn missing_pixels_lower_the_fill_rate_and_a_map_without_depth_has_no_quality() {
        let mut some = maps(0.0);
        some[0].slice_mut(s![.., ..30]).fill(f32::NAN);
        let found = figures(&some, None, PROJECTION, None).unwrap();
        assert!((found.fill_rate - 0.875).abs() < 1e-9 && found.accuracy_mm.is_none(), "{found:?}");
        let none = vec![Array2::from_elem((50, 60), f32::NAN); 2];
        assert!(figures(&none, None, PROJECTION, None).is_err());
    }

    #[test]
    fn records_are_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("quality.toml");
        assert_eq!(read_record(&path).unwrap(), QualityRecord::default());
        let measurements = [1.0, 2.0].map(|noise| figures(&maps(noise), None, PROJECTION, None).unwrap());
        for found in measurements.clone() {
            append(&path, found).unwrap();
        }
        assert_eq!(read_record(&path).unwrap().measurements, measurements);
        std::fs::write(&path, "measurement = 3").unwrap();
        assert!(read_record(&path).is_err());
    }
}
