//! `farnear activity` with synthetic people: training, recognition in masks and video, evaluation, rejected input.

mod motion;
mod people;
mod shipped;

use std::{fs, path::Path, sync::LazyLock};

use assert_cmd::Command;
use image::{GrayImage, Luma};
use serde_json::Value;

use crate::common::{Folder, fails, farnear, figures, number, succeeds};

const SUBJECTS: usize = 4;

/// Masks of four people who walk, crouch and dig in two views, and a file of samples; made once for all tests.
struct People {
    folder: Folder,
    samples: String,
}

static PEOPLE: LazyLock<People> = LazyLock::new(|| {
    let folder = Folder::new();
    let out = folder.text("people");
    let count = SUBJECTS.to_string();
    let made = figures(
        farnear(&["silhouettes", "synthetic", "--subjects", &count, "--activities", "walk,crouch,dig"])
            .args(["--views", "2", "--rate-hz", "6", "--mm-per-px", "25", "--out", &out, "--json"]),
    );
    assert_eq!((number(&made, "performances"), number(&made, "views")), (12.0, 2.0));
    let samples = folder.text("people/samples.toml");
    People { folder, samples }
});

impl People {
    fn text(&self, name: &str) -> String {
        self.folder.text(name)
    }

    fn masks(&self, name: &str, view: u32) -> String {
        self.folder.text(&format!("people/{name}-1/view{view}"))
    }

    fn train(&self, model: &str, more: &[&str]) -> Command {
        let mut command = farnear(&["activity", "train", &self.samples, "--out", model]);
        command.args(more);
        command
    }

    /// Writes the samples that satisfy `keep` into a file of their own.
    fn only(&self, name: &str, keep: impl Fn(&str) -> bool) -> String {
        let all = fs::read_to_string(&self.samples).expect("samples");
        let kept: String = all.split_inclusive("\n\n").filter(|sample| keep(sample)).collect();
        self.folder.file(&format!("people/{name}"), kept)
    }
}

#[test]
fn unseen_people_are_recognised_and_the_results_are_whole() {
    let people = &*PEOPLE;
    let out = people.text("evaluation");
    let evaluate =
        ["activity", "evaluate", &people.samples, "--leave-one-subject-out", "--no-search", "--json"];
    let found = figures(farnear(&evaluate).args(["--out", &out]));
    assert!(number(&found, "accuracy") > 0.8, "{found}");
    assert_eq!((number(&found, "clips"), number(&found, "answers")), (12.0, 12.0));
    assert_eq!((&found["views"], &found["full_frames"]), (&"fused".into(), &true.into()));
    assert_eq!(found["confusion"]["classes"], serde_json::json!(["crouch", "dig", "walk"]));
    let counts: u64 = found["confusion"]["counts"]
        .as_array()
        .expect("rows")
        .iter()
        .flat_map(|row| row.as_array().expect("a row"))
        .filter_map(Value::as_u64)
        .sum();
    assert_eq!(counts, 12);
    let [low, high] = [0, 1].map(|i| found["confidence_interval"][i].as_f64().expect("a number"));
    assert!(low < number(&found, "accuracy") && number(&found, "accuracy") <= high && high <= 1.0);
    assert!(number(&found, "seconds_per_frame") > 0.0);
    assert!(image::open(people.folder.path("evaluation/confusion.png")).is_ok());
    let table = fs::read_to_string(people.folder.path("evaluation/confusion.md")).expect("a table");
    assert!(table.contains("| | crouch | dig | walk |"), "{table}");
    let record = fs::read_to_string(people.folder.path("evaluation/evaluation.toml")).expect("a record");
    assert_eq!(record.matches("[[fold]]").count(), SUBJECTS, "{record}");

    let each =
        figures(farnear(&evaluate).args(["--views", "each", "--classifier", "knn", "--mode", "ordered"]));
    assert_eq!((number(&each, "answers"), &each["mode"]), (24.0, &"ordered".into()));
    let thesis = figures(farnear(&evaluate).args(["--epl", "thesis"]));
    assert_eq!(thesis["mode"], "thesis");
}

#[test]
fn other_samples_can_be_learned_from_but_never_the_same_people() {
    let people = &*PEOPLE;
    let one = people.only("p0.toml", |sample| sample.contains("\"p00\""));
    let others = people.only("others.toml", |sample| !sample.contains("\"p00\""));
    let evaluate = |test: &str, more: &[&str]| {
        let mut command = farnear(&["activity", "evaluate", test, "--no-search", "--json"]);
        command.args(more);
        command
    };
    let found = figures(&mut evaluate(&one, &["--train", &others]));
    assert_eq!((number(&found, "answers"), number(&found, "subjects")), (3.0, 1.0));
    // Training without p0 is the same as leaving p0 out.
    let left_out = figures(&mut evaluate(&one, &["--train", &people.samples, "--leave-one-subject-out"]));
    assert_eq!(found["confusion"], left_out["confusion"]);
    let renamed =
        fs::read_to_string(&one).expect("samples").replace("activity = \"dig\"", "activity = \"delve\"");
    let renamed = people.folder.file("people/renamed.toml", renamed);
    let apart = figures(&mut evaluate(&renamed, &["--train", &others]));
    assert_eq!((number(&apart, "answers"), &apart["not_known"]), (2.0, &serde_json::json!(["delve"])));
    assert!(found["not_known"].is_null(), "{found}");
    fails(&mut evaluate(&one, &["--train", &people.samples]), 1, &["`p00`", "--leave-one-subject-out"]);
    fails(&mut evaluate(&one, &["--leave-one-subject-out"]), 1, &["at least 3 subjects", "1"]);
    fails(&mut evaluate(&one, &[]), 2, &["--leave-one-subject-out", "--train"]);
    fails(&mut evaluate(&one, &["--open-set"]), 1, &["an open set needs at least 4 subjects", "1"]);
    let lame = people.only("lame.toml", |sample| !sample.contains("p02-dig-1/view2"));
    fails(
        &mut evaluate(&lame, &["--leave-one-subject-out", "--views", "fused"]),
        1,
        &["lame.toml", "--views each"],
    );
    let each = figures(&mut evaluate(&lame, &["--leave-one-subject-out"]));
    assert_eq!((&each["views"], number(&each, "answers")), (&"each".into(), 23.0));
}

#[test]
fn models_answer_live_and_in_windows_and_refuse_what_they_do_not_know() {
    let people = &*PEOPLE;
    let model = people.text("model.fnm");
    let trained = figures(&mut people.train(&model, &["--any-view", "--no-search", "--json"]));
    assert_eq!((number(&trained, "clips"), number(&trained, "views")), (24.0, 1.0));
    let masks = people.masks("p01-dig", 1);
    let recognise = ["activity", "recognise", &masks, "--model", &model];
    let (lines, _) = succeeds(&mut farnear(&recognise));
    let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let (whole, running) = lines.split_last().expect("lines");
    assert_eq!(whole["frames"], running.len());
    assert_eq!(whole["activity"], "dig");
    assert_eq!(running.last().expect("a frame")["activity"], "dig");
    for line in running {
        assert!((0.0..=1.0).contains(&number(line, "confidence")) && line["name"].is_string(), "{line}");
    }
    let one = figures(farnear(&recognise).args(["--json", "--window", "20"]));
    let windows = one["windows"].as_array().expect("windows");
    assert!(
        windows.len() > 1 && windows[0]["from"] == 1 && windows.last().expect("one")["to"] == whole["frames"]
    );

    // A pulsing horizontal bar is not a person at any of these thresholds.
    let bar = people.text("bar");
    fs::create_dir(&bar).expect("a folder");
    for frame in 0..20_u32 {
        let level = |x: u32, y: u32| {
            Luma([if (40..44 + frame).contains(&y) && (10..140).contains(&x) { 255_u8 } else { 0 }])
        };
        GrayImage::from_fn(150, 90, level)
            .save(people.folder.path(&format!("bar/{frame}.png")))
            .expect("a picture");
    }
    let bar = figures(&mut farnear(&["activity", "recognise", &bar, "--model", &model, "--json"]));
    assert!(bar["activity"].is_null() && number(&bar, "outlier_score") > 1.0, "{bar}");

    // The same person walks in a video, dark in front of a light wall. (At a dozen pixels across the digger's spade is
    // cleaned away.)
    fs::create_dir(people.folder.path("video")).expect("a folder");
    let count = fs::read_dir(people.masks("p01-walk", 1)).expect("a folder").count();
    for frame in 0..count + 12 {
        let name = format!("frame_{:06}.png", frame.saturating_sub(12) + 1);
        let mask =
            image::open(Path::new(&people.masks("p01-walk", 1)).join(name)).expect("a mask").into_luma8();
        let picture = GrayImage::from_fn(mask.width(), mask.height(), |x, y| {
            let noise = ((frame as u32 * 7919 + y * 104_729 + x * 1_299_709) % 7) as u8;
            let person = frame >= 12 && mask[(x, y)].0[0] > 0;
            Luma([if person { 60 + noise } else { 180 + noise }])
        });
        picture.save(people.folder.path(&format!("video/f{frame:03}.png"))).expect("a picture");
    }
    let video = people.text("video");
    let seen = figures(&mut farnear(&["activity", "recognise", &video, "--model", &model, "--json"]));
    assert_eq!((&seen["activity"], number(&seen, "frames")), (&"walk".into(), (count + 12) as f64), "{seen}");
    assert!(
        number(&seen, "flagged_frames") >= 10.0,
        "the background is learned from frames without a person"
    );

    let fused = people.text("fused.fnm");
    succeeds(&mut people.train(&fused, &["--no-search"]));
    let second = people.masks("p01-dig", 2);
    fails(&mut farnear(&["activity", "recognise", &masks, "--model", &fused]), 1, &["fused.fnm", "2 views"]);
    let both =
        figures(&mut farnear(&["activity", "recognise", &masks, &second, "--model", &fused, "--json"]));
    assert_eq!(both["activity"], "dig");
}

#[test]
fn settings_are_chosen_over_the_subjects_where_they_are_not_given() {
    let people = &*PEOPLE;
    let model = people.text("thesis.fnm");
    let trained = figures(&mut people.train(&model, &["--epl", "thesis", "--json"]));
    assert!(number(&trained, "condition_number") > 1.0, "{trained}");
    let gamma = number(&trained, "gamma");
    assert!([0.03, 0.1, 0.3, 1.0].iter().any(|g| (g - gamma).abs() < 1e-6), "{trained}");
    assert!((0.3..=1.0).contains(&number(&trained, "inner_accuracy")), "{trained}");
    assert!(trained["layout"].as_str().is_some_and(|text| text.starts_with("isomap:3,k=")), "{trained}");
}

#[test]
fn damaged_models_and_samples_are_named_and_nothing_is_written() {
    let people = &*PEOPLE;
    let model = people.text("whole.fnm");
    let shapes = people.folder.path("shapes");
    fs::create_dir(&shapes).expect("a folder");
    for frame in 0..6 {
        GrayImage::from_pixel(100, 100, Luma([255]))
            .save(shapes.join(format!("{frame}.png")))
            .expect("a picture");
    }
    let empty = people.folder.path("empty");
    fs::create_dir(&empty).expect("a folder");
    GrayImage::new(50, 40).save(empty.join("0.png")).expect("a picture");
    fs::create_dir(people.folder.path("mixed")).expect("a folder");
    GrayImage::new(50, 40).save(people.folder.path("mixed/0.png")).expect("a picture");
    GrayImage::new(51, 40).save(people.folder.path("mixed/1.png")).expect("a picture");
    // An earlier model is replaced, other files are not.
    people.folder.file("whole.fnm", "farnearA, damaged");
    let notes = people.folder.file("notes.txt", "mine");
    for (file, why) in [(&people.samples, "replace the input"), (&notes, "not a model")] {
        let before = fs::read(file).expect("a file");
        fails(&mut people.train(file, &["--no-search"]), 2, &[file.as_str(), why, "name another file"]);
        assert_eq!(fs::read(file).expect("a file"), before);
    }
    succeeds(&mut people.train(&model, &["--any-view", "--no-search"]));
    let bytes = fs::read(&model).expect("a model");
    let changed = |name: &str, at: usize| {
        let mut bytes = bytes.clone();
        bytes[at] ^= 8;
        people.folder.file(name, bytes)
    };
    let [format, descriptor, body] =
        [("format.fnm", 8), ("descriptor.fnm", 12), ("body.fnm", bytes.len() / 2)]
            .map(|(name, at)| changed(name, at));
    let cut = people.folder.file("cut.fnm", &bytes[..bytes.len() / 2]);
    let masks = people.masks("p01-dig", 1);
    let shapes = shapes.display().to_string();
    for (view, model, phrases) in [
        (&masks, &format, vec!["format.fnm", "format version 15", "train it again"]),
        (&masks, &descriptor, vec!["descriptor.fnm", "descriptor version 9", "train it again"]),
        (&masks, &body, vec!["body.fnm", "damaged", "checksum"]),
        (&masks, &cut, vec!["cut.fnm", "cut short"]),
        (&masks, &people.samples, vec!["samples.toml", "not a farnear activity model"]),
        (&masks, &people.text("none.fnm"), vec!["none.fnm"]),
        (&shapes, &model, vec!["cut-out silhouettes", "full frames"]),
        (&people.text("nowhere"), &model, vec!["nowhere"]),
    ] {
        fails(&mut farnear(&["activity", "recognise", view, "--model", model]), 1, &phrases);
    }
    let out = people.text("new.fnm");
    let sample = |masks: &str, activity: &str| {
        format!("[[sample]]\nmasks = \"{masks}\"\nsubject = \"a\"\nactivity = \"{activity}\"\n")
    };
    for (name, text, phrases) in [
        ("no.toml", String::new(), vec!["no.toml", "[[sample]]"]),
        ("one.toml", sample("people/p00-dig-1/view1", "dig"), vec!["one.toml", "two activities"]),
        ("absent.toml", sample("p99", "dig"), vec!["p99", "no such"]),
        ("blank.toml", sample("empty", "dig"), vec!["empty", "all 1 masks are empty"]),
        ("mixed.toml", sample("mixed", "dig"), vec!["51x40", "50x40"]),
        (
            "kinds.toml",
            sample("people/p00-dig-1/view1", "dig") + &sample("shapes", "lie"),
            vec!["full frames", "100x100"],
        ),
        (
            "typo.toml",
            sample("people/p00-dig-1/view1", "dig").replace("subject", "person"),
            vec!["typo.toml", "person"],
        ),
        (
            "twice.toml",
            ["people/p00-dig-1/view1", "people/p00-dig-1/view2"]
                .map(|folder| sample(folder, "dig") + "clip = \"x\"\n")
                .concat(),
            vec!["twice.toml", "clip `x`", "view 1 twice"],
        ),
        (
            "again.toml",
            ["people/p00-dig-1/view1", "people/../people/p00-dig-1/view1"]
                .map(|folder| sample(folder, "dig"))
                .concat(),
            vec!["again.toml", "view1 are listed twice"],
        ),
    ] {
        let file = people.folder.file(name, text);
        fails(&mut farnear(&["activity", "train", &file, "--out", &out]), 1, &phrases);
    }
    assert!(!people.folder.path("new.fnm").exists());
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs the real data next to the repository")]
fn skeletons_of_a_public_set_become_people_to_train_on() {
    let file = farnear_test_data::path("skeletons/Florence_3D_Action_Skeletons.mat");
    let file = file.to_str().expect("a plain path");
    let folder = Folder::new();
    let out = folder.text("people");
    let wrong = folder.file("wrong.mat", "MATLAB 5.0 MAT-file, or so it says");
    let draw = |file: &str, set: &str| {
        let mut command = farnear(&["silhouettes", "skeletons", file, "--set", set, "--out", &out, "--json"]);
        command.args(["--views", "1", "--mm-per-px", "40"]);
        command
    };
    fails(&mut draw(&wrong, "florence"), 1, &["wrong.mat"]);
    fails(&mut draw(file, "utkinect"), 1, &["Florence", "[3, 15, 27]", "[3, 20, frames]"]);
    let made = figures(&mut draw(file, "florence"));
    assert_eq!(
        (number(&made, "performances"), number(&made, "subjects"), number(&made, "activities")),
        (215.0, 10.0, 9.0)
    );
    let samples = folder.text("people/samples.toml");
    let evaluate = ["activity", "evaluate", &samples, "--leave-one-subject-out", "--no-search", "--json"];
    let found = figures(farnear(&evaluate).args(["--mode", "ordered"]));
    assert!(number(&found, "accuracy") > 0.6 && number(&found, "clips") == 215.0, "{found}");
}
