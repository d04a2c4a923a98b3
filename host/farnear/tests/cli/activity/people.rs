//! Several people in one picture, recognised separately.

use std::{fs, path::Path};

use image::{GrayImage, Luma};
use serde_json::Value;

use super::PEOPLE;
use crate::common::{Folder, fails, farnear, figures, succeeds};

fn masks(name: &str) -> Vec<GrayImage> {
    let folder = PEOPLE.masks(name, 1);
    let mut files: Vec<_> =
        fs::read_dir(&folder).expect("masks").map(|entry| entry.expect("an entry").path()).collect();
    files.sort();
    files.iter().map(|file| image::open(file).expect("a mask").to_luma8()).collect()
}

/// Adds a mask to a picture, its left edge at a column, its feet on the ground.
fn paste(picture: &mut GrayImage, mask: &GrayImage, left: u32) {
    let top = picture.height() - 10 - mask.height();
    for (x, y, pixel) in mask.enumerate_pixels().filter(|(.., pixel)| pixel.0[0] > 127) {
        let (x, y) = (left + x, top + y);
        if x < picture.width() {
            picture.put_pixel(x, y, *pixel);
        }
    }
}

fn written(folder: &Folder, name: &str, frames: &[GrayImage]) -> String {
    let path = folder.text(name);
    fs::create_dir(&path).expect("a folder");
    for (number, frame) in frames.iter().enumerate() {
        frame.save(Path::new(&path).join(format!("{number:03}.png"))).expect("saved");
    }
    path
}

#[test]
fn two_people_side_by_side_get_an_answer_each() {
    let folder = Folder::new();
    let (dig, crouch) = (masks("p01-dig"), masks("p02-crouch"));
    let count = dig.len().min(crouch.len());
    let frame = |n: usize, shown: [bool; 2]| {
        let mut picture = GrayImage::new(400, 200);
        for ((mask, left), _) in
            [(&dig[n], 40), (&crouch[n], 260)].into_iter().zip(shown).filter(|(_, shown)| *shown)
        {
            paste(&mut picture, mask, left);
        }
        picture
    };
    let frames: Vec<GrayImage> = (0..count).map(|n| frame(n, [true, true])).collect();
    let path = written(&folder, "both", &frames);
    let annotated = folder.text("annotated");
    let recognise = ["activity", "recognise", &path, "--as", "masks", "--model", "everyday", "--people"];
    let found =
        figures(farnear(&recognise).args(["--among", "dig,crouch", "--video-out", &annotated, "--json"]));
    let people = found["people"].as_array().expect("people");
    assert_eq!(people.len(), 2, "{found}");
    assert_eq!(found["frames"], count);
    for (index, person) in people.iter().enumerate() {
        assert_eq!(
            (&person["silhouettes"], &person["crossing_frames"]),
            (&count.into(), &0.into()),
            "{person}"
        );
        // Each person alone in the picture.
        let frames: Vec<GrayImage> = (0..count).map(|n| frame(n, [index == 0, index == 1])).collect();
        let path = written(&folder, &format!("alone{index}"), &frames);
        let recognise = ["activity", "recognise", &path, "--as", "masks", "--model", "everyday", "--json"];
        let alone = figures(farnear(&recognise).args(["--among", "dig,crouch"]));
        // One schema: a single person and one of several have the same keys and answers.
        let only = alone["people"][0].as_object().expect("a person");
        let keys = |person: &serde_json::Map<String, Value>| person.keys().cloned().collect::<Vec<String>>();
        let without = |mut keys: Vec<String>| {
            keys.retain(|key| key != "reason");
            keys
        };
        assert_eq!(without(keys(only)), without(keys(person.as_object().expect("a person"))));
        for key in ["frames", "empty_frames", "flagged_frames", "window", "seconds_per_frame", "people"] {
            assert!(!found[key].is_null() && !alone[key].is_null(), "{key}");
        }
        assert_eq!((&only["silhouettes"], &only["windows"]), (&person["silhouettes"], &person["windows"]));
        for key in ["probabilities", "activity", "segments"] {
            assert_eq!(person[key], alone[key], "{key}: {person} {alone}");
        }
    }
    assert_eq!(fs::read_dir(&annotated).expect("a folder").count(), count);

    // Both people are present from the third frame on, each in a separate box.
    let (lines, _) = succeeds(&mut farnear(&recognise));
    let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let boxes = |line: &Value| -> Vec<u64> {
        let people = line["people"].as_array().expect("people");
        people.iter().filter_map(|person| person["top_left_bottom_right"][1].as_u64()).collect()
    };
    assert_eq!(boxes(&lines[0]), [0_u64; 0]);
    let third = boxes(&lines[2]);
    assert!(third.len() == 2 && third[0] < 200 && third[1] > 200, "{third:?}");
}

#[test]
fn crossings_are_reported_and_untrackable_videos_rejected() {
    let folder = Folder::new();
    let post = GrayImage::from_pixel(24, 90, Luma([255]));
    let frames: Vec<GrayImage> = (0..50)
        .map(|n| {
            let mut picture = GrayImage::new(320, 120);
            paste(&mut picture, &post, 20 + 5 * n);
            paste(&mut picture, &post, 270 - 5 * n);
            picture
        })
        .collect();
    let path = written(&folder, "cross", &frames);
    let recognise = ["activity", "recognise", &path, "--as", "masks", "--model", "everyday", "--people"];
    let found = figures(farnear(&recognise).arg("--json"));
    let people = found["people"].as_array().expect("people");
    assert_eq!(people.len(), 2, "{found}");
    for person in people {
        let crossing = person["crossing_frames"].as_u64().expect("a number");
        assert!((5..=15).contains(&crossing), "{person}");
        assert_eq!(person["perhaps_swapped_with"], serde_json::json!([]), "their pace tells them apart");
        assert_eq!(person["silhouettes"].as_u64().map(|seen| seen + crossing), Some(50), "{person}");
    }
    let two = ["activity", "recognise", &path, &path, "--as", "masks", "--model", "everyday", "--people"];
    fails(&mut farnear(&two), 2, &["number of views 2", "one view"]);
    let [out, inside] = ["answers", "answers/pictures"].map(|name| folder.text(name));
    for (out, pictures) in [(&out, &out), (&out, &inside), (&inside, &out)] {
        let mut command = farnear(&recognise);
        command.args(["--out", out, "--video-out", pictures]);
        fails(&mut command, 2, &["video_out", pictures.as_str(), "expected another place"]);
    }
    assert!(!folder.path("answers").exists());
    let small = written(&folder, "small", &[GrayImage::from_pixel(100, 100, Luma([255]))]);
    let cut_out = ["activity", "recognise", &small, "--as", "masks", "--model", "everyday", "--people"];
    fails(&mut farnear(&cut_out), 1, &["cut out at 100x100", "full frames"]);
}
