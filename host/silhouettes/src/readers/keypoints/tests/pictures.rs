//! What files state about pictures, and what they lack.

use super::*;

#[test]
fn the_shape_of_the_picture_is_that_of_the_caller() {
    let json = |width: f64, height: f64| {
        let points: Vec<String> = person(layout(17), 100.0)
            .iter()
            .map(|[x, y, c]| format!("[{},{},{c}]", x / width, y / height))
            .collect();
        format!(r#"{{"width":640,"height":480,"frames":[[{0}],[{0}]]}}"#, points.join(","))
    };
    let portrait = Choices { aspect: Some("9:16".parse().expect("a shape")), ..Choices::default() };
    let read_as = |json: &str, choices| read(json.as_bytes(), "json", choices).expect("keypoints");
    let wide = |found: &super::super::super::recording::Recording| {
        let points = found.by_name(0);
        let wide = points["left shoulder"][0] - points["right shoulder"][0];
        wide / (points["left shoulder"][2] - points["left ankle"][2])
    };
    let parts = json(180.0, 320.0);
    let found = read_as(&parts, portrait);
    assert!((wide(&found) - 36.0 / 134.0).abs() < 1e-6, "{}", wide(&found));
    let remarks = found.remarks().join("; ");
    assert!(remarks.contains("a picture of 0.562 times its height (by --aspect)"), "{remarks}");
    assert!(wide(&read_as(&parts, Choices::default())) > 0.6, "of 4:3, as the file states");
    let remarks = read_as(&json(1.0, 1.0), portrait).remarks().join("; ");
    assert!(remarks.contains("--aspect 9:16 is ignored"), "{remarks}");
    let markers = read(b"A_x,A_y,A_z\n1,2,3\n", "csv", portrait).expect("markers");
    assert!(markers.remarks().join("; ").contains("--aspect 9:16 is ignored"), "{:?}", markers.remarks());
}

#[test]
fn a_category_that_the_file_does_not_list_is_reported() {
    let json = |category: usize| {
        format!(
            r#"{{"images":[{{"id":7,"file_name":"b1.png"}}],"categories":[{{"id":1,"name":"macaque"}}],
               "annotations":[{{"image_id":7,"category_id":{category},"keypoints":{}}}]}}"#,
            flat(&person(layout(17), 100.0))
        )
    };
    let remarks = upright(&json(3), 1).remarks().join("; ");
    assert!(remarks.contains("`categories` (1) lacks the category_id 3 of 1 annotations"), "{remarks}");
    let remarks = upright(&json(1), 1).remarks().join("; ");
    assert!(!remarks.contains("category"), "{remarks}");
}

#[test]
fn pictures_with_a_list_of_few_people_each_are_frames() {
    let forms: [fn(&str) -> String; 2] = [str::to_owned, |points| format!(r#"{{"keypoints":{points}}}"#)];
    for of_person in forms {
        let people = |frame: usize| {
            let of = |x: f64| of_person(&lists(&person(layout(17), x + frame as f64)));
            format!(r#""f{frame:02}":[{},{}]"#, of(100.0), of(400.0))
        };
        let json = format!("{{{}}}", (1..=8).map(people).collect::<Vec<_>>().join(","));
        let remarks = upright(&json, 8).remarks().join("; ");
        assert!(remarks.contains("2 people"), "{remarks}");
    }
}

#[test]
fn pictures_of_two_recordings_are_reported() {
    let points = flat(&person(layout(17), 100.0));
    let json = |folders: &[&str]| {
        let names = folders.iter().flat_map(|folder| (1..=4).map(move |n| format!("{folder}/{n:03}.jpg")));
        let entries: Vec<String> =
            names.map(|name| format!(r#"{{"image_id":"{name}","keypoints":{points}}}"#)).collect();
        format!("[{}]", entries.join(","))
    };
    let remarks = upright(&json(&["walk", "run"]), 8).remarks().join("; ");
    assert!(remarks.contains("2 sequences, which begin with run/001.jpg, walk/001.jpg"), "{remarks}");
    let remarks = upright(&json(&["walk"]), 4).remarks().join("; ");
    assert!(!remarks.contains("sequence"), "{remarks}");
}

#[test]
fn the_two_layouts_of_25_points_are_distinguished_by_the_neck() {
    let mut hidden = person(layout(25), 100.0);
    // From the side, with the left arm and leg behind the body.
    hidden[5] = hidden[2];
    for place in [6, 13] {
        hidden[place] = [0.0; 3];
    }
    for (points, layout) in [
        (person(layout(25), 100.0), "BODY_25,"),
        (hidden, "BODY_25,"),
        (person(&layouts::BODY_25B, 100.0), "BODY_25B,"),
    ] {
        let json = format!(r#"{{"people":[{{"pose_keypoints_2d":{}}}]}}"#, flat(&points));
        let found = read(json.as_bytes(), "json", Choices::default()).expect("a person");
        let remarks = found.remarks().join("; ");
        assert!(remarks.contains(&format!("layout OpenPose {layout}")), "{remarks}");
    }
}
