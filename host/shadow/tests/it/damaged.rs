//! Damaged camera files and random silhouettes.

use farnear_shadow::sun::SunPosition;
use farnear_shadow::{CameraFile, Lamp, Light, Method, remove};
use farnear_silhouettes::mask::Mask;
use farnear_silhouettes::silhouette::raster::fill_convex;
use farnear_test_data::{cases, damaged};
use proptest::prelude::*;

const CAMERA: &str = "[camera]\nheight_m = 0.8\nazimuth_deg = 140.0\npitch_deg = 5.0\nfocal_length_mm = 4.0\npixel_um = 60.0\nwidth_px = 64\nheight_px = 48\n\n[subject]\nheight_m = 1.75\nhead_width_m = 0.17\n\n[standard_deviations]\nday = 0.3\nazimuth_deg = 2.0\n";

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(200), failure_persistence: None, ..ProptestConfig::default() })]

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
                    // Nothing is added, and the reported share equals the removed one.
                    prop_assert!(left.iter().zip(&mask).all(|(&left, &set)| set || !left));
                    prop_assert!((0.0..=1.0).contains(&report.removed_fraction));
                }
            }
        }
    }
}
