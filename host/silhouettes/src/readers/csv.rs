//! CSV markers: header `frame,NAME_x,NAME_y,NAME_z,...` (or `NAME:x`, `NAME.X`), a frame per row, mm, empty = hidden; with
//! `NAMEX,NAMEY,NAMEZ` as the Kinect SDK names joints (metres, y up); with names above the axes, as Vicon Nexus, OptiTrack
//! Motive and pandas write them; with a row for each point or value; or of Qualisys Track Manager.

pub(super) mod columns;
mod long;
mod melted;
mod qualisys;
#[cfg(test)]
pub(super) mod sample;

use std::collections::{HashMap, HashSet};

use csv::StringRecord;

use super::keypoints::table;
use super::reader::Reader;
use super::recording::{
    Choices, Found, Known, RecordingError, Source, Unit, Up, check_last_row, number, promised_frames, text,
};
use super::trc::point;
use crate::silhouette::{anatomy, capsule::Point3};

pub const READER: Reader = Reader {
    name: "CSV",
    extensions: &["csv", "tsv"],
    about: "a table with columns NAME_x, NAME_y, NAME_z in millimetres, z up, or of the Kinect SDK, Vicon Nexus, OptiTrack Motive or Qualisys Track Manager; keypoints with NAME_x and NAME_y, with a row for each, or of SLEAP, DeepLabCut or MocapNET",
    read,
};

/// Motive's key of the number of frames.
const MOTIVE_FRAMES: &str = "Total Exported Frames";
/// Some joints under the Kinect SDK's names.
const KINECT: [&str; 4] = ["ShoulderLeft", "WristRight", "KneeLeft", "AnkleRight"];
/// Fewer columns of one axis are not those of a body.
const LEAST_AXES: usize = 3;

/// Separated by commas, semicolons or tabs. Ignores columns without a coordinate suffix (frame number, visibility), except
/// times. Errors have their line.
pub fn read(bytes: &[u8], choices: Choices) -> Result<Found, RecordingError> {
    let text = text(bytes)?;
    const SEPARATORS: [char; 3] = ['\t', ';', ','];
    let header = text.lines().find(|line| line.contains(SEPARATORS) && !line.starts_with('#'));
    let count = |separator: char| header.unwrap_or_default().matches(separator).count();
    let separator = SEPARATORS.into_iter().max_by_key(|separator| count(*separator)).unwrap_or(',');
    let rows: Vec<StringRecord> = csv::ReaderBuilder::new()
        .delimiter(separator as u8)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .flexible(true)
        .has_headers(false)
        .from_reader(text.as_bytes())
        .records()
        .collect::<Result<_, _>>()
        .map_err(|error| RecordingError::Kind { kind: "CSV", reason: error.to_string() })?;
    if let Some(found) = qualisys::read(&rows)? {
        return Ok(found);
    }
    if let Some(found) = layered(&rows)? {
        return Ok(found);
    }
    let rows = long::wide(melted::cast(stacked(joined(rows)))?)?;
    let (columns, below) = rows
        .split_first()
        .ok_or_else(|| RecordingError::Kind { kind: "CSV", reason: "it is empty".into() })?;
    let mut found = match table::read(columns, below, choices)? {
        Some(found) => found,
        None => {
            let apart = long::apart(columns, below)?;
            let (columns, below) = apart.as_deref().and_then(<[_]>::split_first).unwrap_or((columns, below));
            plain(columns, below)?
        }
    };
    match columns::rate_hz(columns, below) {
        Some(rate_hz) => found.rate_hz = rate_hz,
        None => found.remarks.push("the file states no frame rate".into()),
    }
    Ok(found)
}

/// DeepLabCut's rows `scorer`, `individuals` (of several), `bodyparts` and `coords` as one row of `INDIVIDUAL:PART_x`.
fn joined(mut rows: Vec<StringRecord>) -> Vec<StringRecord> {
    let begins = |word: &str| rows.iter().take(4).position(|row| row.get(0) == Some(word));
    let (Some(parts), Some(coords)) = (begins("bodyparts"), begins("coords")) else { return rows };
    let individuals = begins("individuals");
    let name = |(column, axis): (usize, &str)| {
        let cell = |row: usize| rows[row].get(column).unwrap_or_default();
        let person = individuals.map(|row| format!("{}:", cell(row))).unwrap_or_default();
        if column == 0 { "coords".to_owned() } else { format!("{person}{}_{axis}", cell(parts)) }
    };
    let header: StringRecord = rows[coords].iter().enumerate().map(name).collect();
    rows.drain(..coords);
    rows[0] = header;
    rows
}

/// A row of names above one of axes, as pandas writes them, as one row of `NAME_x`. A row with the title of the index alone may
/// follow.
fn stacked(mut rows: Vec<StringRecord>) -> Vec<StringRecord> {
    let [names, axes, ..] = rows.as_slice() else { return rows };
    if axes.iter().filter(|cell| cell.eq_ignore_ascii_case("x")).count() < LEAST_AXES {
        return rows;
    }
    let mut name = "";
    let mut header = StringRecord::new();
    for (column, axis) in axes.iter().enumerate() {
        let own = names.get(column).unwrap_or_default();
        name = if own.is_empty() { name } else { own };
        match (name, axis) {
            (_, "") => header.push_field(own),
            ("", axis) => header.push_field(axis),
            (name, axis) => header.push_field(&format!("{name}_{axis}")),
        }
    }
    let is_title = |row: &StringRecord| {
        row.iter().skip(1).all(str::is_empty) && row.get(0).is_some_and(|cell| number(cell).is_none())
    };
    let titles = usize::from(rows.get(2).is_some_and(is_title));
    rows.drain(..=titles);
    rows[0] = header;
    rows
}

/// A table with one row of names.
fn plain(columns: &StringRecord, rows: &[StringRecord]) -> Result<Found, RecordingError> {
    let mut markers = markers_of::<3>(columns, coordinate)?;
    let is_separated = !markers.is_empty();
    if !is_separated {
        let all: HashSet<&str> = columns.iter().collect();
        let has_all =
            |name: &str| ["X", "Y", "Z"].iter().all(|axis| all.contains(format!("{name}{axis}").as_str()));
        markers = markers_of(columns, |column| unseparated(column).filter(|(name, _)| has_all(name)))?;
    }
    if markers.is_empty() {
        const SHOWN: usize = 6;
        let shown: Vec<&str> = columns.iter().take(SHOWN).collect();
        let reason = format!(
            "its header names no marker ({}): expected NAME_x,NAME_y,NAME_z, or the x1,y1,v1 of numbered keypoints, as many as a \
             layout has, or a row for each point (frame,keypoint,x,y)",
            shown.join(",")
        );
        return Err(RecordingError::Kind { kind: "CSV", reason });
    }
    let has = |joint: &str| markers.iter().any(|(name, _)| anatomy::without_prefix(name) == joint);
    let is_kinect = !is_separated && KINECT.iter().all(|joint| has(joint));
    let (mm, up, source) = if is_kinect {
        let reason = "for joints are named as the Kinect SDK does".into();
        (1000.0, Up::Y, Source::Guess { reason, sure: true })
    } else {
        (1.0, Up::Z, Source::Format)
    };
    let mut places = Vec::new();
    for (name, columns) in &markers {
        let [Some(x), Some(y), Some(z)] = *columns else {
            let reason = format!("marker {name} has no column for each of x, y and z");
            return Err(RecordingError::Line { line: 1, reason });
        };
        places.push([x, y, z]);
    }
    let mut frames = Vec::new();
    for row in rows {
        check_width(row, columns)?;
        frames.push(points(row, &places)?);
    }
    let numbers = columns::place(columns, &columns::FRAMES).map_or(rows.len(), |column| {
        rows.iter().filter_map(|row| row.get(column)).collect::<HashSet<&str>>().len()
    });
    let remark = (numbers < rows.len()).then(|| {
        format!(
            "{} rows share {numbers} frame numbers and are read as frames of one person: add a column person_id if they are \
             several people, or put each recording into a separate file",
            rows.len()
        )
    });
    Ok(Found {
        others: Vec::new(),
        planar: false,
        names: markers.into_iter().map(|(name, _)| name).collect(),
        rate_hz: 0.0,
        frames,
        unit: Known { value: Unit { mm }, source: source.clone() },
        up: Known { value: up, source },
        remarks: remark.into_iter().collect(),
    })
}

pub(super) fn check_width(row: &StringRecord, columns: &StringRecord) -> Result<(), RecordingError> {
    if row.len() == columns.len() {
        return Ok(());
    }
    let reason = format!("{} values, the header has {}", row.len(), columns.len());
    Err(RecordingError::Line { line: line(row), reason })
}

type Marker<const FIELDS: usize> = (String, [Option<usize>; FIELDS]);

/// Names, with the columns of x, y, z and perhaps more.
pub(super) fn markers_of<const FIELDS: usize>(
    columns: &StringRecord,
    coordinate: impl Fn(&str) -> Option<(&str, usize)>,
) -> Result<Vec<Marker<FIELDS>>, RecordingError> {
    let (mut markers, mut known): (Vec<Marker<FIELDS>>, HashMap<&str, usize>) = (Vec::new(), HashMap::new());
    for (index, column) in columns.iter().enumerate() {
        let Some((name, axis)) = coordinate(column) else {
            continue;
        };
        let marker = *known.entry(name).or_insert_with(|| {
            markers.push((name.to_owned(), [None; FIELDS]));
            markers.len() - 1
        });
        if markers[marker].1[axis].replace(index).is_some() {
            let reason = format!("two columns are named {column}");
            return Err(RecordingError::Line { line: 1, reason });
        }
    }
    Ok(markers)
}

/// A table with names in a row above `Frame, ..., X, Y, Z, X, Y, Z`: of Vicon Nexus (units below, z up) and its predecessors
/// (`Field #`, no units), or of OptiTrack Motive (metadata in the first row, y up). `None` for other tables.
fn layered(rows: &[StringRecord]) -> Result<Option<Found>, RecordingError> {
    let first =
        |row: &StringRecord, word: &str| row.get(0).is_some_and(|cell| cell.eq_ignore_ascii_case(word));
    // Forces and angles of Nexus have tables of their own before the trajectories.
    let from = rows.iter().position(|row| first(row, "Trajectories")).unwrap_or(0);
    let is_axes = |row: &StringRecord, column: usize| {
        ["X", "Y", "Z"].iter().zip(column..).all(|(axis, at)| row.get(at).is_some_and(|cell| cell == *axis))
    };
    let header = (from..rows.len()).find(|at| {
        let row = &rows[*at];
        (first(row, "Frame") || first(row, "Field #")) && (1..row.len()).any(|column| is_axes(row, column))
    });
    let Some(header) = header.filter(|header| *header > 0) else { return Ok(None) };
    let motive = rows[..header].iter().position(|row| row.get(1) == Some("Name"));
    let names = &rows[motive.unwrap_or(header - 1)];
    let is_place = |column: usize| motive.is_none() || rows[header - 1].get(column) == Some("Position");
    let (mut markers, mut places): (Vec<String>, Vec<[usize; 3]>) = (Vec::new(), Vec::new());
    for column in
        (1..rows[header].len()).filter(|column| is_axes(&rows[header], *column) && is_place(*column))
    {
        let name = names.get(column).unwrap_or_default();
        if !name.is_empty() && markers.iter().all(|known| known != name) {
            markers.push(name.to_owned());
            places.push([column, column + 1, column + 2]);
        }
    }
    let stated = |key: &str| {
        let cell = rows[0].iter().position(|cell| cell == key)?;
        rows[0].get(cell + 1)
    };
    let units = rows.get(header + 1).filter(|row| row.get(0).is_none_or(|cell| number(cell).is_none()));
    let data = header + 1 + usize::from(units.is_some());
    let unit = match motive {
        Some(_) => stated("Length Units"),
        None => places.first().and_then(|place| units?.get(place[0])),
    };
    let rate = match motive {
        Some(_) => stated("Export Frame Rate").or_else(|| stated("Capture Frame Rate")),
        None => header.checked_sub(2).and_then(|row| rows[row].get(0)),
    };
    let is_frame = |row: &&StringRecord| row.get(0).is_some_and(|cell| number(cell).is_some());
    let frames: Vec<&StringRecord> = rows.iter().skip(data).take_while(is_frame).collect();
    if data + frames.len() == rows.len() {
        let width = places.iter().map(|place| place[2] + 1).max().unwrap_or(0);
        let cells: Vec<(usize, usize)> = frames.iter().map(|row| (line(row), row.len())).collect();
        check_last_row(&cells, width)?;
    }
    let mut remarks = Vec::new();
    if let Some(promised) = stated(MOTIVE_FRAMES).and_then(number).filter(|_| motive.is_some()) {
        let remark = promised_frames(MOTIVE_FRAMES, promised, frames.len());
        remarks.extend(remark.map_err(|reason| RecordingError::Line { line: 1, reason })?);
    }
    Ok(Some(Found {
        others: Vec::new(),
        planar: false,
        names: markers,
        rate_hz: rate.and_then(number).unwrap_or_default(),
        frames: frames.into_iter().map(|row| points(row, &places)).collect::<Result<_, _>>()?,
        unit: Found::stated_unit(unit.unwrap_or("mm")),
        up: Known { value: if motive.is_some() { Up::Y } else { Up::Z }, source: Source::Format },
        remarks,
    }))
}

fn points(row: &StringRecord, places: &[[usize; 3]]) -> Result<Vec<Option<Point3>>, RecordingError> {
    let cells = |place: &[usize; 3]| place.map(|column| row.get(column).unwrap_or_default());
    places.iter().map(|place| point(cells(place), line(row))).collect()
}

pub(super) fn line(row: &StringRecord) -> usize {
    row.position().map_or(0, |position| position.line() as usize)
}

/// Name and axis (0 to 2) of a column `NAME_x`.
pub(super) fn coordinate(column: &str) -> Option<(&str, usize)> {
    let (name, axis) = column.rsplit_once(['_', ':', '.', ' '])?;
    let axis = ["x", "y", "z"].iter().position(|known| axis.eq_ignore_ascii_case(known))?;
    Some((name, axis))
}

/// Name and axis (0 to 2) of a column `NameX`, as the Kinect SDK's `HipCenterX`.
fn unseparated(column: &str) -> Option<(&str, usize)> {
    let axis = ["X", "Y", "Z"].iter().position(|axis| column.ends_with(axis))?;
    let name = &column[..column.len() - 1];
    name.ends_with(|c: char| c.is_lowercase() || c.is_ascii_digit()).then_some((name, axis))
}

#[cfg(test)]
mod tests {
    mod apart;

    use super::*;

    fn read(bytes: &[u8]) -> Result<Found, RecordingError> {
        super::read(bytes, Choices::default())
    }

    #[test]
    fn tables_of_the_kinect_sdk_are_read_in_metres_with_y_up_and_their_rate() {
        const JOINTS: [&str; 20] = [
            "HipCenter",
            "Spine",
            "ShoulderCenter",
            "Head",
            "ShoulderLeft",
            "ElbowLeft",
            "WristLeft",
            "HandLeft",
            "ShoulderRight",
            "ElbowRight",
            "WristRight",
            "HandRight",
            "HipLeft",
            "KneeLeft",
            "AnkleLeft",
            "FootLeft",
            "HipRight",
            "KneeRight",
            "AnkleRight",
            "FootRight",
        ];
        let header = JOINTS.map(|joint| format!("{joint}X,{joint}Y,{joint}Z")).join(",");
        // The head is above, the feet are below the sensor.
        let high = |joint: &str| if joint == "Head" { 0.7 } else { -0.8 };
        let row = JOINTS.map(|joint| format!("0.1,{},3.3", high(joint))).join(",");
        let table = |header: &str| {
            format!("Timestamp,{header},User-ID,Action,\n7000.5,{row},5,Wave,\n7032.5,{row},5,Wave,\n")
        };
        let found = read(table(&header).as_bytes()).expect("valid").settled(Choices::default());
        assert_eq!((found.names.len(), found.rate_hz), (20, 31.25));
        let head = found.by_name(1)["head"];
        assert!(head.iter().zip([100.0, -3300.0, 700.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{head:?}");
        assert!(
            found.by_name(0).contains_key("left hip") && found.by_name(0).contains_key("shoulder centre")
        );
        let remarks = found.remarks().join("; ");
        for guess in ["lengths are taken as metres: a guess", "y is taken as up: a guess", "20 of 20 names"] {
            assert!(remarks.contains(guess), "{guess}: {remarks}");
        }
        let users = [7000, 7032].map(|time| format!("{time},{row},5\n{time},{row},6\n")).concat();
        let second = Choices { person: Some(2), ..Choices::default() };
        let text = format!("Timestamp,{header},User-ID\n{users}");
        let found = crate::readers::read(text.as_bytes(), "csv", second).expect("two people");
        assert_eq!((found.frames.len(), found.rate_hz), (2, 31.25));
        assert!((found.by_name(1)["head"][2] - 700.0).abs() < 1e-9);
        // A name without all three axes is another column; a name in capitals is not split.
        let other = read(b"HeadX,HeadY,HeadZ,ForceX\n1,2,3,4\n").expect("valid");
        assert_eq!((other.names, other.unit.value), (vec!["Head".to_owned()], Unit::MM));
        assert!(read(b"AX,AY,AZ\n1,2,3\n").is_err());
    }

    #[test]
    fn the_rate_is_that_of_a_column_of_times_and_its_absence_is_reported() {
        for (times, expected) in [
            ("t,0;0.01;0.02;0.5", 100.0),
            ("Time (s),10;10.5", 2.0),
            ("TIME,0;40;80", 25.0),
            ("time,0;0;0", 0.0),
            ("frame,0;40;80", 0.0),
        ] {
            let (column, times) = times.split_once(',').expect("a column");
            let rows: String = times.split(';').map(|time| format!("{time},1,2,3\n")).collect();
            let found = read(format!("{column},A_x,A_y,A_z\n{rows}").as_bytes()).expect("valid");
            assert_eq!(found.rate_hz, expected, "{column}");
            let remarks: &[&str] = if expected > 0.0 { &[] } else { &["the file states no frame rate"] };
            assert_eq!(found.remarks, remarks, "{column}");
        }
    }

    #[test]
    fn tables_are_read_and_bad_ones_named() {
        let read_back = read(b"frame,LASI_x,LASI_y,LASI_z,RASI_x,RASI_y,RASI_z\n1,1,2,3,,,\n2,4,5,6,7,8,9\n")
            .expect("valid");
        assert_eq!(read_back.names, vec!["LASI", "RASI"]);
        assert_eq!(read_back.frames[0], vec![Some([1.0, 2.0, 3.0]), None]);
        assert!(
            read(b"frame,A_x,A_y,B_z\n").expect_err("mixed").to_string().contains("marker A has no column")
        );
        for (header, column) in [("A_x,A_y,A_z,A_x\n", "A_x"), ("frame,x0,y0,x1,y1,x0\n", "x0")] {
            let error = read(header.as_bytes()).expect_err("twice").to_string();
            assert!(error.contains(&format!("two columns are named {column}")), "{error}");
        }
        for short in ["A_x,A_y,A_z\n1,2,3\n1,2\n", "A_x,A_y,A_z\r\n1,2,3\r\n1,2\r\n"] {
            let error = read(short.as_bytes()).expect_err("short").to_string();
            assert!(error.starts_with("line 3"), "{error}");
        }
        let error = read(b"a,b\n").expect_err("no marker").to_string();
        assert!(error.contains("names no marker (a,b): expected NAME_x"), "{error}");
        assert!(read(b"").is_err());
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

    #[test]
    fn names_above_axes_are_joined_as_pandas_writes_them() {
        let columns = |of: fn(&str) -> String| ["LFHD", "LASI", "LTOE"].map(of).join(",");
        let (names, merged) = (columns(|name| [name; 3].join(",")), columns(|name| format!("{name},,")));
        let axes = columns(|_| "x,y,z".into());
        let rows = "0,1,2,1700,4,5,1000,7,8,60\n1,1,2,1701,4,5,1000,7,8,60\n";
        for text in [
            format!(",{names}\n,{axes}\n{rows}"),
            format!("marker,{names}\naxis,{axes}\nframe{}\n{rows}", ",".repeat(9)),
            format!("frame,{merged}\n,{}\n{rows}", axes.to_uppercase()),
        ] {
            let found = read(text.as_bytes()).unwrap_or_else(|error| panic!("{error}: {text}"));
            assert_eq!((found.names.len(), found.frames.len()), (3, 2), "{text}");
            assert_eq!(found.frames[1][0], Some([1.0, 2.0, 1701.0]), "{text}");
        }
        let timed = format!(",{names}\ntime,{axes}\n{}", rows.replace("1,1,2,", "0.04,1,2,"));
        assert_eq!(read(timed.as_bytes()).expect("valid").rate_hz, 25.0);
    }

    #[test]
    fn tables_of_nexus_and_motive_have_their_names_above_the_axes() {
        let nexus = "Devices\n1000\n,,Plate - Force\nFrame,Sub Frame,Fx,Fy,Fz\n,,N,N,N\n1,0,1,2,3\n\n\
            Trajectories\n100\n,,Nick:LASI,,,Nick:RASI,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,cm,cm,cm,cm,cm,cm\n\
            1,0,1,2,3,,,\n2,0,4,5,6,7,8,9\n";
        let found = read(nexus.as_bytes()).expect("valid");
        assert_eq!(found.names, ["Nick:LASI", "Nick:RASI"]);
        assert_eq!(
            found.frames,
            [vec![Some([1.0, 2.0, 3.0]), None], vec![Some([4.0, 5.0, 6.0]), Some([7.0, 8.0, 9.0])]]
        );
        assert_eq!((found.rate_hz, found.unit.value.mm, found.up.value), (100.0, 10.0, Up::Z));

        // Cut in the middle of a row; with empty cells left out; with another table below.
        let cut = nexus.trim_end().trim_end_matches("8,9");
        let error = read(cut.as_bytes()).expect_err("cut short").to_string();
        assert!(error.starts_with("line 14: 7 values, the header names 8"), "{error}");
        let short = read(nexus.replace(",3,,,", ",3").replace(",7,8,9", "").as_bytes()).expect("valid");
        assert_eq!(short.frames, [vec![Some([1.0, 2.0, 3.0]), None], vec![Some([4.0, 5.0, 6.0]), None]]);
        assert!(read(format!("{cut}\n\nModel Outputs\n100\n").as_bytes()).is_ok());

        let with_tabs = read(nexus.replace(',', "\t").as_bytes()).expect("valid");
        assert_eq!(with_tabs.frames, found.frames);

        let earlier = "Title\nNotes:,\"\"\n\nTRAJECTORIES\n120,Hz\n,LASI,,,RASI,,\nField #,X,Y,Z,X,Y,Z\n1,1,2,3,,,\n2,4,5,6,7,8,9\n";
        let earlier = read(earlier.as_bytes()).expect("valid");
        assert_eq!((earlier.rate_hz, earlier.names), (120.0, vec!["LASI".into(), "RASI".into()]));
        assert_eq!(earlier.frames, found.frames);

        let motive = "Format Version,1.23,Take Name,Walk,Capture Frame Rate,120.0,Export Frame Rate,60.0,Length Units,Meters\n\n\
            ,Type,Bone,Bone,Bone,Bone,Bone,Bone,Bone,Marker,Marker,Marker\n,Name,Ann:Hip,Ann:Hip,Ann:Hip,Ann:Hip,Ann:Hip,Ann:Hip,Ann:Hip,C7,C7,C7\n\
            ,ID,1,1,1,1,1,1,1,2,2,2\n,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Position,Position,Position\n\
            Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,X,Y,Z\n0,0.0,0,0,0,1,0.1,0.9,0.2,0.1,1.5,0.2\n";
        let found = read(motive.as_bytes()).expect("valid");
        assert_eq!(found.names, ["Ann:Hip", "C7"]);
        assert_eq!(found.frames, [[Some([0.1, 0.9, 0.2]), Some([0.1, 1.5, 0.2])]]);
        assert_eq!((found.rate_hz, found.unit.value.mm, found.up.value), (60.0, 1000.0, Up::Y));
        let promising = |frames: &str| {
            let stated = format!("Export Frame Rate,60.0,Total Exported Frames,{frames}");
            read(motive.replace("Export Frame Rate,60.0", &stated).as_bytes())
        };
        let remarks = |frames: &str| promising(frames).expect("valid").remarks;
        assert_eq!((remarks("1"), remarks("")), (Vec::new(), Vec::new()));
        assert_eq!(remarks("2"), ["Total Exported Frames promises 2 frames, the file has 1"]);
        let error = promising("600").expect_err("cut short").to_string();
        assert!(error.starts_with("line 1") && error.contains("600") && error.contains("after 1"), "{error}");
    }
}
