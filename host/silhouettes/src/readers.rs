//! Readers of motion capture and keypoints: bytes in, arrays out. Damaged files give errors with their
//! position; no reader panics or allocates more than a fixed multiple of the file.
//!
//! [`READERS`] lists the formats; a new one is a file with a `READER` and a line in the table. [`read`]
//! selects by file extension and returns millimetres with z up:
//! ```
//! use farnear_silhouettes::readers::{self, recording::Choices};
//! let recording = readers::read(b"HEAD_x,HEAD_y,HEAD_z\n0,0,1700\n", "csv", Choices::default())?;
//! assert_eq!(recording.by_name(0)["HEAD"], [0.0, 0.0, 1700.0]);
//! # Ok::<(), farnear_silhouettes::readers::recording::RecordingError>(())
//! ```
//! MATLAB files hold data sets of body joints ([`skeletons`]).

mod amass;
mod body;
pub mod bvh;
pub mod c3d;
pub mod csv;
pub mod keypoints;
pub mod kinect;
pub mod matlab;
pub mod ntu;
mod people;
mod posture;
pub mod reader;
pub mod recording;
pub mod skeletons;
pub mod trc;
mod zip;

use reader::Reader;
use recording::{Choices, Found, Recording, RecordingError, Source, Up};

pub const READERS: [Reader; 8] = [
    bvh::READER,
    c3d::READER,
    csv::READER,
    keypoints::READER,
    kinect::READER,
    amass::READER,
    ntu::READER,
    trc::READER,
];

/// Widespread formats that are not read, and what to do.
const EXPORTS: [(&[&str], &str); 2] = [
    (&["h5", "hdf5", "slp", "parquet", "xlsx"], "; export the table as .csv"),
    (&["fbx", "mvnx", "amc", "asf", "glb", "mot", "qtm"], "; export the motion as .bvh, .c3d, .trc or .csv"),
];

/// Reads by file extension (any case, no dot). `choices` overrides the file; guesses are in [`Recording::remarks`].
pub fn read(bytes: &[u8], extension: &str, choices: Choices) -> Result<Recording, RecordingError> {
    let ending = extension.to_lowercase();
    let reader = READERS.iter().find(|reader| reader.extensions.contains(&ending.as_str()));
    let reader = reader.ok_or_else(|| {
        let export = EXPORTS.iter().find(|(endings, _)| endings.contains(&ending.as_str()));
        let advice = export.map_or("", |(_, advice)| advice);
        RecordingError::Extension { known: format!("{}{advice}", extensions()), found: ending }
    })?;
    settled((reader.read)(bytes, choices)?, choices)
}

pub fn read_keypoint_files<'a>(
    files: impl IntoIterator<Item = (&'a str, &'a [u8])>,
    choices: Choices,
) -> Result<Recording, RecordingError> {
    settled(keypoints::read_files(files, choices)?, choices)
}

fn settled(found: Found, choices: Choices) -> Result<Recording, RecordingError> {
    if let Some(up @ (Up::Z | Up::MinusZ)) = choices.up.filter(|_| found.planar) {
        return Err(RecordingError::PlanarUp(up));
    }
    let recording = people::pick(found, choices.person.unwrap_or(1))?.settled(choices);
    match &recording.unit.source {
        Source::Unknown { stated } => Err(RecordingError::Unit(stated.clone())),
        _ => Ok(recording),
    }
}

pub fn extensions() -> String {
    let all = READERS.iter().flat_map(|reader| reader.extensions);
    all.map(|extension| format!(".{extension}")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_ending_has_one_reader_and_others_are_named() {
        let all: Vec<&str> = READERS.iter().flat_map(|reader| reader.extensions).copied().collect();
        for ending in &all {
            assert_eq!(all.iter().filter(|other| *other == ending).count(), 1, "{ending}");
            assert_eq!(ending.to_lowercase(), *ending);
        }
        let error = read(b"", "PNG", Choices::default()).expect_err("no reader");
        assert!(error.to_string().contains("`.png`") && error.to_string().contains(".bvh, .c3d"), "{error}");
        for (ending, advice) in [("h5", "export the table as .csv"), ("mvnx", "export the motion as .bvh")] {
            let error = read(b"", ending, Choices::default()).expect_err("no reader").to_string();
            assert!(error.contains(advice), "{error}");
        }
        assert!(read(b"", "TRC", Choices::default()).is_err());
    }
}
