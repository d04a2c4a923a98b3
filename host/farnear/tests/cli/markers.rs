//! `farnear silhouettes markers` on synthetic CSV and BVH files and, where present, on real recordings.

use std::fs;

use image::{GrayImage, Luma};

use crate::common::{Folder, fails, farnear, figures, number, succeeds};

/// A suit of two boxes: a body 1 m tall, 0.4 m wide and 0.2 m deep, and a head on it.
const TEMPLATE: &str = "name = 'boxes'\n[[part]]\nname = 'body'\nmarkers = ['B1', 'B2', 'B3', 'B4', 'B5', 'B6', 'B7', 'B8']\n\
                        [[part]]\nname = 'head'\nmarkers = ['H1', 'H2', 'H3']\n";

/// The figure, away from the origin (zeros are missing markers), moves 0.5 m along x in each of three frames. The head
/// is hidden in the last.
fn recording() -> String {
    let mut points: Vec<(String, [f64; 3])> = (0..8)
        .map(|i| {
            let corner = [i & 1, i >> 1 & 1, i >> 2 & 1].map(f64::from);
            (format!("B{}", i + 1), [400.0 * corner[0], 100.0 + 200.0 * corner[1], 1000.0 * corner[2]])
        })
        .collect();
    for (i, x) in [100.0, 300.0, 200.0].into_iter().enumerate() {
        points.push((format!("H{}", i + 1), [x, 200.0, if i == 2 { 1300.0 } else { 1000.0 }]));
    }
    let columns: Vec<String> = points.iter().map(|(n, _)| format!("{n}_x,{n}_y,{n}_z")).collect();
    let mut text = format!("time,{}\n", columns.join(","));
    for frame in 0..3 {
        let cells: Vec<String> = points
            .iter()
            .map(|(name, [x, y, z])| match (frame, name.starts_with('H')) {
                (2, true) => ",,".into(),
                _ => format!("{},{y},{z}", x + 500.0 * f64::from(frame)),
            })
            .collect();
        text += &format!("{},{}\n", frame + 1, cells.join(","));
    }
    text
}

fn bounds(picture: &GrayImage) -> [u32; 4] {
    let set = picture.enumerate_pixels().filter(|(_, _, level)| level.0[0] == 255);
    set.fold([u32::MAX, u32::MAX, 0, 0], |[t, l, b, r], (x, y, _)| {
        [t.min(y), l.min(x), b.max(y + 1), r.max(x + 1)]
    })
}

#[test]
fn every_view_gets_its_masks_and_hidden_parts_are_flagged() {
    let folder = Folder::new();
    let (file, template) = (folder.file("walk.csv", recording()), folder.file("suit.toml", TEMPLATE));
    let out = folder.text("masks");
    let arguments =
        ["silhouettes", "markers", &file, "--template", &template, "--views", "4", "--mm-per-px", "10"];
    let found = figures(farnear(&arguments).args(["--out", &out, "--json"]));
    assert_eq!((number(&found, "views"), number(&found, "silhouettes")), (4.0, 12.0));
    assert_eq!((number(&found, "flagged_frames"), number(&found, "empty_frames")), (1.0, 0.0));
    let mask = |view: u32, frame: u32| {
        image::open(folder.path(&format!("masks/view{view}/frame_{frame:06}.png")))
            .expect("a mask")
            .into_luma8()
    };
    // The front is 40 x 130 pixels and moves 50 px per frame; the side is 20 wide and does not move. Rounding: 1 px.
    let [top, left, bottom, right] = bounds(&mask(1, 1));
    assert!(
        (bottom - top).abs_diff(131) <= 1 && (right - left).abs_diff(41) <= 1,
        "{:?}",
        bounds(&mask(1, 1))
    );
    assert!(bounds(&mask(1, 2))[1].abs_diff(left + 50) <= 1);
    let [_, side_left, _, side_right] = bounds(&mask(2, 1));
    assert!((side_right - side_left).abs_diff(21) <= 1);
    assert!(bounds(&mask(2, 3))[1].abs_diff(side_left) <= 1);
    let index = fs::read_to_string(folder.path("masks/silhouettes.toml")).expect("an index");
    assert!(index.contains("missing:head") && index.contains("frame_000003"), "{index}");
    assert!(!index.contains("frame_000001"), "{index}");

    let [gallery, small] = ["gallery", "small"].map(|name| folder.text(name));
    let kept = figures(farnear(&arguments).args(["--out", &gallery, "--keep", "5", "--json"]));
    assert_eq!(number(&kept, "silhouettes"), 5.0);
    let pictures =
        folder.listing().into_iter().filter(|name| name.starts_with("gallery/") && name.ends_with("png"));
    assert_eq!(pictures.count(), 5);
    succeeds(farnear(&arguments).args(["--out", &small, "--centred", "--fill", "triplets"]));
    let picture = image::open(folder.path("small/view1/frame_000002.png")).expect("a mask").into_luma8();
    let [top, _, bottom, _] = bounds(&picture);
    // Full height, except for the head's tip, whose last pixels fall between two samples.
    assert!(picture.dimensions() == (100, 100) && bottom - top >= 97, "{top} {bottom}");
}

#[test]
fn recordings_that_do_not_fit_are_refused_by_name() {
    let folder = Folder::new();
    let (good, template) = (folder.file("walk.csv", recording()), folder.file("suit.toml", TEMPLATE));
    let empty = folder.file("empty.csv", "frame,A_x,A_y,A_z\n1,,,\n");
    let far = folder.file("far.csv", recording().replace("\n1,0,", "\n1,90000000,"));
    let broken = folder.file("broken.csv", recording().replace("1000", "tall"));
    let short = folder.file("short.trc", "PathFileType\t4\n");
    let odd = folder.file("odd.c3d", [2_u8, 0x50, 1, 2, 3]);
    let other = folder.file("walk.fbx", "Kaydara FBX Binary");
    let one = folder.file("one.toml", "name = 'x'\n[[part]]\nname = 'a'\nmarkers = ['A']\n");
    let doubled = folder.file("doubled.toml", "name = 'x'\n[[part]]\nname = 'a'\nmarkers = []\n");
    fs::create_dir(folder.path("yolo")).expect("a folder");
    folder.file("yolo/walk_1.txt", "0 0.5 0.5 0.2 0.6 0.5 0.5 0.9");
    fs::create_dir(folder.path("poses")).expect("a folder");
    folder.file("poses/walk_1.json", openpose(&[100.0]));
    folder.file("poses/walk_2.json", "");
    let before = folder.listing();
    for (file, template, phrases) in [
        (&folder.text("poses"), "keypoints", vec!["poses: walk_2.json: line 1: not JSON"]),
        (&folder.text("yolo"), "keypoints", vec!["yolo", "no .json file", ".txt"]),
        (
            &good,
            "plug-in-gait",
            vec!["walk.csv: none of the recording's names", "LFHD", "B1", "with --template"],
        ),
        (&good, "jacket", vec!["jacket", "vicon-53"]),
        (&good, &doubled, vec!["doubled.toml", "no markers"]),
        (&empty, &one, vec!["empty.csv", "no frame has a visible marker"]),
        (&far, &template, vec!["unit"]),
        (&broken, &template, vec!["broken.csv", "line 2", "tall"]),
        (&short, &template, vec!["short.trc", "line"]),
        (&odd, &template, vec!["odd.c3d", "C3D", "ends within"]),
        (&other, &template, vec!["walk.fbx", ".bvh, .c3d"]),
        (&folder.text("none.c3d"), &template, vec!["none.c3d"]),
    ] {
        let out = folder.text("masks");
        let arguments = ["silhouettes", "markers", file, "--template", template, "--out", &out];
        fails(&mut farnear(&arguments), 1, &phrases);
    }
    assert_eq!(folder.listing(), before, "nothing is left behind");
}

#[test]
fn a_person_who_lies_because_another_axis_points_up_is_warned_of() {
    let folder = Folder::new();
    let (file, template) = (folder.file("walk.csv", recording()), folder.file("suit.toml", TEMPLATE));
    let drawn = |up: &str, out: &str| {
        let arguments = ["silhouettes", "markers", &file, "--template", &template, "--mm-per-px", "20"];
        figures(farnear(&arguments).args(["--up", up, "--out", &folder.text(out), "--json"]))["warnings"]
            .clone()
    };
    assert!(drawn("z", "upright").is_null() && drawn("-z", "reversed").is_null());
    let lying = drawn("y", "lying").to_string();
    assert!(lying.contains("longer than high in 3 of 3 frames") && lying.contains("--up"), "{lying}");
}

/// A body like in the CMU library's BVH files: their joint names, y up, units of 56.444 mm, 30.5 units from toe to
/// crown. In three frames it walks 10 units along z, and turns about the vertical in the last.
fn skeleton() -> String {
    let chain = |joints: &[(&str, [f64; 3])], end: [f64; 3]| {
        let open: String = joints
            .iter()
            .map(|(name, [x, y, z])| {
                format!("JOINT {name}\n{{\nOFFSET {x} {y} {z}\nCHANNELS 3 Zrotation Yrotation Xrotation\n")
            })
            .collect();
        let [x, y, z] = end;
        format!("{open}End Site\n{{\nOFFSET {x} {y} {z}\n}}\n{}", "}\n".repeat(joints.len()))
    };
    let leg = |side: &str, x: f64| {
        let names = ["UpLeg", "Leg", "Foot", "ToeBase"].map(|part| format!("{side}{part}"));
        let offsets = [[x, -1.5, 0.0], [0.0, -7.0, 0.0], [0.0, -7.0, 0.0], [0.0, -1.0, 2.0]];
        let joints: Vec<(&str, [f64; 3])> = names.iter().map(String::as_str).zip(offsets).collect();
        chain(&joints, [0.0, 0.0, 1.0])
    };
    let arm = |side: &str, x: f64| {
        let names = ["Arm", "ForeArm", "Hand"].map(|part| format!("{side}{part}"));
        let offsets = [[x, 7.0, 0.0], [5.0 * x.signum(), 0.0, 0.0], [4.0 * x.signum(), 0.0, 0.0]];
        let joints: Vec<(&str, [f64; 3])> = names.iter().map(String::as_str).zip(offsets).collect();
        chain(&joints, [x.signum(), 0.0, 0.0])
    };
    let trunk = chain(
        &[
            ("Spine", [0.0, 2.0, 0.0]),
            ("Spine1", [0.0, 3.0, 0.0]),
            ("Neck", [0.0, 4.0, 0.0]),
            ("Head", [0.0, 2.0, 0.0]),
        ],
        [0.0, 3.0, 0.0],
    );
    let body = [leg("Left", 1.5), leg("Right", -1.5), arm("Left", 3.0), arm("Right", -3.0), trunk].concat();
    let mut text = format!(
        "HIERARCHY\nROOT Hips\n{{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation\n\
         {body}}}\nMOTION\nFrames: 3\nFrame Time: 0.0083333\n"
    );
    let rest = vec!["0"; 3 * body.matches("CHANNELS").count()].join(" ");
    for (z, turn_deg) in [(0, 0), (10, 0), (10, 90)] {
        text += &format!("0 17 {z} 0 {turn_deg} 0 {rest}\n");
    }
    text
}

#[test]
fn a_skeleton_is_drawn_and_guesses_are_reported() {
    let folder = Folder::new();
    let (file, out) = (folder.file("walk.bvh", skeleton()), folder.text("masks"));
    let arguments = ["silhouettes", "markers", &file, "--template", "bvh", "--views", "4"];
    let (figures, stderr) =
        succeeds(farnear(&arguments).args(["--mm-per-px", "10", "--out", &out, "--json"]));
    let figures: serde_json::Value = serde_json::from_str(&figures).expect("JSON");
    assert_eq!((number(&figures, "silhouettes"), number(&figures, "flagged_frames")), (12.0, 0.0));
    for phrase in
        ["warning: ", "walk.bvh: lengths are taken as units of 56.444 mm", "y is taken as up", "--units"]
    {
        assert!(stderr.contains(phrase), "{phrase:?} is not in: {stderr}");
    }
    assert_eq!(figures["warnings"].as_array().map(Vec::len), Some(2), "{figures}");
    let size = |name: &str| {
        let mask = image::open(folder.path(name)).expect("a mask").into_luma8();
        let [top, left, bottom, right] = bounds(&mask);
        (f64::from(bottom - top), f64::from(right - left))
    };
    // The skeleton is 30.5 units from toe to crown, each 56.444 mm, plus some centimetres of body at both ends; its
    // arms are 26 units from tip to tip. The front view is as wide as the arms, the side view is not; a quarter turn
    // swaps them.
    let (height, width) = size("masks/view1/frame_000001.png");
    assert!((172.0..195.0).contains(&height) && (147.0..165.0).contains(&width), "{height} {width}");
    let (_, turned) = size("masks/view1/frame_000003.png");
    assert!(turned < 0.5 * width, "{turned} {width}");
    let (_, side) = size("masks/view2/frame_000001.png");
    assert!(side < 0.5 * width, "{side} {width}");

    // A given scale produces no question and no message.
    let metric = folder.text("metric");
    let named = ["--units", "cm", "--up", "y", "--mm-per-px", "10", "--out", &metric, "--json"];
    let (figures, stderr) = succeeds(farnear(&arguments).args(named));
    assert!(!stderr.contains("taken as") && !figures.contains("warnings"), "{stderr} {figures}");
    let (small, _) = size("metric/view1/frame_000001.png");
    assert!(small < 0.3 * height, "{small} {height}: centimetres are smaller");
}

#[test]
fn a_broken_skeleton_is_refused_with_its_line() {
    let folder = Folder::new();
    let good = skeleton();
    let promised = good.lines().position(|line| line.starts_with("Frames:")).expect("a count") + 1;
    let last = good.lines().count();
    let line = |number: usize| format!("line {number}");
    let cut: String = good.lines().take(last - 2).map(|line| format!("{line}\n")).collect();
    for (name, text, phrases) in [
        ("angle.bvh", good.replace("0 17 10 0 90", "0 17 10 0 ninety"), vec![line(last), "ninety".into()]),
        ("short.bvh", cut, vec![line(last - 2), "1 frames".into(), "3".into()]),
        ("count.bvh", good.replace("Frames: 3", "Frames: many"), vec![line(promised), "many".into()]),
        ("axis.bvh", good.replacen("Zrotation", "Wrotation", 1), vec![line(5), "Wrotation".into()]),
    ] {
        let (file, out) = (folder.file(name, text), folder.text("masks"));
        let arguments = ["silhouettes", "markers", &file, "--template", "bvh", "--out", &out];
        let mut phrases: Vec<&str> = phrases.iter().map(String::as_str).collect();
        phrases.push(name);
        fails(&mut farnear(&arguments), 1, &phrases);
        assert!(!folder.path("masks").exists(), "{name}");
    }
    let (file, out) = (folder.file("walk.bvh", good), folder.text("masks"));
    let wrong = ["silhouettes", "markers", &file, "--template", "bvh", "--units", "furlong", "--out", &out];
    fails(&mut farnear(&wrong), 2, &["furlong", "cmu"]);
    let other = ["silhouettes", "markers", &file, "--template", "opencap", "--out", &out];
    fails(&mut farnear(&other), 1, &["walk.bvh", "`bvh` fits"]);
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs the real data next to the repository")]
fn real_recordings_fit_built_in_templates() {
    let data = farnear_test_data::path("mocap");
    let folder = Folder::new();
    for (name, template) in [
        ("cmu_02_05.c3d", "plug-in-gait"),
        ("nick_freeform_001.c3d", "vicon-53"),
        ("walking1.trc", "opencap"),
    ] {
        let (file, out) = (data.join(name).display().to_string(), folder.text(name));
        let arguments =
            ["silhouettes", "markers", &file, "--template", template, "--views", "2", "--every", "40"];
        let found = figures(farnear(&arguments).args(["--out", &out, "--json"]));
        assert_eq!(number(&found, "silhouettes"), 2.0 * number(&found, "frames"), "{name}");
        // Whole parts are hidden in few frames at most.
        assert!(number(&found, "flagged_frames") <= 0.2 * number(&found, "frames"), "{name}: {found}");
    }
    let file = data.join("walking1.trc").display().to_string();
    let out = folder.text("wrong");
    let wrong = ["silhouettes", "markers", &file, "--template", "plug-in-gait", "--out", &out];
    fails(&mut farnear(&wrong), 1, &["walking1.trc", "LFHD", "`opencap` fits"]);
    let cut = folder.file("cut.c3d", &fs::read(data.join("cmu_02_05.c3d")).expect("readable")[..100_000]);
    let truncated = ["silhouettes", "markers", &cut, "--template", "plug-in-gait", "--out", &out];
    fails(&mut farnear(&truncated), 1, &["cut.c3d", "ends within the frames", "100000"]);
}

#[test]
fn masks_are_split_at_number_gaps_and_frames_without_a_person() {
    let folder = Folder::new();
    let masks = folder.text("masks");
    fs::create_dir(&masks).expect("a folder");
    // Frames with a person: 8 to 12, 14 to 17, 40 to 41.
    for frame in (8..18_u32).chain(40..42) {
        let seen = frame != 13;
        GrayImage::from_fn(60, 40, |x, y| {
            Luma([if seen && x / 10 == frame % 6 && y > 5 { 255_u8 } else { 0 }])
        })
        .save(folder.path(&format!("masks/silho_{frame}.png")))
        .expect("a picture");
    }
    let cut = |least: &str, out: &str| {
        let mut command =
            farnear(&["silhouettes", "passages", &masks, "--activity", "walk \"fast\"", "--subject", "p1"]);
        command.args(["--least-frames", least, "--out", &folder.text(out), "--json"]);
        command
    };
    let found = figures(&mut cut("3", "passages"));
    let counts = ["masks", "passages", "frames", "too_short"].map(|name| number(&found, name));
    assert_eq!(counts, [12.0, 2.0, 9.0, 1.0], "{found}");
    assert!(folder.path("passages/passage2/silho_17.png").exists());
    let samples = fs::read_to_string(folder.path("passages/samples.toml")).expect("samples");
    let samples: toml::Table = samples.parse().expect("TOML");
    assert_eq!(samples["sample"][1]["activity"].as_str(), Some("walk \"fast\""));
    fails(&mut cut("6", "none"), 1, &["masks", "6 successive frames"]);
    assert!(!folder.path("none").exists());
}

/// A frame of OpenPose with an upright person at every x, 1 px per centimetre.
fn openpose(people: &[f64]) -> String {
    let upright = [
        (0.0, 30.0),
        (0.0, 48.0),
        (-18.0, 50.0),
        (-24.0, 78.0),
        (-26.0, 104.0),
        (18.0, 50.0),
        (24.0, 78.0),
        (26.0, 104.0),
        (0.0, 100.0),
        (-9.0, 100.0),
        (-9.0, 142.0),
        (-9.0, 184.0),
        (9.0, 100.0),
        (9.0, 142.0),
        (9.0, 184.0),
        (-3.0, 28.0),
        (3.0, 28.0),
        (-7.0, 30.0),
        (7.0, 30.0),
        (14.0, 190.0),
        (16.0, 188.0),
        (8.0, 188.0),
        (-14.0, 190.0),
        (-16.0, 188.0),
        (-8.0, 188.0),
    ];
    let person = |x: &f64| {
        let points = upright.iter().map(|(aside, down)| format!("{},{down},0.9", x + aside));
        format!("{{\"pose_keypoints_2d\":[{}]}}", points.collect::<Vec<_>>().join(","))
    };
    format!("{{\"version\":1.3,\"people\":[{}]}}", people.iter().map(person).collect::<Vec<_>>().join(","))
}

#[test]
fn the_shape_of_the_picture_is_checked_and_reported_where_it_has_no_effect() {
    let folder = Folder::new();
    let file = folder.file("one.json", openpose(&[100.0]));
    let (out, other) = (folder.text("masks"), folder.text("other"));
    let arguments = ["silhouettes", "markers", &file, "--aspect"];
    let found = figures(farnear(&arguments).args(["9:16", "--out", &out, "--json"]));
    let warnings = found["warnings"].to_string();
    assert!(warnings.contains("--aspect 9:16 is ignored"), "{warnings}");
    fails(farnear(&arguments).args(["9", "--out", &other]), 2, &["`9` is not the shape", "1080x1920"]);
}

#[test]
fn a_folder_of_openpose_files_gives_masks_of_its_view_and_samples() {
    let folder = Folder::new();
    fs::create_dir(folder.path("poses")).expect("a folder");
    for frame in 0..12 {
        let x = 100.0 + 5.0 * f64::from(frame);
        let people = if frame < 3 { vec![x] } else { vec![500.0, x] };
        let name = format!("poses/walk_{frame:012}_keypoints.json");
        folder.file(&name, openpose(if frame == 6 { &[] } else { &people }));
    }
    let (poses, out) = (folder.text("poses"), folder.text("masks"));
    let mut command = farnear(&["silhouettes", "markers", &poses, "--mm-per-px", "10", "--out", &out]);
    let found = figures(command.args(["--samples", "walk", "--subject", "anna", "--json"]));
    assert_eq!(
        (number(&found, "views"), number(&found, "frames"), number(&found, "silhouettes")),
        (1.0, 12.0, 11.0)
    );
    let warnings = found["warnings"].to_string();
    assert!(
        warnings.contains("BODY_25") && warnings.contains("2 people") && warnings.contains("guess"),
        "{warnings}"
    );
    let index = fs::read_to_string(folder.path("masks/silhouettes.toml")).expect("an index");
    assert!(!index.contains("rate_hz"), "keypoints state no rate: {index}");
    let mask = |frame: u32| {
        image::open(folder.path(&format!("masks/view1/frame_{frame:06}.png"))).expect("a mask").into_luma8()
    };
    let [top, left, bottom, right] = bounds(&mask(1));
    assert!(
        (160..200).contains(&(bottom - top)) && (50..75).contains(&(right - left)),
        "{:?}",
        bounds(&mask(1))
    );
    assert!(bounds(&mask(12))[1].abs_diff(left + 55) <= 3, "{:?}", bounds(&mask(12)));
    let samples = fs::read_to_string(folder.path("masks/samples.toml")).expect("samples");
    assert!(samples.contains("anna") && samples.contains("walk"), "{samples}");
    let second = folder.text("second");
    let found = figures(
        farnear(&["silhouettes", "markers", &poses, "--person", "2", "--out"]).args([&second, "--json"]),
    );
    assert_eq!(number(&found, "silhouettes"), 8.0);
    let third = ["silhouettes", "markers", &poses, "--person", "3", "--out", &folder.text("third")];
    fails(&mut farnear(&third), 1, &["no person 3", "2 are in the file"]);
}
