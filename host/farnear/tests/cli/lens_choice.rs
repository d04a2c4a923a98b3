//! Proposed optics, and whether renders with them keep the promised accuracy.

use crate::common::{Folder, fails, farnear, figures, number, succeeds};

#[test]
fn a_proposal_measures_within_the_error_it_promises() {
    let folder = Folder::new();
    let (file, pair, out) = (folder.text("optics.toml"), folder.text("pair"), folder.text("out"));
    let what = ["optics", "--distance-mm", "300", "--range-mm", "40", "--error-mm", "0.2", "--out", &file];
    let proposed = figures(farnear(&what).arg("--json"));
    assert!((number(&proposed, "far_mm") - 320.0).abs() < 1e-6, "{proposed}");
    assert!((number(&proposed, "near_mm") - 280.0).abs() < 1e-6, "{proposed}");
    let render = ["render", "--scene", "slant", "--optics", &file, "--width", "320", "--height", "240"];
    succeeds(farnear(&render).args(["--out", &pair]));
    let [far, near] = ["far", "near"].map(|name| format!("{pair}/{name}.png"));
    let depth = ["depth", &far, &near, "--optics", &file, "--out", &out];
    succeeds(&mut farnear(&depth));
    let truth = format!("{pair}/truth.npy");
    let found = figures(&mut farnear(&["compare", &out, &truth, "--border", "24", "--json"]));
    let (rmse, expected) = (number(&found, "rmse_mm"), number(&proposed, "expected_error_whitened_mm"));
    println!("expected {expected} mm, measured {rmse} mm");
    assert!(
        rmse < 0.2 && rmse < 2.0 * expected && rmse > 0.3 * expected,
        "{rmse} mm, expected {expected}: {found}"
    );
}

#[test]
fn too_much_blur_is_reported_with_a_remedy() {
    let folder = Folder::new();
    let ordinary = "[lens]\nfocal_length_mm = 50.0\nf_number = 2.0\n[sensor]\npixel_um = 3.9\n[focus]\nfar_mm = 5000.0\nnear_mm = 1000.0\n";
    let file = folder.file("camera.toml", ordinary);
    let (stdout, _) = succeeds(&mut farnear(&["optics", "--optics", &file]));
    assert!(
        stdout.contains("max_blur_px = 136.") && stdout.contains("usable is 2 to 4 px: bin 50 x 50"),
        "{stdout}"
    );
    fails(
        &mut farnear(&["optics", "--distance-mm", "300", "--range-mm", "400"]),
        2,
        &["range-mm", "less than"],
    );
    let far = ["optics", "--distance-mm", "300", "--range-mm", "40", "--error-mm", "0.0001"];
    fails(&mut farnear(&far), 2, &["error-mm", "noise alone"]);
}
