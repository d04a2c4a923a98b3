//! Selects the images of a stack and their focus positions.

use std::path::PathBuf;

use farnear_capture::record::{CAPTURE_FILE, CaptureRecord, read_record};
use farnear_depth::optics::{Distortion, Optics};
use farnear_files::{order, stack};
use ndarray::Array2;

use super::FocusStackRequest;
use crate::{
    error::{Result, WorkflowError},
    optics,
};

/// Coordinate of the images in a stack.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Axis {
    /// Distance from lens to object. Sensor distance is linear in its reciprocal.
    ObjectMm,
    StageUm,
    /// Image number, from 1.
    Number,
}

pub(super) struct Listed {
    pub images: Vec<PathBuf>,
    pub axis: Axis,
    pub positions: Vec<f64>,
    pub described_by: Vec<PathBuf>,
    pub optics: Option<Optics>,
    /// Side of a pixel at the object, from the file's metadata.
    pub object_pixel_um: Option<f64>,
    pub remarks: Vec<String>,
}

pub(super) fn of(request: &FocusStackRequest) -> Result<Listed> {
    let record = if request.stack.is_dir() { read_record(&request.stack)? } else { None };
    let listed = match &record {
        Some(record) => stack::Stack {
            images: record.exposure.iter().map(|exposure| request.stack.join(&exposure.image)).collect(),
            ..stack::Stack::default()
        },
        None => stack::list(&request.stack)?,
    };
    let (images, mut remarks) = (listed.images, listed.remarks);
    let (axis, positions) = match (&request.distances_mm, &request.sensor_mm, &request.positions_um, &record)
    {
        (Some(distances), ..) => (Axis::ObjectMm, distances.clone()),
        (_, Some(distances), ..) => (Axis::ObjectMm, objects(distances, request)?),
        (_, _, Some(positions), _) => (Axis::StageUm, positions.clone()),
        (.., Some(record)) => (Axis::ObjectMm, objects(&sensors(record), request)?),
        (.., None) => match listed.positions_um {
            Some(positions) => (Axis::StageUm, positions),
            None => {
                remarks.extend(order::gap(&images).map(|[before, after]| {
                    format!(
                        "the numbers in the names have a gap between {} and {}: images are counted without it; if one is missing \
                         there, give --positions-um",
                        before.display(),
                        after.display()
                    )
                }));
                (Axis::Number, (1..=images.len()).map(|number| number as f64).collect())
            }
        },
    };
    let optics = lens(request)?;
    let object_pixel_um = listed.object_pixel_um;
    if positions.len() != images.len() {
        let expected = format!("one for each of the {} images is needed", images.len());
        let name = match (axis, &request.sensor_mm) {
            (Axis::StageUm, _) => "positions-um",
            (_, Some(_)) => "sensor-mm",
            _ => "distances-mm",
        };
        return Err(WorkflowError::parameter(name, format!("({} numbers)", positions.len()), expected));
    }
    let mut order: Vec<(f64, PathBuf)> = positions.into_iter().zip(images).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let Some(twice) = order.windows(2).find(|two| two[0].0 == two[1].0) {
        let expected =
            "each image of a stack has its own focus: a program's further runs are separate stacks";
        return Err(WorkflowError::parameter(
            "distance",
            format!("{} {} twice", twice[0].0, axis.unit()),
            expected,
        ));
    }
    let (positions, images) = order.into_iter().unzip();
    let described_by =
        crate::optics::file_of_pair(request.optics.as_deref(), &request.stack.join("stack.png"));
    let capture = record.map(|_| request.stack.join(CAPTURE_FILE));
    let mut described_by: Vec<PathBuf> = described_by.into_iter().chain(capture).collect();
    described_by.dedup();
    Ok(Listed { images, axis, positions, described_by, optics, object_pixel_um, remarks })
}

fn lens(request: &FocusStackRequest) -> Result<Option<Optics>> {
    // A far image's path gives the folder; any name in it works.
    let found = optics::of_pair(request.optics.as_deref(), &request.stack.join("stack.png"));
    match found {
        // Of a lens without a scale, lateral positions are not known. The images are not binned.
        Ok((lens, _)) if lens.stage().is_some_and(|stage| !stage.scale_known) => Ok(None),
        Ok((lens, _)) => Ok(Some(lens.unbinned())),
        Err(error) if request.optics.is_some() || request.stack.join("optics.toml").is_file() => Err(error),
        Err(_) => Ok(None),
    }
}

fn sensors(record: &CaptureRecord) -> Vec<f64> {
    record.exposure.iter().map(|exposure| exposure.sensor_measured_mm).collect()
}

/// Object distances in focus at these sensor distances; thin lens, u = F w / (w - F).
fn objects(sensor_mm: &[f64], request: &FocusStackRequest) -> Result<Vec<f64>> {
    let found = optics::of_pair(request.optics.as_deref(), &request.stack.join("stack.png"));
    let (lens, _) = found.map_err(|error| match error {
        WorkflowError::NoOptics { .. } => WorkflowError::NoStackOptics { stack: request.stack.clone() },
        error => error,
    })?;
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

impl Axis {
    pub(super) fn unit(self) -> &'static str {
        match self {
            Self::ObjectMm => "mm",
            Self::StageUm => "um",
            Self::Number => "image",
        }
    }

    /// Maps a position to the coordinate in which a sharpness curve is symmetric.
    fn even(self, position: f64) -> f64 {
        if self == Self::ObjectMm { -1.0 / position } else { position }
    }

    fn position(self, even: f64) -> f64 {
        if self == Self::ObjectMm { -1.0 / even } else { even }
    }
}

impl Listed {
    pub(super) fn distortion(&self) -> Option<Distortion> {
        self.optics.and_then(|lens| lens.distortion())
    }

    /// Positions in the coordinate of the peak fit.
    pub(super) fn even_positions(&self) -> Vec<f64> {
        self.positions.iter().map(|position| self.axis.even(*position)).collect()
    }

    pub(super) fn depth(&self, place: &Array2<f32>) -> Array2<f32> {
        depth_at(place, self.axis, &self.even_positions())
    }

    pub(super) fn without(&mut self, left_out: &[usize]) {
        for index in left_out.iter().rev() {
            self.images.remove(*index);
            self.positions.remove(*index);
        }
    }
}

/// Coordinates for [`farnear_depth::focus_stack::depth_from_positions`]; evenly spaced without distances.
pub fn even_positions(count: usize, focused_at_mm: Option<&[f64]>) -> Vec<f64> {
    match focused_at_mm {
        Some(mm) => mm.iter().map(|mm| Axis::ObjectMm.even(*mm)).collect(),
        None => (1..=count).map(|number| number as f64).collect(),
    }
}

/// Depths of places among images at these [`even_positions`]: in mm if these are of distances, else image numbers from 1.
pub fn depth_of_places(place: &Array2<f32>, even: &[f64], in_mm: bool) -> Array2<f32> {
    depth_at(place, if in_mm { Axis::ObjectMm } else { Axis::Number }, even)
}

fn depth_at(place: &Array2<f32>, axis: Axis, even: &[f64]) -> Array2<f32> {
    place.mapv(|place| {
        if !place.is_finite() {
            return f32::NAN;
        }
        let below = (place as usize).min(even.len().saturating_sub(2));
        let part = f64::from(place) - below as f64;
        axis.position((1.0 - part) * even[below] + part * even[below + 1]) as f32
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    fn listed(axis: Axis, positions: Vec<f64>) -> Listed {
        Listed {
            images: vec![PathBuf::new(); positions.len()],
            axis,
            positions,
            described_by: vec![],
            optics: None,
            object_pixel_um: None,
            remarks: vec![],
        }
    }

    #[test]
    fn between_images_the_reciprocal_of_a_distance_is_even() {
        let of_distances = listed(Axis::ObjectMm, vec![500.0, 1000.0]);
        let depth = of_distances.depth(&array![[0.0, 0.5, 1.0, f32::NAN]]);
        assert_eq!(depth[(0, 0)], 500.0);
        assert!((depth[(0, 1)] - 666.667).abs() < 1e-2);
        assert_eq!(depth[(0, 2)], 1000.0);
        assert!(depth[(0, 3)].is_nan());
    }

    #[test]
    fn sensor_distances_without_a_lens_name_the_stack() {
        let folder = tempfile::tempdir().unwrap();
        let stack = folder.path().to_path_buf();
        let request = FocusStackRequest { stack, ..FocusStackRequest::default() };
        let error = objects(&[52.0, 53.0], &request).unwrap_err().to_string();
        assert!(error.contains(&format!("the stack {} has neither", folder.path().display())), "{error}");
        assert!(!error.contains("stack.png"), "{error}");
    }

    #[test]
    fn a_learned_lens_is_that_of_the_unbinned_images() {
        use farnear_depth::optics::Stage;

        let folder = tempfile::tempdir().unwrap();
        let optics: Optics = toml::from_str(include_str!("../../../../examples/rig.toml")).unwrap();
        let found = |scale_known| {
            let stage = Stage { scale_known, ..Stage::identity(4, 2) };
            let text = toml::to_string(&optics.binned(4).with_stage(stage)).unwrap();
            std::fs::write(folder.path().join("optics.toml"), text).unwrap();
            lens(&FocusStackRequest { stack: folder.path().into(), ..FocusStackRequest::default() }).unwrap()
        };
        assert_eq!(found(true), Some(optics));
        assert_eq!(found(false), None);
    }

    #[test]
    fn numbers_and_stage_positions_are_even_themselves() {
        assert_eq!(
            listed(Axis::Number, vec![1.0, 2.0, 3.0, 4.0]).depth(&array![[2.5_f32]]),
            array![[3.5_f32]]
        );
        let stage = listed(Axis::StageUm, vec![-4.0, 0.0, 2.0]);
        assert_eq!(stage.depth(&array![[0.0_f32, 1.0, 1.5]]), array![[-4.0_f32, 0.0, 1.0]]);
        let mut without = listed(Axis::Number, vec![1.0, 2.0, 3.0, 4.0]);
        without.without(&[1]);
        assert_eq!(without.depth(&array![[0.5_f32]]), array![[2.0_f32]]);
    }
}
