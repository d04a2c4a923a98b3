use super::*;
use crate::context::Heard;

const CAMERA: &str = "[camera]\nheight_m = 1.5\nazimuth_deg = 0\nfocal_length_mm = 4.0\npixel_um = 6.0\n";

/// Masks `1.png`, `2.png`, ... of a rectangle each: its first row and column, and the last ones plus 1.
fn request(folder: &Path, camera: &str, people: &[[usize; 4]]) -> ShadowRemoveRequest {
    let masks = folder.join("masks");
    fs::create_dir(&masks).unwrap();
    for (number, [top, left, bottom, right]) in (1..).zip(people) {
        let is_set = |(y, x): (usize, usize)| (*top..*bottom).contains(&y) && (*left..*right).contains(&x);
        let png = masks::png(&Mask::from_shape_fn((480, 640), is_set)).unwrap();
        fs::write(masks.join(format!("{number}.png")), png).unwrap();
    }
    fs::write(folder.join("camera.toml"), camera).unwrap();
    ShadowRemoveRequest {
        masks,
        camera: folder.join("camera.toml"),
        out: folder.join("out"),
        ..ShadowRemoveRequest::default()
    }
}

fn flags(folder: &Path, frame: usize) -> String {
    let index: toml::Table = fs::read_to_string(folder.join("out/shadow.toml")).unwrap().parse().unwrap();
    index["frame"][frame]["flags"].to_string()
}

#[test]
fn a_sun_without_place_or_time_names_what_is_missing() {
    let noon = || Some("2014-06-23T11:30:00Z".to_string());
    let sun = |lat, lon, time| ShadowRemoveRequest { lat, lon, time, ..ShadowRemoveRequest::default() };
    for (request, missing) in [
        (sun(Some(52.38), None, noon()), "sun lon missing: expected lat, lon and time"),
        (sun(None, Some(-1.56), noon()), "sun lat missing"),
        (sun(Some(52.38), None, None), "sun lon and time missing"),
        (ShadowRemoveRequest { lamp: Some("0,6,3".into()), ..sun(Some(52.38), None, None) }, "one of"),
    ] {
        let error = request.check().unwrap_err().to_string();
        assert!(error.contains(missing), "{error}");
    }
}

#[test]
fn a_sun_that_sets_is_flagged_after_the_first_mask() {
    let folder = tempfile::tempdir().unwrap();
    let request = ShadowRemoveRequest {
        lat: Some(52.38),
        lon: Some(-1.56),
        // Elevations of 5.0, 3.3 and 1.6 degrees.
        time: Some("2014-12-21T15:00:00Z".into()),
        rate_hz: Some(1e-3),
        ..request(folder.path(), CAMERA, &[[180, 290, 360, 350]; 3])
    };
    let figures = remove_from_masks(&request, &Context::unattended()).unwrap();
    assert!(
        figures.cut + figures.unchanged == 3 && figures.unchanged > 0 && figures.empty == 0,
        "{figures:?}"
    );
    assert!(flags(folder.path(), 2).contains("low-sun"), "{}", flags(folder.path(), 2));
    let [before, after] =
        ["masks", "out"].map(|name| masks::read_all(&folder.path().join(name)).unwrap().pixels());
    assert_eq!(before[2], after[2]);
    let late = ShadowRemoveRequest {
        time: Some("2014-12-21T15:33:20Z".into()),
        out: folder.path().join("late"),
        ..request
    };
    let error = remove_from_masks(&late, &Context::unattended()).unwrap_err().to_string();
    assert!(error.starts_with("the sun stands at 1."), "{error}");
}

#[test]
fn a_steep_camera_is_reported() {
    for (pitch_deg, is_steep) in [(45.0, false), (65.0, true)] {
        let folder = tempfile::tempdir().unwrap();
        let camera = format!("{CAMERA}pitch_deg = {pitch_deg:?}\n");
        let request = ShadowRemoveRequest {
            shadow_direction: Some(0.0),
            ..request(folder.path(), &camera, &[[180, 290, 360, 350]])
        };
        let heard = Heard::default();
        remove_from_masks(&request, &heard.context()).unwrap();
        let warned = heard.warnings().iter().any(|text| text.contains(&format!("down by {pitch_deg} deg")));
        assert_eq!(warned, is_steep, "{:?}", heard.warnings());
    }
}

#[test]
fn a_person_who_is_too_near_is_flagged_after_the_first_mask() {
    // The camera looks up: who fills the picture is below and behind it.
    let camera = format!("{CAMERA}pitch_deg = -20.0\n");
    let direction = |folder: &Path, people: &[[usize; 4]]| ShadowRemoveRequest {
        shadow_direction: Some(10.0),
        ..request(folder, &camera, people)
    };
    let (far, near) = ([180, 290, 360, 350], [100, 20, 460, 620]);
    let folder = tempfile::tempdir().unwrap();
    let figures = remove_from_masks(&direction(folder.path(), &[far, near]), &Context::unattended()).unwrap();
    assert_eq!((figures.cut, figures.unchanged, figures.empty), (1, 1, 0));
    assert!(flags(folder.path(), 1).contains("no-distance"), "{}", flags(folder.path(), 1));
    let folder = tempfile::tempdir().unwrap();
    let error = remove_from_masks(&direction(folder.path(), &[near, far]), &Context::unattended());
    let error = error.unwrap_err().to_string();
    assert!(error.contains("distance"), "{error}");
}

#[test]
fn the_uncertainty_is_that_of_the_fitted_person() {
    use farnear_shadow::synthetic::scene::{Kind, scene};
    let drawn = scene(Kind::Bending, 3);
    let place = farnear_shadow::sun::Place { latitude_deg: 52.38, longitude_deg: -1.56 };
    let time = "2014-06-23T10:30:00Z".parse().unwrap();
    let moment = Moment { place, time };
    let work = Work {
        light: LightSource::Sun { moment, rate_hz: None },
        method: Method::Hybrid,
        camera: &drawn.camera,
        chooser: None,
        stages: None,
        cut_seconds: 0.0,
        uncut: [0; 2],
    };
    let (_, report, sure) = work.cut(&drawn.silhouette, drawn.sun.into(), Some(moment)).unwrap();
    let fitted = propagate(&drawn.camera, time, place, Model::Psa, report.subject).unwrap();
    assert_eq!(sure, Some(fitted));
    assert_ne!(report.subject, subject_of(&drawn.silhouette, &drawn.camera).unwrap());
}

#[test]
fn a_light_from_the_opposite_side_is_flagged_as_a_poor_fit() {
    use farnear_shadow::{
        sun::SunPosition,
        synthetic::scene::{Kind, scene},
    };
    const SCENES: u64 = 20;
    let is_poor = |seed: u64, light: fn(SunPosition) -> Light| {
        let drawn = scene(Kind::Standard, seed);
        let light = light(drawn.sun);
        let (_, report) = remove(&drawn.silhouette, &drawn.camera, light, 0.0, Method::Hybrid).unwrap();
        doubts(&report, light, Method::Hybrid).contains(&POOR_FIT)
    };
    let poor = |light: fn(SunPosition) -> Light| (0..SCENES).filter(|seed| is_poor(*seed, light)).count();
    let opposite = |sun: SunPosition| {
        Light::Sun(SunPosition { azimuth_deg: (sun.azimuth_deg + 180.0).rem_euclid(360.0), ..sun })
    };
    let (right, wrong) = (poor(Light::Sun), poor(opposite));
    assert!(right <= 1 && wrong >= 15, "{right} and {wrong} of {SCENES}");
    // A direction needs no fit.
    assert_eq!(poor(|_| Light::Direction { eta_rad: 0.3 }), 0);
}
