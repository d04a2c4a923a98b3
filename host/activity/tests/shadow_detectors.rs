//! The five image-based detectors on made scenes with known shadow. The floors lie some points below what they reach, so
//! that a broken detector shows and a retuned one need not.

use farnear_activity::{
    shadow_detectors::{Method, made_scene},
    synthetic::scene::Kind,
};

/// At least `removed` % of the shadow goes and at most `wrongly` % of the subject.
#[track_caller]
fn reaches(method: Method, removed: f64, wrongly: f64) {
    let score = made_scene::score(method, Kind::Standard, 0..10);
    let percent = |value: Option<f64>| value.expect("every scene has a subject and a shadow");
    let found = (percent(score.removed_percent()), percent(score.wrongly_removed_percent()));
    println!(
        "{}: {:.1} % of the shadow removed, {:.1} % of the subject wrongly, intersection over union {:.1} %",
        method.name(),
        found.0,
        found.1,
        percent(score.iou_percent())
    );
    assert!(found.0 >= removed && found.1 <= wrongly, "{found:?}");
}

#[test]
fn chromaticity() {
    reaches(Method::Chromaticity, 75.0, 15.0);
}

#[test]
fn physical() {
    reaches(Method::Physical, 95.0, 8.0);
}

#[test]
fn geometry() {
    reaches(Method::Geometry, 75.0, 15.0);
}

#[test]
fn small_region_texture() {
    reaches(Method::SmallRegionTexture, 80.0, 4.0);
}

#[test]
fn large_region_texture() {
    reaches(Method::LargeRegionTexture, 80.0, 5.0);
}
