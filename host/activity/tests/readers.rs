//! Readers on real recordings, and on the same recordings damaged in seeded ways.

use farnear_activity::mask::area;
use farnear_activity::readers::{c3d, csv, matlab, skeletons, trc};
use farnear_activity::silhouette::markers::{Fill, close, draw, extent};
use farnear_activity::silhouette::template::Template;
use farnear_activity::silhouette::view::{Canvas, views_round};
use proptest::prelude::*;
use std::path::PathBuf;

fn shared(name: &str) -> Option<Vec<u8>> {
    let found =
        std::fs::read(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name)).ok();
    if found.is_none() {
        println!("skipped: no shared data");
    }
    found
}

#[test]
fn a_real_c3d_walk_makes_silhouettes_from_eight_views() {
    let Some(bytes) = shared("mocap/cmu_02_05.c3d") else { return };
    let recording = c3d::read(&bytes).expect("a C3D file");
    println!(
        "{} markers, {} frames, {} Hz: {:?}",
        recording.names.len(),
        recording.frames.len(),
        recording.rate_hz,
        &recording.names[..8]
    );
    assert!(recording.names.len() >= 41 && recording.frames.len() > 100 && recording.rate_hz > 50.0);
    let template = Template::named("plug-in-gait").expect("built in");
    template.check(&recording.names).expect("the suit is Plug-in Gait's");
    let frame = recording.by_name(recording.frames.len() / 2);
    for view in views_round(8, 0.0) {
        let canvas = Canvas::fitting(&extent(std::slice::from_ref(&frame), &template, &view), 6.0, 12)
            .expect("finite");
        let drawn = draw(&frame, &template, &view, &canvas, Fill::Hull);
        assert!(drawn.missing_parts.is_empty(), "{:?}", drawn.missing_parts);
        let mask = close(&drawn.mask, 21);
        // A person covers between 0.25 and 1.6 square metres of a picture.
        let square_metres = area(mask.view()) as f64 * 36e-6;
        assert!((0.25..1.6).contains(&square_metres), "{square_metres}");
    }
}

#[test]
fn other_c3d_and_trc_recordings_are_read() {
    if let Some(bytes) = shared("mocap/nick_freeform_001.c3d") {
        let recording = c3d::read(&bytes).expect("a C3D file");
        assert!(recording.frames.len() > 10 && !recording.names.is_empty());
    }
    for name in ["walking1", "DJ1", "squats1"] {
        let Some(bytes) = shared(&format!("mocap/{name}.trc")) else { return };
        let recording = trc::read(&String::from_utf8_lossy(&bytes), true).expect("a TRC file");
        assert_eq!(recording.names.len(), 51);
        assert!(recording.frames.len() > 100);
        let first = recording.by_name(0)["C7"];
        // The file is in metres with y up: a neck stands 1.4 m above the ground, 1.8 m at the top
        // of a drop jump's box.
        assert!((1200.0..1900.0).contains(&first[2]), "{first:?}");
    }
}

#[test]
fn skeleton_sets_hold_what_they_should() {
    if let Some(bytes) = shared("skeletons/UTKinect_Skeletons.mat") {
        let clips = skeletons::read_cells(&bytes, &skeletons::KINECT_20).expect("a MAT-file");
        assert_eq!(clips.len(), 199);
        assert_eq!(clips[0].frames.len(), 44);
        assert!(skeletons::read_cells(&bytes, &skeletons::FLORENCE_15).is_err());
    }
    if let Some(bytes) = shared("skeletons/Florence_3D_Action_Skeletons.mat") {
        let clips = skeletons::read_cells(&bytes, &skeletons::FLORENCE_15).expect("a MAT-file");
        assert_eq!(clips.len(), 215);
    }
}

#[test]
fn truncated_recordings_are_errors_not_panics() {
    if let Some(bytes) = shared("mocap/cmu_02_05.c3d") {
        for cut in [0, 1, 2, 100, 511, 512, 600, 2000, 5000, bytes.len() / 2, bytes.len() - 600] {
            assert!(c3d::read(&bytes[..cut]).is_err(), "cut at {cut}");
        }
    }
    if let Some(bytes) = shared("mocap/walking1.trc") {
        let text = String::from_utf8_lossy(&bytes);
        assert!(trc::read(&text[..40], true).is_err());
        assert!(
            trc::read(&text.replacen("\tm\t", "\tfurlong\t", 1), true)
                .expect_err("unit")
                .to_string()
                .contains("furlong")
        );
    }
}

#[test]
fn damaged_recordings_never_panic() {
    let (Some(motion), Some(joints)) =
        (shared("mocap/nick_freeform_001.c3d"), shared("skeletons/Florence_3D_Action_Skeletons.mat"))
    else {
        return;
    };
    // The header and parameter blocks decide everything: damage is aimed there.
    let motion = motion[..motion.len().min(60_000)].to_vec();
    let mut runner = proptest::test_runner::TestRunner::new(ProptestConfig {
        cases: 300,
        failure_persistence: None,
        ..ProptestConfig::default()
    });
    let damage = proptest::collection::vec((0_usize..6000, any::<u8>()), 1..12);
    runner
        .run(&damage, |places| {
            for source in [&motion, &joints] {
                let mut bytes = source.clone();
                for &(at, value) in &places {
                    let at = at % bytes.len();
                    bytes[at] = value;
                }
                let _ = c3d::read(&bytes);
                if source.len() == joints.len() {
                    let _ = matlab::read(&bytes[..4000.min(bytes.len())]);
                }
            }
            Ok(())
        })
        .expect("no panic");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn any_bytes_and_text_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..2000), text in "\\PC{0,300}") {
        let _ = matlab::read(&bytes);
        let mut keyed = bytes.clone();
        if keyed.len() > 2 {
            keyed[0] = 2;
            keyed[1] = 0x50;
        }
        let _ = c3d::read(&keyed);
        let _ = csv::read(&text);
        let _ = trc::read(&format!("PathFileType\t4\nDataRate\tNumMarkers\tUnits\n100\t1\tmm\nFrame#\tTime\tA\n\n{text}"), false);
    }
}

#[test]
fn unknown_markers_are_named() {
    let error = Template::named("plug-in-gait")
        .expect("built in")
        .check(&["A".into(), "B".into()])
        .expect_err("no such suit");
    assert!(error.to_string().contains("LFHD") && error.to_string().contains("plug-in-gait"), "{error}");
    assert!(Template::parse("name = 'x'\n[[part]]\nname = 'head'\nmarkers = []\n").is_err());
}
