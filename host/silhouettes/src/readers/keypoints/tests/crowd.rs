//! More people than are read, as of detectors with many false detections.

use super::*;

#[test]
fn the_number_of_people_in_the_remark_is_the_number_that_can_be_selected() {
    let of = |x: f64| format!(r#"{{"pose_keypoints_2d":{}}}"#, flat(&person(layout(25), x)));
    let people = (1..=40).map(|n| of(200.0 * f64::from(n))).collect::<Vec<_>>().join(",");
    let json = format!(r#"{{"frames":[{{"people":[{people}]}},{{"people":[{people}]}}]}}"#);
    let select = |number: usize| {
        let choices = Choices { person: Some(number), ..Choices::default() };
        read(json.as_bytes(), "json", choices)
    };
    let remarks = select(16).expect("the last").remarks().join("; ");
    assert!(remarks.contains("16 people") && remarks.contains("24 who are seen less"), "{remarks}");
    let error = select(17).expect_err("one too many").to_string();
    assert_eq!(error, "no person 17: 16 are in the file");
}

/// A detection somewhere else in every frame: each begins a track, and those before are soon forgotten.
#[test]
fn a_person_is_followed_among_false_detections() {
    let of = |x: f64| format!(r#"{{"pose_keypoints_2d":{}}}"#, flat(&person(layout(25), x)));
    let frames: Vec<String> = (0..100)
        .map(|n| {
            let other = of(1000.0 + 300.0 * f64::from(n * 7 % 100));
            // The person is hidden for 20 frames.
            let people = if (40..60).contains(&n) { other } else { format!("{other},{}", of(100.0)) };
            format!(r#"{{"people":[{people}]}}"#)
        })
        .collect();
    let found = upright(&format!(r#"{{"frames":[{}]}}"#, frames.join(",")), 100);
    let seen = (0..100).filter(|n| found.by_name(*n).contains_key("neck")).count();
    assert_eq!(seen, 80);
}

#[test]
fn a_collection_of_pictures_of_one_person_each_is_one_person_and_people_one_after_the_other_are_several() {
    let read_at = |places: &[f64]| {
        let of = |x: &f64| format!(r#"{{"pose_keypoints_2d":{}}}"#, flat(&person(layout(25), *x)));
        let frames: Vec<String> = places.iter().map(|x| format!(r#"{{"people":[{}]}}"#, of(x))).collect();
        let found = upright(&format!(r#"{{"frames":[{}]}}"#, frames.join(",")), places.len());
        let seen = (0..places.len()).filter(|n| found.by_name(*n).contains_key("neck")).count();
        (seen, found.remarks().join("; "))
    };
    let leaping: Vec<f64> = (0..12).map(|n| 1000.0 * f64::from(n * 7 % 12)).collect();
    let (seen, remarks) = read_at(&leaping);
    assert!(seen == 12 && remarks.contains("leaps between 12 places"), "{seen}: {remarks}");
    let after_each_other: Vec<f64> = (0..12).map(|n| if n < 8 { 100.0 } else { 5000.0 }).collect();
    let (seen, remarks) = read_at(&after_each_other);
    assert!(seen == 8 && remarks.contains("2 people"), "{seen}: {remarks}");
    let three: Vec<f64> = (0..90).map(|n| 1000.0 * f64::from(1 + n / 30)).collect();
    let (seen, remarks) = read_at(&three);
    assert!(seen == 30 && remarks.contains("3 people"), "{seen}: {remarks}");
}
