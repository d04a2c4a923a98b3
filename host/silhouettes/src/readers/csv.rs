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

/// Separated by commas, semicolons or tabs. Ignores columns without a coordinate suffix (frame number, time,
/// visibility). Errors have their line.
pub fn read(bytes: &[u8]) -> Result<Found, RecordingError> {
    let text = text(bytes)?;
    let header = text.lines().find(|line| !line.trim().is_empty() && !line.starts_with('#'));
    let count = |separator: u8| header.unwrap_or_default().bytes().filter(|byte| *byte == separator).count();
    let separator = [b'\t', b';', b','].into_iter().max_by_key(|separator| count(*separator)).unwrap_or(b',');
    let mut table = csv::ReaderBuilder::new()
        .delimiter(separator)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .flexible(true)
        .from_reader(text.as_bytes());
    let columns = table.headers().map_err(unreadable)?.clone();
    let mut markers: Vec<(String, [Option<usize>; 3])> = Vec::new();
    for (index, column) in columns.iter().enumerate() {
        let Some((name, axis)) = coordinate(column) else {
            continue;
        };
        let known = markers.iter().position(|(known, _)| known == name);
        let marker = known.unwrap_or_else(|| {
            markers.push((name.to_owned(), [None; 3]));
            markers.len() - 1
        });
        if markers[marker].1[axis].replace(index).is_some() {
            let reason = format!("two columns are named {column}");
            return Err(RecordingError::Line { line: 1, reason });
        }
    }
    if markers.is_empty() {
        return Err(RecordingError::Kind {
            kind: "CSV",
            reason: "its header names no marker (NAME_x,NAME_y,NAME_z)".into(),
        });
    }
    let mut places = Vec::new();
    for (name, columns) in &markers {
        let [Some(x), Some(y), Some(z)] = *columns else {
            let reason = format!("marker {name} has no column for each of x, y and z");
            return Err(RecordingError::Line { line: 1, reason });
        };
        places.push([x, y, z]);
    }
    let mut frames = Vec::new();
    for row in table.records() {
        let row = row.map_err(unreadable)?;
        let line = row.position().map_or(0, |position| position.line() as usize);
        if row.len() != columns.len() {
            let reason = format!("{} values, the header has {}", row.len(), columns.len());
            return Err(RecordingError::Line { line, reason });
        }
        let cells = |place: &[usize; 3]| place.map(|column| row.get(column).unwrap_or_default());
        frames.push(places.iter().map(|place| point(cells(place), line)).collect::<Result<Vec<_>, _>>()?);
    }
    Ok(Found {
        others: Vec::new(),
        planar: false,
        names: markers.into_iter().map(|(name, _)| name).collect(),
        rate_hz: 0.0,
        frames,
        unit: Known { value: Unit::MM, source: Source::Format },
        up: Known { value: Up::Z, source: Source::Format },
        remarks: Vec::new(),
    })
}

fn unreadable(error: csv::Error) -> RecordingError {
    RecordingError::Kind { kind: "CSV", reason: error.to_string() }
}

/// Name and axis (0 to 2) of a column `NAME_x`.
fn coordinate(column: &str) -> Option<(&str, usize)> {
    let (name, axis) = column.rsplit_once(['_', ':', '.', ' '])?;
    let axis = ["x", "y", "z"].iter().position(|known| axis.eq_ignore_ascii_case(known))?;
    Some((name, axis))
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
        assert!(
            read(b"frame,A_x,A_y,B_z\n").expect_err("mixed").to_string().contains("marker A has no column")
        );
        assert!(
            read(b"A_x,A_y,A_z,A_x\n").expect_err("twice").to_string().contains("two columns are named A_x")
        );
        assert!(read(b"A_x,A_y,A_z\n1,2\n").expect_err("short").to_string().contains("line 2"));
        assert!(read(b"").is_err() && read(b"a,b\n").is_err());
    }

    #[test]
    fn tables_of_other_countries_and_with_other_columns_are_the_same_tables() {
        let plain = read(b"frame,A_x,A_y,A_z,B_x,B_y,B_z\n1,0.5,2,3,4,5,6\n").expect("valid").frames;
        for text in [
            "frame;A_x;A_y;A_z;B_x;B_y;B_z\n1;0,5;2;3;4;5;6\n",
            "frame\tA_x\tA_y\tA_z\tB_x\tB_y\tB_z\r1\t0.5\t2\t3\t4\t5\t6\r",
            "frame,A_x,A_y,A_z,A_visibility,B_x,B_y,B_z,B_visibility\n1,0.5,2,3,0.9,4,5,6,0.8\n",
            "\"A_x\",\"B_x\",\"A_y\",\"B_y\",\"A_z\",\"B_z\"\n\"0,5\",\"4\",\"2\",\"5\",\"3\",\"6\"\n",
        ] {
            assert_eq!(read(text.as_bytes()).expect("valid").frames, plain, "{text}");
        }
    }
}
