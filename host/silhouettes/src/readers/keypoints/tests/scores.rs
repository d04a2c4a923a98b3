//! Scores above 1, as logits and percent have them.

use super::*;

fn scored(count: usize, score: fn(usize) -> f64) -> String {
    let mut points = person(layout(count), 100.0);
    points.iter_mut().enumerate().for_each(|(number, point)| point[2] = score(number));
    flat(&points)
}

#[test]
fn scores_above_one_are_not_depths_in_formats_that_define_them_as_scores() {
    let logit = |number: usize| 3.0 + (number * 7 % 13) as f64;
    let percent = |number: usize| 60.0 + (number * 7 % 39) as f64;
    let scores: [fn(usize) -> f64; 3] = [logit, percent, |_| 12.3];
    for score in scores {
        let points = scored(17, score);
        for json in [
            format!(r#"[{{"image_id":0,"category_id":1,"keypoints":{points},"score":0.9}}]"#),
            format!(
                r#"{{"images":[{{"id":7,"file_name":"b1.png"}}],"annotations":[{{"image_id":7,"keypoints":{points}}}]}}"#
            ),
            format!(r#"{{"1":{{"0000":{{"keypoints":{points},"scores":0.9}}}}}}"#),
            format!(r#"{{"people":[{{"pose_keypoints_2d":{}}}]}}"#, scored(25, score)),
            format!(r#"{{"people":[{{"pose_keypoints":{}}}]}}"#, scored(18, score)),
        ] {
            upright(&json, 1);
        }
    }
}

#[test]
fn triples_of_other_formats_may_be_coordinates() {
    let points = flat(&in_space(&layouts::HUMAN36M));
    upright_in_space(&format!(r#"[{{"keypoints":{points}}},{{"keypoints":{points}}}]"#));
}

#[test]
fn scores_of_heat_maps_next_to_pixels_are_no_depths_in_any_format() {
    let points = scored(17, |number| 1.1 + 0.2 * (number * 7 % 13) as f64);
    upright(&points, 1);
    upright(&format!("[{points},{points}]"), 2);
    upright(&format!(r#"[{{"keypoints":{points}}}]"#), 1);
}

#[test]
fn triples_of_an_unknown_layout_are_neither_pairs_nor_quadruples() {
    // Pixels with scores, and places about the hips.
    let others: [fn(usize) -> f64; 2] =
        [|n| if n % 3 == 2 { 0.9 } else { 100.0 + 7.0 * n as f64 }, |n| (n * 37 % 90) as f64 / 50.0 - 0.9];
    for (count, other) in [36, 60, 66, 72].into_iter().flat_map(|count| others.map(|other| (count, other))) {
        let numbers: Vec<String> = (0..count).map(|n| other(n).to_string()).collect();
        let json = format!(r#"[{{"keypoints":[{}]}}]"#, numbers.join(","));
        let error = read(json.as_bytes(), "json", Choices::default()).expect_err("no layout").to_string();
        assert!(error.contains("it holds no person's points"), "{count}: {error}");
    }
    let pairs: Vec<String> = person(layout(33), 100.0).iter().map(|[x, y, _]| format!("{x},{y}")).collect();
    upright(&format!("[[{0}],[{0}]]", pairs.join(",")), 2);
}
