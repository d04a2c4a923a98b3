//! Scenes from files: a user's height map and texture.

use farnear_files::npy;
use ndarray::Array2;

use crate::common::{Folder, fails, farnear, figures, number, rig_optics, succeeds};

const SIZE: [&str; 4] = ["--width", "200", "--height", "150"];

/// A bump of 30 mm on a wall at 925 mm.
fn bump(folder: &Folder) -> String {
    let depth = Array2::from_shape_fn((60, 80), |(y, x)| {
        let [y, x] = [y as f32 - 30.0, x as f32 - 40.0].map(|d| d / 26.0);
        925.0 - 30.0 * (-x * x - y * y).exp()
    });
    folder.file("bump.npy", npy::write(depth.view()))
}

/// A picture with texture everywhere: two of its pixels per camera pixel.
fn picture(folder: &Folder) -> String {
    let mut state = 1_u32;
    let pixels = (0..400 * 300).map(|_| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        60 + (state >> 25) as u8
    });
    let bytes = b"P5 400 300 255\n".iter().copied().chain(pixels).collect::<Vec<u8>>();
    folder.file("picture.pgm", bytes)
}

fn render<'a>(scene: &'a str, out: &'a str) -> Vec<&'a str> {
    [&["render", "--scene", scene, "--optics", rig_optics(), "--out", out], SIZE.as_slice()].concat()
}

#[test]
fn a_height_map_and_a_picture_are_rendered_and_found_again() {
    let folder = Folder::new();
    bump(&folder);
    picture(&folder);
    let scene = folder.file("scene.toml", "depth = \"bump.npy\"\ntexture = \"picture.pgm\"\n");
    let out = folder.text("pair");
    let rendered = figures(farnear(&render(&scene, &out)).args(["--noise", "none", "--json"]));
    assert!((number(&rendered, "nearest_mm") - 895.0).abs() < 0.1, "{rendered}");
    assert!((number(&rendered, "farthest_mm") - 924.26).abs() < 0.1, "{rendered}");
    let [far, near, truth, map] = ["pair/far.png", "pair/near.png", "pair/truth.npy", "pair/depth/depth.npy"]
        .map(|name| folder.text(name));
    succeeds(&mut farnear(&["depth", &far, &near]));
    let compared = figures(&mut farnear(&["compare", &map, &truth, "--border", "16", "--json"]));
    // The windows average over 13 px, in which the bump's flanks fall by up to 3 mm.
    println!("{compared}");
    assert!(number(&compared, "rmse_mm") < 0.3, "{compared}");
}

#[test]
fn a_scene_file_accepts_a_named_scene() {
    let folder = Folder::new();
    let scene = folder.file("scene.toml", "scene = \"plane:905\"\ntexture = \"fractal\"\ncontrast = 0.3\n");
    let [a, b] = ["a", "b"].map(|name| folder.text(name));
    succeeds(&mut farnear(&render(&scene, &a)));
    succeeds(&mut farnear(&render("plane:905,texture=fractal,contrast=0.3", &b)));
    let image = |name: &str| std::fs::read(folder.path(name)).unwrap();
    assert!(image("a/far.png") == image("b/far.png"));
}

#[test]
fn mistakes_in_scene_files_are_named_with_the_file() {
    let folder = Folder::new();
    bump(&folder);
    picture(&folder);
    let out = folder.text("out");
    fails(&mut farnear(&render(&folder.text("absent.toml"), &out)), 1, &["absent.toml", "cannot read"]);
    fails(&mut farnear(&render("kone", &out)), 2, &["unknown scene \"kone\"", "plane:MM, staircase"]);
    for (text, phrases) in [
        ("depth = \"absent.npy\"", &["scene.toml", "absent.npy"][..]),
        ("depth = \"picture.pgm\"", &["picture.pgm", "8-bit integers, not mm"]),
        ("depth = \"bump.npy\"\ntexture = \"sandd\"", &["texture = \"sandd\" is neither sand nor fractal"]),
        ("depth = \"bump.npy\"\ntexture = \"bump.npy\"", &["bump.npy is not an image"]),
        ("depth = \"bump.npy\"\nscene = \"cone\"", &["exactly one of"]),
        ("deph = \"bump.npy\"", &["unknown field `deph`"]),
        ("depth = \"bump.npy\"\ntexture = \"picture.pgm\"\ncontrast = 0.5", &["has its own"]),
    ] {
        let scene = folder.file("scene.toml", text);
        fails(&mut farnear(&render(&scene, &out)), 1, phrases);
    }
    assert!(!folder.path("out").exists(), "a failure leaves nothing behind");
}
