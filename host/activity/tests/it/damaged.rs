//! Files of every kind with words damaged, so that readers are reached beyond their first line; and what they let through is used.

use crate::cases;
use farnear_activity::mask::Mask;
use farnear_activity::readers::{self, c3d, csv, kinect, matlab, ntu, recording::Choices, trc};
use farnear_activity::shadow::{CameraFile, Lamp, Light, Method, remove};
use farnear_activity::silhouette::raster::fill_convex;
use farnear_activity::silhouette::template::Template;
use farnear_activity::sun::SunPosition;
use farnear_test_data::damaged;
use proptest::prelude::*;
use std::fmt::Write;

fn ntu_file() -> String {
    let mut text = String::from("3\n");
    for frame in 0..3 {
        text += "1\n72057594037944738 0 0 1 1 0 1 0.1 0.2 2\n25\n";
        for joint in 0..25 {
            let up = 0.07 * f64::from(joint);
            writeln!(text, "0.{frame} {up} 3.1 1 2 3 4 0.1 0.2 0.3 0.4 2").expect("a string");
        }
    }
    text
}

fn kinect_file() -> String {
    let row = |frame: usize| (0..60).map(|i| format!("{}.{frame}", i % 3)).collect::<Vec<_>>().join(" ");
    (0..4).map(row).collect::<Vec<_>>().join("\n")
}

const TRC: &str = "PathFileType\t4\t(X/Y/Z)\twalk.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n100\t100\t2\t2\tmm\t100\t1\t2\nFrame#\tTime\tA\t\t\tB\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n1\t0.0\t1\t2\t3\t4\t5\t6\n2\t0.01\t1\t2\t3\t4\t5\t6\n";
const CSV: &str = "frame,HEAD_x,HEAD_y,HEAD_z,HIP_x,HIP_y,HIP_z\n0,0,0,1700,0,0,900\n1,0,0,1690,0,0,890\n";
const CAMERA: &str = "[camera]\nheight_m = 0.8\nazimuth_deg = 140.0\npitch_deg = 5.0\nfocal_length_mm = 4.0\npixel_um = 60.0\nwidth_px = 64\nheight_px = 48\n\n[subject]\nheight_m = 1.75\nhead_width_m = 0.17\n\n[standard_deviations]\nday = 0.3\nazimuth_deg = 2.0\n";
const TEMPLATE: &str =
    "name = 'doll'\n[[part]]\nname = 'trunk'\nmarkers = ['HEAD', 'HIP']\nthickness_mm = 120.0\n";

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(200), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_texts_are_read_or_refused(
        words in proptest::collection::vec((any::<usize>(), any::<usize>()), 1..6),
        lost in proptest::option::of(any::<usize>()),
    ) {
        let hurt = |text: &str| damaged(text, &words, lost);
        let _ = ntu::read(hurt(&ntu_file()).as_bytes());
        let _ = kinect::read(hurt(&kinect_file()).as_bytes());
        let _ = trc::read(hurt(TRC).as_bytes());
        let _ = csv::read(hurt(CSV).as_bytes());
        let _ = Template::parse(&hurt(TEMPLATE));
        // Whatever is read is also turned upright and its units guessed.
        for (text, ending) in [(TRC.to_owned(), "trc"), (CSV.to_owned(), "csv"), (ntu_file(), "skeleton"), (kinect_file(), "txt")] {
            let _ = readers::read(hurt(&text).as_bytes(), ending, Choices::default());
        }
    }

    #[test]
    fn binary_files_with_their_own_beginning_are_read_or_refused(mut bytes in proptest::collection::vec(any::<u8>(), 600..3000), blocks in 0..6_u8) {
        // C3D: parameters in block 2, the key 0x50, a processor; MATLAB 5: 124 bytes of text, version, byte order.
        bytes[..4].copy_from_slice(&[2, 0x50, blocks, 0]);
        bytes[512..516].copy_from_slice(&[1, 0x50, blocks, 84]);
        let _ = c3d::read(&bytes);
        bytes[..116].fill(b' ');
        bytes[124..128].copy_from_slice(&[0, 1, b'I', b'M']);
        let _ = matlab::read(&bytes);
    }

    #[test]
    fn any_camera_and_any_silhouette_lose_their_shadow_or_are_refused(
        words in proptest::collection::vec((any::<usize>(), any::<usize>()), 0..3),
        places in proptest::collection::vec((-20.0..90.0_f64, -20.0..70.0_f64), 3..12),
        (elevation_deg, azimuth_deg) in (-10.0..90.0_f64, 0.0..360.0_f64),
        lamp in (-50.0..50.0_f64, -50.0..50.0_f64, 0.0..30.0_f64),
        sd in prop_oneof![0.0..1.0_f64, Just(f64::NAN), Just(f64::INFINITY)],
    ) {
        let Ok(file) = CameraFile::parse(&damaged(CAMERA, &words, None)) else { return Ok(()) };
        let mut mask = Mask::default((48, 64));
        for corners in places.chunks(3) {
            fill_convex(&mut mask, &corners.iter().map(|&(x, y)| [x, y]).collect::<Vec<_>>());
        }
        let (right_m, ahead_m, up_m) = lamp;
        let lights: [Light; 3] = [
            SunPosition { elevation_deg, azimuth_deg }.into(),
            Light::Lamp(Lamp { right_m, ahead_m, up_m }),
            Light::Direction { eta_rad: azimuth_deg.to_radians() },
        ];
        for light in lights {
            for method in [Method::Hybrid, Method::Thesis] {
                if let Ok((left, report)) = remove(&mask, &file, light, sd, method) {
                    // Nothing is added, and the share told is the one taken.
                    prop_assert!(left.iter().zip(&mask).all(|(&left, &set)| set || !left));
                    prop_assert!((0.0..=1.0).contains(&report.removed_fraction));
                }
            }
        }
    }
}
