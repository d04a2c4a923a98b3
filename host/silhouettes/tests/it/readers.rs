//! Readers on real recordings, and on damaged copies.

use crate::damaged::{CSV, ntu_file};
use farnear_silhouettes::mask::area;
use farnear_silhouettes::readers::{
    self, c3d, csv, kinect, matlab, ntu,
    recording::{Choices, Recording, RecordingError},
    skeletons, trc,
};
use farnear_silhouettes::silhouette::{
    parts::{Fill, close, draw, extent},
    template::Template,
    view::{Canvas, views_round},
};
use farnear_test_data::cases;
use proptest::prelude::*;

fn shared(name: &str) -> Vec<u8> {
    std::fs::read(farnear_test_data::path(name)).expect("the file is among the data")
}

fn read(bytes: &[u8], ending: &str) -> Result<Recording, RecordingError> {
    readers::read(bytes, ending, Choices::default())
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs the real data next to the repository")]
fn a_real_c3d_walk_makes_silhouettes_from_eight_views() {
    let recording = read(&shared("mocap/cmu_02_05.c3d"), "c3d").expect("a C3D file");
    assert!(recording.remarks().is_empty(), "unit and axes are the file's and the format's");
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
        // A person covers between 0.25 and 1.6 square metres.
        let square_metres = area(mask.view()) as f64 * 36e-6;
        assert!((0.25..1.6).contains(&square_metres), "{square_metres}");
    }
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs the real data next to the repository")]
fn other_c3d_and_trc_recordings_are_read() {
    let recording = read(&shared("mocap/nick_freeform_001.c3d"), "c3d").expect("a C3D file");
    assert!(recording.frames.len() > 10 && !recording.names.is_empty());
    for name in ["walking1", "DJ1", "squats1"] {
        let recording = read(&shared(&format!("mocap/{name}.trc")), "trc").expect("a TRC file");
        assert_eq!(recording.names.len(), 51);
        assert!(recording.frames.len() > 100);
        let first = recording.by_name(0)["C7"];
        // In metres with y up: a neck is 1.4 m above the ground, 1.8 m on a drop jump's box.
        assert!((1200.0..1900.0).contains(&first[2]), "{first:?}");
    }
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs the real data next to the repository")]
fn skeleton_sets_hold_what_they_should() {
    let bytes = shared("skeletons/UTKinect_Skeletons.mat");
    let clips = skeletons::read_cells(&bytes, &skeletons::KINECT_20).expect("a MAT-file");
    assert_eq!(clips.len(), 199);
    assert_eq!(clips[0].frames.len(), 44);
    assert!(skeletons::read_cells(&bytes, &skeletons::FLORENCE_15).is_err());
    let bytes = shared("skeletons/Florence_3D_Action_Skeletons.mat");
    let clips = skeletons::read_cells(&bytes, &skeletons::FLORENCE_15).expect("a MAT-file");
    assert_eq!(clips.len(), 215);
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs the real data next to the repository")]
fn truncated_recordings_are_errors_not_panics() {
    let bytes = shared("mocap/cmu_02_05.c3d");
    for cut in [0, 1, 2, 100, 511, 512, 600, 2000, 5000, bytes.len() / 2, bytes.len() - 600] {
        assert!(c3d::read(&bytes[..cut]).is_err(), "cut at {cut}");
    }
    let bytes = shared("mocap/walking1.trc");
    assert!(trc::read(&bytes[..40]).is_err());
    let furlongs = String::from_utf8_lossy(&bytes).replacen("\tm\t", "\tfurlong\t", 1);
    let read = trc::read(furlongs.as_bytes()).expect("an unknown unit is left to the caller");
    assert!(format!("{:?}", read.unit).contains("furlong"));
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs the real data next to the repository")]
fn damaged_recordings_never_panic() {
    // Header and parameter blocks decide everything, so damage is placed there.
    let mut motion = shared("mocap/nick_freeform_001.c3d");
    motion.truncate(60_000);
    let mut joints = shared("skeletons/Florence_3D_Action_Skeletons.mat");
    joints.truncate(4000);
    let mut runner = proptest::test_runner::TestRunner::new(ProptestConfig {
        cases: cases(300),
        failure_persistence: None,
        ..ProptestConfig::default()
    });
    let damage = proptest::collection::vec((0_usize..6000, any::<u8>()), 1..12);
    runner
        .run(&damage, |places| {
            let damaged = |source: &[u8]| {
                let mut bytes = source.to_vec();
                for &(at, value) in &places {
                    let at = at % bytes.len();
                    bytes[at] = value;
                }
                bytes
            };
            let _ = c3d::read(&damaged(&motion));
            let _ = c3d::read(&damaged(&joints));
            let _ = matlab::read(&damaged(&joints));
            Ok(())
        })
        .expect("no panic");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(256), failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn any_bytes_and_text_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..2000), text in "\\PC{0,300}") {
        let _ = matlab::read(&bytes);
        let mut keyed = bytes.clone();
        if keyed.len() > 2 {
            keyed[0] = 2;
            keyed[1] = 0x50;
        }
        let _ = c3d::read(&keyed);
        let _ = csv::read(text.as_bytes(), Choices::default());
        let _ = ntu::read(text.as_bytes());
        let _ = kinect::read(text.as_bytes());
        let headed =
            format!("PathFileType\t4\nDataRate\tNumMarkers\tUnits\n100\t1\tmm\nFrame#\tTime\tA\n\n{text}");
        let _ = trc::read(headed.as_bytes());
    }
}

#[test]
fn unknown_markers_are_named() {
    let error = Template::named("plug-in-gait")
        .expect("built in")
        .check(&["A".into(), "B".into()])
        .expect_err("no such suit");
    assert!(error.to_string().contains("LFHD") && error.to_string().contains("plug-in-gait"), "{error}");
    let legs = "LASI RASI LTHI RTHI LKNE RKNE LTIB RTIB LANK RANK LTOE RTOE".split(' ').map(str::to_owned);
    let error = Template::named("plug-in-gait").expect("built in").check(&legs.collect::<Vec<_>>());
    let error = error.expect_err("legs").to_string();
    assert!(
        error.starts_with(
            "the recording has only lower torso, left thigh, right thigh, left leg and foot, right leg and foot, and a part"
        ),
        "{error}"
    );
    assert!(Template::parse("name = 'x'\n[[part]]\nname = 'head'\nmarkers = []\n").is_err());
}

/// One marker, two float frames, label and unit.
fn small_c3d() -> Vec<u8> {
    let mut bytes = vec![0_u8; 4 * 512];
    bytes[..2].copy_from_slice(&[2, 0x50]);
    for (word, value) in [(2, 1_u16), (3, 0), (4, 1), (5, 2), (9, 4)] {
        bytes[2 * (word - 1)..2 * word].copy_from_slice(&value.to_le_bytes());
    }
    bytes[12..16].copy_from_slice(&(-1.0_f32).to_le_bytes());
    bytes[20..24].copy_from_slice(&100.0_f32.to_le_bytes());
    let mut parameters = vec![1, 0x50, 2, 84];
    let entry = |parameters: &mut Vec<u8>, name: &str, group: i8, body: &[u8], last: bool| {
        parameters.extend([name.len() as u8, group as u8]);
        parameters.extend(name.as_bytes());
        let next = if last { 0 } else { 2 + body.len() as u16 };
        parameters.extend(next.to_le_bytes());
        parameters.extend(body);
    };
    entry(&mut parameters, "POINT", -1, &[0], false);
    entry(&mut parameters, "LABELS", 1, &[0xff, 2, 4, 1, b'L', b'A', b'S', b'I', 0], false);
    entry(&mut parameters, "UNITS", 1, &[0xff, 2, 2, 1, b'm', b'm', 0], true);
    bytes[512..512 + parameters.len()].copy_from_slice(&parameters);
    for (i, value) in [1.0_f32, 2.0, 3.0, 0.0, 4.0, 5.0, 6.0, -1.0].into_iter().enumerate() {
        bytes[1536 + 4 * i..1540 + 4 * i].copy_from_slice(&value.to_le_bytes());
    }
    bytes
}

#[test]
fn a_small_c3d_file_is_read_as_written() {
    let read = read(&small_c3d(), "C3D").expect("a C3D file");
    assert_eq!((read.names, read.rate_hz), (vec!["LASI".to_owned()], 100.0));
    assert_eq!(read.frames, vec![vec![Some([1.0, 2.0, 3.0])], vec![None]]);
}

const TRC: &str = "PathFileType\t4\t(X/Y/Z)\tx.trc\nDataRate\tNumMarkers\tUnits\n100\t2\tm\nFrame#\tTime\tA\t\t\tB\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n1\t0\t0.1\t0.2\t0.3\t\t\t\n2\t0.01\t1\t2\t3\t4\t5\t6\n";
#[test]
fn a_trc_file_cut_short_is_refused_with_both_numbers() {
    let promising = |frames: &str| {
        let keys = TRC.replace("DataRate\tNumMarkers", "DataRate\tNumFrames\tNumMarkers");
        keys.replace("100\t2\tm", &format!("100\t{frames}\t2\tm"))
    };
    assert_eq!(trc::read(promising("2").as_bytes()).expect("whole").frames.len(), 2);
    // Fewer frames, or no number, are accepted.
    assert!(trc::read(promising("1").as_bytes()).is_ok() && trc::read(promising("?").as_bytes()).is_ok());
    let error = trc::read(promising("139").as_bytes()).expect_err("cut short").to_string();
    assert!(error.contains("139") && error.contains("ends after 2") && error.contains("line 3"), "{error}");
}

#[test]
fn a_trc_file_cut_in_its_last_row_is_refused() {
    let whole = TRC.replace("0.3\t\t\t\n", "0.3\t7\t8\t9\n");
    let hidden = whole.replace("3\t4\t5\t6\n", "3\t\t\t\n");
    assert_eq!(trc::read(hidden.as_bytes()).expect("hidden").frames[1], [Some([1.0, 2.0, 3.0]), None]);
    let cut = whole.trim_end().trim_end_matches("\t5\t6");
    let error = trc::read(cut.as_bytes()).expect_err("cut short").to_string();
    assert!(error.starts_with("line 8: 6 values, the header names 8"), "{error}");
    // A program that leaves out empty cells does so in other rows, too.
    let short = whole.replace("0.3\t7\t8\t9\n", "0.3\n").replace("3\t4\t5\t6\n", "3\n");
    assert_eq!(trc::read(short.as_bytes()).expect("hidden").frames.len(), 2);
}

#[test]
fn a_trc_file_without_a_rate_or_with_one_name_twice_is_reported() {
    let remarks = |text: &str| {
        let recording = read(text.as_bytes(), "trc").expect("a TRC file");
        (recording.rate_hz, recording.remarks().join("; "))
    };
    assert_eq!(remarks(TRC).0, 100.0);
    for rate in ["0", "-5", "nan"] {
        let (rate_hz, remarks) = remarks(&TRC.replace("\n100\t2", &format!("\n{rate}\t2")));
        assert!(rate_hz == 0.0 && remarks.contains("DataRate = "), "{rate}: {remarks}");
    }
    let (_, twice) = remarks(&TRC.replace("A\t\t\tB", "A\t\t\tA"));
    assert!(twice.contains("share a name (A)"), "{twice}");
}

#[test]
fn a_trc_file_of_a_part_of_a_recording_is_read_with_a_remark() {
    let keys = TRC.replace("DataRate\tNumMarkers", "DataRate\tNumFrames\tNumMarkers");
    let whole = keys.replace("\n100\t2", "\n100\t900\t2");
    let part = whole.replace("\n1\t0\t", "\n185\t3.07\t").replace("\n2\t0.01\t", "\n186\t3.08\t");
    let found = trc::read(part.as_bytes()).expect("a part");
    assert_eq!(found.frames.len(), 2);
    assert!(
        found.remarks[0].contains("900 frames, the file has 2 from frame 185 on: a part"),
        "{:?}",
        found.remarks
    );
    assert!(trc::read(whole.as_bytes()).is_err(), "cut short");
}

#[test]
fn a_trc_file_with_other_numbers_of_tabs_between_its_names_is_read() {
    for names in ["A\t\t\t\tB", "A\t\tB", "\tA\t\t\tB"] {
        let text = TRC.replace("A\t\t\tB", names);
        assert_ne!(text, TRC);
        let found = trc::read(text.as_bytes()).expect("a TRC file");
        assert_eq!(
            (found.names.as_slice(), found.remarks.len()),
            (["A".to_owned(), "B".to_owned()].as_slice(), 0)
        );
        assert_eq!(found.frames[1][1], Some([4.0, 5.0, 6.0]));
    }
}

#[test]
fn a_trc_file_with_whole_columns_between_its_names_is_read() {
    let text = "PathFileType\t4\nDataRate\tNumMarkers\tUnits\n100\t3\tmm\nFrame#\tTime\tA\t\t\tB\t\t\tC\n\n\n1\t0\t1\t2\t3\t4\t5\t6\t7\t8\t9\n";
    for between in ["\t".repeat(6), "\t".repeat(9)] {
        let spread = text.replace("A\t\t\tB\t\t\tC", &["A", "B", "C"].join(&between));
        assert_ne!(spread, text);
        assert_eq!(trc::read(spread.as_bytes()), trc::read(text.as_bytes()));
    }
    assert_eq!(trc::read(text.as_bytes()).expect("a TRC file").names, ["A", "B", "C"]);
    // Values in every column are those of unnamed trajectories, too.
    let whole = text.replace("A\t\t\tB\t\t\tC", &["A", "B", "C"].join(&"\t".repeat(6)));
    let whole = whole.replace("\t9\n", &format!("\t9{}\n", "\t10\t11\t12".repeat(3)));
    let found = trc::read(whole.as_bytes()).expect("a TRC file");
    assert_eq!(found.frames[0], [1.0, 7.0, 10.0].map(|x| Some([x, x + 1.0, x + 2.0])));
}

#[test]
fn a_trc_file_with_doubled_tabs_between_its_values_is_read() {
    let doubled = TRC.replace("\n100\t2\tm\n", "\n  100.0\t\t  2\t\t m\n");
    assert_ne!(doubled, TRC);
    assert_eq!(trc::read(doubled.as_bytes()), trc::read(TRC.as_bytes()));
    let missing = TRC.replace("\n100\t2\tm\n", "\n100\t\tm\n");
    let error = trc::read(missing.as_bytes()).expect_err("no number of markers").to_string();
    assert!(error.starts_with("line 3: NumMarkers = ``"), "{error}");
}

#[test]
fn names_of_a_trc_file_without_columns_are_reported_and_not_read() {
    let whole = trc::read(TRC.as_bytes()).expect("a TRC file");
    let named = TRC.replace("A\t\t\tB\n", "A\t\t\tB\t\t\tV_Hip\t\t\tV_Knee\t\t\t\n");
    let empty = named.replace("4\t5\t6\n", "4\t5\t6\t\t\t\t\t\t\t\n");
    for text in [&named, &empty] {
        let found = trc::read(text.as_bytes()).expect("two markers");
        assert_eq!((&found.names, &found.frames), (&whole.names, &whole.frames));
        assert!(found.remarks.join("; ").contains("2 names after the 2 markers"), "{:?}", found.remarks);
    }
    // As many names as markers, of which the second has none.
    let unnamed = TRC.replace("A\t\t\tB\n", "A\t\t\t\t\t\tV_Hip\t\t\t\n");
    let found = trc::read(unnamed.as_bytes()).expect("a marker");
    assert_eq!(found.names, ["A"]);
    assert!(found.remarks.join("; ").contains("1 of 2 trajectories have no name"), "{:?}", found.remarks);
    let full = named.replace("4\t5\t6\n", "4\t5\t6\t7\t8\t9\t1\t2\t3\n");
    let error = trc::read(full.as_bytes()).expect_err("a wrong number").to_string();
    assert!(error.contains("4 marker names, NumMarkers says 2"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(256), failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn damaged_small_recordings_are_read_or_refused(
        places in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in any::<prop::sample::Index>(),
    ) {
        let damaged = |source: &[u8]| {
            let mut bytes = source.to_vec();
            for (at, value) in &places {
                let at = at.index(bytes.len());
                bytes[at] = *value;
            }
            bytes
        };
        let bytes = damaged(&small_c3d());
        let _ = c3d::read(&bytes);
        let _ = c3d::read(&bytes[..cut.index(bytes.len())]);
        let _ = trc::read(&damaged(TRC.as_bytes()));
        let _ = csv::read(&damaged(CSV.as_bytes()), Choices::default());
        let skeleton = ntu_file();
        assert!(ntu::read(skeleton.as_bytes()).is_ok());
        let _ = ntu::read(&damaged(skeleton.as_bytes()));
        let _ = ntu::read(&skeleton.as_bytes()[..cut.index(skeleton.len())]);
        let _ = kinect::read(&damaged("1 0.5 -2e3 ".repeat(20).as_bytes()));
    }
}
