//! TRC files (Motion Analysis, OpenSim): marker trajectories separated by tabs, or as spreadsheets save them.

use super::reader::Reader;
use super::recording::{
    Found, Known, RecordingError, Source, Up, check_last_row, number, promised_frames, text,
};
use crate::silhouette::capsule::Point3;

pub const READER: Reader = Reader {
    name: "TRC",
    extensions: &["trc"],
    about: "Motion Analysis and OpenSim markers, y up",
    read: |bytes, _| read(bytes),
};

/// Most files, such as OpenSim's, have y up. Errors have their line.
pub fn read(bytes: &[u8]) -> Result<Found, RecordingError> {
    let text = text(bytes)?;
    let lines: Vec<&str> = text.lines().collect();
    let line = |n: usize| {
        lines
            .get(n)
            .copied()
            .ok_or_else(|| RecordingError::Kind { kind: "TRC", reason: format!("it has no line {}", n + 1) })
    };
    if !line(0)?.starts_with("PathFileType") {
        return Err(RecordingError::Kind {
            kind: "TRC",
            reason: "its first line does not start with PathFileType".into(),
        });
    }
    let separator =
        line(0)?.chars().nth("PathFileType".len()).filter(|c| matches!(c, ',' | ';')).unwrap_or('\t');
    let cells = |n: usize| -> Result<Vec<&str>, RecordingError> {
        Ok(line(n)?.split(separator).map(str::trim).collect())
    };
    let (mut keys, mut values) = (cells(1)?, cells(2)?);
    // Some programs write two tabs between the values.
    let [filled_keys, filled_values] = [&keys, &values]
        .map(|cells| cells.iter().copied().filter(|cell| !cell.is_empty()).collect::<Vec<&str>>());
    if filled_keys.len() == filled_values.len() {
        (keys, values) = (filled_keys, filled_values);
    }
    let value = |key: &str| {
        let place = keys.iter().position(|k| k.eq_ignore_ascii_case(key));
        let found = place.and_then(|index| values.get(index).copied());
        found.ok_or_else(|| RecordingError::Line { line: 3, reason: format!("no value of {key}") })
    };
    let stated = |key: &str| {
        let text = value(key)?;
        number(text).ok_or_else(|| RecordingError::Line {
            line: 3,
            reason: format!("{key} = `{text}` is not a number"),
        })
    };
    let unit = Found::stated_unit(value("Units").unwrap_or_default());
    let (rate_hz, count) = (stated("DataRate")?, stated("NumMarkers")?);
    // A name is above the first of its three columns; Cortex omits names of unidentified trajectories.
    let cells: Vec<&str> = cells(3)?.into_iter().skip(2).collect();
    let all: Vec<(usize, String)> = (0..)
        .zip(cells.chunks(3))
        .filter(|(_, group)| !group[0].is_empty())
        .map(|(place, group)| (place, group[0].to_owned()))
        .collect();
    // Some programs write other numbers of tabs between the names. With whole columns between them, two may be a marker and a
    // virtual one.
    let apart = all.get(1).map_or(1, |(place, _)| *place);
    let are_spread = apart > 1
        && all.len() > 2
        && all.len() as f64 == count
        && (0..).step_by(apart).zip(&all).all(|(at, (place, _))| at == *place)
        && columns(&lines, separator) as f64 <= count;
    let packed = are_spread || cells.iter().enumerate().any(|(at, cell)| at % 3 != 0 && !cell.is_empty());
    let (mut places, mut names): (Vec<usize>, Vec<String>) = if packed {
        cells.iter().filter(|name| !name.is_empty()).map(|name| (*name).to_owned()).enumerate().unzip()
    } else {
        all.into_iter().unzip()
    };
    let mut remarks = Vec::new();
    // Cortex names virtual markers, too, and writes no columns of them.
    let within = places.iter().filter(|place| (**place as f64) < count).count();
    if (1..names.len()).contains(&within) && columns(&lines, separator) as f64 <= count {
        remarks.push(format!(
            "{} names after the {count} markers have no columns and are not read ({}, ...)",
            names.len() - within,
            names[within]
        ));
        places.truncate(within);
        names.truncate(within);
    }
    let unnamed = count - names.len() as f64;
    if unnamed < 0.0 || names.is_empty() {
        return Err(RecordingError::Line {
            line: 4,
            reason: format!("{} marker names, NumMarkers says {count}", names.len()),
        });
    }
    if unnamed > 0.0 {
        remarks.push(format!("{unnamed} of {count} trajectories have no name and are not read"));
    }
    let frames = rows(&lines, &places, separator)?;
    // Without the number all frames are read.
    if let Ok(promised) = stated("NumFrames") {
        let mut rows = lines.iter().skip(first_row(&lines, separator));
        let first = rows.find_map(|row| number(row.split(separator).next()?.trim()));
        match promised_frames("NumFrames", promised, frames.len()) {
            Ok(remark) => remarks.extend(remark),
            Err(_) if first.is_some_and(|first| first > 1.0) => remarks.push(format!(
                "NumFrames counts {promised} frames, the file has {} from frame {} on: a part of a recording, or cut short",
                frames.len(),
                first.unwrap_or_default()
            )),
            Err(reason) => return Err(RecordingError::Line { line: 3, reason }),
        }
    }
    let has_rate = rate_hz.is_finite() && rate_hz > 0.0;
    if !has_rate {
        remarks
            .push(format!("DataRate = {rate_hz}, expected more than 0: the frame rate is taken as unknown"));
    }
    let rate_hz = if has_rate { rate_hz } else { 0.0 };
    let up = Known { value: Up::Y, source: Source::Format };
    // Of programs that measure in one picture, such as Sports2D.
    let mut points = frames.iter().flatten().flatten().peekable();
    let planar = points.peek().is_some() && points.all(|point| point[2] == 0.0);
    Ok(Found { names, rate_hz, frames, others: Vec::new(), planar, unit, up, remarks })
}

/// Lines before the frames: the fifth has the axes (X1, Y1, Z1), but some programs omit it and the blank one after it.
fn first_row(lines: &[&str], separator: char) -> usize {
    let number_of = |row: &&str| number(row.split(separator).next()?.trim());
    4 + usize::from(lines.get(4).and_then(number_of).is_none())
}

/// Points with values in the longest row.
fn columns(lines: &[&str], separator: char) -> usize {
    let is_blank = |c: char| c.is_whitespace() || c == separator;
    let rows = lines.iter().skip(first_row(lines, separator));
    let cells = rows.map(|row| row.trim_end_matches(is_blank).split(separator).count());
    cells.max().unwrap_or(0).saturating_sub(2).div_ceil(3)
}

/// Rows after the header: number, time, then x, y, z in these columns; missing cells at the end are hidden.
fn rows(
    lines: &[&str],
    places: &[usize],
    separator: char,
) -> Result<Vec<Vec<Option<Point3>>>, RecordingError> {
    let width = places.iter().map(|place| 5 + 3 * place).max().unwrap_or(0);
    let (mut frames, mut all) = (Vec::new(), Vec::new());
    for (index, row) in lines.iter().enumerate().skip(first_row(lines, separator)) {
        // Trailing tabs are common; a blank row separates header and data.
        let cells: Vec<&str> = row.trim_end_matches([separator, '\r']).split(separator).collect();
        if row.trim_matches(|c: char| c.is_whitespace() || c == separator).is_empty() {
            continue;
        }
        // Tabs are those of hidden markers.
        all.push((index + 1, row.split(separator).count()));
        let mut points = Vec::with_capacity(places.len());
        for &m in places {
            let cell = |k: usize| cells.get(2 + 3 * m + k).map_or("", |cell| cell.trim());
            points.push(point([cell(0), cell(1), cell(2)], index + 1)?);
        }
        frames.push(points);
    }
    check_last_row(&all, width)?;
    Ok(frames)
}

pub(super) fn is_hidden(cell: &str) -> bool {
    const WORDS: [&str; 10] = ["nan", "na", "n/a", "#n/a", "null", "none", "-", ".", "?", "missing"];
    // As C libraries of Windows print it.
    cell.is_empty() || cell.contains(".#") || WORDS.iter().any(|word| cell.eq_ignore_ascii_case(word))
}

/// Three cells; an empty or invalid one is a hidden marker.
pub(super) fn point(cells: [&str; 3], line: usize) -> Result<Option<Point3>, RecordingError> {
    if cells.into_iter().any(is_hidden) {
        return Ok(None);
    }
    let mut point = [0.0; 3];
    for (value, cell) in point.iter_mut().zip(cells) {
        *value = number(cell)
            .ok_or_else(|| RecordingError::Line { line, reason: format!("`{cell}` is not a number") })?;
    }
    Ok(Some(point))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_one_picture_have_one_view() {
        let file = |depth: &str| {
            format!(
                "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n30\t30\t2\t2\tm\n\
                 Frame#\tTime\tHead\t\t\tLHeel\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\
                 0\t0.0\t2.0\t1.7\t0.0\t2.1\t0.1\t0.0\n1\t0.03\t2.0\t1.7\t0.0\t2.2\t0.1\t{depth}\n"
            )
        };
        for (depth, planar) in [("0.0", true), ("0.2", false)] {
            let found = read(file(depth).as_bytes()).expect("a TRC file");
            assert_eq!((found.planar, found.frames.len()), (planar, 2), "{depth}");
        }
    }

    #[test]
    fn a_header_without_a_unit_and_a_line_of_axes_is_read() {
        let file = "PathFileType\t4\t(X/Y/Z)\ta.trc\ndatarate\tnummarkers\n30\t2\nFrame#\tTime\tHead\t\t\tLHeel\n\
                    1\t0.0\t0\t1700\t9\t0\t1\t5\n2\t0.03\t0\t1700\t9\tNone\t-1.#IND\t.\n";
        let found = read(file.as_bytes()).expect("a TRC file");
        assert_eq!((found.frames.len(), found.unit.value.mm), (2, 1.0));
        assert_eq!(found.frames[0][1].zip(found.frames[1][0]), Some(([0.0, 1.0, 5.0], [0.0, 1700.0, 9.0])));
        assert_eq!(found.frames[1][1], None);
    }
}
