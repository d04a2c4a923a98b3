//! Motion recordings for training and as samples.

use crate::common::{Folder, fails, farnear, figures, number, succeeds};

/// The 20 joints of a person as lines of text, metres, y up. Over the frames the arms rise, or the trunk bends.
fn kinect(size: f64, raise: f64, stoop: f64) -> String {
    let mut text = String::new();
    for frame in 0..30 {
        let t = f64::from(frame) / 29.0;
        let lean = (70.0 * stoop * t).to_radians();
        let trunk = |up: f64, across: f64| [across, 0.95 + up * lean.cos(), 3.0 - up * lean.sin()];
        let arm = |side: f64, along: f64| {
            let angle = (170.0 * raise * t).to_radians();
            let [x, y, z] = trunk(0.5, 0.2 * side);
            [x + 0.3 * along * side * angle.sin(), y - 0.6 * along * angle.cos(), z]
        };
        let leg = |side: f64, up: f64| [0.12 * side, up, 3.0];
        let mut joints = vec![trunk(0.0, 0.0), trunk(0.25, 0.0), trunk(0.5, 0.0), trunk(0.72, 0.0)];
        for side in [-1.0, 1.0] {
            joints.extend([trunk(0.5, 0.2 * side), arm(side, 0.5), arm(side, 0.9), arm(side, 1.0)]);
        }
        for side in [-1.0, 1.0] {
            joints.extend([leg(side, 0.92), leg(side, 0.5), leg(side, 0.08), leg(side, 0.02)]);
        }
        text += &format!("{}", frame + 1);
        for [x, y, z] in joints {
            text += &format!(" {:.4} {:.4} {:.4}", size * x, size * y, size * z);
        }
        text += "\n";
    }
    text
}

#[test]
fn motion_files_teach_and_become_samples() {
    let folder = Folder::new();
    let mut files = Vec::new();
    for (name, size) in [("ann", 0.92), ("bob", 1.06)] {
        let up = folder.file(&format!("{name}-up.txt"), kinect(size, 1.0, 0.0));
        let down = folder.file(&format!("{name}-down.txt"), kinect(size, 0.0, 1.0));
        files.extend([format!("{name}:raise arms={up}"), format!("{name}:stoop={down}")]);
    }
    let model = folder.text("model.fnm");
    let train = |files: &[String], more: &[&str]| {
        let mut command =
            farnear(&["activity", "train", "--out", &model, "--no-search", "--cameras", "10", "--json"]);
        command.args(more).arg("--motion").args(files);
        command
    };
    let trained = figures(&mut train(&files, &[]));
    assert_eq!((number(&trained, "subjects"), number(&trained, "activities")), (2.0, 2.0));
    assert_eq!((number(&trained, "clips"), number(&trained, "views")), (40.0, 1.0));

    // Each activity by another person: nothing to cross-validate.
    let alone = [("raise arms", "ann-up.txt"), ("stoop", "bob-down.txt")]
        .map(|(activity, file)| format!("{activity}={}", folder.text(file)));
    let unlike = folder.text("alone.fnm");
    let search = ["activity", "train", "--out", &unlike, "--cameras", "10", "--json", "--motion"];
    let (trained, stderr) = succeeds(farnear(&search).args(&alone));
    assert!(trained.contains("\"inner_accuracy\":null"), "{trained}");
    assert!(stderr.contains("raise arms, stoop: one subject each"), "{stderr}");

    let eve = folder.file("eve.txt", kinect(1.0, 1.0, 0.0));
    let out = folder.text("eve");
    let draw =
        ["silhouettes", "markers", &eve, "--views", "4", "--mm-per-px", "15", "--samples", "raise arms"];
    let (_, stderr) = succeeds(farnear(&draw).args(["--out", &out]));
    assert!(stderr.contains("`kinect` fits best"), "{stderr}");
    let samples = folder.text("eve/samples.toml");
    let judged = figures(&mut farnear(&["activity", "evaluate", &samples, "--model", &model, "--json"]));
    assert_eq!((number(&judged, "answers"), number(&judged, "accuracy")), (4.0, 1.0), "{judged}");
    fails(
        farnear(&draw).args(["--out", &folder.text("no"), "--keep", "3"]),
        2,
        &["kept silhouettes 3", "no samples"],
    );

    let nameless = folder.text("ann-up.txt");
    fails(&mut train(std::slice::from_ref(&nameless), &[]), 1, &["ann-up.txt", "ACTIVITY=FILE"]);
    fails(&mut train(&[format!("walk={}", folder.text("none.bvh"))], &[]), 1, &["none.bvh"]);
    fails(&mut train(&files, &["--template", "vicon-53"]), 1, &["vicon-53", "`kinect` fits it"]);
    let bad = folder.file("bad.txt", "1 2 3\n");
    fails(&mut train(&[format!("walk={bad}")], &[]), 1, &["bad.txt", "line 1", "3 numbers"]);
    fails(&mut train(&["=x.bvh".into()], &[]), 2, &["ACTIVITY=FILE"]);
}
