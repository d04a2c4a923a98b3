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
fn points_of_low_confidence_are_missing_in_percent_bytes_and_parts_of_1000() {
    // The left wrist is a guess of the estimator; one value is garbage.
    for full in [1.0, 100.0, 255.0, 1000.0] {
        let mut points = person(layout(17), 100.0);
        points.iter_mut().for_each(|point| point[2] = 0.9 * full);
        (points[9][2], points[4][2]) = (0.05 * full, 5000.0);
        let person =
            format!(r#"[{{"image_id":0,"category_id":1,"keypoints":{},"score":0.9}}]"#, flat(&points));
        let found = upright(&person, 1);
        assert!(!found.by_name(0).contains_key("left wrist"), "{full}");
        let remarks = found.remarks().join("; ");
        assert_eq!(remarks.contains(&format!("parts of {full} (")), full > 1.0, "{remarks}");
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
    let others = [person(layout(26), 100.0), about_the_hips(layout(26))];
    for (count, other) in
        [12, 20, 22, 24].into_iter().flat_map(|count| others.iter().map(move |o| (count, o)))
    {
        let json = format!(r#"[{{"keypoints":{}}}]"#, flat(&other[..count]));
        let error = read(json.as_bytes(), "json", Choices::default()).expect_err("no layout").to_string();
        let expected = format!("no person's points, the longest list in a frame has {} values", 3 * count);
        assert!(error.contains(&expected), "{count}: {error}");
    }
    let pairs: Vec<String> = person(layout(33), 100.0).iter().map(|[x, y, _]| format!("{x},{y}")).collect();
    upright(&format!("[[{0}],[{0}]]", pairs.join(",")), 2);
}

fn about_the_hips(layout: &Layout) -> Vec<[f64; 3]> {
    in_space(layout).into_iter().map(|[x, y, z]| [x, y, z - 0.9]).collect()
}

#[test]
fn pairs_about_the_hips_and_quadruples_are_no_triples() {
    let pairs: Vec<String> =
        person(layout(18), 0.0).iter().map(|[x, y, _]| format!("{x},{}", y - 100.0)).collect();
    upright(&format!(r#"[{{"keypoints":[{}]}}]"#, pairs.join(",")), 1);
    for count in [15, 18] {
        let points = about_the_hips(layout(count));
        let quadruples: Vec<String> = points.iter().map(|[x, y, z]| format!("{x},{y},{z},0.9")).collect();
        upright_in_space(&format!(r#"[{{"keypoints":[{}]}}]"#, quadruples.join(",")));
    }
}
