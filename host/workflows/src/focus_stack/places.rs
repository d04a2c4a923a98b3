//! Which images make a stack, and where each is focused.

use std::path::PathBuf;

use farnear_capture::record::{CaptureRecord, read_record};
use farnear_depth::optics::{Distortion, Optics};
use farnear_files::masks;
use ndarray::Array2;

use super::FocusStackSettings;
use crate::{
    error::{Result, WorkflowError},
    optics,
};

/// Where the images of a stack are focused, one number each.
#[derive(Clone, PartialEq, Debug)]
pub enum Places {
    /// Distances from lens to object, mm.
    ObjectMm(Vec<f64>),
    /// Distances from lens to sensor, mm.
    SensorMm(Vec<f64>),
}

/// The images of a stack in the order of their focus.
pub(super) struct Listed {
    pub images: Vec<PathBuf>,
    /// Distances from lens to object at which they are sharp, mm, rising or falling.
    pub focused_at_mm: Option<Vec<f64>>,
    /// What the lens bends, where that is known.
    pub distortion: Option<Distortion>,
}

/// The images, and what is known of them.
pub(super) fn of(settings: &FocusStackSettings) -> Result<Listed> {
    let record = if settings.stack.is_dir() { read_record(&settings.stack)? } else { None };
    let images = match &record {
        Some(record) => record.exposure.iter().map(|exposure| settings.stack.join(&exposure.image)).collect(),
        None => masks::listed(&settings.stack)?,
    };
    let focused_at_mm = match (&settings.places, &record) {
        (Some(Places::ObjectMm(distances)), _) => Some(distances.clone()),
        (Some(Places::SensorMm(distances)), _) => Some(objects(distances, settings)?),
        (None, Some(record)) => Some(objects(&sensors(record), settings)?),
        (None, None) => None,
    };
    let distortion = lens(settings)?.and_then(|lens| lens.distortion());
    let Some(focused_at_mm) = focused_at_mm else {
        return Ok(Listed { images, focused_at_mm: None, distortion });
    };
    if focused_at_mm.len() != images.len() {
        let expected = format!("one for each of the {} images is needed", images.len());
        return Err(WorkflowError::parameter(
            "distances",
            format!("{} numbers", focused_at_mm.len()),
            expected,
        ));
    }
    let mut order: Vec<(f64, PathBuf)> = focused_at_mm.into_iter().zip(images).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let Some(twice) = order.windows(2).find(|two| two[0].0 == two[1].0) {
        let expected =
            "each image of a stack is focused elsewhere: a program's further runs make stacks of their own";
        return Err(WorkflowError::parameter("distance", format!("{} mm twice", twice[0].0), expected));
    }
    let (focused_at_mm, images) = order.into_iter().unzip();
    Ok(Listed { images, focused_at_mm: Some(focused_at_mm), distortion })
}

/// The lens, where somebody knows it; optics that are named or lie in the folder have to be right.
fn lens(settings: &FocusStackSettings) -> Result<Option<Optics>> {
    // A pair's far image names the folder; here any name in it does.
    let found = optics::of_pair(settings.optics.as_deref(), &settings.stack.join("stack.png"));
    match found {
        Ok((lens, _)) => Ok(Some(lens)),
        Err(error) if settings.optics.is_some() || settings.stack.join("optics.toml").is_file() => Err(error),
        Err(_) => Ok(None),
    }
}

fn sensors(record: &CaptureRecord) -> Vec<f64> {
    record.exposure.iter().map(|exposure| exposure.sensor_measured_mm).collect()
}

/// Distances of the objects that are sharp with the sensor so far from the lens: the thin lens, u = F w / (w - F).
fn objects(sensor_mm: &[f64], settings: &FocusStackSettings) -> Result<Vec<f64>> {
    // A pair's far image names the folder; here any name in it does.
    let (lens, _) = optics::of_pair(settings.optics.as_deref(), &settings.stack.join("stack.png"))?;
    let focal_length_mm = lens.focal_length_mm();
    let object = |&sensor_mm: &f64| {
        if sensor_mm > focal_length_mm {
            Ok(focal_length_mm * sensor_mm / (sensor_mm - focal_length_mm))
        } else {
            Err(WorkflowError::InsideFocalLength { sensor_mm, focal_length_mm })
        }
    };
    sensor_mm.iter().map(object).collect()
}

impl Listed {
    pub(super) fn depth(&self, place: &Array2<f32>) -> Array2<f32> {
        depth_of_places(place, self.focused_at_mm.as_deref())
    }
}

/// Depth of each place in the stack: mm where the distances are known, else the number of the image, from 1. Between images
/// the sensor's distance is what changes evenly, and that goes with the reciprocal of depth.
pub fn depth_of_places(place: &Array2<f32>, focused_at_mm: Option<&[f64]>) -> Array2<f32> {
    let Some(mm) = focused_at_mm else { return place.mapv(|place| place + 1.0) };
    place.mapv(|place| {
        if !place.is_finite() {
            return f32::NAN;
        }
        let below = (place as usize).min(mm.len().saturating_sub(2));
        let part = f64::from(place) - below as f64;
        ((1.0 - part) / mm[below] + part / mm[below + 1]).recip() as f32
    })
}

/// Numbers with commas between them, as a person types them.
///
/// # Errors
/// What is no number above 0.
pub fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let number = |part: &str| {
        let found = part.trim().parse::<f64>().ok().filter(|v| v.is_finite() && *v > 0.0);
        found.ok_or_else(|| {
            format!("`{}` is no distance in mm; expected numbers such as 300,310,320", part.trim())
        })
    };
    text.split(',').map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn between_images_the_reciprocal_is_even() {
        let listed = Listed { images: vec![], focused_at_mm: Some(vec![500.0, 1000.0]), distortion: None };
        let depth = listed.depth(&array![[0.0, 0.5, 1.0, f32::NAN]]);
        assert_eq!(depth[(0, 0)], 500.0);
        assert!((depth[(0, 1)] - 666.667).abs() < 1e-2);
        assert_eq!(depth[(0, 2)], 1000.0);
        assert!(depth[(0, 3)].is_nan());
        let unknown = Listed { images: vec![], focused_at_mm: None, distortion: None };
        assert_eq!(unknown.depth(&array![[2.5_f32]]), array![[3.5_f32]]);
    }

    #[test]
    fn distances_are_numbers_above_nought() {
        assert_eq!(numbers("300, 310.5"), Ok(vec![300.0, 310.5]));
        for wrong in ["", "300,,310", "-3", "far", "NaN"] {
            assert!(numbers(wrong).is_err(), "{wrong}");
        }
    }
}
