//! From a folder of slices to a depth map by two commands, with a lens by wave optics.

use std::fs;

use farnear_files::{image_file, map};
use farnear_scene::wave::{WaveLens, random_texture};
use ndarray::{Array2, s};

use crate::common::{Folder, fails, farnear, figures, number, succeeds};

const SIZE: [usize; 2] = [160, 128];
const SLICES: usize = 13;
const STEP_MM: f64 = 0.1;
const FAR_MM: f64 = 100.0;
/// Defocus on the image side per slice: 0.6 px of blur.
const STEP_UM: f64 = 29.0;

/// Writes slices `numbers` of a surface, in focus at slice `focus` (from 1) in the middle and 0.3 slices
/// later at the lower border.
fn slices(path: &str, focus: f64, numbers: impl Iterator<Item = usize>, seed: u64) {
    fs::create_dir_all(path).expect("a folder");
    let lens = WaveLens {
        f_number: 4.0,
        pixel_um: 6.0,
        light: vec![[0.54, 1.0]],
        spherical_waves: 0.25,
        astigmatism_waves: 0.0,
    };
    // Spherical aberration is balanced by defocus of as many waves.
    let best_um = -lens.spherical_waves * 8.0 * lens.f_number * lens.f_number * lens.light[0][0];
    let cells = random_texture(true, SIZE[0], SIZE[1], 0.2, seed);
    for number in numbers {
        let away = |y: usize| number as f64 - focus - 0.6 * (y as f64 / SIZE[1] as f64 - 0.5);
        let image = lens.image(&cells, &|y, _| best_um + STEP_UM * away(y));
        let codes = Array2::from_shape_fn((SIZE[1], SIZE[0]), |(y, x)| {
            let mixed = ((y * SIZE[0] + x) * 64 + number + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            // Even over three codes, SD 0.9, about a camera's.
            let noise = 3.0 * ((mixed >> 40) as f32 / (1 << 24) as f32 - 0.5);
            (115.0 * image[(y, x)] + noise).round().clamp(0.0, 255.0) as u16
        });
        let png = image_file::encode_png(codes.view(), 8).expect("a picture");
        fs::write(format!("{path}/{number:02}.png"), png).expect("a file");
    }
}

#[test]
fn two_commands_lead_from_slices_to_depth_of_another_scene() {
    let folder = Folder::new();
    let [target, scene, lens, out] = ["target", "scene", "lens.toml", "depth"].map(|name| folder.text(name));
    slices(&target, 7.2, 1..=SLICES, 3);
    let [step, far] = [STEP_MM, FAR_MM].map(|value| value.to_string());
    let arguments =
        ["calibrate", "stack", &target, "--step-mm", &step, "--far-mm", &far, "--out", &lens, "--json"];
    let found = figures(&mut farnear(&arguments));
    assert_eq!(found["verdict"].as_str(), Some("good"), "{found}");
    assert_eq!((number(&found, "slices"), number(&found, "bin")), (SLICES as f64, 1.0));
    assert!((number(&found, "slope") - 1.0).abs() < 0.05, "{found}");
    assert!(number(&found, "within_three") > 0.97 && number(&found, "fill") > 0.95, "{found}");
    // 0.6 px of blur per slice, and the lens has a floor.
    let pair_step = number(&found, "pair_step") as usize;
    assert!((3..=6).contains(&pair_step), "{found}");
    // The printed command measures the target, whose middle both images must not show alike.
    let next = found["next"].as_str().expect("a command");
    let (_, command) = next.split_once("farnear ").expect("a command");
    let words: Vec<&str> = command.split_whitespace().collect();
    let (_, stderr) = succeeds(farnear(&words).args(["--out", &folder.text("next")]));
    assert!(!stderr.contains("noise alone"), "{next}: {stderr}");
    // Another texture at another distance.
    let focus = 5.0 + 0.6 * pair_step as f64;
    slices(&scene, focus, [5, 5 + pair_step].into_iter(), 4);
    let [far_image, near_image] = [5, 5 + pair_step].map(|number| format!("{scene}/{number:02}.png"));
    let depth = ["depth", &far_image, &near_image, "--optics", &lens, "--out", &out, "--json"];
    let measured = figures(&mut farnear(&depth));
    assert!(number(&measured, "valid_fraction") > 0.9, "{measured}");
    let depth_mm = map::read(format!("{out}/depth.npy").as_ref()).expect("a map");
    let [upper, lower] = [s![12..40, 12..SIZE[0] - 12], s![SIZE[1] - 40..SIZE[1] - 12, 12..SIZE[0] - 12]]
        .map(|part| {
            let part = depth_mm.slice(part);
            let valid: Vec<f64> = part.iter().filter(|d| d.is_finite()).map(|d| f64::from(*d)).collect();
            valid.iter().sum::<f64>() / valid.len() as f64
        });
    // The surface's middle, and its slope between the parts. The response is within 0.02 of a pair's range.
    let expected = FAR_MM - STEP_MM * 0.6 * pair_step as f64;
    let tolerance = 0.04 * STEP_MM * pair_step as f64;
    assert!((0.5 * (upper + lower) - expected).abs() < tolerance, "{upper} {lower} {expected}");
    assert!(upper - lower > 0.2 * STEP_MM, "later in focus is nearer: {upper} {lower}");
}

#[test]
fn a_target_that_is_not_flat_is_refused_with_its_spread() {
    let folder = Folder::new();
    let [target, other] = ["target", "other"].map(|name| folder.text(name));
    slices(&target, 5.0, 1..=SLICES, 3);
    slices(&other, 9.0, 1..=SLICES, 3);
    // A checkerboard of both distances.
    for number in 1..=SLICES {
        let path = |folder: &str| format!("{folder}/{number:02}.png");
        let [left, right] = [&target, &other].map(|folder| image_file::read_grey(path(folder).as_ref()));
        let [left, right] = [left, right].map(|image| image.expect("a picture").pixels);
        let block = 32;
        let mixed = Array2::from_shape_fn(left.dim(), |(y, x)| {
            let from = if (x / block + y / block) % 2 == 0 { &left } else { &right };
            (255.0 * from[(y, x)]).round() as u16
        });
        let png = image_file::encode_png(mixed.view(), 8).expect("a picture");
        fs::write(path(&target), png).expect("a file");
    }
    let lens = folder.text("lens.toml");
    let arguments = ["calibrate", "stack", &target, "--step-mm", "0.1", "--out", &lens];
    fails(&mut farnear(&arguments), 2, &["not flat", "slices", "flat, textured target"]);
    assert!(!folder.path("lens.toml").exists());
}

#[test]
fn the_pages_of_a_tiff_tell_their_step_and_give_the_same_lens() {
    use tiff::{
        encoder::{TiffEncoder, colortype::Gray8},
        tags::Tag,
    };

    let folder = Folder::new();
    let [target, pages, lens, other, plot] =
        ["target", "stack.tif", "lens.toml", "other.toml", "lens.svg"].map(|name| folder.text(name));
    slices(&target, 7.2, 1..=SLICES, 3);
    let mut file = TiffEncoder::new(fs::File::create(&pages).expect("a file")).expect("a TIFF");
    for number in 1..=SLICES {
        let path = format!("{target}/{number:02}.png");
        let grey = image_file::read_grey(path.as_ref()).expect("a picture").pixels;
        let codes: Vec<u8> = grey.iter().map(|value| (255.0 * value).round() as u8).collect();
        let mut page = file.new_image::<Gray8>(SIZE[0] as u32, SIZE[1] as u32).expect("a page");
        if number == 1 {
            let about =
                format!("ImageJ=1.53t\nimages={SLICES}\nslices={SLICES}\nunit=mm\nspacing={STEP_MM}\n");
            page.encoder().write_tag(Tag::ImageDescription, &*about).expect("a tag");
        }
        page.write_data(&codes).expect("pixels");
    }
    let of_pages =
        figures(&mut farnear(&["calibrate", "stack", &pages, "--plot", &plot, "--out", &lens, "--json"]));
    assert_eq!(of_pages["verdict"].as_str(), Some("good"), "{of_pages}");
    assert!(of_pages["next"].as_str().is_some_and(|next| next.contains("wrong without a warning")));
    let step = STEP_MM.to_string();
    figures(&mut farnear(&["calibrate", "stack", &target, "--step-mm", &step, "--out", &other, "--json"]));
    let read = |path: &str| fs::read_to_string(path).expect("a lens");
    assert_eq!(read(&lens), read(&other));
    assert!(read(&plot).contains("Held-out errors"));
    let without = ["calibrate", "stack", &target, "--out", &other];
    fails(&mut farnear(&without), 2, &["step-mm", "neither metadata nor names"]);
    let below = ["calibrate", "stack", &target, "--step-mm", "-0.1", "--out", &other];
    let error = fails(&mut farnear(&below), 2, &["step-mm -0.1: expected a positive number", "--near-first"]);
    assert!(!error.contains("calibrating"), "{error}");
}
