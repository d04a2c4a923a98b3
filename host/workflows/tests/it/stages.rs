//! Pictures of shadow removal.

use std::{fs, path::Path};

use farnear_shadow::Method;
use farnear_silhouettes::mask::Mask;
use farnear_workflows::{
    Context, WorkflowError,
    shadow::removal::{ShadowRemoveRequest, remove_from_masks},
};
use image::{GrayImage, Luma, RgbImage};

const CAMERA: &str = "[camera]\nheight_m = 1.5\nazimuth_deg = 0\nfocal_length_mm = 4.0\npixel_um = 6.0\nwidth_px = 640\nheight_px = 480\n[subject]\ndistance_m = 6.0\n";

fn save(path: &Path, mask: &Mask) {
    fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
    let level = |x, y| Luma([if mask[[y as usize, x as usize]] { 255 } else { 0 }]);
    GrayImage::from_fn(640, 480, level).save(path).expect("a picture");
}

/// A person 60 px wide with a shadow to the right, cast by a lamp to the left.
fn person(y: usize, x: usize) -> bool {
    (180..360).contains(&y) && (290..350).contains(&x)
}

fn settings(folder: &Path) -> ShadowRemoveRequest {
    let shadow = |y: usize, x: usize| (355..365).contains(&y) && (320..460).contains(&x);
    save(
        &folder.join("masks/a1.png"),
        &Mask::from_shape_fn((480, 640), |(y, x)| person(y, x) || shadow(y, x)),
    );
    save(&folder.join("masks/a2.png"), &Mask::default((480, 640)));
    fs::write(folder.join("camera.toml"), CAMERA).expect("a file");
    ShadowRemoveRequest {
        masks: folder.join("masks"),
        camera: folder.join("camera.toml"),
        lamp: Some("-3,6,3".into()),
        out: folder.join("out"),
        stages: Some(folder.join("stages")),
        ..ShadowRemoveRequest::default()
    }
}

fn count(picture: &RgbImage, is: impl Fn([u8; 3]) -> bool) -> usize {
    picture.pixels().filter(|pixel| is(pixel.0)).count()
}

#[test]
fn every_mask_has_a_picture_of_its_stages() {
    let root = tempfile::tempdir().expect("a folder");
    let hybrid = settings(root.path());
    remove_from_masks(&hybrid, &Context::unattended()).expect("cut");
    let read = |name: &str| image::open(root.path().join(name)).expect("a picture").into_rgb8();
    let (explained, nobody) = (read("stages/a1.png"), read("stages/a2.png"));
    let red = |[r, g, b]: [u8; 3]| r > 150 && g < 90 && b < 90;
    let blue = |[r, g, b]: [u8; 3]| b > 200 && r < 120 && g < 200;
    // Removed pixels are red: as many in the picture as in the mask.
    let lost = |out: &str| {
        let [before, after] = [read("masks/a1.png"), read(out)].map(|p| count(&p, |[r, ..]| r > 127));
        before - after
    };
    assert!(lost("out/a1.png") > 600);
    assert!(
        count(&explained, red) >= lost("out/a1.png"),
        "{} {}",
        count(&explained, red),
        lost("out/a1.png")
    );
    assert!(count(&explained, blue) > 100, "the edge is drawn");
    // An empty mask gives one panel, a person five: mask, edge, direction, explanation, cut.
    assert_eq!((count(&nobody, red), count(&nobody, blue)), (0, 0));
    let panels_of = |picture: &RgbImage| picture.width() / 210;
    assert!(panels_of(&explained) >= 5 && nobody.width() < 700, "{} {}", explained.width(), nobody.width());

    // The published method has no explanation: one panel less for the same mask.
    let printed = ShadowRemoveRequest {
        method: Method::Thesis,
        out: root.path().join("printed"),
        stages: Some(root.path().join("printed-stages")),
        ..hybrid.clone()
    };
    remove_from_masks(&printed, &Context::unattended()).expect("cut");
    assert!(read("printed-stages/a1.png").width() < explained.width());

    let inside = ShadowRemoveRequest {
        out: root.path().join("more"),
        stages: Some(root.path().join("more/stages")),
        ..hybrid
    };
    let error = remove_from_masks(&inside, &Context::unattended()).expect_err("one inside of the other");
    assert!(matches!(error, WorkflowError::Parameter { name: "stages", .. }), "{error}");
    assert!(!root.path().join("more").exists());
}
