//! Depth map files, with the unit from the record next to them.

use std::{
    fs,
    path::{Path, PathBuf},
};

use farnear_depth::optics::Optics;
use farnear_files::{
    image_file,
    map::{self, NoData, Scale},
    mesh::Lateral,
};
use ndarray::Array2;
use serde::Deserialize;

use super::{Measured, Unit, lateral, lateral_of_stack};
use crate::{
    depth::part::Part,
    error::{Result, WorkflowError},
    optics,
    result_folder::{self, DEPTH_RECORD, STACK_RECORD},
};

#[derive(Deserialize)]
struct DepthRecord {
    optics: Optics,
    part: Option<Part>,
    png: Option<Scale>,
}

#[derive(Deserialize)]
struct StackRecord {
    unit: Unit,
    optics: Option<Optics>,
    /// Side of a pixel at the object.
    object_pixel_um: Option<f64>,
}

enum Record {
    Depth(Box<DepthRecord>),
    Stack(Box<StackRecord>),
}

/// Values of a file, whose holes depend on the unit.
pub(crate) struct MapFile {
    file: PathBuf,
    values: Array2<f32>,
    nodata: Option<NoData>,
    /// `None` without a record, and for another map next to one, such as the true depth.
    pub unit: Option<Unit>,
    /// Part of the images that the map shows; `None` for all.
    pub part: Option<Part>,
}

impl MapFile {
    /// A remark on a map whose unit is unknown.
    pub fn taken_as_mm(&self) -> Option<String> {
        self.unit.is_none().then(|| {
            format!(
                "the depths of {} are taken as mm: no depth.toml or stack.toml next to it states the unit of this file (they state that \
                 of depth.npy, depth.tiff and depth.png)",
                self.file.display()
            )
        })
    }

    /// Depths in mm, as [`depth`](Self::depth). Fails for a map whose record states another unit.
    pub fn depth_mm(self, name: &'static str, remarks: &mut Vec<String>) -> Result<Array2<f32>> {
        match self.unit {
            None | Some(Unit::Mm) => Ok(self.depth(Unit::Mm, remarks)),
            Some(unit) => {
                let expected = format!("expected a map in mm, its record states {unit}");
                Err(WorkflowError::parameter(name, self.file.display(), expected))
            }
        }
    }

    /// Depths in this unit; holes are NaN. Adds remarks on values that mark holes or seem to.
    pub fn depth(self, unit: Unit, remarks: &mut Vec<String>) -> Array2<f32> {
        let negative = self.values.iter().filter(|value| **value < 0.0 && !unit.is_depth(**value)).count();
        let depth = self.values.mapv_into(|value| if unit.is_depth(value) { value } else { f32::NAN });
        let file = self.file.display();
        remarks.extend(self.nodata.map(|NoData { value, pixels }| {
            format!("{file}: {pixels} pixels of the value {value:?} are holes (GDAL_NODATA)")
        }));
        if negative > 0 {
            remarks.push(format!(
                "{file}: {negative} negative pixels are holes: a depth is positive; add a constant to heights around 0"
            ));
        }
        remarks.extend(map::far_from_others(depth.view()).into_iter().map(|NoData { value, pixels }| {
            format!(
                "{file}: {pixels} pixels have the value {value:?}, far from all others: if it marks holes, store NaN there, or the value in \
                 the tag GDAL_NODATA"
            )
        }));
        depth
    }
}

pub(crate) fn read_map(path: &Path) -> Result<MapFile> {
    let (file, _, record) = with_record(path)?;
    values_of(&file, record.as_ref())
}

/// The file of a map, its folder, and the record there. Fails for a file of a result that is not its depth.
fn with_record(path: &Path) -> Result<(PathBuf, PathBuf, Option<Record>)> {
    let (file, folder) = file_and_folder(path);
    let record = record_of(&folder)?;
    let is_of_result = || result_folder::files().any(|name| file.file_name() == Some(name.as_ref()));
    if record.is_some() && !is_depth(&file) && is_of_result() {
        let reason =
            "it is another file of a result, whose depth is in depth.npy, depth.tiff or depth.png: name that";
        return Err(WorkflowError::file(&file, "a depth map")(reason));
    }
    Ok((file, folder, record))
}

fn is_depth(file: &Path) -> bool {
    file.file_stem() == Some("depth".as_ref())
}

pub(super) fn read(path: &Path) -> Result<Measured> {
    let (file, folder, record) = with_record(path)?;
    let map = values_of(&file, record.as_ref())?;
    let (unit, part) = (map.unit.unwrap_or_default(), map.part);
    let mut remarks = Vec::from_iter(map.taken_as_mm());
    let depth = map.depth(unit, &mut remarks);
    let deviation = deviation_of(&file, &folder, depth.dim())?;
    let lateral = match &record {
        Some(Record::Depth(record)) => lateral(&record.optics, part),
        Some(Record::Stack(record)) => match (unit, &record.optics, record.object_pixel_um) {
            (Unit::Mm, Some(optics), _) => lateral_of_stack(optics),
            (Unit::Um, _, Some(side)) => Lateral::Pixel(side),
            _ => Lateral::Unknown,
        },
        None => match optics::of_pair(None, &folder.join("far.png")) {
            Ok((optics, _)) => lateral(&optics, None),
            Err(WorkflowError::NoOptics { .. }) => Lateral::Unknown,
            Err(error) => return Err(error),
        },
    };
    Ok(Measured { depth, deviation, unit, lateral, remarks })
}

/// In a folder the first of depth.npy, depth.tiff and depth.png.
fn file_and_folder(path: &Path) -> (PathBuf, PathBuf) {
    if !path.is_dir() {
        return (path.into(), path.parent().unwrap_or(Path::new("")).into());
    }
    let maps = ["depth.npy", "depth.tiff", "depth.png"].map(|name| path.join(name));
    let found = maps.iter().find(|map| map.exists()).unwrap_or(&maps[0]);
    (found.clone(), path.into())
}

fn record_of(folder: &Path) -> Result<Option<Record>> {
    let text =
        |record: &Path| fs::read_to_string(record).map_err(WorkflowError::read("the map's record", record));
    let depth = folder.join(DEPTH_RECORD);
    if depth.exists() {
        let record = toml::from_str(&text(&depth)?);
        return record
            .map(|record| Some(Record::Depth(Box::new(record))))
            .map_err(WorkflowError::file(&depth, "a record of a depth map"));
    }
    let stack = folder.join(STACK_RECORD);
    if stack.exists() {
        let record = toml::from_str(&text(&stack)?);
        return record
            .map(|record| Some(Record::Stack(Box::new(record))))
            .map_err(WorkflowError::file(&stack, "a record of a focus stack"));
    }
    Ok(None)
}

fn values_of(file: &Path, record: Option<&Record>) -> Result<MapFile> {
    let unit = record.filter(|_| is_depth(file)).map(|record| match record {
        Record::Depth(_) => Unit::Mm,
        Record::Stack(stack) => stack.unit,
    });
    let part = match record {
        Some(Record::Depth(record)) => record.part,
        _ => None,
    };
    let codes = match record {
        Some(Record::Depth(record)) if file.file_name() == Some("depth.png".as_ref()) => record.png,
        _ => None,
    };
    if let Some(Scale { offset_mm, scale_mm }) = codes {
        let codes = image_file::read_grey(file)?.pixels.mapv(|value| f64::from(value) * f64::from(u16::MAX));
        let depth = |code: f64| (offset_mm + scale_mm * code.round()) as f32;
        let depth = codes.mapv(|code| if code < 0.5 { f32::NAN } else { depth(code) });
        return Ok(MapFile { file: file.into(), values: depth, nodata: None, unit, part });
    }
    let (values, nodata) = map::read_with_nodata(file)?;
    // Another map next to it may show the whole images.
    let part = part.filter(|part| is_depth(file) || part.fits(values.dim()));
    Ok(MapFile { file: file.into(), values, nodata, unit, part })
}

fn deviation_of(file: &Path, folder: &Path, dim: (usize, usize)) -> Result<Option<Array2<f32>>> {
    let path = folder.join("uncertainty.npy");
    // Another map in the folder, such as the true depth, has no deviation.
    if !is_depth(file) || !path.exists() {
        return Ok(None);
    }
    let deviation = map::read(&path)?;
    if deviation.dim() == dim {
        return Ok(Some(deviation));
    }
    let reason = format!("{:?} rows and columns, the depth map has {dim:?}", deviation.dim());
    Err(WorkflowError::file(&path, "a map of the depth's size")(reason))
}

#[cfg(test)]
mod tests {
    use farnear_files::npy;

    use super::*;

    #[test]
    fn only_the_depth_map_has_the_deviation_next_to_it() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["depth.npy", "truth.npy", "uncertainty.npy"] {
            let map = npy::write(Array2::from_elem((3, 4), 900.0).view());
            fs::write(folder.path().join(name), map).expect("a writable folder");
        }
        let found = |name: &str| read(&folder.path().join(name)).expect("a map").deviation;
        assert!(found("").is_some() && found("depth.npy").is_some());
        assert_eq!(found("truth.npy"), None);
    }

    #[test]
    fn a_record_states_the_unit_of_the_depth_only() {
        let folder = tempfile::tempdir().expect("a folder");
        let map = npy::write(Array2::from_elem((3, 4), 0.5).view());
        for name in ["depth.npy", "truth.npy", "confidence.npy"] {
            fs::write(folder.path().join(name), &map).expect("a writable folder");
        }
        let found = |name: &str| read(&folder.path().join(name));
        // Of another program, without a record.
        assert!(found("confidence.npy").expect("a map").remarks[0].contains("taken as mm"));
        fs::write(folder.path().join(STACK_RECORD), "unit = \"um\"\n").expect("a writable folder");
        for name in ["", "depth.npy"] {
            let depth = found(name).expect("a map");
            assert!(depth.unit == Unit::Um && depth.remarks.is_empty(), "{name}: {:?}", depth.remarks);
        }
        let truth = found("truth.npy").expect("a map");
        assert!(truth.unit == Unit::Mm && truth.remarks[0].contains("truth.npy are taken as mm"));
        let error = found("confidence.npy").expect_err("a reliability").to_string();
        assert!(error.contains("confidence.npy") && error.contains("depth.npy"), "{error}");
    }

    #[test]
    fn another_map_next_to_a_record_has_its_region_and_axis() {
        let folder = tempfile::tempdir().expect("a folder");
        let map = npy::write(Array2::from_elem((3, 4), 900.0).view());
        for name in ["depth.npy", "corrected.npy"] {
            fs::write(folder.path().join(name), &map).expect("a writable folder");
        }
        let optics = include_str!("../../../../examples/rig.toml").replace('[', "[optics.");
        let part = "[part]\nx = 5\ny = 0\nimage_width = 9\nimage_height = 9\n";
        fs::write(folder.path().join(DEPTH_RECORD), optics + part).expect("a writable folder");
        let found = |name: &str| {
            let path = folder.path().join(name);
            (read_map(&path).expect("a map"), read(&path).expect("a map").lateral)
        };
        let [(depth, lateral), (corrected, same)] = ["depth.npy", "corrected.npy"].map(found);
        assert!(depth.part.is_some() && corrected.part == depth.part, "{:?}", corrected.part);
        assert_eq!(same, lateral);
        let whole = npy::write(Array2::from_elem((9, 9), 900.0).view());
        fs::write(folder.path().join("truth.npy"), whole).expect("a writable folder");
        let (truth, centred) = found("truth.npy");
        assert!(truth.part.is_none() && centred != lateral);
        assert_eq!((depth.unit, corrected.unit), (Some(Unit::Mm), None));
    }

    #[test]
    fn values_that_mark_holes_have_remarks_in_units_that_allow_them() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.npy");
        let mut depth = Array2::from_shape_fn((8, 8), |(y, x)| 900.0 + (y + x) as f32);
        depth.row_mut(3).fill(-9999.0);
        depth.row_mut(5).fill(1e10);
        fs::write(&path, npy::write(depth.view())).expect("a writable folder");
        let remarks = |unit| {
            let mut remarks = Vec::new();
            read_map(&path).expect("a map").depth(unit, &mut remarks);
            remarks
        };
        let [negative, far] = &remarks(Unit::Mm)[..] else { panic!("negative depths in mm are holes") };
        assert!(negative.contains("8 negative pixels are holes"), "{negative}");
        assert!(far.contains("8 pixels have the value 10000000000.0"), "{far}");
        assert_eq!(remarks(Unit::Um).len(), 2);
        let mut none = Vec::new();
        let nodata = Some(NoData { value: -1.0, pixels: 3 });
        let values = Array2::from_elem((1, 2), 5.0);
        MapFile { file: "b.tif".into(), values, nodata, unit: None, part: None }.depth(Unit::Um, &mut none);
        assert!(none[0].contains("3 pixels of the value -1.0 are holes"), "{none:?}");
    }
}
