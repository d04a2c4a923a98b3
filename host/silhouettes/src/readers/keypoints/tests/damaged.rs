//! Files that hold something else, or too little.

use super::*;

#[test]
fn a_damaged_file_of_a_folder_is_named() {
    let good = format!(r#"{{"people":[{{"pose_keypoints_2d":{}}}]}}"#, flat(&person(layout(25), 100.0)));
    for bad in ["", r#"{"people":["#] {
        let files = [("a_1.json", good.as_bytes()), ("a_2.json", bad.as_bytes())];
        let error = read_files(files, Choices::default()).unwrap_err().to_string();
        assert!(error.starts_with("a_2.json: line 1: not JSON"), "{error}");
    }
}

#[test]
fn lists_of_numbers_with_the_length_of_a_layout_by_chance_are_refused() {
    let numbers = |count: usize| (0..count).map(|n| (10 * n).to_string()).collect::<Vec<_>>().join(",");
    let others: Vec<String> = (0..11).map(|n| format!(r#""lips{n}":[{}]"#, numbers(10))).collect();
    let json = format!(r#"{{"silhouette":[{}],{}}}"#, numbers(36), others.join(","));
    let error = read(json.as_bytes(), "json", Choices::default()).expect_err("points of a face").to_string();
    assert!(error.contains("1 of its frames") && error.contains("11 other values"), "{error}");
}

#[test]
fn frames_of_an_unknown_layout_are_reported() {
    let points = flat(&person(layout(17), 100.0));
    let json = format!(r#"[{{"keypoints":{points}}},{{"keypoints":[1,2,3]}},{{"keypoints":[]}}]"#);
    let found = upright(&json, 3);
    assert!(
        found.remarks().iter().any(|remark| remark.starts_with("1 frames hold")),
        "{:?}",
        found.remarks()
    );
}
