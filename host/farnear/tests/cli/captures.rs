//! Measurements in a stored capture, and its report.

use std::{fs, path::Path};

use farnear_files::{image_file::encode_png, npy};
use ndarray::Array2;

use crate::common::{Folder, fails, farnear, figures, number, render, rig_optics, succeeds};

const RECORD: &str = include_str!("../../../workflows/src/sessions/capture.toml");

/// A capture of a plane with a slope of 0.05 mm per column.
fn capture(folder: &Path, further_mm: f32) {
    fs::create_dir_all(folder).unwrap();
    fs::write(folder.join("capture.toml"), RECORD).unwrap();
    let image = encode_png(Array2::<u16>::from_elem((40, 60), 9).view(), 8).unwrap();
    fs::write(folder.join("far.png"), &image).unwrap();
    fs::write(folder.join("near.png"), &image).unwrap();
    let depth = Array2::from_shape_fn((40, 60), |(_, x)| 900.0 + further_mm + 0.05 * x as f32);
    fs::write(folder.join("depth.npy"), npy::write(depth.view())).unwrap();
}

#[test]
fn a_slant_is_measured_from_the_command_line() {
    let folder = Folder::new();
    let [first, second] = [("a", 0.0), ("b", 2.0)].map(|(name, further_mm)| {
        capture(&folder.path(name), further_mm);
        folder.text(name)
    });
    let region = figures(&mut farnear(&["measure", "region", &first, "--region", "0,0,11,40", "--json"]));
    assert!((number(&region, "mean_mm") - 900.25).abs() < 1e-3, "{region}");
    assert_eq!(number(&region, "fill_rate"), 1.0);
    let plane = figures(&mut farnear(&["measure", "plane", &first, "--json"]));
    // A pixel covers 7.4 um * 17 = 0.126 mm at 900 mm.
    assert!((number(&plane, "slope_x") - 0.397).abs() < 2e-3, "{plane}");
    let profile =
        figures(&mut farnear(&["measure", "profile", &first, "--from", "0,9", "--to", "59,9", "--json"]));
    assert_eq!(profile["points"].as_array().map(Vec::len), Some(60));
    let difference = figures(&mut farnear(&["measure", "difference", &first, &second, "--json"]));
    assert!((number(&difference, "mean_mm") - 2.0).abs() < 1e-3, "{difference}");
    farnear(&["measure", "region", &first, "--region", "50,0,11,1"]).assert().code(2);
    farnear(&["measure", "profile", &first, "--from", "1", "--to", "2,2"]).assert().code(2);
}

#[test]
fn maps_of_every_kind_are_measured() {
    let folder = Folder::new();
    // A map of another program: no record, no optics, 0 for holes.
    let depth = Array2::from_shape_fn((40, 60), |(y, _)| if y == 0 { 0.0 } else { 500.0_f32 });
    let bare = folder.file("bare.npy", npy::write(depth.view()));
    let tiff = folder.file("bare.tiff", farnear_files::map::tiff(depth.view()).unwrap());
    for map in [&bare, &tiff] {
        let region = figures(&mut farnear(&["measure", "region", map, "--json"]));
        assert_eq!((number(&region, "mean_mm"), number(&region, "fill_rate")), (500.0, 0.975));
        assert!(region["plane"]["slope_y_mm_per_px"].is_number(), "{region}");
    }
    let farther = folder.file("farther.npy", npy::write(depth.mapv(|z| z + 2.0).view()));
    let difference = figures(&mut farnear(&["measure", "difference", &bare, &farther, "--json"]));
    assert_eq!((number(&difference, "pixels"), number(&difference, "mean_mm")), (2340.0, 2.0));
    // A result with only the coded picture or the TIFF.
    render(&folder, "slant", "pair");
    let [far, near] = ["pair/far.png", "pair/near.png"].map(|name| folder.text(name));
    let mut means = Vec::new();
    for write in ["npy", "tiff", "png"] {
        let out = folder.text(write);
        let depth = ["depth", &far, &near, "--optics", rig_optics(), "--out", &out, "--write", write];
        succeeds(&mut farnear(&depth));
        let region = figures(&mut farnear(&["measure", "region", &out, "--json"]));
        means.push(number(&region, "mean_mm"));
        let page = folder.text(&format!("{write}.html"));
        succeeds(&mut farnear(&["report", &out, "--out", &page]));
    }
    assert!((means[0] - means[1]).abs() < 1e-9 && (means[0] - means[2]).abs() < 1e-3, "{means:?}");
    fails(
        &mut farnear(&["report", &folder.text("pair/.."), "--out", &folder.text("x.html")]),
        2,
        &["record"],
    );
}

#[test]
fn a_capture_becomes_a_page() {
    let folder = Folder::new();
    capture(&folder.path("pair"), 0.0);
    let out = folder.text("pair.html");
    succeeds(&mut farnear(&["report", &folder.text("pair"), "--out", &out]));
    let page = fs::read_to_string(&out).unwrap();
    assert!(page.starts_with("<!doctype html>") && page.contains("<h1>pair</h1>"));
    let absent = folder.text("absent");
    farnear(&["report", &absent, "--out", &folder.text("none.html")]).assert().code(1);
    assert!(!folder.path("none.html").exists());
}
