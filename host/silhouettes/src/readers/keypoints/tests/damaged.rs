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
    assert!(error.contains("people's points in 1 frames, other values in 11"), "{error}");
}

#[test]
fn entries_of_an_unknown_layout_are_reported() {
    let points = flat(&person(layout(17), 100.0));
    for json in [
        format!(r#"[{{"keypoints":{points}}},{{"keypoints":[1,2,3]}},{{"keypoints":[]}}]"#),
        format!(
            r#"[{{"image_id":1,"keypoints":{points}}},{{"image_id":2,"keypoints":[1,2,3]}},{{"image_id":3,"keypoints":[]}}]"#
        ),
        format!(
            r#"{{"1":{{"1":{{"keypoints":{points}}},"2":{{"keypoints":[1,2,3]}},"3":{{"keypoints":[]}}}}}}"#
        ),
    ] {
        let remarks = upright(&json, 3).remarks().join("; ");
        assert!(remarks.contains("in a known layout are taken as empty: 1 entries"), "{remarks}");
    }
}
