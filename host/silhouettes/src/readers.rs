//! Readers of what others' instruments write: bytes in, arrays out. Damaged files give errors that say where; none makes a
//! reader panic or ask for more memory than a fixed multiple of the file.
//!
//! Motion capture goes through one table, [`READERS`]: a further format is a file next to the others with a `READER` in it, and a
//! line in the table. [`read`] chooses by a file's ending and gives millimetres with z up:
//!
//! ```
//! use farnear_silhouettes::readers::{self, recording::Choices};
//!
//! let recording = readers::read(b"HEAD_x,HEAD_y,HEAD_z\n0,0,1700\n", "csv", Choices::default())?;
//! assert_eq!(recording.by_name(0)["HEAD"], [0.0, 0.0, 1700.0]);
//! # Ok::<(), farnear_silhouettes::readers::recording::RecordingError>(())
//! ```
//!
//! Data sets of body joints come as MATLAB files ([`skeletons`]).

mod amass;
mod body;
pub mod bvh;
pub mod c3d;
pub mod csv;
pub mod keypoints;
pub mod kinect;
pub mod matlab;
pub mod ntu;
pub mod reader;
pub mod recording;
pub mod skeletons;
pub mod trc;
mod zip;

use reader::Reader;
use recording::{Choices, Found, Recording, RecordingError, Source};

/// All formats of motion capture.
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

/// Reads a recording with the reader of its file's ending (any case, without the dot). What the caller names in `choices` goes before what the
/// file says or suggests; guesses are in [`Recording::remarks`].
/// Errors: [`RecordingError::Extension`] for an ending that no reader has, and the errors of the reader.
pub fn read(bytes: &[u8], extension: &str, choices: Choices) -> Result<Recording, RecordingError> {
    let ending = extension.to_lowercase();
    let reader = READERS.iter().find(|reader| reader.extensions.contains(&ending.as_str()));
    let reader = reader.ok_or_else(|| RecordingError::Extension { found: ending, known: extensions() })?;
    settled((reader.read)(bytes)?, choices)
}

/// Reads a folder of keypoint files, a frame each, in the order in which they are given.
///
/// # Errors
/// As [`read`].
pub fn read_keypoint_files<'a>(
    files: impl IntoIterator<Item = &'a [u8]>,
    choices: Choices,
) -> Result<Recording, RecordingError> {
    settled(keypoints::read_files(files)?, choices)
}

fn settled(found: Found, choices: Choices) -> Result<Recording, RecordingError> {
    let people = 1 + found.others.len();
    if let Some(wanted) = choices.person.filter(|wanted| !(1..=people).contains(wanted)) {
        return Err(RecordingError::Person { wanted, found: people });
    }
    let recording = found.settled(choices);
    match &recording.unit.source {
        Source::Unknown { stated } => Err(RecordingError::Unit(stated.clone())),
        _ => Ok(recording),
    }
}

/// The endings of all readers, for messages: `.bvh, .c3d, ...`.
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
        assert!(read(b"", "TRC", Choices::default()).is_err());
    }
}
