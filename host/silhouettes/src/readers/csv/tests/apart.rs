//! Tables with columns that may tell people or points apart.

use crate::readers::{
    self,
    csv::{long::point_column, sample::BODY},
    recording::{Choices, Recording},
};

#[track_caller]
fn read(text: &str) -> Recording {
    let found = readers::read(text.as_bytes(), "csv", Choices::default());
    found.unwrap_or_else(|error| panic!("{error}: {text}"))
}

/// Rows of a person in space after these cells.
#[track_caller]
fn in_space(header: &str, rows: &[&str]) -> Recording {
    let names = BODY.map(|(name, _)| format!(",{name}_x,{name}_y,{name}_z")).concat();
    let place = BODY.map(|(_, [x, y])| format!(",{},5,{}", 10.0 * x, 1900.0 - 10.0 * y)).concat();
    let rows: String = rows.iter().map(|row| format!("{row}{place}\n")).collect();
    read(&format!("{header}{names}\n{rows}"))
}

/// Rows of a person in a picture after these cells, so far to the right.
#[track_caller]
fn in_picture(header: &str, rows: &[(&str, f64)]) -> Recording {
    let names = BODY.map(|(name, _)| format!(",{name}_x,{name}_y,{name}_c")).concat();
    let place = |right: f64| BODY.map(|(_, [x, y])| format!(",{},{y},0", x + right)).concat();
    let rows: String = rows.iter().map(|(row, right)| format!("{row}{}\n", place(*right))).collect();
    read(&format!("{header}{names}\n{rows}"))
}

#[test]
fn recordings_that_follow_each_other_and_rows_with_their_own_number_are_frames() {
    let trials = ["ann,1,0", "ann,1,1", "ann,2,0", "ann,2,1", "ben,1,0", "ben,1,1", "ben,2,0", "ben,2,1"];
    assert_eq!(in_space("subject,trial,frame", &trials).frames.len(), 8);
    assert_eq!(in_space("person_id", &["1", "2", "3", "4"]).frames.len(), 4);
}

#[test]
fn rows_of_people_without_a_number_are_kept() {
    let found = in_space("frame,track_id", &["0,1", "0,2", "1,", "1,2"]);
    let remarks = found.remarks().join("; ");
    assert!(found.frames.len() == 2 && remarks.contains("3 people: 1 1, 2 2, 3 unnamed"), "{remarks}");
}

#[test]
fn numbers_within_a_frame_of_a_picture_may_swap() {
    let rows = [("0,1", 0.0), ("0,2", 300.0), ("1,1", 300.0), ("1,2", 0.0), ("2,1", 0.0), ("2,2", 300.0)];
    let found = in_picture("frame,instance", &rows);
    let nose = |frame: usize| found.by_name(frame)["nose"][0];
    assert!((nose(0) - nose(1)).abs() < 1.0 && found.remarks().join("; ").contains("2 people"));
}

#[test]
fn whole_seconds_do_not_number_the_frames_of_one_person() {
    let rows = ["1,0", "1,0", "1,1", "1,1"].map(|row| (row, 0.0));
    assert_eq!(in_picture("track_id,time", &rows).frames.len(), 4);
}

#[test]
fn frames_of_which_one_has_no_time_are_in_the_order_of_the_file() {
    let row = |index: usize, time: &str| {
        let of = |(name, [x, y]): (&str, [f64; 2])| {
            format!("{time},{name},{},5,{}\n", 10.0 * x + 100.0 * index as f64, 1900.0 - 10.0 * y)
        };
        BODY.map(of).concat()
    };
    let rows = [row(0, "0.05"), row(1, "0.1"), row(2, "")].concat();
    let found = read(&format!("time,marker,x,y,z\n{rows}"));
    assert_eq!([0, 1, 2].map(|frame| found.by_name(frame)["nose"][0]), [1000.0, 1100.0, 1200.0]);
}

#[test]
fn counts_of_points_name_none() {
    assert_eq!(["points", "markers", "keypoints"].map(point_column), [None; 3]);
    assert_eq!(["bodyparts", "Body Part", "joint_id"].map(|name| point_column(name).is_some()), [true; 3]);
}

#[test]
fn a_wide_table_with_other_columns_stays_one() {
    let found = in_space("frame,marker,x,y", &["0,start,0.1,0.2", "1,walk,0.1,0.2"]);
    assert_eq!(found.by_name(1)["left_knee"], [1090.0, 5.0, 480.0]);
}
