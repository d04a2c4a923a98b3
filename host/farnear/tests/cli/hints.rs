//! Messages that name what to do instead.

use std::fs;

use crate::common::{Folder, fails, farnear};

#[test]
fn an_unknown_name_of_a_model_is_answered_with_the_names_that_exist() {
    let folder = Folder::new();
    fs::create_dir(folder.path("masks")).unwrap();
    let masks = folder.text("masks");
    for (model, is_name) in [("walk", true), ("walk.fnm", false), ("absent/walk", false)] {
        let recognise = ["activity", "recognise", &masks, "--model", model];
        let stderr = fails(&mut farnear(&recognise), 1, &["cannot read the model", model]);
        let names = "everyday or everyday-order-free (`farnear activity models`";
        assert_eq!(stderr.contains(names), is_name, "{stderr}");
    }
}

#[test]
fn recordings_and_folders_of_views_or_videos_are_answered_with_what_is_read_instead() {
    let folder = Folder::new();
    for name in ["views/view1", "views/view2", "videos", "texts"] {
        fs::create_dir_all(folder.path(name)).unwrap();
    }
    for name in ["videos/b.mp4", "videos/a.AVI", "videos/a.txt", "texts/a.txt"] {
        folder.file(name, "");
    }
    let recordings =
        ["walk.bvh", "walk.C3D", "walk.trc", "walk.json"].map(|name| folder.file(name, "nothing"));
    let recordings = recordings.map(|file| (file, "`farnear silhouettes markers` makes masks".to_owned()));
    let folders = [("views", "views/view1"), ("videos", "videos/a.AVI")];
    let folders = folders.map(|(name, inner)| (folder.text(name), format!("such as {}", folder.text(inner))));
    let out = folder.text("out");
    for (input, hint) in recordings.iter().chain(&folders) {
        let phrases = [input.as_str(), hint.as_str()];
        fails(&mut farnear(&["activity", "recognise", input, "--model", "everyday"]), 1, &phrases);
        fails(&mut farnear(&["silhouettes", "video", input, "--out", &out]), 1, &phrases);
    }
    let texts = folder.text("texts");
    let stderr = fails(&mut farnear(&["silhouettes", "video", &texts, "--out", &out]), 1, &["no picture"]);
    assert!(!stderr.contains("such as"), "{stderr}");
}
