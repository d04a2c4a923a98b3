//! Models that come with the program, and their evaluation.

use std::{fs, path::Path};

use assert_cmd::Command;
use image::GrayImage;

use super::PEOPLE;
use crate::common::{Folder, fails, farnear, figures, number, succeeds};

fn recognise(masks: &[&str]) -> Command {
    let mut command = farnear(&["activity", "recognise", "--as", "masks", "--model", "everyday"]);
    command.args(masks);
    command
}

#[test]
fn models_that_come_with_the_program_need_nothing_else() {
    let people = &*PEOPLE;
    let listed = figures(&mut farnear(&["activity", "models", "--json"]));
    let names: Vec<&str> = listed["model"]
        .as_array()
        .expect("models")
        .iter()
        .filter_map(|model| model["name"].as_str())
        .collect();
    assert_eq!(names, ["everyday", "everyday-order-free"]);
    let (sheet, _) = succeeds(&mut farnear(&["activity", "models", "--sheet"]));
    assert!(sheet.contains("synthetic") && sheet.contains("UTKinect"), "{sheet}");
    for name in names {
        let masks = people.masks("p00-walk", 1);
        let recognise = ["activity", "recognise", &masks, "--as", "masks", "--model", name, "--json"];
        let found = figures(&mut farnear(&recognise));
        assert_eq!(
            found["probabilities"].as_array().map(Vec::len),
            listed["model"][0]["activities"].as_array().map(Vec::len)
        );
        // A person walks. Restricted to walking and an unlike activity, the answer is walking even for a high outlier
        // score.
        let among = figures(farnear(&recognise).args(["--among", "walk,jumping jack"]));
        assert_eq!(among["probabilities"].as_array().map(Vec::len), Some(2), "{among}");
        assert_eq!(among["probabilities"][1]["activity"], "walk", "{among}");
        assert!(among["probabilities"][1]["probability"].as_f64() > Some(0.9), "{among}");
    }
    let masks = people.masks("p00-walk", 1);
    let both: [&str; 2] = [&masks, &people.masks("p00-walk", 2)];
    figures(recognise(&both).arg("--json"));
    let unknown = ["activity sing: the model knows", "jumping jack"];
    fails(recognise(&both).args(["--among", "walk,sing"]), 2, &unknown);
    fails(&mut farnear(&["activity", "recognise", &masks, "--model", "everyyday"]), 1, &["everyyday"]);
}

#[test]
fn a_finished_model_is_judged_and_its_mistakes_are_listed() {
    let people = &*PEOPLE;
    let out = people.text("judged");
    let evaluate = ["activity", "evaluate", &people.samples, "--model", "everyday", "--json"];
    let found = figures(farnear(&evaluate).args(["--out", &out]));
    // Two views of twelve clips, each separately.
    assert_eq!((number(&found, "answers"), number(&found, "strangers")), (24.0, 0.0));
    assert!(found["accuracy_among"].as_f64() >= found["accuracy"].as_f64(), "{found}");
    assert_eq!(found["confusion"]["classes"], serde_json::json!(["crouch", "dig", "walk"]));
    let wrong = fs::read_to_string(Path::new(&out).join("wrong.csv")).expect("written");
    let mistakes = 24.0 * (1.0 - number(&found, "accuracy_among"));
    assert_eq!(wrong.lines().count() - 1, mistakes.round() as usize, "{wrong}");
    let fused = figures(farnear(&evaluate).args(["--views", "fused", "--same", "walk=sneak"]));
    assert_eq!(number(&fused, "answers"), 12.0);
    assert_eq!(fused["confusion"]["classes"], serde_json::json!(["crouch", "dig", "sneak"]));
    let refused = |arguments: [&str; 2], words: &[&str]| {
        let evaluate = ["activity", "evaluate", &people.samples, "--model", "everyday"];
        fails(farnear(&evaluate).args(arguments), 2, words);
    };
    refused(["--same", "wlak=walk"], &["wlak=walk", "crouch, dig, walk"]);
    refused(["--same", "walk=wlak"], &["walk=wlak", "jumping jack"]);
    refused(["--leave-one-set-out", &people.samples], &["samples.toml", "each set once"]);

    // Activities that the model does not know are unknown, not wrong; without any known activity there is no accuracy.
    let all = fs::read_to_string(&people.samples).expect("samples");
    let renamed = people.folder.file("people/renamed.toml", all.replace("\"dig\"", "\"yodel\""));
    let strange = figures(&mut farnear(&["activity", "evaluate", &renamed, "--model", "everyday", "--json"]));
    assert_eq!((number(&strange, "answers"), number(&strange, "strangers")), (16.0, 8.0));
    assert_eq!(strange["not_known"], serde_json::json!(["yodel"]));
    assert!((0.0..=1.0).contains(&number(&strange, "outlier_auroc")), "{strange}");
    let nothing = people.only("yodel.toml", |sample| sample.contains("dig"));
    let text = fs::read_to_string(&nothing).expect("samples").replace("\"dig\"", "\"yodel\"");
    let nothing = people.folder.file("people/yodel.toml", text);
    let refused = ["none of its activities (yodel)", "jumping jack"];
    fails(&mut farnear(&["activity", "evaluate", &nothing, "--model", "everyday"]), 1, &refused);
    // The same between samples: an accuracy of 0 would only mean that names differ.
    let others = people.only("others.toml", |sample| sample.contains("p00") && !sample.contains("dig"));
    let text = fs::read_to_string(&nothing).expect("samples").replace("subject = \"p", "subject = \"q");
    let nothing = people.folder.file("people/yodel.toml", text);
    let evaluate = ["activity", "evaluate", &nothing, "--train", &others, "--no-search"];
    fails(&mut farnear(&evaluate), 1, &["none of its activities (yodel)", "crouch, walk"]);
}

#[test]
fn an_unknown_answer_has_a_reason() {
    let folder = Folder::new();
    let masks = folder.text("nobody");
    fs::create_dir(&masks).expect("a folder");
    for frame in 0..3 {
        GrayImage::new(60, 60).save(Path::new(&masks).join(format!("{frame}.png"))).expect("saved");
    }
    let found = figures(recognise(&[&masks]).arg("--json"));
    assert!(found["activity"].is_null());
    assert_eq!(found["reason"], "no person in any of the 3 frames");
}

/// Silhouettes of two people who walk through the picture, eight times, by a background model from video.
#[test]
#[cfg_attr(not(shared_data), ignore = "needs the real data next to the repository")]
fn walking_in_front_of_a_real_camera_is_recognised() {
    let folder = Folder::new();
    let mut walking = 0;
    let mut passages = 0;
    for person in ["person01", "person02"] {
        let mut files: Vec<(u32, std::path::PathBuf)> =
            fs::read_dir(farnear_test_data::path("kth_walk").join(person))
                .expect("the set")
                .map(|entry| {
                    let path = entry.expect("an entry").path();
                    let stem = path.file_stem().and_then(|stem| stem.to_str()).expect("a name");
                    (stem.trim_start_matches("silho_").parse().expect("a number"), path)
                })
                .collect();
        files.sort();
        for run in files.chunk_by(|a, b| b.0 == a.0 + 1).filter(|run| run.len() >= 20) {
            let masks = folder.text(&format!("{person}-{}", run[0].0));
            fs::create_dir(&masks).expect("a folder");
            for (number, path) in run {
                fs::copy(path, Path::new(&masks).join(format!("{number:06}.jpg"))).expect("copied");
            }
            // JPEG leaves grey values at the edges; the files still count as masks.
            let found =
                figures(&mut farnear(&["activity", "recognise", &masks, "--model", "everyday", "--json"]));
            let best = found["probabilities"].as_array().expect("probabilities").iter().max_by(|a, b| {
                a["probability"].as_f64().partial_cmp(&b["probability"].as_f64()).expect("numbers")
            });
            walking += u32::from(best.is_some_and(|share| share["activity"] == "walk"));
            passages += 1;
        }
    }
    assert_eq!(passages, 8);
    assert!(walking >= 7, "{walking} of 8");
}

#[test]
fn a_shipped_network_and_unlabelled_clips_serve_where_samples_come_from_elsewhere() {
    let people = &*PEOPLE;
    let one = people.only("elsewhere.toml", |sample| sample.contains("\"p00\""));
    let others = people.only("labelled.toml", |sample| !sample.contains("\"p00\""));
    let evaluate = |more: &[&str]| {
        let mut command =
            farnear(&["activity", "evaluate", &one, "--train", &others, "--views", "each", "--json"]);
        command.args(more);
        command
    };
    let found = figures(&mut evaluate(&["--features", "everyday", "--adapt"]));
    assert_eq!((&found["mode"], number(&found, "answers")), (&"everyday".into(), 6.0));
    assert!(number(&found, "accuracy") > 0.6, "{found}");
    let aligned = figures(&mut evaluate(&["--no-search", "--align", "coral"]));
    let plain = figures(&mut evaluate(&["--no-search"]));
    assert!(number(&aligned, "accuracy") > 0.4 && number(&plain, "accuracy") > 0.4, "{aligned} {plain}");
    fails(&mut evaluate(&["--align", "sideways"]), 2, &["sideways", "coral"]);
    fails(&mut evaluate(&["--features", "nobody"]), 2, &["nobody", "everyday-order-free"]);
    fails(
        &mut evaluate(&["--features", "everyday", "--mode", "ordered"]),
        2,
        &["features everyday", "--mode"],
    );

    let model = people.text("features.fnm");
    let train =
        ["activity", "train", &others, "--out", &model, "--features", "everyday", "--any-view", "--json"];
    let trained = figures(&mut farnear(&train));
    assert_eq!((&trained["pattern"], &trained["mode"]), (&"network".into(), &"everyday".into()));
    let masks = people.masks("p00-dig", 1);
    let annotated = people.text("annotated");
    let unlabelled: Vec<String> = ["p00-walk", "p00-crouch", "p00-dig"]
        .iter()
        .flat_map(|name| [1, 2].map(|view| people.masks(name, view)))
        .collect();
    let mut recognise = farnear(&["activity", "recognise", &masks, "--model", &model, "--json"]);
    recognise.args(["--video-out", &annotated, "--adapt-to"]).args(&unlabelled);
    let answer = figures(&mut recognise);
    let probabilities = answer["probabilities"].as_array().expect("probabilities");
    let dig = probabilities.iter().find(|share| share["activity"] == "dig").expect("an activity");
    assert!(number(dig, "probability") > 0.4, "{answer}");
    let segments = answer["segments"].as_array().expect("segments");
    assert_eq!(segments[0]["from"], 1);
    assert_eq!(segments.last().expect("one")["to"], answer["frames"]);
    let pictures = fs::read_dir(&annotated).expect("a folder").count();
    assert_eq!(pictures as f64, number(&answer, "frames"));
    let picture =
        image::open(people.folder.path("annotated/frame_000003.png")).expect("a picture").into_rgb8();
    // The strip with the answer is below the enlarged frame, with the bar of the most probable activity.
    assert!(picture.width() >= 320 && picture.height() > 240);
    assert!(picture.pixels().any(|pixel| pixel.0 == [255, 160, 0]), "the outline");
    let mut again = farnear(&["activity", "recognise", &masks, "--model", &model, "--video-out", &annotated]);
    fails(&mut again, 1, &["annotated", "exists already"]);
    // Shipped models contain no clips.
    let mut shipped = farnear(&["activity", "recognise", &masks, "--model", "everyday", "--adapt-to"]);
    fails(shipped.args(&unlabelled), 1, &["everyday", "contains no training clips", "features"]);
}
