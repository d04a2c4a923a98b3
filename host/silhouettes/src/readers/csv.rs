//! CSV markers: header `frame,NAME_x,NAME_y,NAME_z,...` (or `NAME:x`, `NAME.X`), a frame per row, mm, empty = hidden.

use super::reader::Reader;
use super::recording::{Found, Known, RecordingError, Source, Unit, Up, text};
use super::trc::point;

pub const READER: Reader = Reader {
    name: "CSV",
    extensions: &["csv"],
    about: "a table with columns NAME_x, NAME_y, NAME_z in millimetres, z up",
    read,
};

/// Ignores leading columns without a coordinate suffix (frame number, time). Errors have their line.
pub fn read(bytes: &[u8]) -> Result<Found, RecordingError> {
    let text = text(bytes)?;
    let mut lines =
        text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    let (_, header) =
        lines.next().ok_or_else(|| RecordingError::Kind { kind: "CSV", reason: "it is empty".into() })?;
    let columns: Vec<&str> = header.split(',').map(|cell| cell.trim().trim_matches('"')).collect();
    let axis = |column: &str| -> Option<(String, char)> {
        let (name, axis) = column.rsplit_once(['_', ':', '.', ' '])?;
        let axis = axis.to_ascii_lowercase();
        matches!(axis.as_str(), "x" | "y" | "z")
            .then(|| (name.to_owned(), axis.chars().next().unwrap_or('x')))
    };
    let skipped = columns.iter().take_while(|column| axis(column).is_none()).count();
    let mut names = Vec::new();
    for (index, group) in columns[skipped..].chunks(3).enumerate() {
        let found: Vec<_> = group.iter().map(|column| axis(column)).collect();
        let [Some((name, 'x')), Some((second, 'y')), Some((third, 'z'))] = found.as_slice() else {
            let reason = format!("columns {group:?} of marker {} are not its x, y and z", index + 1);
            return Err(RecordingError::Line { line: 1, reason });
        };
        if name != second || name != third {
            return Err(RecordingError::Line {
                line: 1,
                reason: format!("columns {group:?} are of several markers"),
            });
        }
        names.push(name.clone());
    }
    if names.is_empty() {
        return Err(RecordingError::Kind {
            kind: "CSV",
            reason: "its header names no marker (NAME_x,NAME_y,NAME_z)".into(),
        });
    }
    let mut frames = Vec::new();
    for (index, line) in lines {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        if cells.len() != columns.len() {
            let reason = format!("{} values, the header has {}", cells.len(), columns.len());
            return Err(RecordingError::Line { line: index + 1, reason });
        }
        let row: Result<Vec<_>, _> =
            cells[skipped..].chunks(3).map(|c| point([c[0], c[1], c[2]], index + 1)).collect();
        frames.push(row?);
    }
    Ok(Found {
        others: Vec::new(),
        planar: false,
        names,
        rate_hz: 0.0,
        frames,
        unit: Known { value: Unit::MM, source: Source::Format },
        up: Known { value: Up::Z, source: Source::Format },
        remarks: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_read_and_bad_ones_named() {
        let read_back = read(b"frame,LASI_x,LASI_y,LASI_z,RASI_x,RASI_y,RASI_z\n1,1,2,3,,,\n2,4,5,6,7,8,9\n")
            .expect("valid");
        assert_eq!(read_back.names, vec!["LASI", "RASI"]);
        assert_eq!(read_back.frames[0], vec![Some([1.0, 2.0, 3.0]), None]);
        assert!(read(b"frame,A_x,A_y,B_z\n").expect_err("mixed").to_string().contains("several markers"));
        assert!(read(b"A_x,A_y,A_z\n1,2\n").expect_err("short").to_string().contains("line 2"));
        assert!(read(b"").is_err() && read(b"a,b\n").is_err());
    }
}
