//! The five detectors on synthetic scenes. Limits are half a point from the results.

use farnear_shadow::detectors::{Detector, Images, Method};
use farnear_shadow::score::ShadowScore;
use farnear_shadow::synthetic::{
    pictures::{Pictures, colour_in},
    scene::{Kind, Scene, scene},
};
use ndarray::Array2;
use std::sync::LazyLock;

static SCENES: LazyLock<Vec<(Scene, Pictures)>> = LazyLock::new(|| {
    let made = |seed| {
        let scene = scene(Kind::Standard, seed);
        let pictures = colour_in(scene.truth().view(), seed);
        (scene, pictures)
    };
    (0..10).map(made).collect()
});

/// Score over the scenes; the foreground is body and shadow.
fn score(method: Method) -> ShadowScore {
    let mut total = ShadowScore::default();
    let mut detector = Detector::new(method);
    for (scene, pictures) in SCENES.iter() {
        let (truth, foreground) = (scene.truth(), scene.silhouette.view());
        let images = Images::new(pictures.frame.view(), pictures.background.view(), foreground);
        let shadow = detector.detect(&images.expect("one shape"));
        let left = Array2::from_shape_fn(truth.dim(), |at| foreground[at] && !shadow[at]);
        total.add(Some(foreground), left.view(), truth.view()).expect("one shape");
    }
    total
}

#[track_caller]
fn reaches(method: Method, removed: f64, wrongly: f64) {
    let score = score(method);
    let percent = |value: Option<f64>| value.expect("every scene has a subject and a shadow");
    let found = (percent(score.removed_percent()), percent(score.wrongly_removed_percent()));
    println!(
        "{}: {:.1} % of the shadow removed, {:.1} % of the subject wrongly, intersection over union {:.1} %",
        method,
        found.0,
        found.1,
        percent(score.iou_percent())
    );
    assert!(found.0 >= removed && found.1 <= wrongly, "{found:?}");
}

#[test]
fn chromaticity() {
    reaches(Method::Chromaticity, 89.5, 7.6);
}

#[test]
fn physical() {
    reaches(Method::Physical, 99.4, 7.6);
}

#[test]
fn geometry() {
    reaches(Method::Geometry, 95.4, 9.7);
}

#[test]
fn small_region_texture() {
    reaches(Method::SmallRegionTexture, 87.1, 0.5);
}

#[test]
fn large_region_texture() {
    reaches(Method::LargeRegionTexture, 93.7, 2.0);
}
