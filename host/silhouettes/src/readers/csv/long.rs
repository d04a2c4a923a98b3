//! Tables with a row for each point: the frame or its time, perhaps the person, the point's name or number, and `x`, `y`, perhaps
//! `z` and a confidence. They become tables with a row for each frame (and person) and columns `NAME_x`. In tables with a row for each
//! person and points in space, people become prefixes. Linear in the file.

use std::cmp::Ordering;
use std::collections::{HashMap, HashSet};

use csv::StringRecord;

use super::{
    LEAST_AXES, check_width,
    columns::{CONFIDENCES, FRAMES, POINTS, TIMES, people, place, simple},
    coordinate, line, unseparated,
};
use crate::readers::{
    keypoints::{names, table::are_keypoints},
    recording::{RecordingError, number},
};

/// What may follow in the names of columns of points.
const WORDS: [&str; 5] = ["name", "id", "idx", "index", "number"];
/// Most cells of the wide table for each row; with more, most would be empty.
const MOST_CELLS: usize = 20;

struct Columns {
    point: usize,
    /// Text before the numbers, if the points have numbers.
    numbered: Option<&'static str>,
    /// Columns with the text after a point's name.
    fields: Vec<(usize, String)>,
    frame: Option<usize>,
    time: Option<usize>,
    person: Option<usize>,
    /// People of markers in space are prefixes of the names.
    are_prefixes: bool,
    /// Name of rows without one; else these are ignored.
    unnamed: Option<&'static str>,
    /// What a row is of, also in the plural, and the character between its name and that of a field.
    of: (&'static str, &'static str, char),
}

/// Rows of a frame and person with their points.
struct Group<'a> {
    /// Number or time, or another name.
    frame: String,
    first: &'a StringRecord,
    rows: HashMap<usize, &'a StringRecord>,
}

/// The rows as they are, if they are not those of points.
pub fn wide(rows: Vec<StringRecord>) -> Result<Vec<StringRecord>, RecordingError> {
    let Some((header, below)) = rows.split_first() else { return Ok(rows) };
    let Some(columns) = columns(header, below) else { return Ok(rows) };
    table(&columns, header, below)
}

/// A table with a row for each person in a frame and points in space, with people as prefixes; `None` for one person.
pub fn apart(
    header: &StringRecord,
    below: &[StringRecord],
) -> Result<Option<Vec<StringRecord>>, RecordingError> {
    let axes = header.iter().filter_map(|column| coordinate(column).or_else(|| unseparated(column)));
    let depths = axes.filter(|(_, axis)| *axis == 2).count();
    let Some(person) = people(header, below, false).filter(|_| depths >= LEAST_AXES) else { return Ok(None) };
    let (frame, time) = (place(header, &FRAMES), place(header, &TIMES));
    let is_named = |row: &&StringRecord| row.get(person).is_some_and(|cell| !cell.is_empty());
    let named: Vec<&StringRecord> = below.iter().filter(is_named).collect();
    let count = |at: usize| named.iter().filter_map(|row| row.get(at)).collect::<HashSet<&str>>().len();
    // The number of a person alone may change, and recordings may follow each other.
    let alone = frame.or(time).map_or(count(person) == named.len(), |at| {
        let pairs: HashSet<_> = named.iter().map(|row| (row.get(at), row.get(person))).collect();
        count(at) == named.len() || pairs.len() < named.len()
    });
    if count(person) < 2 || alone {
        return Ok(None);
    }
    let is_field = |at: &usize| *at != person && Some(*at) != frame && Some(*at) != time;
    let fields = (0..header.len()).filter(is_field).map(|at| (at, header[at].to_owned())).collect();
    let columns = Columns {
        point: person,
        numbered: None,
        fields,
        frame,
        time,
        person: None,
        are_prefixes: false,
        unnamed: Some("unnamed"),
        of: ("person", "people", ':'),
    };
    table(&columns, header, below).map(Some)
}

/// Refuses tables of which most cells would be empty.
pub fn check_cells(rows: usize, of: &str, columns: usize, frames: usize) -> Result<(), RecordingError> {
    if columns * frames <= MOST_CELLS * rows {
        return Ok(());
    }
    let reason = format!(
        "its {rows} rows hold {columns} different {of} in {frames} frames, expected most of the {of} in each frame"
    );
    Err(RecordingError::Kind { kind: "CSV", reason })
}

fn table(
    columns: &Columns,
    header: &StringRecord,
    below: &[StringRecord],
) -> Result<Vec<StringRecord>, RecordingError> {
    let (names, groups) = grouped(columns, header, below)?;
    let (of, many, separator) = columns.of;
    if names.is_empty() {
        let reason = format!("it has no row of a {of} below its header");
        return Err(RecordingError::Kind { kind: "CSV", reason });
    }
    check_cells(below.len(), many, names.len(), groups.len())?;
    let track = columns.person.filter(|_| !columns.are_prefixes);
    let kept: Vec<usize> = [track, columns.time].into_iter().flatten().collect();
    let mut all = StringRecord::from(vec!["frame"]);
    // A name may state a unit, or whether people are meant.
    kept.iter().for_each(|at| all.push_field(&header[*at]));
    for name in &names {
        columns.fields.iter().for_each(|(_, field)| all.push_field(&format!("{name}{separator}{field}")));
    }
    let mut table = vec![all];
    for group in &groups {
        let mut row = StringRecord::from(vec![group.frame.as_str()]);
        row.set_position(group.first.position().cloned());
        kept.iter().for_each(|at| row.push_field(&group.first[*at]));
        for place in 0..names.len() {
            let own = group.rows.get(&place);
            columns.fields.iter().for_each(|(at, _)| row.push_field(own.map_or("", |own| &own[*at])));
        }
        table.push(row);
    }
    Ok(table)
}

fn columns(header: &StringRecord, below: &[StringRecord]) -> Option<Columns> {
    let axes = ["x", "y", "z"].map(|axis| (place(header, &[axis, format!("{axis}_coord").as_str()]), axis));
    let sure = place(header, &CONFIDENCES);
    let wide = header.iter().filter_map(coordinate).filter(|(_, axis)| *axis == 0).count();
    if axes[0].0.is_none() || axes[1].0.is_none() || wide >= LEAST_AXES {
        return None;
    }
    let is_flat = axes[2].0.is_none();
    let fields = axes.into_iter().filter_map(|(at, axis)| Some((at?, axis.to_owned())));
    let is_sure = is_flat || sure.is_some();
    let sure = sure.map(|at| (at, header[at].to_owned()));
    let named: Vec<(usize, &'static str)> =
        header.iter().enumerate().filter_map(|(at, column)| Some((at, point_column(column)?))).collect();
    let is_number = |at: usize| {
        let mut cells = below.iter().filter_map(|row| row.get(at));
        cells.all(|cell| cell.is_empty() || whole(cell).is_some())
    };
    let by_name = named.iter().find(|(at, _)| !is_number(*at));
    let (point, word) = *by_name.or_else(|| named.first())?;
    let count = below.iter().filter_map(|row| whole(row.get(point)?)).collect::<HashSet<u32>>().len();
    // Numbers in a picture are those of keypoints, under any name of their column.
    let numbered = by_name.is_none().then_some(if is_flat { "keypoint" } else { word });
    Some(Columns {
        point,
        numbered,
        are_prefixes: !is_flat && numbered.is_none_or(|word| !are_keypoints(word, count, is_sure)),
        fields: fields.chain(sure).collect(),
        frame: place(header, &FRAMES),
        time: place(header, &TIMES),
        person: people(header, below, true).filter(|at| {
            let people: HashSet<Option<&str>> = below.iter().map(|row| row.get(*at)).collect();
            people.len() > 1
        }),
        unnamed: None,
        of: ("point", "points", '_'),
    })
}

/// The word for points in the name of a column that tells them apart.
pub fn point_column(column: &str) -> Option<&'static str> {
    let simple = simple(column);
    POINTS
        .into_iter()
        .find(|word| simple.strip_prefix(*word).is_some_and(|rest| rest.is_empty() || WORDS.contains(&rest)))
}

fn whole(cell: &str) -> Option<u32> {
    let value = number(cell).filter(|value| value.fract() == 0.0 && (0.0..1e6).contains(value))?;
    Some(value as u32)
}

/// Names of all points, and the rows by frame and person, in the order of the frames' numbers or times.
fn grouped<'a>(
    columns: &Columns,
    header: &StringRecord,
    below: &'a [StringRecord],
) -> Result<(Vec<String>, Vec<Group<'a>>), RecordingError> {
    let (mut names, mut places) = (Vec::new(), HashMap::new());
    let (mut groups, mut known): (Vec<Group<'a>>, HashMap<(String, &str), usize>) =
        (Vec::new(), HashMap::new());
    // Without a frame and a time: points of the first frame, and the number of rows.
    let (mut order, mut seen, mut count) = (Vec::new(), HashSet::new(), 0_usize);
    for row in below {
        check_width(row, header)?;
        let person = columns.person.map_or("", |at| &row[at]);
        let point = match (&row[columns.point], columns.unnamed) {
            ("", None) => continue,
            ("", Some(name)) => name,
            (point, _) => point,
        };
        let frame = match columns.frame.or(columns.time) {
            Some(at) => row[at].to_owned(),
            None => {
                if count == order.len() && seen.insert((person, point)) {
                    order.push((person, point));
                } else if order[count % order.len()] != (person, point) {
                    return Err(unordered(row));
                }
                count += 1;
                ((count - 1) / order.len()).to_string()
            }
        };
        let own = match (columns.numbered, whole(point)) {
            (Some(word), Some(number)) => format!("{word}_{number}"),
            _ => point.to_owned(),
        };
        let is_prefixed = columns.are_prefixes && !person.is_empty();
        let name = if is_prefixed { format!("{person}:{own}") } else { own };
        let place = *places.entry(name).or_insert_with_key(|name| {
            names.push(name.clone());
            names.len() - 1
        });
        let key = (frame, if columns.are_prefixes { "" } else { person });
        let group = *known.entry(key).or_insert_with_key(|(frame, _)| {
            groups.push(Group { frame: frame.clone(), first: row, rows: HashMap::new() });
            groups.len() - 1
        });
        let group = &mut groups[group];
        if group.rows.insert(place, row).is_some() {
            let reason = format!(
                "a second row of the {} `{}` in frame {}, expected one: a column such as person_id tells people apart",
                columns.of.0, names[place], group.frame
            );
            return Err(RecordingError::Line { line: line(row), reason });
        }
    }
    if let Some(row) = below.last().filter(|_| !count.is_multiple_of(order.len().max(1))) {
        return Err(unordered(row));
    }
    let value = |group: &Group<'_>| number(&group.frame).filter(|value| value.is_finite());
    if groups.iter().all(|group| value(group).is_some()) {
        groups.sort_by(|a, b| value(a).partial_cmp(&value(b)).unwrap_or(Ordering::Equal));
    } else if columns.frame.is_some() {
        groups.sort_by_cached_key(|group| names::split(&group.frame));
    }
    if columns.frame.is_none() {
        let mut known: HashMap<String, usize> = HashMap::new();
        for group in &mut groups {
            let next = known.len();
            group.frame = known.entry(group.frame.clone()).or_insert(next).to_string();
        }
    }
    Ok((names, groups))
}

fn unordered(row: &StringRecord) -> RecordingError {
    let reason = "the rows do not repeat the same points or people, and no column numbers the frames: expected frame or time";
    RecordingError::Line { line: line(row), reason: reason.into() }
}

#[cfg(test)]
mod tests {
    use crate::readers::{
        csv::sample::{BODY, COCO, read},
        recording::Recording,
    };

    /// Rows of all points in two frames.
    fn rows(row: impl Fn(usize, usize, &str, [f64; 2]) -> String) -> Vec<String> {
        let points = || COCO.into_iter().zip(BODY);
        let frame = |frame: usize| points().map(move |(number, (name, place))| (frame, number, name, place));
        (0..2).flat_map(frame).map(|(frame, number, name, place)| row(frame, number, name, place)).collect()
    }

    #[track_caller]
    fn expect_person(header: &str, rows: &[String]) -> Recording {
        let found = read(header, rows, None).unwrap_or_else(|error| panic!("{error}: {header}"));
        assert_eq!(found.frames.len(), 2, "{header}");
        for frame in 0..2 {
            let points = found.by_name(frame);
            let height = points["nose"][2] - points["left ankle"][2];
            assert!(found.planar && (1300.0..1800.0).contains(&height), "{header}: {height} mm");
            assert!(points["left shoulder"][0] > points["right shoulder"][0]);
        }
        found
    }

    #[test]
    fn rows_of_points_by_name_or_number_are_frames() {
        let named = rows(|frame, _, name, [x, y]| format!("{frame},{name},{x},{y},0.9"));
        for column in ["bodypart", "keypoint_name", "joint", "Landmark"] {
            expect_person(&format!("frame,{column},x,y,confidence"), &named);
        }
        // As pandas melts them: all frames of a point, then those of the next.
        let mut melted = named.clone();
        melted.sort_by_key(|row| row.split(',').nth(1).map(str::to_owned));
        expect_person("frame,keypoint,x,y,likelihood", &melted);
        let numbered = rows(|frame, number, _, [x, y]| format!("{frame},{number},{x},{y}"));
        for column in ["keypoint", "joint", "marker"] {
            let found = expect_person(&format!("frame,{column},x,y"), &numbered);
            let remarks = found.remarks().join("; ");
            assert!(remarks.contains("from 0 up to 16, in the layout COCO (a guess)"), "{remarks}");
        }
        let both =
            rows(|frame, number, name, [x, y]| format!("{},{number},{name},{x},{y}", 0.04 * frame as f64));
        assert_eq!(expect_person("time,landmark_id,landmark_name,x,y", &both).rate_hz, 25.0);
        let alone = rows(|_, _, name, [x, y]| format!("{name},{x},{y}"));
        expect_person("keypoint,x_coord,y_coord", &alone);
    }

    #[test]
    fn landmarks_of_mediapipe_have_the_depth_of_a_picture() {
        let row = |frame: usize, number: usize| {
            let name = match number {
                0 => "nose",
                11 => "left_shoulder",
                12 => "right_shoulder",
                23 => "left_hip",
                24 => "right_hip",
                27 => "left_ankle",
                28 => "right_ankle",
                _ => "left_knee",
            };
            let place = BODY.iter().find(|(known, _)| *known == name).map_or([1.0; 2], |(_, place)| *place);
            format!("{frame},{number},{},{},-0.2", place[0] / 320.0, place[1] / 200.0)
        };
        let rows: Vec<String> =
            (0..2).flat_map(|frame| (0..33).map(move |number| row(frame, number))).collect();
        let remarks = expect_person("frame,landmark,x,y,z", &rows).remarks().join("; ");
        assert!(remarks.contains("in the layout MediaPipe"), "{remarks}");
    }

    #[test]
    fn rows_of_several_people_are_followed_in_pictures_and_in_space() {
        let of =
            |person: usize, frame: usize, name: &str, place: &str| format!("{frame},{person},{name},{place}");
        let flat = rows(|frame, _, name, [x, y]| {
            [0, 1]
                .map(|person| of(person, frame, name, &format!("{},{y}", x + 300.0 * person as f64)))
                .join("\n")
        });
        for column in ["person_id", "id"] {
            let found = read(&format!("frame,{column},keypoint,x,y"), &flat, Some(2)).expect("two people");
            assert!(found.frames.len() == 2 && found.remarks().join("; ").contains("2 people"));
        }
        let in_space = rows(|frame, _, name, [x, y]| {
            let place = |person: usize| format!("{},{},{}", 10.0 * x, 2000 * person + 5, 1900.0 - 10.0 * y);
            [0, 1].map(|person| of(person, frame, name, &place(person))).join("\n")
        });
        let found = read("frame,person,marker,x,y,z", &in_space, Some(2)).expect("two people");
        assert!(!found.planar && found.frames.len() == 2);
        assert_eq!(found.by_name(1)["left_knee"], [1090.0, 2005.0, 480.0]);
        assert!(read("frame,person,marker,x,y,z", &in_space, Some(3)).is_err());
        let numbered = rows(|frame, number, _, [x, y]| {
            [1, 2].map(|person| format!("{frame},{person},{number},{x},{y},{}", 1000 * person)).join("\n")
        });
        let found = read("frame,person,marker,x,y,z", &numbered, None).expect("markers");
        assert_eq!((found.frames.len(), found.by_name(1)["2:marker_5"]), (2, [118.0, 50.0, 2000.0]));
    }

    #[test]
    fn rows_of_people_in_space_are_kept_apart_and_a_number_that_changes_is_one_person() {
        let row = |person: usize, frame: usize| {
            let place =
                |[x, y]: [f64; 2]| format!(",{},{},{}", 10.0 * x, 2000 * person + 5, 1900.0 - 10.0 * y);
            format!("{frame},{person}{}", BODY.map(|(_, own)| place(own)).concat())
        };
        let names = BODY.map(|(name, _)| format!(",{name}_x,{name}_y,{name}_z")).concat();
        let rows: Vec<String> = (0..6).map(|n| row(1 + n / 3, n % 3)).collect();
        for column in ["person_id", "id"] {
            let found = read(&format!("frame,{column}{names}"), &rows, Some(2)).expect("two people");
            assert_eq!(found.frames.len(), 3);
            assert_eq!(found.by_name(2)["left_knee"], [1090.0, 4005.0, 480.0]);
            assert!(found.remarks().join("; ").contains("2 people"), "{column}");
        }
        let alone: Vec<String> = (0..6).map(|n| row(1 + n / 3, n)).collect();
        let found = read(&format!("frame,track_id{names}"), &alone, None).expect("one person");
        assert_eq!((found.frames.len(), found.by_name(5)["left_knee"][1]), (6, 4005.0));
        let repeated =
            read(&format!("frame,take{names}"), &rows, None).expect("one person").remarks().join("; ");
        assert!(repeated.contains("6 rows share 3 frame numbers"), "{repeated}");
        let error = read(&format!("take,track_id{names}"), &rows, None).expect_err("no frames").to_string();
        assert!(error.starts_with("line 5: the rows do not repeat the same points or people"), "{error}");
    }

    #[test]
    fn frames_are_in_the_order_of_their_numbers_or_times() {
        let mut melted = rows(|frame, _, name, [x, y]| {
            let frame = frame as f64;
            format!("{},{name},{},5,{}", 0.5 * frame, 10.0 * x + 100.0 * frame, 1900.0 - 10.0 * y)
        });
        melted.sort_by_key(|row| row.split(',').nth(1).map(str::to_owned));
        // The first frame lacks the first point.
        melted.remove(0);
        let named: Vec<String> = melted
            .iter()
            .map(|row| match row.strip_prefix("0.5,") {
                Some(rest) => format!("img_10,{rest}"),
                None => format!("img_9,{}", &row[2..]),
            })
            .collect();
        for (column, rows) in [("frame", &melted), ("time", &melted), ("frame", &named)] {
            let found = read(&format!("{column},marker,x,y,z"), rows, None).expect("markers");
            let nose = [0, 1].map(|frame| found.by_name(frame)["nose"][0]);
            assert!(!found.by_name(0).contains_key("left_ankle"));
            assert_eq!(nose, [1000.0, 1100.0], "{column}");
        }
    }

    #[test]
    fn without_frames_and_times_rows_that_do_not_repeat_the_same_points_are_refused() {
        let ordered = rows(|_, _, name, [x, y]| format!("{name},{x},{y}"));
        let mut melted = ordered.clone();
        melted.sort();
        let without = |place: usize| [&ordered[..place], &ordered[place + 1..]].concat();
        for (rows, line) in [(melted, 4), (without(0), 26), (without(13), 15)] {
            let error = read("keypoint,x,y", &rows, None).expect_err("no order").to_string();
            assert!(error.starts_with(&format!("line {line}: the rows do not repeat the same")), "{error}");
        }
    }

    #[test]
    fn a_point_twice_in_a_frame_and_points_of_no_common_frames_are_refused() {
        let named = rows(|_, _, name, [x, y]| format!("7,{name},{x},{y}"));
        let error = read("frame,keypoint,x,y", &named, None).expect_err("twice").to_string();
        assert!(error.starts_with("line 15: a second row of the point `nose` in frame 7"), "{error}");
        let sparse: Vec<String> = (0..100).map(|n| format!("{n},p{n},1,2")).collect();
        let error = read("frame,keypoint,x,y", &sparse, None).expect_err("sparse").to_string();
        assert!(error.contains("100 rows hold 100 different points in 100 frames"), "{error}");
        let error = read("frame,keypoint,x,y", &["0,nose,1".into(), "0,left_knee,1,2".into()], None);
        assert!(error.expect_err("a cell too few").to_string().starts_with("line 2: 3 values"));
        let error = read("frame,keypoint,x,y", &[], None).expect_err("a header").to_string();
        assert!(error.contains("no row of a point below its header"), "{error}");
    }

    #[test]
    fn openpose_numbers_without_all_points_are_distinguished_from_coco_by_the_neck() {
        let places: [[f64; 2]; 13] = [
            [100.0, 30.0],
            [100.0, 50.0],
            [82.0, 50.0],
            [76.0, 78.0],
            [74.0, 104.0],
            [118.0, 50.0],
            [124.0, 78.0],
            [126.0, 104.0],
            [91.0, 100.0],
            [91.0, 142.0],
            [91.0, 184.0],
            [109.0, 100.0],
            [109.0, 142.0],
        ];
        let row = |(number, [x, y]): (usize, &[f64; 2])| format!("0,{number},{x},{y}");
        // BODY_25 has the middle of the hips; here both ankles, too.
        let with_hips = [&places[..8], &[[100.0, 100.0]], &places[8..], &[[109.0, 184.0]]].concat();
        for (places, layout) in [(places.to_vec(), "OpenPose COCO"), (with_hips, "OpenPose BODY_25")] {
            let rows: Vec<String> = places.iter().enumerate().map(row).collect();
            let found = read("frame,keypoint,x,y", &rows, None).expect("a person");
            let remarks = found.remarks().join("; ");
            assert!(remarks.contains(&format!("in the layout {layout} (")), "{remarks}");
            assert!(found.by_name(0)["left knee"][0] > found.by_name(0)["right knee"][0]);
        }
    }
}
