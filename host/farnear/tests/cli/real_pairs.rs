//! Pairs from imperfect cameras.

use std::fs;

use farnear_files::{
    image_file::{encode_png, read_grey},
    map,
};
use ndarray::Array2;

use crate::common::{Folder, fails, farnear, figures, number, render, rig_optics, succeeds};

/// Writes values from 0 to 1 as an 8-bit picture.
fn write(folder: &Folder, name: &str, pixels: &Array2<f32>) -> String {
    let codes = pixels.mapv(|v| (v * 255.0).round().clamp(0.0, 255.0) as u16);
    folder.file(name, encode_png(codes.view(), 8).expect("a picture"))
}

#[test]
fn brightness_and_position_are_corrected_and_reported() {
    let folder = Folder::new();
    render(&folder, "plane:905", "pair");
    let far = folder.text("pair/far.png");
    let near = read_grey(&folder.path("pair/near.png")).expect("the near image").pixels;
    // 8 px to the right and 20 % darker; uncovered pixels have the mean brightness.
    let moved = Array2::from_shape_fn(near.dim(), |(y, x)| 0.8 * if x < 8 { 0.45 } else { near[(y, x - 8)] });
    let moved = write(&folder, "moved.png", &moved);
    let depth = |align: &str, out: &str| {
        let out = folder.text(out);
        let command =
            ["depth", &far, &moved, "--optics", rig_optics(), "--align", align, "--json", "--out", &out];
        figures(&mut farnear(&command))
    };
    let found = depth("auto", "auto");
    assert!((number(&found, "median_mm") - 905.0).abs() < 0.5, "{found}");
    let record = fs::read_to_string(folder.path("auto/depth.toml")).expect("a record");
    for phrase in ["[prepared.aligned]", "[prepared.balanced]", "align = \"auto\"", "[[no_depth]]"] {
        assert!(record.contains(phrase), "{phrase}: {record}");
    }
    let reasons = read_grey(&folder.path("auto/reason.png")).expect("reasons").pixels;
    let map = map::read(&folder.path("auto/depth.npy")).expect("a map");
    for (reason, depth) in reasons.iter().zip(&map) {
        assert_eq!(*reason == 0.0, depth.is_finite());
    }
    // Without alignment the images match nowhere.
    let out = folder.text("none");
    let command = ["depth", &far, &moved, "--optics", rig_optics(), "--align", "none", "--out", &out];
    fails(&mut farnear(&command), 1, &["do not show the same scene", "correlation"]);
}

#[test]
fn a_missing_psf_and_other_units_are_reported() {
    let folder = Folder::new();
    render(&folder, "plane:905", "one");
    let [far, near] = ["one/far.png", "one/near.png"].map(|name| folder.text(name));
    let text = fs::read_to_string(rig_optics()).expect("the optics");
    let bare = folder.file("bare.toml", text.split("[psf]").next().expect("a beginning"));
    let (_, stderr) =
        succeeds(&mut farnear(&["depth", &far, &near, "--optics", &bare, "--out", &folder.text("a")]));
    assert!(stderr.contains("no [psf]") && stderr.contains("pill-box"), "{stderr}");
    let metres = folder.file("metres.toml", text.replace("pixel_um = 7.4", "pixel_um = 0.0074"));
    let (_, stderr) =
        succeeds(&mut farnear(&["depth", &far, &near, "--optics", &metres, "--out", &folder.text("b")]));
    assert!(stderr.contains("pixel_um is 0.0074") && stderr.contains("another unit"), "{stderr}");
}

#[test]
fn windows_and_confidence_are_asked_for() {
    let folder = Folder::new();
    render(&folder, "plane:905", "pair");
    let [far, near] = ["pair/far.png", "pair/near.png"].map(|name| folder.text(name));
    let pair = ["depth", &far, &near, "--optics", rig_optics(), "--json", "--out"];
    let errors = |out: &str, arguments: &[&str]| {
        figures(farnear(&pair).arg(folder.text(out)).args(arguments));
        let measured =
            figures(&mut farnear(&["measure", "plane", &folder.text(&format!("{out}/depth.npy")), "--json"]));
        (number(&measured, "rms_mm"), number(&measured, "z_mm"))
    };
    let (ro, _) = errors("ro", &["--method", "ro"]);
    let (white, depth) = errors("white", &[]);
    // Adaptive windows reduce the noise of a plane by a factor of 2.6 to 3.
    assert!(white < 0.45 * ro && (depth - 905.0).abs() < 0.1, "{white} {ro} {depth}");
    let (wide, _) = errors("wide", &["--method", "ro", "--window", "21"]);
    assert!(wide < 0.7 * ro, "{wide} {ro}");
    let out = folder.text("sure");
    let found = figures(farnear(&pair).arg(&out).args(["--min-confidence", "0.9999"]));
    assert_eq!(number(&found, "valid_fraction"), 0.0);
    fails(farnear(&pair).arg(&out).args(["--min-confidence", "2"]), 2, &["min-confidence", "0 to 1"]);
    fails(farnear(&pair).arg(&out).args(["--window", "8"]), 2, &["adaptive", "odd"]);
    for method in ["favaro", "ro"] {
        let asked = ["--window", "adaptive", "--method", method];
        fails(farnear(&pair).arg(&out).args(asked), 2, &[method, "pixels"]);
    }
}

#[test]
fn a_camera_is_calibrated_and_used() {
    let folder = Folder::new();
    // Far from the middle of the range, where the error of the response does not cancel between the images.
    render(&folder, "plane:928", "pair");
    let response = |y: usize, x: usize| {
        let hash = ((y * 7919 + x * 104_729) as u32 ^ 0x9e37).wrapping_mul(2_654_435_761);
        1.0 + 0.05 * ((hash ^ (hash >> 15)).wrapping_mul(0x2c1b_3c6d) as f32 / 2_147_483_648.0 - 1.0)
    };
    let uneven = |name: &str| {
        let image = read_grey(&folder.path(&format!("pair/{name}"))).expect("an image").pixels;
        let seen = Array2::from_shape_fn(image.dim(), |(y, x)| image[(y, x)] * response(y, x));
        write(&folder, name, &seen)
    };
    let [far, near] = ["far.png", "near.png"].map(uneven);
    let flat = write(&folder, "flat.png", &Array2::from_shape_fn((240, 320), |(y, x)| 0.8 * response(y, x)));
    let camera = folder.text("camera");
    let learned =
        figures(&mut farnear(&["calibrate", "camera", "--flat", &flat, "--out", &camera, "--json"]));
    assert!((1.5..3.5).contains(&number(&learned, "response_sd_percent")), "{learned}");
    let rms = |out: &str, arguments: &[&str]| {
        let out = folder.text(out);
        let pair = ["depth", &far, &near, "--optics", rig_optics(), "--out", &out];
        succeeds(farnear(&pair).args(arguments));
        let measured = figures(&mut farnear(&["measure", "plane", &format!("{out}/depth.npy"), "--json"]));
        number(&measured, "rms_mm")
    };
    let (before, after) = (rms("before", &[]), rms("after", &["--camera-frames", &camera]));
    assert!(after < 0.8 * before, "{after} {before}");
    let absent = folder.text("absent");
    let pair = ["depth", &far, &near, "--optics", rig_optics(), "--out", &absent, "--camera-frames", &absent];
    fails(&mut farnear(&pair), 1, &["absent", "camera's frames"]);
    assert!(!folder.path("absent").exists());
}

#[test]
fn an_aperture_is_given_as_a_picture() {
    let folder = Folder::new();
    let pair = folder.text("pair");
    let scene = ["--scene", "plane:893", "--psf", "ring:inner=0.7", "--width", "200", "--height", "160"];
    succeeds(farnear(&["render", "--optics", rig_optics(), "--out", &pair]).args(scene));
    let [far, near] = ["pair/far.png", "pair/near.png"].map(|name| folder.text(name));
    let rho = |y: usize, x: usize| (y as f64 - 31.5).hypot(x as f64 - 31.5) / 32.0;
    let ring = Array2::from_shape_fn((64, 64), |(y, x)| f32::from((0.7..1.0).contains(&rho(y, x))));
    let ring = write(&folder, "aperture.png", &ring);
    let error = |psf: &str, out: &str| {
        let out = folder.text(out);
        let command = ["depth", &far, &near, "--optics", rig_optics(), "--psf", psf, "--out", &out, "--json"];
        let figures = figures(&mut farnear(&command));
        // A wrong PSF may leave no depth at all.
        figures["median_mm"].as_f64().map_or(f64::INFINITY, |median_mm| (median_mm - 893.0).abs())
    };
    let (of_picture, of_formula, of_disc) =
        (error(&ring, "a"), error("ring:inner=0.7", "b"), error("pillbox", "c"));
    assert!(of_picture < 0.3 && of_formula < 0.3 && of_disc > 1.0, "{of_picture} {of_formula} {of_disc}");
    let record = fs::read_to_string(folder.path("a/depth.toml")).expect("a record");
    assert!(record.contains("model = \"radial\"") && record.contains("rings = ["), "{record}");
    let bar = Array2::from_shape_fn((64, 64), |(y, _)| f32::from(y.abs_diff(32) < 5));
    let bar = write(&folder, "bar.png", &bar);
    let command = ["depth", &far, &near, "--optics", rig_optics(), "--psf", &bar, "--out", &folder.text("d")];
    let (_, stderr) = succeeds(&mut farnear(&command));
    assert!(stderr.contains("are not round"), "{stderr}");
    let command =
        ["depth", &far, &near, "--optics", rig_optics(), "--psf", "airy", "--out", &folder.text("e")];
    fails(&mut farnear(&command), 2, &["unknown PSF \"airy\"", "FILE.png"]);
}

#[test]
fn a_region_is_what_the_whole_map_has_there() {
    let folder = Folder::new();
    render(&folder, "slant", "pair");
    let [far, near] = ["pair/far.png", "pair/near.png"].map(|name| folder.text(name));
    let depth = |more: &[&str], out: &str| {
        let out = folder.text(out);
        let command = ["depth", &far, &near, "--optics", rig_optics(), "--json", "--out", &out];
        figures(farnear(&command).args(more));
        map::read(&folder.path(&format!("{}/depth.npy", out.rsplit('/').next().expect("a name"))))
            .expect("a map")
    };
    let (whole, part) = (depth(&[], "whole"), depth(&["--region", "50,30,48,40"], "part"));
    assert_eq!(part.dim(), (40, 48));
    for ((y, x), depth) in part.indexed_iter() {
        let there = whole[(y + 30, x + 50)];
        assert!(
            (depth - there).abs() < 0.05 || depth.is_nan() || there.is_nan(),
            "({x}, {y}) {depth} {there}"
        );
    }
    assert!(part.iter().filter(|depth| depth.is_finite()).count() > 1800);
    let record = fs::read_to_string(folder.path("part/depth.toml")).expect("a record");
    assert!(record.contains("[part]\nx = 50\ny = 30\n"), "{record}");
    // Mesh and measures keep the whole image's axis: the fitted plane is the same in mm.
    let plane = |name: &str, region: &str| {
        let map = folder.text(&format!("{name}/depth.npy"));
        number(&figures(&mut farnear(&["measure", "plane", &map, "--region", region, "--json"])), "z_mm")
    };
    let (of_part, of_whole) = (plane("part", "0,0,48,40"), plane("whole", "50,30,48,40"));
    assert!((of_part - of_whole).abs() < 0.05, "{of_part} {of_whole}");
    for (region, phrase) in [("0,0,9999,9", "9999x9 at (0, 0)"), ("1,2,3", "column, row, width and height")] {
        let command =
            ["depth", &far, &near, "--optics", rig_optics(), "--region", region, "--out", &folder.text("x")];
        let output = farnear(&command).output().expect("a program");
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && stderr.contains(phrase), "{stderr}");
    }
}
