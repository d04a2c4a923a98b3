//! Keypoints in a table: columns of x, y and perhaps a confidence for each named point, as SLEAP (`nose.x`) and MocapNET
//! (`2DX_neck`) write them, and DeepLabCut in rows of names that the CSV reader joins (`nose_x`, `Ann:nose_x`); or for each
//! numbered point (`x1`, `y1`, `z1`, `v1`; `landmark_0_x`).

use std::collections::HashMap;

use csv::StringRecord;

use super::{
    document::Document,
    found,
    layouts::{Layout, NAMES},
    points::{Person, Raw},
    spatial,
};
use crate::{
    readers::{
        csv::{
            check_width,
            columns::{CONFIDENCES, FRAMES, PEOPLE, frames, is_of, people},
            coordinate, line, markers_of,
        },
        people::prefixed,
        recording::{Choices, Found, RecordingError, number},
        trc::point,
    },
    silhouette::{aliases, anatomy},
};

/// MocapNET writes x, y and the visibility before the name.
const MOCAPNET: [&str; 3] = ["2DX_", "2DY_", "visible_"];

struct Column {
    name: String,
    place: [usize; 2],
    depth: Option<usize>,
    sure: Option<usize>,
}

/// `None` for a table of points in space, or without points. A z may be the depth of points in a picture, as MediaPipe has it.
pub fn read(
    columns: &StringRecord,
    rows: &[StringRecord],
    choices: Choices,
) -> Result<Option<Found>, RecordingError> {
    let is_point = |name: &str| columns.iter().filter_map(coordinate).any(|(own, _)| own == name);
    // One kind counts: some tables have a score and a visibility of each point.
    let kind = columns.iter().filter_map(confidence).find_map(|(name, kind)| is_point(name).then_some(kind));
    let (mut points, mut has_z) = points_of(columns, |column| field(column, kind))?;
    let names: Vec<String> = points.iter().map(|point| point.name.clone()).collect();
    for (point, name) in points.iter_mut().zip(prefixed(&names).unwrap_or(names)) {
        point.name = name;
    }
    let mut numbers = Vec::new();
    if bodies(&points).is_empty() {
        numbers = numbers_of(&points).unwrap_or_default();
        // Next to the points of a person these are the x1, y1, x2 and y2 of a box.
        if numbers.is_empty() {
            match points_of(columns, numbered) {
                Ok((others, has_depth)) => {
                    if let Some(found) = numbers_of(&others) {
                        (points, has_z, numbers) = (others, has_depth, found);
                    }
                }
                Err(error) if points.is_empty() => return Err(error),
                // They may be of another kind.
                Err(_) => {}
            }
        }
    }
    if points.is_empty() {
        return Ok(None);
    }
    let mut bodies = bodies(&points);
    if !numbers.is_empty() {
        bodies.push(("", points.iter().enumerate().collect()));
    }
    let known: usize = bodies.iter().map(|(_, body)| body.len()).sum();
    if known == 0 && has_z {
        return Ok(None);
    }
    if known == 0 {
        let names: Vec<&str> = points.iter().take(6).map(|point| point.name.as_str()).collect();
        let reason = format!(
            "too few of the points ({}) are those of a person, expected names such as nose, left_shoulder and right_hip: \
             rename the columns, or add columns NAME_z if the points are markers in space",
            names.join(", ")
        );
        return Err(RecordingError::Line { line: 1, reason });
    }
    let track = people(columns, rows, false);
    let are_several = track.is_some_and(|at| rows.windows(2).any(|two| two[0].get(at) != two[1].get(at)));
    let names = frames(columns, rows, are_several);
    // Other numbers mostly count the people of one frame.
    let track = track.filter(|at| names.is_none() || is_of(&columns[*at], &PEOPLE));
    let mut ids: HashMap<(&str, &str), i64> = HashMap::new();
    let mut frames: Vec<(String, Vec<Person>)> = Vec::new();
    for (index, row) in rows.iter().enumerate() {
        check_width(row, columns)?;
        let track = track.map_or("", |column| cell(row, column));
        let mut people = Vec::new();
        for (prefix, body) in &bodies {
            let mut raw = vec![Raw::MISSING; if numbers.is_empty() { NAMES.len() } else { points.len() }];
            for (place, column) in body {
                let [x, y] = column.place.map(|column| cell(row, column));
                if let Some([x, y, _]) = point([x, y, "0"], line(row))? {
                    let of =
                        |column: Option<usize>| number(cell(row, column?)).filter(|value| value.is_finite());
                    let third = of(column.depth);
                    // A column named as a depth holds no confidence.
                    let sure = of(column.sure).or(has_z.then_some(1.0));
                    raw[*place] = Raw { x, y, third, sure };
                }
            }
            let next = ids.len() as i64;
            // Without numbers of frames each row is one.
            let is_named = names.is_none() || !(track.is_empty() && prefix.is_empty());
            let id = is_named.then(|| *ids.entry((track, *prefix)).or_insert(next));
            people.push(Person { labels: numbers.clone(), ..Person::named(raw, id) });
        }
        let name = names.as_ref().and_then(|names| names.get(index)).cloned();
        frames.push((name.unwrap_or_else(|| index.to_string()), people));
    }
    if has_z && numbers.is_empty() && spatial::has_depth(frames.iter().flat_map(|(_, people)| people)) {
        return Ok(None);
    }
    if frames.is_empty() {
        return Err(RecordingError::Kind { kind: "CSV", reason: "it has no row below its header".into() });
    }
    if names.is_none() && ids.len() > bodies.len() {
        let reason = format!(
            "{} people have rows of their own, and no column numbers the frames: expected one of {}",
            ids.len(),
            FRAMES.join(", ")
        );
        return Err(RecordingError::Line { line: 1, reason });
    }
    let ignored = if has_z { "; their z is taken as a depth next to a picture and ignored" } else { "" };
    let about = || format!("{known} of {} named points are keypoints{ignored}", points.len());
    found(Document::of_frames(frames), choices, numbers.is_empty().then(about)).map(Some)
}

/// Columns of points, and whether one has a z.
fn points_of(
    columns: &StringRecord,
    field: impl Fn(&str) -> Option<(&str, usize)>,
) -> Result<(Vec<Column>, bool), RecordingError> {
    let markers = markers_of::<4>(columns, field)?;
    let has_z = markers.iter().any(|(_, [_, _, depth, _])| depth.is_some());
    let point = |(name, [x, y, depth, sure]): (String, [Option<usize>; 4])| {
        Some(Column { name, place: [x?, y?], depth, sure })
    };
    Ok((markers.into_iter().filter_map(point).collect(), has_z))
}

fn cell(row: &StringRecord, column: usize) -> &str {
    row.get(column).unwrap_or_default()
}

/// Points of a person with their places in [`NAMES`].
type Body<'a> = Vec<(usize, &'a Column)>;

/// People by the prefixes of their points' names.
fn bodies(points: &[Column]) -> Vec<(&str, Body<'_>)> {
    let mut prefixes: Vec<&str> = points.iter().map(|point| anatomy::prefix(&point.name)).collect();
    prefixes.sort_unstable();
    prefixes.dedup();
    let bodies = prefixes.into_iter().map(|prefix| (prefix, body(points, prefix)));
    bodies.filter(|(_, body)| !body.is_empty()).collect()
}

fn body<'a>(points: &'a [Column], prefix: &str) -> Body<'a> {
    let own: Vec<&Column> = points.iter().filter(|point| anatomy::prefix(&point.name) == prefix).collect();
    let names: Vec<String> = own.iter().map(|point| point.name.clone()).collect();
    let place = |name: &str| NAMES.iter().position(|known| *known == name);
    let known = aliases::keypoints(&names).into_iter();
    known.filter_map(|(at, name)| Some((place(&name)?, *own.get(at)?))).collect()
}

/// Numbers after a text that all names share, of keypoints.
fn numbers_of(points: &[Column]) -> Option<Vec<String>> {
    let parts = |point: &Column| {
        let text = point.name.trim_end_matches(|c: char| c.is_ascii_digit());
        (text.to_ascii_lowercase(), point.name[text.len()..].to_owned())
    };
    let (texts, numbers): (Vec<String>, Vec<String>) = points.iter().map(parts).unzip();
    let text = texts.first()?;
    let is_sure = points.iter().all(|point| point.depth.is_none() || point.sure.is_some());
    let are_alike =
        texts.iter().all(|other| other == text) && numbers.iter().all(|number| !number.is_empty());
    (are_alike && are_keypoints(text, points.len(), is_sure)).then_some(numbers)
}

/// Whether numbered points are keypoints by two of: their text, as many as a layout has, and no depth or a confidence. Others are
/// markers.
pub(in crate::readers) fn are_keypoints(text: &str, count: usize, is_sure: bool) -> bool {
    let is_named = ["keypoint", "landmark", "kp"].iter().any(|word| text.contains(word));
    let is_layout = Layout::of(count).is_some();
    if is_sure { is_named || is_layout } else { is_named && is_layout }
}

/// Name of a point, and the kind of its confidence.
fn confidence(column: &str) -> Option<(&str, &'static str)> {
    let (name, last) = column.rsplit_once(['_', ':', '.', ' '])?;
    let kind = CONFIDENCES.into_iter().find(|known| last.eq_ignore_ascii_case(known))?;
    Some((name, kind))
}

/// Name of a point, and 0 for x, 1 for y, 2 for z, 3 for the confidence of this kind.
fn field<'a>(column: &'a str, kind: Option<&str>) -> Option<(&'a str, usize)> {
    let mocapnet = MOCAPNET.iter().zip([0, 1, 3]).find_map(|(start, axis)| {
        let (begin, name) = column.split_at_checked(start.len())?;
        begin.eq_ignore_ascii_case(start).then_some((name, axis))
    });
    let sure = || {
        let (name, own) = confidence(column)?;
        (Some(own) == kind).then_some((name, 3))
    };
    mocapnet.or_else(|| coordinate(column)).or_else(sure)
}

/// Number of a point, and 0 for `x1` or `x1_coord`, 1 for `y1`, 2 for `z1`, 3 for the confidence `v1`.
fn numbered(column: &str) -> Option<(&str, usize)> {
    let column = column.strip_suffix("_coord").unwrap_or(column);
    let axis = ['x', 'y', 'z', 'v'].iter().position(|axis| column.to_ascii_lowercase().starts_with(*axis))?;
    let number = column[1..].trim_start_matches('_');
    let is_number = !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit());
    is_number.then_some((number, axis))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::readers::{self, csv::sample::BODY, recording::Recording};

    fn read(text: &str, person: Option<usize>) -> Result<Recording, RecordingError> {
        readers::read(text.as_bytes(), "csv", Choices { person, ..Choices::default() })
    }

    /// The cells of all points, `x` to the right.
    fn cells(of: impl Fn(&str, [f64; 2]) -> String) -> String {
        BODY.iter().map(|(name, place)| format!(",{}", of(name, *place))).collect()
    }

    /// Places of a layout's points; those that the body lacks are at the origin.
    fn places(points: usize) -> Vec<[f64; 2]> {
        let place = |name: Option<usize>| {
            let name = NAMES[name?].replace(' ', "_");
            BODY.iter().find(|(known, _)| *known == name).map(|(_, place)| *place)
        };
        let layout = Layout::of(points).expect("a layout");
        layout.places().map(|name| place(name).unwrap_or_default()).collect()
    }

    #[track_caller]
    fn expect_person(text: &str, frames: usize) -> Recording {
        let found = read(text, None).unwrap_or_else(|error| panic!("{error}: {text}"));
        assert_eq!(found.frames.len(), frames);
        let points = found.by_name(0);
        assert!(found.planar && points["left wrist"][0] > points["right wrist"][0]);
        assert!(points["right wrist"][2] > points["nose"][2] && points["nose"][2] > points["left wrist"][2]);
        let height = points["nose"][2] - points["left ankle"][2];
        assert!((1300.0..1800.0).contains(&height), "{height} mm");
        assert!(found.remarks().iter().any(|remark| remark.contains("named points are keypoints")));
        found
    }

    #[test]
    fn tables_of_sleap_are_read_by_names_frames_and_tracks() {
        let header =
            format!("track,frame_idx,instance.score{}", cells(|n, _| format!("{n}.x,{n}.y,{n}.score")));
        let row = |track: &str, frame: usize, x: f64| {
            format!("{track},{frame},0.9{}", cells(|_, [at, y]| format!("{},{y},0.9", at + x)))
        };
        // Frame 1 is missing; the score of a labelled point is empty.
        let rows = [0, 2, 3].map(|frame| [row("ann", frame, 0.0), row("ben", frame, 300.0)].join("\n"));
        let text = format!("{header}\n{}\n", rows.join("\n")).replacen("0.9,118", ",118", 1);
        let ann = expect_person(&text, 4);
        assert!(ann.by_name(1).is_empty());
        assert!(ann.remarks().iter().any(|remark| remark.starts_with("2 people")), "{:?}", ann.remarks());
        assert!(read(&text, Some(2)).is_ok() && read(&text, Some(3)).is_err());
        let error = read(&text.replacen(",82,50", ",82", 1), None).expect_err("a cell too few").to_string();
        assert!(error.starts_with("line 2") && error.contains("the header has"), "{error}");
    }

    #[test]
    fn rows_of_several_people_need_a_column_of_frames_and_may_have_one_of_times() {
        let header = cells(|name, _| format!("{name}_x,{name}_y"));
        let row = |track: &str, frame: usize, x: f64| {
            let place = cells(|_, [at, y]| format!("{},{y}", at + x));
            format!("{track},{frame},{}{place}\n", 0.04 * frame as f64)
        };
        let rows = |track: &str, x: f64| (0..3).map(|frame| row(track, frame, x)).collect::<String>();
        let rows = rows("ann", 0.0) + &rows("ben", 300.0);
        for name in FRAMES {
            let found = expect_person(&format!("track_id,{name},time{header}\n{rows}"), 3);
            let remarks = found.remarks().join("; ");
            assert!(found.rate_hz == 25.0 && remarks.contains("2 people"), "{} {remarks}", found.rate_hz);
            assert!(!remarks.contains("frame rate"), "{remarks}");
        }
        expect_person(&format!("track_id,take,time{header}\n{rows}"), 3);
        let error = read(&format!("track_id,take,clock{header}\n{rows}"), None).expect_err("no frames");
        let error = error.to_string();
        assert!(
            error.starts_with("line 1") && error.contains("2 people") && error.contains("frame_idx"),
            "{error}"
        );
        let found = expect_person(&format!("take,frame,clock{header}\n{}", row("a", 0, 0.0)), 1);
        assert!(
            found.remarks().join("; ").contains("the file states no frame rate"),
            "{:?}",
            found.remarks()
        );
    }

    #[test]
    fn a_table_without_numbers_of_frames_has_one_person_however_they_leap() {
        let header = cells(|name, _| format!("{name}_x,{name}_y"));
        let row = |x: f64| format!("a{}\n", cells(|_, [at, y]| format!("{},{y}", at + x)));
        let rows: String = (0..6).map(|frame| row(if frame < 3 { 0.0 } else { 600.0 })).collect();
        let found = expect_person(&format!("take{header}\n{rows}"), 6);
        assert!(!found.by_name(5).is_empty(), "{:?}", found.remarks());
        assert!(!found.remarks().join("; ").contains("people"), "{:?}", found.remarks());
    }

    #[test]
    fn boxes_next_to_named_points_are_no_points() {
        let header = cells(|name, _| format!("{name}_x,{name}_y"));
        let row = cells(|_, [x, y]| format!("{x},{y}"));
        let found = expect_person(&format!("frame,x1,y1,x2,y2,x_1{header}\n0,1,2,3,4,5{row}\n"), 1);
        let remarks = found.remarks().join("; ");
        assert!(remarks.contains("13 of 13 named points"), "{remarks}");
    }

    #[test]
    fn the_place_of_a_box_next_to_numbered_points_is_no_point() {
        let row: String = places(17).iter().map(|[x, y]| format!(",{x},{y}")).collect();
        for suffix in ["", "_coord"] {
            let header: String = (1..=17).map(|n| format!(",x{n}{suffix},y{n}{suffix}")).collect();
            let text = format!("frame,bbox_x,bbox_y,bbox_w{header}\n0,1,2,3{row}\n");
            let found = read(&text, None).unwrap_or_else(|error| panic!("{error}: {text}"));
            let remarks = found.remarks().join("; ");
            assert!(remarks.contains("in the layout COCO"), "{remarks}");
            assert!(found.by_name(0)["right wrist"][2] > found.by_name(0)["nose"][2]);
        }
    }

    #[test]
    fn one_kind_of_confidence_counts() {
        let header = cells(|name, _| format!("{name}_x,{name}_y,{name}_visibility,{name}_score"));
        let row = cells(|_, [x, y]| format!("{x},{y},1,0.01"));
        expect_person(&format!("frame,instance.likelihood{header}\n0,0.5{row}\n"), 1);
    }

    #[test]
    fn names_of_the_template_are_known() {
        let header: String = NAMES.iter().map(|name| format!(",{name}_x,{name}_y")).collect();
        let row: String = (0..NAMES.len()).map(|n| format!(",{},{}", 100 + n % 2, 30 + 5 * n)).collect();
        let found = read(&format!("frame{header}\n0{row}\n"), None).expect("keypoints");
        let remarks = found.remarks().join("; ");
        assert!(remarks.contains("28 of 28 named points are keypoints, seen from one side"), "{remarks}");
        assert!(found.by_name(0).contains_key("hip centre"));
    }

    #[test]
    fn tables_of_deeplabcut_are_read_by_their_rows_of_names() {
        let kinds = cells(|_, _| "x,y,likelihood".into());
        let names = cells(|name, _| format!("{name},{name},{name}"));
        let scorer = cells(|_, _| "DLC,DLC,DLC".into());
        let row = |x: f64| cells(|_, [at, y]| format!("{},{y},0.9", at + x));
        let text = format!("scorer{scorer}\nbodyparts{names}\ncoords{kinds}\n0{}\n1{}\n", row(0.0), row(5.0));
        expect_person(&text, 2);
        let of = |person: &str| cells(|_, _| [person; 3].join(","));
        let two = format!(
            "scorer{scorer}{scorer}\nindividuals{}{}\nbodyparts{names}{names}\ncoords{kinds}{kinds}\n0{}{}\n",
            of("ann"),
            of("ben"),
            row(0.0),
            row(300.0)
        );
        expect_person(&two, 1);
        assert!(read(&two, Some(2)).is_ok() && read(&two, Some(3)).is_err());
        let mouse = text.replace("_shoulder", "_paw").replace("_hip", "_whisker").replace("_knee", "_toe");
        let error = read(&mouse.replace("_wrist", "_claw"), None).expect_err("a mouse").to_string();
        assert!(error.contains("nose, left_paw") && error.contains("rename the columns"), "{error}");
    }

    #[test]
    fn a_depth_next_to_parts_of_the_picture_is_no_height_and_metres_remain_metres() {
        let header = cells(|name, _| format!("{name}_x,{name}_y,{name}_z"));
        for depth in ["0.4", "-0.2", ""] {
            let row = cells(|_, [x, y]| format!("{},{},{depth}", x / 320.0, y / 200.0));
            expect_person(&format!("frame{header}\n0{row}\n1{row}\n"), 2);
        }
        // A person in metres with z up, who stays within a square metre.
        let row = cells(|_, [x, y]| format!("{},0.3,{}", x / 200.0, (190.0 - y) / 100.0));
        let found = read(&format!("frame{header}\n0{row}\n"), None).expect("markers");
        assert!(!found.planar && (found.by_name(0)["nose"][2] - 1600.0).abs() < 1e-6);
    }

    #[test]
    fn depths_about_the_hips_of_a_person_near_the_camera_are_ignored() {
        let depth = |name: &str, y: f64| match name {
            "left_hip" => 0.1,
            "right_hip" => -0.1,
            _ => (y - 100.0) / 40.0,
        };
        let header = cells(|name, _| format!("{name}_x,{name}_y,{name}_z"));
        let row = cells(|name, [x, y]| format!("{},{},{}", x / 320.0, y / 200.0, depth(name, y)));
        expect_person(&format!("frame{header}\n0{row}\n1{row}\n"), 2);
    }

    #[test]
    fn tables_of_numbered_points_are_read_in_the_order_of_a_layout() {
        let row = |[x, y]: &[f64; 2]| format!(",{},{},-0.3,0.9", x / 320.0, y / 200.0);
        let row: String = places(33).iter().map(row).collect();
        let columns: [fn(usize, &str) -> String; 4] = [
            |n, field| format!("{}{}", &field[..1], n + 1),
            |n, field| format!("{}_{n}", &field[..1]),
            |n, field| format!("L{n}_{field}"),
            |n, field| format!("landmark_{n}_{field}"),
        ];
        for column in columns {
            let fields = (0..33).flat_map(|n| ["x", "y", "z", "visibility"].map(|field| column(n, field)));
            let text = format!("frame,{}\n0{row}\n1{row}\n", fields.collect::<Vec<_>>().join(","));
            let found = read(&text, None).unwrap_or_else(|error| panic!("{error}: {text}"));
            let points = found.by_name(1);
            assert!(found.planar && points["left wrist"][0] > points["right wrist"][0]);
            assert!(
                points["right wrist"][2] > points["nose"][2] && points["nose"][2] > points["left wrist"][2]
            );
            let remarks = found.remarks().join("; ");
            assert!(remarks.contains("in the layout MediaPipe"), "{remarks}");
        }
        // Markers in space have no confidences; other columns may be named as twice the same number.
        for (text, count, others) in [("M", 17, ""), ("landmark_", 60, ""), ("M", 13, ",v1,V1,x1,x1_coord")] {
            let header: String =
                (1..=count).map(|n| format!(",{text}{n}_x,{text}{n}_y,{text}{n}_z")).collect();
            let row: String = (1..=count).map(|n| format!(",{},{},{}", 10 * n, 7 * n, 100 * n)).collect();
            let cells = ",5".repeat(others.matches(',').count());
            let found = read(&format!("frame{header}{others}\n0{row}{cells}\n"), None).expect("markers");
            assert!(!found.planar && found.names[0] == format!("{text}1"), "{:?}", found.names);
        }
    }

    #[test]
    fn tables_of_mocapnet_are_parts_of_the_picture_whose_hands_and_feet_are_wrists_and_ankles() {
        let name = |name: &str| {
            let short = name.replace("left_", "l").replace("right_", "r");
            short.replace("wrist", "hand").replace("ankle", "foot").replace("nose", "head")
        };
        let header = cells(|part, _| format!("2DX_{0},2DY_{0},visible_{0}", name(part)));
        for visible in ["1", "95"] {
            let row = cells(|_, [x, y]| format!("{},{},{visible}", x / 320.0, y / 200.0));
            let csv = format!("frameNumber,skeletonID,totalSkeletons{header}\n0,0,1{row}\n1,0,1{row}\n");
            expect_person(&csv, 2);
        }
    }
}
