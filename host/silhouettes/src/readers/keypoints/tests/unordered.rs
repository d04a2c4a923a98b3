//! Points that state their name or number, in any order and incomplete.

use super::*;

const COCO: [&str; 17] = [
    "nose",
    "left_eye",
    "right_eye",
    "left_ear",
    "right_ear",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_ankle",
    "right_ankle",
];

/// Frames with these points of COCO, in this order.
fn frames(shown: &[Vec<usize>], label: impl Fn(usize) -> String) -> String {
    let points = person(layout(17), 100.0);
    let frame = |order: &Vec<usize>| {
        let point = |n: &usize| {
            let [x, y, c] = points[*n];
            format!(r#"{{{},"x":{x},"y":{y},"confidence":{c}}}"#, label(*n))
        };
        format!(r#"{{"keypoints":[{}]}}"#, order.iter().map(point).collect::<Vec<_>>().join(","))
    };
    format!("[{}]", shown.iter().map(frame).collect::<Vec<_>>().join(","))
}

/// Reversed, without a head, two points, and everything in order.
fn shown() -> [Vec<usize>; 4] {
    [(0..17).rev().collect(), (5..17).collect(), vec![9, 13], (0..17).collect()]
}

#[track_caller]
fn expect_placed(json: &str, about: &str) -> super::super::super::recording::Recording {
    let found = upright(json, 4);
    assert_eq!(found.frames[0], found.frames[3]);
    let (part, whole) = (found.by_name(1), found.by_name(3));
    assert!(!part.contains_key("nose") && part["left wrist"] == whole["left wrist"]);
    assert!(found.by_name(2).is_empty(), "two points are not a body");
    assert!(found.remarks().iter().any(|remark| remark.contains(about)), "{:?}", found.remarks());
    found
}

#[test]
fn points_are_placed_by_their_numbers() {
    let from_zero = expect_placed(
        &frames(&shown(), |n| format!(r#""id":{n}"#)),
        "from 0 up to 16, in the layout COCO (a guess)",
    );
    let from_one = frames(&shown(), |n| format!(r#""id":"{}""#, n + 1));
    assert_eq!(
        expect_placed(&from_one, "from 1 up to 17, in the layout COCO (a guess)").frames,
        from_zero.frames
    );
    // Both frames lack points, and the ankles are missing in both.
    let cut = frames(&[(0..15).collect(), (0..13).rev().collect()], |n| format!(r#""id":{n}"#));
    let found = read(cut.as_bytes(), "json", Choices::default()).expect("keypoints");
    assert_eq!(found.by_name(0)["left hip"], found.by_name(1)["left hip"]);
    assert!(found.remarks().iter().any(|remark| remark.contains("layout COCO")), "{:?}", found.remarks());
}

#[test]
fn points_from_one_without_ears_are_those_of_coco() {
    let order: Vec<usize> = (0..17).filter(|n| !(3..5).contains(n)).collect();
    let found = upright(&frames(&[order.clone(), order], |n| format!(r#""id":{}"#, n + 1)), 2);
    let remarks = found.remarks().join("; ");
    assert!(remarks.contains("from 1 up to 17, in the layout COCO (a guess)"), "{remarks}");
}

#[test]
fn numbers_up_to_no_layouts_last_one_are_refused() {
    let refused = |count: usize| {
        let point = |n: usize| format!(r#"{{"id":{n},"x":{},"y":{}}}"#, 10 * n, 7 * n);
        let points: Vec<String> = (0..count).map(point).collect();
        let json = format!(r#"[{{"keypoints":[{}]}}]"#, points.join(","));
        read(json.as_bytes(), "json", Choices::default()).expect_err("no layout").to_string()
    };
    // BODY_25 without feet, and a hundred other things.
    for count in [19, 100] {
        let error = refused(count);
        assert!(error.contains("too few of its named points (0, 1, 10"), "{error}");
    }
}

#[test]
fn numbers_that_run_through_the_file_leave_its_order() {
    let points = person(layout(17), 100.0);
    let frame = |frame: usize| {
        let point =
            |(n, [x, y, _]): (usize, &[f64; 3])| format!(r#"{{"id":{},"x":{x},"y":{y}}}"#, 17 * frame + n);
        let points: Vec<String> = points.iter().enumerate().map(point).collect();
        format!(r#"{{"keypoints":[{}]}}"#, points.join(","))
    };
    let found = upright(&format!("[{}]", (0..5).map(frame).collect::<Vec<_>>().join(",")), 5);
    let remarks = found.remarks().join("; ");
    assert!(remarks.contains("17 keypoints by their order in the layout COCO"), "{remarks}");
}

#[test]
fn points_are_placed_by_their_names() {
    for key in ["name", "part"] {
        let json = frames(&shown(), |n| format!(r#""id":7,"{key}":"{}""#, COCO[n]));
        expect_placed(&json, "17 of 17 named points are keypoints");
    }
    // Never more than a trunk, limbs and a nose.
    let few = [vec![15, 0, 16, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14]];
    upright(&frames(&few, |n| format!(r#""name":"{}""#, COCO[n])), 1);
}

#[test]
fn points_with_their_names_as_keys_are_read() {
    let points = person(layout(17), 100.0);
    let with = |point: fn(&[f64; 3]) -> String| -> String {
        let points = COCO.iter().zip(&points).map(|(name, place)| format!("{name:?}:{}", point(place)));
        format!(r#"{{"time":0.1,{}}}"#, points.collect::<Vec<_>>().join(","))
    };
    for frame in [
        with(|[x, y, c]| format!(r#"{{"x":{x},"y":{y},"confidence":{c}}}"#)),
        with(|[x, y, _]| format!("[{x},{y}]")),
        with(|[x, y, c]| format!("[{x},{y},{c}]")),
    ] {
        upright(&frame, 1);
        upright(&format!("[{frame},{frame}]"), 2);
        upright(&format!(r#"{{"frames":[{{"keypoints":{frame}}},{{"people":[{frame}]}}]}}"#), 2);
        upright(&format!(r#"{{"f1":{frame},"f2":{frame},"f4":{frame}}}"#), 4);
    }
}

#[test]
fn named_points_of_mediapipe_have_the_depth_of_a_picture() {
    let names = "nose left_eye_inner left_eye left_eye_outer right_eye_inner right_eye right_eye_outer left_ear right_ear \
                 mouth_left mouth_right left_shoulder right_shoulder left_elbow right_elbow left_wrist right_wrist \
                 left_pinky right_pinky left_index right_index left_thumb right_thumb left_hip right_hip left_knee \
                 right_knee left_ankle right_ankle left_heel right_heel left_foot_index right_foot_index";
    let points = |shown: &dyn Fn(&str) -> bool| -> Vec<String> {
        names
            .split_whitespace()
            .zip(person(layout(33), 100.0))
            .filter(|(name, _)| shown(name))
            .map(|(name, [x, y, _])| {
                let (x, y) = (x / 640.0, y / 360.0);
                format!(r#"{{"x":{x},"y":{y},"z":-{x},"score":0.9,"name":"{name}"}}"#)
            })
            .collect()
    };
    let all = points(&|_| true);
    let without_ears = points(&|name| !name.ends_with("ear"));
    assert_eq!((all.len(), without_ears.len()), (33, 31));
    for mut shown in [all, without_ears] {
        shown.reverse();
        let found = upright(&format!(r#"[{{"keypoints":[{}]}}]"#, shown.join(",")), 1);
        assert!(found.by_name(0).contains_key("left big toe"));
    }
}

#[test]
fn named_points_may_be_in_space() {
    let points = in_space(layout(17));
    // On the ground with z up, and about the hips with y down.
    let places: [fn([f64; 3]) -> [f64; 3]; 2] = [|point| point, |[x, y, z]| [x, 0.9 - z, y]];
    for place in places {
        let of = |n: &usize| {
            let ([x, y, z], name) = (place(points[*n]), COCO[*n]);
            format!(r#"{{"name":"{name}","x":{x},"y":{y},"z":{z}}}"#)
        };
        let order = [16, 0, 15, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14];
        let json = order.iter().map(of).collect::<Vec<_>>().join(",");
        upright_in_space(&format!(r#"[{{"keypoints":[{json}]}}]"#));
    }
}

#[test]
fn unknown_names_leave_the_order_of_the_file_or_are_refused() {
    let whole: Vec<usize> = (0..17).collect();
    let unknown = |n: usize| format!(r#""name":"p{n}""#);
    let found = upright(&frames(&[whole.clone(), whole.clone(), vec![9, 13]], unknown), 3);
    let remarks = found.remarks().join("; ");
    assert!(
        remarks.contains("by their order in the layout COCO") && remarks.contains("; 1 with"),
        "{remarks}"
    );
    upright(&frames(&[whole], |n| format!(r#""id":{}"#, 100 + n)), 1);
    let error = read(frames(&[vec![9, 13], vec![4]], unknown).as_bytes(), "json", Choices::default());
    let error = error.expect_err("no names").to_string();
    assert!(error.contains("p13") && error.contains("left_shoulder"), "{error}");
}

#[test]
fn the_place_of_a_persons_box_is_not_a_point() {
    let points = lists(&person(layout(17), 100.0));
    upright(&format!(r#"{{"people":[{{"id":3,"x":10,"y":20,"keypoints":{points}}}]}}"#), 1);
}

/// Numbers from 0, numbers from 1, and names.
const LABELS: [fn(usize) -> String; 3] =
    [|n| format!(r#""id":{n}"#), |n| format!(r#""id":{}"#, n + 1), |n| format!(r#""name":"{}""#, COCO[n])];

#[test]
fn a_label_twice_is_refused_with_its_frame() {
    let whole: Vec<usize> = (0..17).collect();
    let once_more: Vec<usize> = (0..17).chain([5]).collect();
    for (label, refused) in LABELS.into_iter().zip(["5", "6", "left_shoulder"]) {
        let expected = |frame: usize| format!("frame {frame} has two points `{refused}` of one person");
        // The fourth point has the label of the sixth.
        let wrong = frames(std::slice::from_ref(&whole), |n| label(if n == 3 { 5 } else { n }));
        let error = read(wrong.as_bytes(), "json", Choices::default()).expect_err("twice").to_string();
        assert!(error.contains(&expected(1)), "{error}");
        let more = frames(&[whole.clone(), once_more.clone()], label);
        let error = read(more.as_bytes(), "json", Choices::default()).expect_err("twice").to_string();
        assert!(error.contains(&expected(2)), "{error}");
    }
}

#[test]
fn ankles_that_no_frame_shows_are_reported_and_the_other_points_stay_in_place() {
    for label in LABELS {
        let json = frames(&[(0..15).collect(), (0..15).collect()], label);
        let found = read(json.as_bytes(), "json", Choices::default()).expect("keypoints");
        let points = found.by_name(0);
        let height = points["left shoulder"][2] - points["left knee"][2];
        assert!((height - 920.0).abs() < 1.0 && !points.contains_key("left ankle"), "{height}");
        let remarks = found.remarks().join("; ");
        assert!(remarks.contains("no frame shows left ankle, right ankle"), "{remarks}");
    }
    let whole = upright(&frames(&[(0..17).collect()], LABELS[2]), 1);
    assert!(whole.remarks().iter().all(|remark| !remark.contains("no frame shows")), "{:?}", whole.remarks());
}

#[test]
fn numbers_of_another_layout_are_distinguished_from_coco_without_ankles_by_equal_limbs() {
    for count in [15, 16] {
        let point = |(n, [x, y, _]): (usize, &[f64; 3])| format!(r#"{{"id":{n},"x":{x},"y":{y}}}"#);
        let points: Vec<String> = person(layout(count), 100.0).iter().enumerate().map(point).collect();
        let found = upright(&format!(r#"[{{"keypoints":[{}]}}]"#, points.join(",")), 1);
        let remarks = found.remarks().join("; ");
        assert!(remarks.contains(layout(count).name), "{remarks}");
    }
}

/// No layout is chosen because none of its limbs is seen.
#[test]
fn hidden_points_do_not_favour_a_layout_without_limbs() {
    let seen: Vec<usize> = [0].into_iter().chain(5..14).chain([15]).collect();
    let json = frames(&[seen.clone(), seen], LABELS[0]);
    // A person is not symmetric.
    let [x, y, _] = person(layout(17), 100.0)[7];
    let moved = json.replace(&format!(r#""x":{x},"y":{y}"#), &format!(r#""x":{},"y":{y}"#, x + 3.0));
    assert_ne!(moved, json);
    let found = read(moved.as_bytes(), "json", Choices::default()).expect("keypoints");
    let remarks = found.remarks().join("; ");
    assert!(remarks.contains(layout(17).name), "{remarks}");
}

#[test]
fn seven_points_of_a_person_are_enough() {
    let seven = vec![0, 5, 6, 11, 12, 13, 15];
    for label in [LABELS[0], LABELS[2]] {
        upright(&frames(std::slice::from_ref(&seven), label), 1);
        upright(&frames(&[seven.clone(), seven.clone()], label), 2);
    }
}

#[test]
fn poses_of_ml5_are_read_by_the_names_of_their_points() {
    let camel = |name: &str| -> String {
        let mut words = name.split('_');
        let first = words.next().unwrap_or_default().to_owned();
        words.fold(first, |all, word| all + &word[..1].to_uppercase() + &word[1..])
    };
    let point = |(name, [x, y, c]): (&&str, [f64; 3])| {
        format!(r#"{{"score":{c},"part":"{}","position":{{"x":{x},"y":{y}}}}}"#, camel(name))
    };
    let mut points: Vec<String> = COCO.iter().zip(person(layout(17), 100.0)).map(point).collect();
    points.reverse();
    let bone = format!("[[{},{}]]", points[0], points[2]);
    let pose = format!(
        r#"{{"pose":{{"score":0.9,"keypoints":[{}],"nose":{{"x":1,"y":2}}}},"skeleton":{bone}}}"#,
        points.join(",")
    );
    upright(&pose, 1);
    upright(&format!("[{pose},{pose}]"), 2);
    upright(&format!("[[{pose}],[]]"), 2);
}

/// The names of COCO's categories tell the order of the points and that they are triples, also of numbers of points that no layout has.
#[test]
fn the_categories_of_coco_name_its_points() {
    let read_with = |names: &[String], numbers: &str| {
        let names: Vec<String> = names.iter().map(|name| format!("{name:?}")).collect();
        let json = format!(
            r#"{{"images":[{{"id":1,"file_name":"a1.jpg"}}],"categories":[{{"id":1,"name":"person","keypoints":[{}]}}],
               "annotations":[{{"id":5,"image_id":1,"category_id":1,"keypoints":[{numbers}]}}]}}"#,
            names.join(",")
        );
        read(json.as_bytes(), "json", Choices::default())
    };
    let points = person(layout(17), 100.0);
    let of = |order: &[usize]| {
        let names: Vec<String> = order.iter().map(|n| COCO[*n].to_owned()).collect();
        let numbers: Vec<String> =
            order.iter().map(|n| format!("{},{},2", points[*n][0], points[*n][1])).collect();
        (names, numbers.join(","))
    };
    for order in [(0..17).rev().collect::<Vec<_>>(), (5..17).collect(), (3..17).rev().collect()] {
        let (names, numbers) = of(&order);
        let found = read_with(&names, &numbers).expect("people");
        let found = found.by_name(0);
        assert!((found["left shoulder"][2] - found["left ankle"][2] - 1340.0).abs() < 60.0, "{found:?}");
    }
    // A tiger.
    let (mut names, numbers) = of(&(0..17).collect::<Vec<_>>());
    for (at, name) in names.iter_mut().enumerate().skip(5) {
        *name = format!("paw_{at}");
    }
    let error = read_with(&names, &numbers).expect_err("an animal").to_string();
    assert!(error.contains("too few of its named points"), "{error}");
}
