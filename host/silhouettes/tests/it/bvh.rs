//! A synthetic walker, and damaged files that name the line.

use farnear_silhouettes::mask::{BoundingBox, area};
use farnear_silhouettes::readers::{
    self, bvh,
    recording::{Choices, Source, Unit, Up},
};
use farnear_silhouettes::silhouette::{
    parts::{Fill, close, draw, extent},
    template::Template,
    view::{Canvas, views_round},
};
use farnear_test_data::cases;
use proptest::prelude::*;
use std::fmt::Write;

/// Joints below the hips: name, tree depth, offset, in file order. `-` closes a chain with an end site.
const TREE: [(&str, usize, [f64; 3]); 27] = [
    ("LHipJoint", 1, [0.0, 0.0, 0.0]),
    ("LeftUpLeg", 2, [1.7, -1.7, 0.4]),
    ("LeftLeg", 3, [0.0, -7.5, 0.0]),
    ("LeftFoot", 4, [0.0, -7.4, 0.0]),
    ("LeftToeBase", 5, [0.0, -0.8, 2.3]),
    ("-", 6, [0.0, 0.0, 1.2]),
    ("RHipJoint", 1, [0.0, 0.0, 0.0]),
    ("RightUpLeg", 2, [-1.7, -1.7, 0.4]),
    ("RightLeg", 3, [0.0, -7.5, 0.0]),
    ("RightFoot", 4, [0.0, -7.4, 0.0]),
    ("RightToeBase", 5, [0.0, -0.8, 2.3]),
    ("-", 6, [0.0, 0.0, 1.2]),
    ("LowerBack", 1, [0.0, 0.0, 0.0]),
    ("Spine", 2, [0.0, 2.1, -0.1]),
    ("Spine1", 3, [0.0, 2.1, -0.1]),
    ("Neck", 4, [0.0, 0.0, 0.0]),
    ("Neck1", 5, [0.0, 1.6, 0.2]),
    ("Head", 6, [0.0, 1.6, -0.1]),
    ("-", 7, [0.0, 1.7, 0.0]),
    ("LeftArm", 4, [3.4, 0.8, -0.2]),
    ("LeftForeArm", 5, [5.0, 0.0, 0.0]),
    ("LeftHand", 6, [4.5, 0.0, 0.0]),
    ("-", 7, [1.5, 0.0, 0.0]),
    ("RightArm", 4, [-3.4, 0.8, -0.2]),
    ("RightForeArm", 5, [-5.0, 0.0, 0.0]),
    ("RightHand", 6, [-4.5, 0.0, 0.0]),
    ("-", 7, [-1.5, 0.0, 0.0]),
];

/// 1.65 m in CMU units (56.444 mm), towards +z, left +x. Angles Z, Y, X; limbs swing about x.
fn walk(frames: usize) -> String {
    let mut text = "HIERARCHY\nROOT Hips\n{\n\tOFFSET 0 0 0\n\tCHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation \
                    Xrotation \n"
        .to_owned();
    let mut depth = 1;
    for (name, at, [x, y, z]) in TREE {
        while depth > at {
            depth -= 1;
            let _ = writeln!(text, "{}}}", "\t".repeat(depth));
        }
        let indent = "\t".repeat(at);
        let head = if name == "-" { "End Site".to_owned() } else { format!("JOINT {name}") };
        let _ = writeln!(text, "{indent}{head}\n{indent}{{\n{indent}\tOFFSET {x:.5} {y:.5} {z:.5}");
        if name != "-" {
            let _ = writeln!(text, "{indent}\tCHANNELS 3 Zrotation Yrotation Xrotation");
        }
        depth += 1;
    }
    for depth in (0..depth).rev() {
        let _ = writeln!(text, "{}}}", "\t".repeat(depth));
    }
    let _ = writeln!(text, "MOTION\nFrames: {frames}\nFrame Time: .0333333");
    for frame in 0..frames {
        let phase = std::f64::consts::TAU * frame as f64 / 30.0;
        let _ = write!(text, "0 17.6 {:.4} 0 0 0", 0.8 * frame as f64);
        for (name, _, _) in TREE.iter().filter(|(name, _, _)| *name != "-") {
            // Left and right legs, and arms and legs, are half a period apart. Arms hang down from the rest
            // pose.
            let side = if name.starts_with("Left") { 1.0 } else { -1.0 };
            let [z, y, x] = match &name[name.len().min(if side > 0.0 { 4 } else { 5 })..] {
                "UpLeg" => [0.0, 0.0, -25.0 * side * phase.sin()],
                "Leg" => [0.0, 0.0, 25.0 - 25.0 * side * phase.cos()],
                "Arm" => [-80.0 * side, 20.0 * phase.sin(), 0.0],
                "ForeArm" => [0.0, -15.0 * side, 0.0],
                _ => [0.0; 3],
            };
            let _ = write!(text, " {z:.4} {y:.4} {x:.4}");
        }
        text.push('\n');
    }
    text
}

#[test]
fn a_walk_of_the_cmu_kind_makes_silhouettes_from_eight_views() {
    let text = walk(30);
    let recording = readers::read(text.as_bytes(), "bvh", Choices::default()).expect("a BVH file");
    assert_eq!((recording.names.len(), recording.frames.len()), (28, 30));
    assert!((recording.rate_hz - 30.0).abs() < 0.01);
    assert!((recording.unit.value.mm - 56.444).abs() < 0.001 && recording.up.value == Up::Y);
    let remarks = recording.remarks();
    assert!(
        remarks.len() == 2 && remarks.iter().all(|remark| remark.contains(": a guess, for ")),
        "{remarks:?}"
    );
    let template = Template::named("bvh").expect("built in");
    template.check(&recording.names).expect("the joints are those of the template");
    let frame = recording.by_name(10);
    for view in views_round(8, 0.0) {
        let reach = extent(std::slice::from_ref(&frame), &template, &view);
        let canvas = Canvas::fitting(&reach, 6.0, 12).expect("finite");
        let drawn = draw(&frame, &template, &view, &canvas, Fill::Hull);
        assert!(drawn.missing_parts.is_empty(), "{:?}", drawn.missing_parts);
        let mask = close(&drawn.mask, 7);
        let bounds = BoundingBox::of(mask.view()).expect("drawn");
        let (tall_m, square_metres) = (bounds.height() as f64 * 6e-3, area(mask.view()) as f64 * 36e-6);
        assert!(
            (1.5..1.75).contains(&tall_m) && (0.3..0.9).contains(&square_metres),
            "{tall_m} {square_metres}"
        );
    }
}

#[test]
fn feet_stay_under_the_body_and_the_caller_may_know_better() {
    let text = walk(30);
    let read = |choices| readers::read(text.as_bytes(), "BVH", choices).expect("a BVH file");
    let walked = read(Choices::default());
    for frame in 0..30 {
        let joints = walked.by_name(frame);
        let lowest = joints["LeftFoot"][2].min(joints["RightFoot"][2]);
        // Hips at 17.6 units, legs of 16.6: an ankle is within 8 cm of a straight leg's reach.
        assert!((0.0..150.0).contains(&lowest) && joints["Head"][2] > 1200.0, "frame {frame}: {lowest}");
    }
    let given = read(Choices { unit: Some(Unit { mm: 10.0 }), up: Some(Up::Z), ..Choices::default() });
    assert_eq!(given.up.source, Source::Caller);
    assert!((given.by_name(0)["Hips"][1] - 176.0).abs() < 1e-9, "y of the file stays y");
}

#[track_caller]
fn names_a_line(bytes: &[u8]) {
    if let Err(error) = bvh::read(bytes) {
        let text = error.to_string();
        assert!(text.starts_with("line ") && text.len() < 400, "{text}");
    }
}

#[test]
fn every_truncation_is_an_error_with_a_line_and_that_of_the_last_frame_is_said() {
    let text = walk(3);
    let frames: Vec<usize> = text.trim_end().rmatch_indices('\n').map(|(at, _)| at).collect();
    for cut in 0..text.trim_end().len() - 6 {
        match bvh::read(&text.as_bytes()[..cut]) {
            Ok(found) => {
                assert!(cut >= frames[0] - 6 && found.frames.len() == 2 && !found.remarks.is_empty(), "{cut}")
            }
            Err(error) => {
                let error = error.to_string();
                assert!(error.starts_with("line ") && cut < frames[0], "cut at {cut}: {error}");
            }
        }
    }
}

#[test]
fn joints_at_the_origin_are_not_missing() {
    let text = walk(2).replace("0 17.6 0.0000", "0 0 0.0000");
    let found = readers::read(text.as_bytes(), "bvh", Choices::default()).expect("a walker");
    assert!(found.by_name(0).contains_key("Hips") && found.by_name(0).contains_key("LowerBack"));
    assert!(found.remarks().iter().all(|remark| !remark.contains("missing")), "{:?}", found.remarks());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(256), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..600), text in "\\PC{0,300}") {
        names_a_line(&bytes);
        names_a_line(text.as_bytes());
        names_a_line(format!("HIERARCHY\nROOT a\n{{\n{text}").as_bytes());
        names_a_line(format!("HIERARCHY ROOT a\n{{ OFFSET 0 0 0 CHANNELS 1 Xrotation }}\nMOTION\n{text}").as_bytes());
    }

    #[test]
    fn damaged_files_are_read_or_name_the_line(
        places in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        words in proptest::collection::vec((any::<prop::sample::Index>(), "[A-Za-z{}:0-9.e+-]{1,8}"), 0..3),
    ) {
        let mut bytes = walk(2).into_bytes();
        for (at, value) in &places {
            let at = at.index(bytes.len());
            bytes[at] = *value;
        }
        names_a_line(&bytes);
        // Exchanged words reach further than random bytes.
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let mut split: Vec<&str> = text.split(' ').collect();
        for (at, word) in &words {
            let at = at.index(split.len());
            split[at] = word;
        }
        names_a_line(split.join(" ").as_bytes());
    }
}
