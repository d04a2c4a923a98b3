//! Tables of Qualisys Track Manager: rows of a key and its values, of which `MARKER_NAMES` has the names, and rows of x, y and z,
//! perhaps after the frame's number and time; mm, z up.

use csv::StringRecord;

use super::{line, points};
use crate::readers::recording::{
    Found, Known, RecordingError, Source, Unit, Up, check_last_row, number, promised_frames,
};
use crate::readers::trc::is_hidden;

/// The key of the number of frames.
const FRAMES: &str = "NO_OF_FRAMES";

/// `None` for other tables.
pub fn read(rows: &[StringRecord]) -> Result<Option<Found>, RecordingError> {
    let key = |key: &str| rows.iter().position(|row| row.get(0) == Some(key));
    let (Some(promised), Some(names_at)) = (key(FRAMES), key("MARKER_NAMES")) else { return Ok(None) };
    let value = |at: usize| rows[at].get(1).and_then(number);
    let mut names: Vec<String> = rows[names_at].iter().skip(1).map(str::to_owned).collect();
    while names.last().is_some_and(String::is_empty) {
        names.pop();
    }
    let is_frame =
        |row: &&StringRecord| row.get(0).is_some_and(|cell| is_hidden(cell) || number(cell).is_some());
    let below: Vec<&StringRecord> = rows[names_at + 1..].iter().filter(is_frame).collect();
    let widest = below.iter().map(|row| row.len()).max().unwrap_or(0);
    let numbers = 3 * names.len();
    let first = if widest >= numbers + 2 { 2 } else { 0 };
    if names.is_empty() || widest < numbers {
        let reason = format!(
            "{} markers are named, and rows have {widest} values, expected x, y and z of each marker",
            names.len()
        );
        return Err(RecordingError::Line { line: line(&rows[names_at]), reason });
    }
    let cells: Vec<(usize, usize)> = below.iter().map(|row| (line(row), row.len())).collect();
    check_last_row(&cells, first + numbers)?;
    let remark = value(promised).map(|promised| promised_frames(FRAMES, promised, below.len())).transpose();
    let remark = remark.map_err(|reason| RecordingError::Line { line: line(&rows[promised]), reason })?;
    let places: Vec<[usize; 3]> =
        (0..names.len()).map(|marker| [0, 1, 2].map(|axis| first + 3 * marker + axis)).collect();
    Ok(Some(Found {
        others: Vec::new(),
        planar: false,
        names,
        rate_hz: key("FREQUENCY").and_then(value).unwrap_or_default(),
        frames: below.into_iter().map(|row| points(row, &places)).collect::<Result<_, _>>()?,
        unit: Known { value: Unit::MM, source: Source::Format },
        up: Known { value: Up::Z, source: Source::Format },
        remarks: remark.flatten().into_iter().collect(),
    }))
}

#[cfg(test)]
mod tests {
    use crate::readers::{self, recording::Choices};

    /// Two frames of two markers.
    fn file(axes: &str, frames: [&str; 2]) -> String {
        format!(
            "NO_OF_FRAMES\t2\nNO_OF_MARKERS\t2\nFREQUENCY\t100\nTIME_STAMP\t2026-01-19, 10:19:43.755\t2063631.9\n\
             DATA_INCLUDED\t3D\nMARKER_NAMES\tLFHD\tLTOE\nTRAJECTORY_TYPES\tMeasured\tMeasured\n{axes}{}\n{}\n",
            frames[0], frames[1]
        )
    }

    #[test]
    fn markers_are_read_with_and_without_numbers_of_frames() {
        let axes = "Frame\tTime\tLFHD X\tLFHD Y\tLFHD Z\tLTOE X\tLTOE Y\tLTOE Z\n";
        for text in [
            file("", ["1\t2\t1700\t4\t5\t60", "\t\t\t4\t5\t60"]),
            file("", ["1\t2\t1700\t4\t5\t60", "NULL\tNULL\tNULL\t4\t5\t60"]),
            file(axes, ["1\t0.00\t1\t2\t1700\t4\t5\t60", "2\t0.01\t0\t0\t0\t4\t5\t60"]),
        ] {
            for ending in ["tsv", "csv"] {
                let found = readers::read(text.as_bytes(), ending, Choices::default());
                let found = found.unwrap_or_else(|error| panic!("{error}: {text}"));
                assert_eq!((found.frames.len(), found.rate_hz), (2, 100.0));
                assert_eq!(found.by_name(0)["LFHD"], [1.0, 2.0, 1700.0], "{text}");
                assert!(!found.by_name(1).contains_key("LFHD") && found.by_name(1)["LTOE"][2] == 60.0);
            }
        }
    }

    #[test]
    fn a_marker_without_a_name_keeps_its_columns() {
        let row = "1\t2\t1700\t7\t7\t7\t4\t5\t60";
        let text = file("", [row, row]).replace("LFHD\tLTOE", "LFHD\t\tLTOE\t");
        let found = readers::read(text.as_bytes(), "tsv", Choices::default()).expect("markers");
        assert_eq!(found.by_name(0)["LTOE"], [4.0, 5.0, 60.0]);
    }

    #[test]
    fn a_file_that_was_cut_short_is_refused() {
        for (text, expected) in [
            (file("", ["1\t2\t1700\t4\t5\t60", "1\t2\t1700"]), "line 9: 3 values, the header names 6"),
            (
                file("", ["1\t2\t1700\t4\t5\t60", ""]).replace("FRAMES\t2", "FRAMES\t20"),
                "line 1: NO_OF_FRAMES promises 20 frames, the file ends after 1",
            ),
            (file("", ["1\t2\t1700", "1\t2\t1700"]), "line 6: 2 markers are named, and rows have 3 values"),
        ] {
            let error = readers::read(text.as_bytes(), "tsv", Choices::default()).expect_err("cut short");
            assert!(error.to_string().starts_with(expected), "{error}");
        }
    }
}
