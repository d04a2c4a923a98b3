//! `farnear shadow score` on small masks counted by hand.

use std::{fs, path::Path};

use assert_cmd::Command;
use image::{GrayImage, Luma, Rgb, RgbImage};

use crate::common::{fails, farnear, figures};

fn picture(path: &Path, rows: &[&[u8]]) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let (width, height) = (rows[0].len() as u32, rows.len() as u32);
    GrayImage::from_fn(width, height, |x, y| Luma([rows[y as usize][x as usize]])).save(path).unwrap();
}

fn score(arguments: &[&Path]) -> Command {
    let mut command = farnear(&["shadow", "score", "--json"]);
    command.args(arguments);
    command
}

const TRUTH: &[&[u8]] = &[&[255, 255, 255, 255], &[50, 50, 50, 50], &[170, 85, 0, 0]];
const AFTER: &[&[u8]] = &[&[255, 255, 255, 0], &[0, 0, 0, 255], &[255, 255, 0, 255]];
const BEFORE: &[&[u8]] = &[&[255, 255, 255, 0], &[255, 255, 0, 255], &[255, 255, 0, 255]];

#[test]
fn one_frame_counted_by_hand() {
    let root = tempfile::tempdir().unwrap();
    let [truth, after, before] = ["truth.png", "after.png", "before.png"].map(|name| root.path().join(name));
    picture(&truth, TRUTH);
    picture(&after, AFTER);
    picture(&before, BEFORE);
    let found = figures(&mut score(&[&after, &truth]));
    // 3 of 4 shadow and 1 of 4 person pixels are not in the mask. It holds 3 person, 1 shadow and 1 counted background
    // pixel; the person has 4: 3 / 6.
    assert_eq!(found["removed_percent"], 75.0);
    assert_eq!(found["wrongly_removed_percent"], 25.0);
    assert_eq!(found["iou_percent"], 50.0);

    let found = figures(&mut score(&[&after, &truth, Path::new("--before"), &before]));
    // Of the 3 present shadow pixels 2 were removed; no present person pixel was.
    assert_eq!(found["removed_percent"], 66.667);
    assert_eq!(found["wrongly_removed_percent"], 0.0);
    assert_eq!(found["iou_percent"], 50.0);
}

#[test]
fn folders_are_matched_by_name_or_number_and_summed() {
    let root = tempfile::tempdir().unwrap();
    let (truth, masks) = (root.path().join("truth"), root.path().join("masks"));
    picture(&truth.join("gt000001.png"), &[&[255, 50]]);
    picture(&truth.join("gt000002.png"), &[&[255, 50]]);
    picture(&masks.join("in000001.png"), &[&[255, 0]]);
    picture(&masks.join("in000002.png"), &[&[0, 255]]);
    picture(&masks.join("in000003.png"), &[&[0, 255]]);
    let found = figures(&mut score(&[&masks, &truth]));
    assert_eq!((&found["frames"], &found["removed_percent"]), (&2.into(), &50.0.into()));
    assert_eq!(found["wrongly_removed_percent"], 50.0);
    // Intersection 1, union 1 + 2.
    assert_eq!(found["iou_percent"], 33.333);
}

#[test]
fn a_truth_without_shadow_takes_it_from_the_masks_before() {
    let root = tempfile::tempdir().unwrap();
    let [truth, after, before] = ["truth.png", "after.png", "before.png"].map(|name| root.path().join(name));
    picture(&truth, &[&[255, 255, 0, 0, 0]]);
    picture(&after, &[&[255, 255, 255, 0, 0]]);
    picture(&before, &[&[255, 255, 255, 255, 0]]);
    assert!(figures(&mut score(&[&after, &truth]))["removed_percent"].is_null());
    let found = figures(&mut score(&[&after, &truth, Path::new("--before"), &before]));
    assert_eq!((&found["removed_percent"], &found["shadow_pixels"]), (&50.0.into(), &2.into()));
}

#[test]
fn bad_input_is_named() {
    let root = tempfile::tempdir().unwrap();
    let [truth, after] = ["truth.png", "after.png"].map(|name| root.path().join(name));
    picture(&truth, &[&[255, 50]]);
    picture(&after, &[&[255, 0, 0]]);
    fails(&mut score(&[&after, &truth]), 1, &["3x1", "2x1"]);
    picture(&truth, &[&[255, 51]]);
    picture(&after, &[&[255, 0]]);
    fails(&mut score(&[&after, &truth]), 1, &["level 51", "column 1, row 0"]);
    RgbImage::from_pixel(2, 1, Rgb([255, 0, 0])).save(&truth).unwrap();
    fails(&mut score(&[&after, &truth]), 1, &["truth.png", "grey"]);
    fails(&mut score(&[&after, &root.path().join("none")]), 1, &["none", "no such"]);

    let (truths, masks) = (root.path().join("truths"), root.path().join("masks"));
    picture(&truths.join("gt1.png"), &[&[255]]);
    picture(&truths.join("gt2.png"), &[&[255]]);
    picture(&masks.join("in1.png"), &[&[255]]);
    fails(&mut score(&[&masks, &truths]), 1, &["no mask for", "gt2.png"]);
    picture(&masks.join("other2.png"), &[&[255]]);
    picture(&masks.join("in2.png"), &[&[255]]);
    fails(&mut score(&[&masks, &truths]), 1, &["other2.png", "in2.png"]);
}
