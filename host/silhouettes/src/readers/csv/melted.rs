//! Tables with a row for each value, as `melt` and `pivot_longer` write them: the frame or its time, perhaps the person and the point,
//! the name of the value (`nose_x`, or `x` next to a point) and the value. They become tables with a column for each name. Linear in
//! the file.

use std::collections::HashMap;

use csv::StringRecord;

use super::{
    check_width,
    columns::{FRAMES, TIMES, is_of, people, place},
    coordinate, line,
    long::{check_cells, point_column},
    unseparated,
};
use crate::readers::recording::RecordingError;

/// What columns of values' names are called.
const NAMES: [&str; 8] = ["variable", "name", "key", "measure", "coords", "coord", "coordinate", "axis"];

/// The cells that tell a group from others, and the number of values of its names before it.
type Key<'a> = (Vec<&'a str>, usize);

/// Values of a frame, or of a person or a point in it.
struct Group<'a> {
    first: &'a StringRecord,
    frame: usize,
    values: HashMap<usize, &'a str>,
}

/// The rows as they are, if they are not those of values.
pub fn cast(rows: Vec<StringRecord>) -> Result<Vec<StringRecord>, RecordingError> {
    let Some((header, below)) = rows.split_first() else { return Ok(rows) };
    let named: Vec<usize> = NAMES.iter().filter_map(|name| place(header, &[*name])).collect();
    let (Some(first), Some(value)) = (named.first(), place(header, &["value"])) else { return Ok(rows) };
    let is_axis = |column: &str| coordinate(column).or_else(|| unseparated(column)).is_some();
    if place(header, &["x"]).is_some() || header.iter().any(is_axis) {
        return Ok(rows);
    }
    let has_points = header.iter().any(|column| point_column(column).is_some());
    let has_axes = |at: &usize| {
        let has = |axis: &str| below.iter().any(|row| row.get(*at).is_some_and(|cell| is_of(cell, &[axis])));
        has("x") && has("y")
    };
    let axis = named.iter().copied().find(has_axes).filter(|_| !has_points);
    // Next to an axis, another name is that of a point.
    let name = axis.unwrap_or(*first);
    let point = named.iter().copied().find(|at| axis.is_some_and(|axis| axis != *at));
    let person = people(header, below, true);
    let is_frame = |column: &str| is_of(column, &FRAMES) || is_of(column, &TIMES);
    let is_key = |at: &usize| {
        let column = &header[*at];
        let is_known =
            [person, point].contains(&Some(*at)) || is_frame(column) || point_column(column).is_some();
        ![name, value].contains(at) && is_known
    };
    let keys: Vec<usize> = (0..header.len()).filter(is_key).collect();
    let has_frames = keys.iter().any(|at| is_frame(&header[*at]));
    let (mut names, mut places): (Vec<&str>, HashMap<&str, usize>) = (Vec::new(), HashMap::new());
    let mut groups: Vec<Group<'_>> = Vec::new();
    let mut known: HashMap<Key<'_>, usize> = HashMap::new();
    let mut counts: HashMap<(Vec<&str>, &str), usize> = HashMap::new();
    for row in below {
        check_width(row, header)?;
        let own: Vec<&str> = keys.iter().map(|at| &row[*at]).collect();
        let of = &row[name];
        let count = counts.entry((own.clone(), of)).or_default();
        if has_frames && *count > 0 {
            let reason = format!(
                "a second `{of}` of a frame, expected one: a column such as person_id tells people apart"
            );
            return Err(RecordingError::Line { line: line(row), reason });
        }
        // Without frames each value of a name is in the next one.
        let frame = *count;
        *count += 1;
        let place = *places.entry(of).or_insert_with_key(|name| {
            names.push(*name);
            names.len() - 1
        });
        let group = *known.entry((own, frame)).or_insert_with(|| {
            groups.push(Group { first: row, frame, values: HashMap::new() });
            groups.len() - 1
        });
        groups[group].values.insert(place, &row[value]);
    }
    check_cells(below.len(), "names", names.len(), groups.len())?;
    let title = |at: &usize| if point == Some(*at) { "point" } else { &header[*at] };
    let mut all: StringRecord = keys.iter().map(title).collect();
    if !has_frames {
        all.push_field("frame");
    }
    names.iter().for_each(|name| all.push_field(name));
    let mut table = vec![all];
    for group in &groups {
        let mut row: StringRecord = keys.iter().map(|at| &group.first[*at]).collect();
        row.set_position(group.first.position().cloned());
        if !has_frames {
            row.push_field(&group.frame.to_string());
        }
        for place in 0..names.len() {
            row.push_field(group.values.get(&place).copied().unwrap_or_default());
        }
        table.push(row);
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use crate::readers::csv::sample::{BODY, read};

    /// A row for each frame, point and axis; all frames of a value before those of the next.
    fn rows(row: impl Fn(usize, &str, &str, f64) -> String) -> Vec<String> {
        let of = |(name, [x, y]): (&str, [f64; 2])| {
            let axes = [("x", x), ("y", y)];
            let axis = |(axis, value): (&str, f64)| [0, 1].map(|frame| row(frame, name, axis, value));
            axes.map(axis).concat()
        };
        BODY.map(of).concat()
    }

    #[test]
    fn values_by_name_are_those_of_frames() {
        let tables = [
            (
                "frame,variable,value",
                rows(|frame, name, axis, value| format!("{frame},{name}_{axis},{value}")),
            ),
            (
                "frame,name,axis,value",
                rows(|frame, name, axis, value| format!("{frame},{name},{axis},{value}")),
            ),
            (
                "Frame Number,name,variable,value",
                rows(|frame, name, axis, value| format!("{frame},{name},{axis},{value}")),
            ),
            ("name,value", rows(|_, name, axis, value| format!("{name}.{axis},{value}"))),
            (
                ",frame,bodyparts,coords,value",
                rows(|frame, name, axis, value| format!("7,{frame},{name},{axis},{value}")),
            ),
        ];
        for (header, rows) in tables {
            let found = read(header, &rows, None).unwrap_or_else(|error| panic!("{error}: {header}"));
            assert_eq!(found.frames.len(), 2, "{header}");
            let points = found.by_name(1);
            let height = points["nose"][2] - points["left ankle"][2];
            assert!(found.planar && (1300.0..1800.0).contains(&height), "{header}: {height} mm");
        }
    }

    #[test]
    fn values_of_several_people_are_kept_apart_and_a_second_value_is_refused() {
        let of = |frame: usize, person: usize, name: &str, axis: &str, value: f64| {
            let place = if axis == "x" { value + 300.0 * person as f64 } else { value };
            format!("{},{person},{name}_{axis},{place}", 0.04 * frame as f64)
        };
        let two = rows(|frame, name, axis, value| {
            [1, 2].map(|person| of(frame, person, name, axis, value)).join("\n")
        });
        for column in ["person_id", "id"] {
            let header = format!("time,{column},variable,value");
            let found = read(&header, &two, Some(2));
            let found = found.unwrap_or_else(|error| panic!("{error}: {header}"));
            assert!(found.rate_hz == 25.0 && found.remarks().join("; ").contains("2 people"));
        }
        let error = read("time,take,variable,value", &two, None).expect_err("twice").to_string();
        assert!(error.starts_with("line 3: a second `nose_x` of a frame"), "{error}");
    }
}
