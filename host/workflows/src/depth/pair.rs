//! Reads a far- and a near-focused image.

use std::path::{Path, PathBuf};

use farnear_capture::record::{CAPTURE_FILE, read_record};
use farnear_files::image_file::{ReadSettings, Samples, read_grey_with, shared_white_level};
use ndarray::Array2;

use crate::error::{Result, WorkflowError};

pub struct Pair {
    pub far: Array2<f32>,
    pub near: Array2<f32>,
    /// White level that both were divided by, 1 = full scale.
    pub white: f32,
    /// The coarser of both sample types.
    pub samples: Samples,
    /// Mean variance of a pixel by lossy compression.
    pub coding_variance: f64,
    /// The dark signal was subtracted, by the record of the capture.
    pub is_without_dark: bool,
}

impl Pair {
    /// Reads both images with one scale. Integers of any depth share a scale; float files have their own.
    /// White is the saturation level if that is below full scale.
    pub fn read(far: &Path, near: &Path, reading: &ReadSettings) -> Result<Self> {
        // In parallel, because decompression takes most of the time.
        let (far_image, near_image) =
            rayon::join(|| read_grey_with(far, reading), || read_grey_with(near, reading));
        let (mut far_image, mut near_image) = (far_image?, near_image?);
        let images = [&far_image, &near_image].into_iter();
        let white = shared_white_level(images, reading.white_level.is_some());
        if let Some(white) = white {
            (far_image, near_image) = (far_image.relative_to(white), near_image.relative_to(white));
        }
        let unfit = |reason| WorkflowError::Pair { far: far.into(), near: near.into(), reason };
        let samples = match (far_image.samples, near_image.samples) {
            (Samples::Integer(a), Samples::Integer(b)) => Samples::Integer(a.min(b)),
            (Samples::Float, Samples::Float) => Samples::Float,
            (far, near) => {
                return Err(unfit(format!(
                    "one has {far} pixels and the other {near} ones: give both as integers or both as float"
                )));
            }
        };
        let white = white.unwrap_or(1.0);
        let of_files = 0.5 * (far_image.coding_variance + near_image.coding_variance);
        // A capture's pictures are PNG; its record tells what the camera gave.
        let record = far.parent().and_then(|folder| read_record(folder).ok()?);
        let of_camera =
            record.as_ref().filter(|_| of_files == 0.0).and_then(|record| record.camera.coding_variance);
        Ok(Self {
            is_without_dark: record
                .is_some_and(|record| record.camera.corrected || record.camera.ambient_subtracted),
            coding_variance: of_files + of_camera.map_or(0.0, |variance| variance / f64::from(white).powi(2)),
            far: far_image.pixels,
            near: near_image.pixels,
            white,
            samples,
        })
    }
}

/// Warns if the file names contradict their order, because a swapped pair gives a plausible mirrored map.
pub fn swapped_by_names(far: &Path, near: &Path) -> Option<String> {
    named_the_other_way_round(far, near).then(|| {
        format!(
            "the pair looks swapped by its names: {} was given as FAR and {} as NEAR",
            name_of(far),
            name_of(near)
        )
    })
}

fn named_the_other_way_round(far: &Path, near: &Path) -> bool {
    let says = |path: &Path, word: &str, other: &str| {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
        stem.contains(word) && !stem.contains(other)
    };
    says(far, "near", "far") && says(near, "far", "near")
}

pub fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Default result folder: the capture's folder, or `depth` next to the far image.
pub fn default_folder(far: &Path) -> PathBuf {
    let folder = far.parent().unwrap_or(Path::new(""));
    if folder.join(CAPTURE_FILE).exists() { folder.to_path_buf() } else { folder.join("depth") }
}

#[cfg(test)]
mod tests {
    use farnear_files::image_file::encode_png;

    use super::*;

    /// A capture keeps the pictures of a JPEG camera as PNG, which has no quantisation tables.
    #[test]
    fn the_record_of_a_capture_tells_of_its_cameras_compression() {
        let folder = tempfile::tempdir().unwrap();
        let [far, near] = ["far.png", "near.png"].map(|name| folder.path().join(name));
        for (file, code) in [(&far, 10_u16), (&near, 20)] {
            std::fs::write(file, encode_png(Array2::from_elem((4, 5), code).view(), 8).unwrap()).unwrap();
        }
        let variance = || Pair::read(&far, &near, &ReadSettings::default()).unwrap().coding_variance;
        assert_eq!(variance(), 0.0);
        let record = include_str!("../sessions/capture.toml");
        let record = record.replace("[camera]\n", "[camera]\ncoding_variance = 2.5e-5\n");
        std::fs::write(folder.path().join(CAPTURE_FILE), record).unwrap();
        assert_eq!(variance(), 2.5e-5);
    }

    #[test]
    fn the_record_of_a_capture_tells_of_a_subtracted_dark_signal() {
        let folder = tempfile::tempdir().unwrap();
        let [far, near] = ["far.png", "near.png"].map(|name| folder.path().join(name));
        for (file, code) in [(&far, 10_u16), (&near, 20)] {
            std::fs::write(file, encode_png(Array2::from_elem((4, 5), code).view(), 8).unwrap()).unwrap();
        }
        for (line, expected) in
            [("", false), ("corrected = true\n", true), ("ambient_subtracted = true\n", true)]
        {
            let record = include_str!("../sessions/capture.toml");
            let record = record.replace("[camera]\n", &format!("[camera]\n{line}"));
            std::fs::write(folder.path().join(CAPTURE_FILE), record).unwrap();
            let pair = Pair::read(&far, &near, &ReadSettings::default()).unwrap();
            assert_eq!(pair.is_without_dark, expected, "{line}");
        }
    }

    #[test]
    fn a_stated_white_level_holds_for_brighter_pixels() {
        let folder = tempfile::tempdir().unwrap();
        let [far, near] = ["far.png", "near.png"].map(|name| folder.path().join(name));
        for (file, code) in [(&far, 1_500_u16), (&near, 900)] {
            let image = Array2::from_shape_fn((4, 5), |(y, x)| code + (y * x) as u16);
            std::fs::write(file, encode_png(image.view(), 16).unwrap()).unwrap();
        }
        let reading = ReadSettings { white_level: Some(1_000), ..ReadSettings::default() };
        let pair = Pair::read(&far, &near, &reading).unwrap();
        assert!(pair.far.iter().all(|value| *value == 1.0), "{:?}", pair.far);
        assert!((pair.near[(0, 0)] - 0.9).abs() < 1e-6, "{:?}", pair.near);
    }

    #[test]
    fn names_tell_a_swapped_pair() {
        let swapped = |far: &str, near: &str| named_the_other_way_round(far.as_ref(), near.as_ref());
        assert!(swapped("a/near.png", "a/far.png"));
        assert!(swapped("Breakfast_NEAR.tif", "breakfast_far.tif"));
        assert!(!swapped("far.png", "near.png"));
        assert!(!swapped("farnear_1.png", "farnear_2.png"));
        assert!(!swapped("near/1.png", "far/2.png"), "folder names are ignored");
        assert!(!swapped("near1.png", "near2.png"));
    }
}
