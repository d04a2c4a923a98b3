//! From optics and images to figures and maps.

use std::{fs, path::Path};

use farnear_files::map;
use ndarray::{Array2, s};

use crate::common::{Folder, farnear, figures, number, render, rig_optics, succeeds};

#[test]
fn optics_of_the_rig_are_known_to_a_micrometre() {
    let range = figures(&mut farnear(&["optics", "--optics", rig_optics(), "--json"]));
    // Li 2014, section 4.2.2: thin lens of 50 mm at f/3.90625, far focus at 933 mm, 2.703 px of 7.4 um.
    for (key, expected, tolerance) in [
        ("far_mm", 933.0, 1e-3),
        ("sensor_far_mm", 52.8313, 1e-3),
        ("sensor_travel_mm", 0.15627, 1e-3),
        ("sensor_near_mm", 52.9875, 1e-3),
        // Known to two decimals.
        ("near_mm", 886.81, 6e-3),
        ("alpha0_mm", 909.29, 6e-3),
    ] {
        let value = number(&range, key);
        assert!((value - expected).abs() <= tolerance, "{key} = {value}, expected {expected}");
    }
}

#[test]
fn a_rendered_pair_gives_back_its_depth() {
    let folder = Folder::new();
    let scene = folder.text("scene");
    let noisy = ["--scene", "staircase", "--psf", "gaussian:k=0.4578", "--noise", "8bit", "--seed", "1"];
    succeeds(farnear(&["render", "--optics", rig_optics(), "--out", &scene]).args(noisy));
    assert_eq!(
        folder.listing(),
        ["scene", "scene/far.png", "scene/near.png", "scene/optics.toml", "scene/truth.npy"]
    );
    let [far, near, optics, truth] =
        ["far.png", "near.png", "optics.toml", "truth.npy"].map(|name| format!("{scene}/{name}"));
    let map = folder.text("map");
    let depth = ["depth", &far, &near, "--optics", &optics, "--median-px", "5", "--out", &map, "--json"];
    let found = figures(&mut farnear(&depth));
    assert_eq!((number(&found, "width"), number(&found, "height")), (640.0, 480.0));
    assert!(number(&found, "seconds") > 0.0 && number(&found, "low_texture_fraction") < 0.01, "{found}");
    assert!((887.0..933.0).contains(&number(&found, "median_mm")), "{found}");
    // Millimetres in .npy and in .tiff, and the project's promise: 0.75 mm away from the steps.
    for file in ["depth.npy", "depth.tiff"] {
        let compare = ["compare", &format!("{map}/{file}"), &truth, "--away-from-edges", "8", "--json"];
        let compared = figures(&mut farnear(&compare));
        let rmse_mm = number(&compared, "rmse_mm");
        println!("{file}: {compared}");
        assert!(rmse_mm > 0.0 && rmse_mm < 0.75, "{compared}");
        assert!(
            number(&compared, "mae_mm") < rmse_mm && number(&compared, "bias_mm").abs() < 0.2,
            "{compared}"
        );
    }
    let confidence = read(&folder.path("map/confidence.npy"));
    assert!(confidence.iter().all(|value| (0.0..=1.0).contains(value)));
}

#[test]
fn the_kinds_of_images_give_the_same_depth() {
    let folder = Folder::new();
    render(&folder, "cone", "pair");
    let mut medians = Vec::new();
    for ending in ["png", "pgm", "ppm", "tiff"] {
        let [far, near] = ["far", "near"].map(|name| {
            let bytes = fs::read(folder.path(&format!("pair/{name}.png"))).expect("an image");
            let grey = image::load_from_memory(&bytes).expect("a PNG").into_luma8();
            let path = folder.path(&format!("{name}.{ending}"));
            write_as(&grey, &path, ending);
            path.to_str().expect("a plain name").to_string()
        });
        let out = folder.text(ending);
        let found =
            figures(&mut farnear(&["depth", &far, &near, "--optics", rig_optics(), "--out", &out, "--json"]));
        medians.push(number(&found, "median_mm"));
    }
    // The mean of three equal channels, and other units, round differently: a few pixels choose another window.
    assert!(medians.iter().all(|median| (median - medians[0]).abs() < 0.02), "{medians:?}");
}

fn write_as(grey: &image::GrayImage, path: &Path, ending: &str) {
    match ending {
        "tiff" => {
            let mut file = fs::File::create(path).expect("a writable folder");
            let mut encoder = tiff::encoder::TiffEncoder::new(&mut file).expect("an encoder");
            let (width, height) = grey.dimensions();
            let values: Vec<f32> = grey.iter().map(|value| f32::from(*value) * 3.0).collect();
            encoder
                .write_image::<tiff::encoder::colortype::Gray32Float>(width, height, &values)
                .expect("written");
        }
        "ppm" => image::DynamicImage::from(grey.clone()).into_rgb8().save(path).expect("written"),
        _ => grey.save(path).expect("written"),
    }
}

#[cfg(target_os = "linux")]
#[test]
fn file_names_that_are_not_utf8_are_accepted() {
    use std::os::unix::ffi::OsStrExt;
    let folder = Folder::new();
    let name = folder.path("").join(std::ffi::OsStr::from_bytes(b"pa\xffir"));
    succeeds(
        farnear(&["render", "--optics", rig_optics(), "--width", "64", "--height", "64", "--out"]).arg(&name),
    );
    let out = name.join(std::ffi::OsStr::from_bytes(b"\xfeout"));
    succeeds(
        farnear(&["depth"])
            .args([name.join("far.png"), name.join("near.png")])
            .arg("--optics")
            .arg(name.join("optics.toml"))
            .arg("--out")
            .arg(&out),
    );
    assert!(out.join("depth.npy").is_file());
}

fn read(path: &Path) -> Array2<f32> {
    map::read(path).expect("a map")
}

fn median_and_sd(region: ndarray::ArrayView2<f32>) -> [f64; 2] {
    let mut values: Vec<f64> = region.iter().filter(|v| v.is_finite()).map(|v| f64::from(*v)).collect();
    values.sort_by(f64::total_cmp);
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
    [values[values.len() / 2], variance.sqrt()]
}

/// The pair of Watanabe and Nayar, where it is present.
#[test]
#[cfg_attr(not(shared_data), ignore = "needs the real data next to the repository")]
fn a_real_pair_gives_the_reference_depths() {
    let data = farnear_test_data::path("breakfast");
    let folder = Folder::new();
    succeeds(
        farnear(&["depth", "--window", "7", "--median-px", "5", "--out", &folder.text("out"), "--optics"])
            .arg(data.join("optics.toml"))
            .args([data.join("breakfast_far.png"), data.join("breakfast_near.png")]),
    );
    let map = read(&folder.path("out/depth.npy"));
    // Medians of an independent implementation with the same PSF, design and windows.
    for (name, rows, columns, reference_mm) in [
        ("wall", 20..130, 30..600, 741.0),
        ("toast", 230..400, 70..200, 635.0),
        ("cup", 220..340, 330..450, 638.0),
        ("front of the table", 440..470, 300..600, 623.0),
    ] {
        let [median_mm, sd_mm] = median_and_sd(map.slice(s![rows, columns]));
        println!("{name}: median {median_mm:.1} mm, SD {sd_mm:.1} mm");
        assert!((median_mm - reference_mm).abs() <= 12.0, "{name}: {median_mm} mm");
        assert!(name != "wall" || sd_mm <= 0.02 * median_mm, "{name}: SD {sd_mm} mm");
    }
}
