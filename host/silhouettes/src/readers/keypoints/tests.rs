use super::super::{read, recording::Choices};
use super::*;
use layouts::{LAYOUTS, Layout};

mod crowd;
mod damaged;
mod pictures;
mod scores;
mod unordered;

/// An upright person at x, 170 pixels tall: 1 px is 10 mm.
fn person(layout: &Layout, x: f64) -> Vec<[f64; 3]> {
    let place = |name: &str| -> [f64; 2] {
        let side = if name.starts_with("left") { 1.0 } else { -1.0 };
        let own = name.trim_start_matches("left ").trim_start_matches("right ");
        match own {
            "nose" | "eye" | "ear" => [x + 3.0 * side, 30.0],
            "head top" => [x, 20.0],
            "neck" => [x, 48.0],
            "shoulder" => [x + 18.0 * side, 50.0],
            "elbow" => [x + 24.0 * side, 78.0],
            "wrist" | "hand" => [x + 26.0 * side, 104.0],
            "hip" => [x + 9.0 * side, 100.0],
            "hip centre" => [x, 100.0],
            "knee" => [x + 9.0 * side, 142.0],
            "ankle" => [x + 9.0 * side, 184.0],
            _ => [x + 11.0 * side, 190.0],
        }
    };
    let mut points: Vec<[f64; 3]> = layout
        .places()
        .map(|name| {
            name.map_or([1.0, 1.0, 0.9], |name| {
                let [x, y] = place(NAMES[name]);
                [x, y, 0.9]
            })
        })
        .collect();
    points.resize(layout.count, [1.0, 1.0, 0.9]);
    points
}

fn flat(points: &[[f64; 3]]) -> String {
    let numbers: Vec<String> = points.iter().flatten().map(f64::to_string).collect();
    format!("[{}]", numbers.join(","))
}

fn layout(count: usize) -> &'static Layout {
    Layout::of(count).expect("a layout")
}

#[track_caller]
fn upright(json: &str, frames: usize) -> super::super::recording::Recording {
    let found =
        read(json.as_bytes(), "json", Choices::default()).unwrap_or_else(|error| panic!("{error}: {json}"));
    assert_eq!(found.frames.len(), frames, "{json}");
    let points = found.by_name(0);
    let height = points["left shoulder"][2] - points["left ankle"][2];
    assert!((height - 1340.0).abs() < 60.0, "{height} mm");
    assert!(points["left shoulder"][0] > points["right shoulder"][0]);
    assert!(found.planar && found.remarks()[0].contains("guess"), "{:?}", found.remarks());
    found
}

#[test]
fn openpose_files_of_all_layouts_are_one_frame_each() {
    for layout in LAYOUTS.iter().filter(|layout| layout.count <= 26) {
        let json = format!(
            r#"{{"version":1.3,"people":[{{"person_id":[-1],"pose_keypoints_2d":{},"face_keypoints_2d":[]}}]}}"#,
            flat(&person(layout, 100.0))
        );
        let found = upright(&json, 1);
        assert!(found.remarks().iter().any(|remark| remark.contains(layout.name)), "{:?}", found.remarks());
    }
}

fn folder(names: &[&str], files: &[String]) -> super::super::recording::Recording {
    let files = names.iter().copied().zip(files.iter().map(String::as_bytes));
    read_files(files, Choices::default()).expect("keypoints").settled(Choices::default())
}

#[test]
fn a_folder_of_openpose_files_is_a_recording_with_empty_frames() {
    let frame =
        |x: f64| format!(r#"{{"people":[{{"pose_keypoints_2d":{}}}]}}"#, flat(&person(layout(25), x)));
    let files = [frame(100.0), r#"{"people":[]}"#.into(), frame(104.0)];
    let found = folder(&["1.json", "2.json", "3.json"], &files);
    assert_eq!(found.frames.len(), 3);
    assert!(found.by_name(1).is_empty());
    let moved = found.by_name(2)["neck"][0] - found.by_name(0)["neck"][0];
    assert!((moved - 40.0).abs() < 3.0, "{moved} mm");
}

#[test]
fn frames_without_a_sure_point_are_frames() {
    let mut points = person(layout(25), 100.0);
    points.iter_mut().for_each(|point| point[2] = 0.05);
    let json = format!(r#"{{"people":[{{"pose_keypoints_2d":{}}}]}}"#, flat(&points));
    let found = folder(&["1.json", "2.json"], &[json.clone(), json]);
    assert_eq!(found.frames.len(), 2);
    assert!(found.by_name(0).is_empty() && found.by_name(1).is_empty());
    let remarks = found.remarks();
    assert!(remarks.iter().any(|remark| remark.contains("below a confidence of 0.1")), "{remarks:?}");
    assert!(remarks.iter().all(|remark| !remark.contains("parts of a picture")), "{remarks:?}");
}

#[test]
fn a_list_in_a_file_of_a_folder_holds_the_people_of_one_frame() {
    let person = |x: f64| format!(r#"{{"keypoints":{}}}"#, flat(&person(layout(17), x)));
    let both = |x: f64| format!("[{},{}]", person(x), person(400.0 - x));
    let files = [both(100.0), "[]".into(), "null".into(), both(104.0)];
    let found = folder(&["1.json", "2.json", "3.json", "4.json"], &files);
    assert_eq!(found.frames.len(), 4);
    assert!(found.by_name(1).is_empty() && found.by_name(2).is_empty());
    assert!(found.remarks().iter().any(|remark| remark.starts_with("2 people")), "{:?}", found.remarks());
    // A folder with one file holds a recording.
    assert_eq!(folder(&["all.json"], &files).frames.len(), 2);
    let recording = format!(r#"{{"frames":[[{0}],[{0}]]}}"#, person(100.0));
    let two = [("a.json", recording.as_bytes()), ("b.json", recording.as_bytes())];
    let error = read_files(two, Choices::default()).unwrap_err().to_string();
    assert!(error.contains("a.json holds 2 frames") && error.contains("alone"), "{error}");
}

#[test]
fn files_missing_from_a_folder_are_frames_without_people() {
    let file = format!(r#"{{"people":[{{"pose_keypoints_2d":{}}}]}}"#, flat(&person(layout(25), 100.0)));
    let files = [&file; 3].map(String::clone);
    let found = |names: [&str; 3]| folder(&names, &files);
    let few = found(["walk_0009_keypoints.json", "walk_0010_keypoints.json", "walk_0013_keypoints.json"]);
    assert_eq!(few.frames.len(), 5);
    assert!(few.by_name(2).is_empty() && !few.by_name(4).is_empty());
    let many = found(["1.json", "2.json", "90.json"]);
    assert_eq!(many.frames.len(), 3);
    assert!(many.remarks().iter().any(|remark| remark.contains("are missing")), "{:?}", many.remarks());
    assert!(few.remarks().iter().all(|remark| !remark.contains("are missing")), "{:?}", few.remarks());
}

#[test]
fn pictures_are_in_the_order_of_all_numbers_of_their_names() {
    let x = |n: usize| 100.0 + n as f64;
    for [first, second, last] in [
        ["frame_9_cam1.jpg", "frame_10_cam1.jpg", "frame_12_cam1.jpg"],
        ["9_640x480.png", "10_640x480.png", "12_640x480.png"],
        ["walk.0009", "walk.0010", "walk.0012"],
    ] {
        let points = [2, 0, 1].map(|n| flat(&person(layout(17), x(n))));
        let names = [last, first, second];
        let list: Vec<String> = names
            .iter()
            .zip(&points)
            .map(|(name, points)| format!(r#"{{"image_id":"{name}","keypoints":{points}}}"#))
            .collect();
        let map: Vec<String> = names
            .iter()
            .zip(&points)
            .map(|(name, points)| format!(r#""{name}":{{"people":[{{"keypoints":{points}}}]}}"#))
            .collect();
        for json in [format!("[{}]", list.join(",")), format!("{{{}}}", map.join(","))] {
            let found = upright(&json, 4);
            assert!(found.by_name(2).is_empty(), "{json}");
            let hips: Vec<f64> = [0, 1, 3].map(|n| found.by_name(n)["left hip"][0]).to_vec();
            assert!(hips.is_sorted(), "{hips:?}");
        }
    }
    // Seconds as numbers.
    let list: Vec<String> = [0.1, 0.0, 0.067, 0.033]
        .iter()
        .map(|second| {
            let points = flat(&person(layout(17), 100.0 + 100.0 * second));
            format!(r#"{{"frame_id":{second:?},"keypoints":{points}}}"#)
        })
        .collect();
    let found = upright(&format!("[{}]", list.join(",")), 4);
    let hips: Vec<f64> = (0..4).map(|n| found.by_name(n)["left hip"][0]).collect();
    assert!(hips.is_sorted(), "{hips:?}");
}

#[test]
fn coco_and_halpe_results_are_ordered_by_picture_and_gaps_are_empty() {
    for count in [17, 26, 133, 136] {
        let entry = |number: usize| {
            format!(
                r#"{{"image_id":"frame_{number}.jpg","category_id":1,"keypoints":{},"score":2.5,"idx":[[1.0]]}}"#,
                flat(&person(layout(count), number as f64))
            )
        };
        let json = format!("[{},{},{}]", entry(10), entry(9), entry(12));
        let found = upright(&json, 4);
        assert!(found.by_name(2).is_empty());
        assert!(found.by_name(1)["left hip"][0] > found.by_name(0)["left hip"][0]);
    }
}

/// AlphaPose without tracking numbers everybody 0 and lists people in any order.
#[test]
fn people_with_one_number_are_followed_by_place() {
    let entry = |frame: usize, x: f64| {
        format!(
            r#"{{"image_id":"{frame}.jpg","category_id":1,"keypoints":{},"score":2.5,"idx":[0.0]}}"#,
            flat(&person(layout(17), x))
        )
    };
    let entries: Vec<String> = (0..12)
        .flat_map(|frame| {
            let [left, right] = [100.0, 400.0].map(|x| entry(frame, x + frame as f64));
            if frame % 3 == 0 { [left, right] } else { [right, left] }
        })
        .collect();
    let json = format!("[{}]", entries.join(","));
    for number in [1, 2] {
        let choices = Choices { person: Some(number), ..Choices::default() };
        let found = read(json.as_bytes(), "json", choices).expect("two people");
        let places: Vec<f64> = (0..12).map(|frame| found.by_name(frame)["nose"][0]).collect();
        assert!(places.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 30.0), "{places:?} mm");
    }
}

#[test]
fn tracks_of_people_and_people_of_frames_are_the_same_recording() {
    let person = |x: f64| format!(r#"{{"keypoints": {}, "scores": 0.9}}"#, flat(&person(layout(17), x)));
    // Frame 11 lacks one of them, frame 12 both.
    let tracks = format!(
        r#"{{"7": {{"0009": {}, "0010": {}, "0013": {}}}, "8": {{"0009": {}, "0010": {}, "0011": {}, "0013": {}}}}}"#,
        person(100.0),
        person(101.0),
        person(102.0),
        person(300.0),
        person(300.0),
        person(300.0),
        person(300.0)
    );
    let frames = format!(
        r#"{{"f9": {{"7": {}, "8": {}}}, "f10": {{"8": {}, "7": {}}}, "f11": {{"8": {}}}, "f13": {{"7": {}, "8": {}}}}}"#,
        person(100.0),
        person(300.0),
        person(300.0),
        person(101.0),
        person(300.0),
        person(102.0),
        person(300.0)
    );
    let [by_track, by_frame] = [tracks, frames].map(|json| upright(&json, 5));
    assert_eq!(by_track.frames, by_frame.frames);
}

#[test]
fn coco_annotations_take_the_order_of_their_pictures() {
    let json = format!(
        r#"{{"images":[{{"id":7,"file_name":"b2.png","width":640,"height":480}},{{"id":3,"file_name":"b1.png"}}],
            "annotations":[{{"image_id":7,"id":1,"keypoints":{},"num_keypoints":17}}]}}"#,
        flat(&person(layout(17), 100.0))
    );
    let found = read(json.as_bytes(), "json", Choices::default()).expect("keypoints");
    assert_eq!(found.frames.len(), 2);
    assert!(found.by_name(0).is_empty() && !found.by_name(1).is_empty());
    let as_text = json.replace(r#""id":7,"#, r#""id":"7","#).replace(r#""image_id":7"#, r#""image_id":"7""#);
    let text = read(as_text.as_bytes(), "json", Choices::default()).expect("keypoints");
    assert_eq!(text.frames, found.frames);
}

#[test]
fn mediapipe_landmarks_are_parts_of_the_picture() {
    let landmarks: Vec<String> = person(layout(33), 100.0)
        .iter()
        .map(|[x, y, _]| format!(r#"{{"x":{},"y":{},"z":-0.1,"visibility":0.98}}"#, x / 320.0, y / 200.0))
        .collect();
    let landmarks = landmarks.join(",");
    for json in [
        format!(
            r#"{{"width":320,"height":200,"frames":[{{"landmarks":[{landmarks}]}},{{"landmarks":[]}}]}}"#
        ),
        format!(r#"{{"width":320,"height":200,"frames":[{{"poseLandmarks":[[{landmarks}]]}},null]}}"#),
        format!(
            r#"{{"width":320,"height":200,"frames":[{{"pose_landmarks":{{"landmark":[{landmarks}]}}}},{{}}]}}"#
        ),
    ] {
        let found = upright(&json, 2);
        assert!(found.remarks().iter().any(|remark| remark.contains("stated")), "{:?}", found.remarks());
    }
    // A point guessed far outside the picture does not make the others pixels.
    let far = landmarks.replacen(&format!(r#""x":{}"#, 103.0 / 320.0), r#""x":4.5"#, 1);
    assert_ne!(far, landmarks);
    let json = format!(r#"{{"width":320,"height":200,"frames":[[{landmarks}],[{landmarks}],[{far}]]}}"#);
    let found = upright(&json, 3);
    assert!(found.remarks().iter().any(|remark| remark.contains("stated")), "{:?}", found.remarks());
    // Without a size the shape is a guess, which is reported.
    let bare = format!("[[{landmarks}],[{landmarks}]]");
    let found = read(bare.as_bytes(), "json", Choices::default()).expect("keypoints");
    assert_eq!(found.frames.len(), 2);
    assert!(found.remarks().iter().any(|remark| remark.contains("doubtful guess")), "{:?}", found.remarks());
}

#[test]
fn mmpose_instances_with_scores_apart_are_read() {
    let points: Vec<String> = person(layout(17), 50.0).iter().map(|[x, y, _]| format!("[{x},{y}]")).collect();
    let mut scores = vec!["0.9"; 17];
    scores[9] = "0.01";
    let json = format!(
        r#"{{"meta_info":{{}},"instance_info":[{{"frame_id":1,"instances":[{{"keypoints":[{}],"keypoint_scores":[{}]}}]}}]}}"#,
        points.join(","),
        scores.join(",")
    );
    let found = upright(&json, 1);
    assert!(!found.by_name(0).contains_key("left wrist"), "its score is 0.01");
    assert!(found.remarks().iter().any(|remark| remark.contains("1 points below")), "{:?}", found.remarks());
}

#[test]
fn several_people_are_followed_apart_and_counted() {
    let of = |x: f64| format!(r#"{{"pose_keypoints_2d":{}}}"#, flat(&person(layout(25), x)));
    // They stay apart while the file's order changes; the second comes later.
    let frames: Vec<String> = (0..10)
        .map(|n| {
            let (a, b) = (of(100.0 + 2.0 * f64::from(n)), of(400.0 - 2.0 * f64::from(n)));
            let people = if n < 3 {
                a
            } else if n % 2 == 0 {
                format!("{a},{b}")
            } else {
                format!("{b},{a}")
            };
            format!(r#"{{"people":[{people}]}}"#)
        })
        .collect();
    let json = format!(r#"{{"frames":[{}]}}"#, frames.join(","));
    let found = upright(&json, 10);
    assert!(found.remarks().iter().any(|remark| remark.starts_with("2 people")), "{:?}", found.remarks());
    let x: Vec<f64> = (0..10).map(|n| found.by_name(n)["neck"][0]).collect();
    assert!(x.windows(2).all(|pair| pair[1] > pair[0]), "{x:?}");
    let choices = Choices { person: Some(2), ..Choices::default() };
    let second = read(json.as_bytes(), "json", choices).expect("the second");
    assert!(second.by_name(0).is_empty() && second.by_name(9)["neck"][0] < second.by_name(3)["neck"][0]);
    let choices = Choices { person: Some(3), ..Choices::default() };
    let error = read(json.as_bytes(), "json", choices).expect_err("two people").to_string();
    assert!(error.contains('3') && error.contains('2'), "{error}");
}

#[test]
fn other_json_is_refused_with_what_was_expected() {
    for json in ["{}", "[]", "3", r#"{"people":[]}"#, r#"{"keypoints":[1,2,3]}"#, r#"{"a":{"b":[1]}}"#] {
        let error = read(json.as_bytes(), "json", Choices::default()).expect_err(json).to_string();
        assert!(error.contains("keypoints"), "{error}");
    }
    let error = read(b"{\n\"people\":", "json", Choices::default()).expect_err("cut short").to_string();
    assert!(error.starts_with("line 2"), "{error}");
}

#[test]
fn points_of_openpose_1_posenet_and_ultralytics_are_read() {
    let points = person(layout(18), 100.0);
    upright(&format!(r#"{{"version":1.0,"people":[{{"pose_keypoints":{}}}]}}"#, flat(&points)), 1);
    let points = person(layout(17), 100.0);
    let nested = points
        .iter()
        .map(|[x, y, c]| format!(r#"{{"score":{c},"part":"nose","position":{{"x":{x},"y":{y}}}}}"#))
        .collect::<Vec<_>>()
        .join(",");
    upright(
        &format!(r#"[{{"score":0.9,"keypoints":[{nested}]}},{{"score":0.9,"keypoints":[{nested}]}}]"#),
        2,
    );
    let column = |k: usize| points.iter().map(|p| p[k].to_string()).collect::<Vec<_>>().join(",");
    let person = format!(
        r#"{{"name":"person","track_id":1,"keypoints":{{"x":[{}],"y":[{}],"visible":[{}]}}}}"#,
        column(0),
        column(1),
        column(2)
    );
    upright(&format!("[[{person}],[{person}],[]]"), 3);
}

#[test]
fn not_a_number_is_a_missing_point_and_stays_in_names() {
    let mut points = person(layout(17), 100.0);
    // The first point and the left wrist.
    points[0][0] = f64::NAN;
    points[9] = [f64::NAN, f64::NEG_INFINITY, f64::NAN];
    let numbers = flat(&points).replace("-inf", "-Infinity");
    assert!(numbers.contains("NaN,") && numbers.contains("-Infinity"));
    let item = |name: &str| format!(r#"{{"image_id":"NaN\"{name}.jpg","keypoints":{numbers}}}"#);
    let found = upright(&format!("[{},{}]", item("1"), item("2")), 2);
    assert!(!found.by_name(0).contains_key("nose") && !found.by_name(0).contains_key("left wrist"));
}

/// The person of [`person`] in metres, 3-D, z up, turned by 30 degrees about the vertical.
fn in_space(layout: &Layout) -> Vec<[f64; 3]> {
    let turned = |[x, y, _]: [f64; 3]| [0.00866 * (x - 100.0), 0.005 * (x - 100.0), 0.01 * (190.0 - y)];
    person(layout, 100.0).into_iter().map(turned).collect()
}

fn lists(points: &[[f64; 3]]) -> String {
    let all: Vec<String> = points.iter().map(|[x, y, z]| format!("[{x},{y},{z}]")).collect();
    format!("[{}]", all.join(","))
}

#[track_caller]
fn upright_in_space(json: &str) -> super::super::recording::Recording {
    let found =
        read(json.as_bytes(), "json", Choices::default()).unwrap_or_else(|error| panic!("{error}: {json}"));
    let points = found.by_name(0);
    let height = points["left shoulder"][2] - points["left ankle"][2];
    assert!((height - 1340.0).abs() < 5.0 && !found.planar, "{height} mm {:?}", found.remarks());
    let wide = points["left shoulder"][0] - points["right shoulder"][0];
    assert!((wide.abs() - 311.8).abs() < 1.0, "{wide} mm");
    found
}

#[test]
fn points_in_three_dimensions_are_of_human36m_or_coco_by_the_length_of_their_limbs() {
    for layout in [&layouts::HUMAN36M, layout(17)] {
        let points = in_space(layout);
        let scores = ["1.0"; 17].join(",");
        let inferencer = format!(
            r#"[[{{"keypoints":{0},"keypoint_scores":[{scores}]}}],[{{"keypoints":{0},"keypoint_scores":[{scores}]}}]]"#,
            lists(&points)
        );
        let found = upright_in_space(&inferencer);
        assert!(found.remarks().iter().any(|remark| remark.contains(layout.name)), "{:?}", found.remarks());
        // y down, about the hips, without scores.
        let camera: Vec<[f64; 3]> = points.iter().map(|[x, y, z]| [*x, 0.9 - z, *y]).collect();
        upright_in_space(&format!("[{},{}]", lists(&camera), lists(&camera)));
    }
}

#[test]
fn points_in_three_dimensions_of_an_unknown_order_are_refused() {
    let mut points = in_space(&layouts::HUMAN36M);
    points.swap(2, 11);
    points.swap(5, 15);
    let json =
        format!(r#"[{{"keypoints":{},"keypoint_scores":[{}]}}]"#, lists(&points), ["1.0"; 17].join(","));
    let error = read(json.as_bytes(), "json", Choices::default()).expect_err("no order").to_string();
    assert!(error.contains("three coordinates") && error.contains("NAME_x"), "{error}");
}

#[test]
fn visibilities_and_scores_are_not_coordinates() {
    let mut points = person(layout(17), 100.0);
    for third in [2.0, 1.1] {
        points.iter_mut().for_each(|point| point[2] = third);
        upright(&format!(r#"{{"people":[{{"keypoints":{}}}]}}"#, flat(&points)), 1);
    }
    let scores: Vec<String> = points.iter().map(|point| point[2].to_string()).collect();
    let json = format!(r#"[{{"keypoints":{},"keypoint_scores":[{}]}}]"#, lists(&points), scores.join(","));
    upright(&json, 1);
}

#[test]
fn world_landmarks_of_mediapipe_are_metres_in_space() {
    let landmarks: Vec<String> = in_space(layout(33))
        .iter()
        .map(|[x, y, z]| format!(r#"{{"x":{x},"y":{},"z":{y},"visibility":0.9}}"#, 0.9 - z))
        .collect();
    let landmarks = landmarks.join(",");
    let found = upright_in_space(&format!(r#"[{{"landmarks":[{landmarks}]}}]"#));
    assert!(found.remarks().iter().all(|remark| !remark.contains("picture")), "{:?}", found.remarks());
    upright_in_space(&format!(r#"[{{"pose_world_landmarks":[{landmarks}]}}]"#));
}

#[test]
fn numbers_as_text_are_numbers() {
    let points: Vec<String> =
        person(layout(17), 50.0).iter().map(|[x, y, c]| format!(r#"["{x}","{y}","{c}"]"#)).collect();
    upright(&format!(r#"[{{"keypoints":[{}]}}]"#, points.join(",")), 1);
}

#[test]
fn pictures_with_y_up_are_reversed_and_those_with_y_first_need_the_axis() {
    let of = |place: fn([f64; 3]) -> [f64; 3]| {
        let points: Vec<[f64; 3]> = person(layout(17), 100.0).into_iter().map(place).collect();
        format!(r#"[{{"keypoints":{}}},{{"keypoints":{}}}]"#, lists(&points), lists(&points))
    };
    let found = upright(&of(|[x, y, c]| [x, 480.0 - y, c]), 2);
    assert!(
        found.remarks().iter().any(|remark| remark.starts_with("y is taken as up")),
        "{:?}",
        found.remarks()
    );

    let swapped = of(|[x, y, c]| [y / 360.0, x / 640.0, c]);
    let lying = read(swapped.as_bytes(), "json", Choices::default()).expect("keypoints").remarks();
    assert!(lying.iter().any(|remark| remark.contains("y before x (--up -x)")), "{lying:?}");
    let up = |up| read(swapped.as_bytes(), "json", Choices { up: Some(up), ..Choices::default() });
    let points = up(Up::MinusX).expect("keypoints");
    let points = points.by_name(0);
    let (wide, high) = (
        points["left shoulder"][0] - points["right shoulder"][0],
        points["left shoulder"][2] - points["left ankle"][2],
    );
    assert!((high - 1340.0).abs() < 60.0 && (wide / high - 36.0 / 134.0).abs() < 0.001, "{wide} {high}");
    let error = up(Up::Z).expect_err("no third axis").to_string();
    assert!(error.contains("--up z") && error.contains("two dimensions"), "{error}");
}
