//! The standard deviation of a map.

use farnear_files::map;
use ndarray::Array2;

use crate::common::{Folder, fails, farnear, figures, number, render, rig_optics, succeeds};

fn read(folder: &Folder, name: &str) -> Array2<f32> {
    map::read(&folder.path(name)).expect("a map")
}

#[test]
fn the_predicted_deviation_is_that_of_the_errors() {
    let folder = Folder::new();
    let [out, far, near, map, other] =
        ["pair", "pair/far.png", "pair/near.png", "map", "other"].map(|name| folder.text(name));
    // Of 640x480 px: a window is 21 px wide, and too few would leave the ratio to chance.
    succeeds(&mut farnear(&["render", "--scene", "plane:905", "--optics", rig_optics(), "--out", &out]));
    let pair = ["depth", &far, &near, "--optics", rig_optics(), "--json", "--out"];
    let camera = "--uncertainty=camera:full_well_e=20000,read_noise_e=12";
    let found = figures(farnear(&pair).args([&map, camera]));
    let of_camera = number(&found["uncertainty"], "median_sd_mm");
    let estimated = figures(farnear(&pair).args([&other, "--uncertainty"]));
    let of_pair = number(&estimated["uncertainty"], "median_sd_mm");
    // The camera's figures are the renderer's; the estimate takes a little of the model's error for noise.
    assert!((0.9..1.2).contains(&(of_pair / of_camera)), "{of_pair} {of_camera}");
    let [depth, deviation] = ["map/depth.npy", "map/uncertainty.npy"].map(|name| read(&folder, name));
    let (mut ratios, mut count) = (0.0, 0.0);
    for y in 16..depth.nrows() - 16 {
        for x in 16..depth.ncols() - 16 {
            ratios += f64::from((depth[(y, x)] - 905.0) / deviation[(y, x)]).powi(2);
            count += 1.0;
        }
    }
    // Errors over their standard deviation: 1, within the promise for predicted over measured, 0.8 to 1.25.
    let ratio = f64::sqrt(ratios / count);
    assert!((0.8..1.25).contains(&ratio), "{ratio}");
    let sidecar = std::fs::read_to_string(folder.path("map/depth.toml")).unwrap();
    assert!(sidecar.contains("[uncertainty]") && sidecar.contains("full_well_e=20000"), "{sidecar}");
}

#[test]
fn maps_without_deviation_are_reported() {
    let folder = Folder::new();
    render(&folder, "slant", "pair");
    let [far, near, map] = ["pair/far.png", "pair/near.png", "map"].map(|name| folder.text(name));
    let pair = ["depth", &far, &near, "--out", &map];
    fails(farnear(&pair).args(["--uncertainty", "--method", "subbarao"]), 2, &["uncertainty", "subbarao"]);
    fails(farnear(&pair).arg("--uncertainty=camera:full_well_e=20000"), 2, &["read_noise_e", "both needed"]);
    succeeds(&mut farnear(&pair));
    assert!(!folder.path("map/uncertainty.npy").exists());
}
