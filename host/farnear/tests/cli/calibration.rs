//! `farnear calibrate`, `correct`, `depth --method --correction --fill` and `operators --plot` on small rendered pairs.

use std::{fs, path::Path};

use assert_cmd::Command;
use farnear_files::{image_file, map, npy};
use ndarray::Array2;
use tempfile::TempDir;

use crate::common::{fails, farnear, figures, succeeds};

const OPTICS: &str = "[lens]\nfocal_length_mm = 50.0\naperture_mm = 12.8\n[sensor]\npixel_um = 7.4\n\
                      [focus]\nfar_mm = 933.0\nmax_blur_px = 2.703\n[psf]\nmodel = \"gaussian\"\nk = 0.4578\n";
const SIZE: (usize, usize) = (120, 160);

struct Bench(TempDir);

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("optics.toml"), OPTICS).unwrap();
        Self(folder)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = farnear(arguments);
        command.current_dir(self.0.path());
        command
    }

    #[track_caller]
    fn figures(&self, arguments: &[&str]) -> serde_json::Value {
        figures(self.command(arguments).arg("--json"))
    }

    #[track_caller]
    fn fails(&self, code: i32, arguments: &[&str], expected: &str) {
        fails(&mut self.command(arguments), code, &[expected]);
    }

    fn render(&self, scene: &str, noise: &str, out: &str) {
        let optics = ["--optics", "optics.toml", "--width", "320", "--height", "240"];
        let what = ["render", "--scene", scene, "--noise", noise, "--out", out];
        self.figures(&[&what[..], &optics].concat());
    }

    fn map(&self, name: &str, map: &Array2<f32>) {
        fs::write(self.0.path().join(name), npy::write(map.view())).unwrap();
    }

    /// Depth maps of flat targets that are `bow` times too deep towards the corners, and their list.
    fn targets(&self, bow: f32) {
        let mut list = String::new();
        for (index, true_mm) in [932.0_f32, 920.0, 910.0, 900.0, 888.0].into_iter().enumerate() {
            let name = format!("flat{index}.npy");
            self.map(&name, &bowl(true_mm, bow));
            list += &format!("[[pattern]]\ndepth = \"{name}\"\ntrue_mm = {true_mm}.0\n");
        }
        fs::write(self.0.path().join("patterns.toml"), list).unwrap();
    }
}

fn bowl(true_mm: f32, bow: f32) -> Array2<f32> {
    Array2::from_shape_fn(SIZE, |(row, column)| {
        let [y, x] = [row as f32 / SIZE.0 as f32 - 0.5, column as f32 / SIZE.1 as f32 - 0.5];
        true_mm + bow * (x * x + y * y)
    })
}

#[test]
fn the_blur_constant_of_a_rendered_pair_is_found() {
    let bench = Bench::new();
    bench.render("plane:933", "8bit", "far-plane");
    let pair = ["far-plane/far.png", "far-plane/near.png", "--optics", "optics.toml"];
    let find = [&["calibrate", "psf"], &pair[..], &["--model", "gaussian", "--out", "found.toml"]].concat();
    let found = bench.figures(&find);
    // A quarter of the pixels of the accuracy pages, so twice their tolerance of 0.002.
    assert!((found["k"].as_f64().unwrap() - 0.4578).abs() < 0.004, "{found}");
    assert_eq!(found["target_mm"], 933.0);
    let written = fs::read_to_string(bench.0.path().join("found.toml")).unwrap();
    assert!(written.contains("gaussian"), "{written}");
    bench.figures(&["optics", "--optics", "found.toml"]);
    bench.fails(2, &[&["calibrate", "psf"], &pair[..], &["--model", "pillbox"]].concat(), "gaussian");
    let inside = [&find[..], &["--depth-mm", "20"]].concat();
    bench.fails(2, &inside, "no image");
}

/// A free profile works in the optics file like any other PSF. Its depth equals that by the pair's own model.
#[test]
fn a_free_profile_is_found_and_used() {
    let bench = Bench::new();
    bench.render("plane:933", "8bit", "far");
    bench.render("plane:905", "8bit", "middle");
    let pair = ["far/far.png", "far/near.png", "--optics", "optics.toml", "--model", "free"];
    let found = bench.figures(&[&["calibrate", "psf"], &pair[..], &["--out", "found.toml"]].concat());
    // Three standard errors for one pair with a quarter of the usual pixels.
    assert!((found["k"].as_f64().unwrap() - 0.4578).abs() < 0.01, "{found}");
    assert_eq!((found["verdict"].as_str(), found["otf"].as_array().unwrap().len()), (Some("good"), 10));
    assert!(found["residual"].as_f64() >= found["noise_residual"].as_f64(), "{found}");
    let written = fs::read_to_string(bench.0.path().join("found.toml")).unwrap();
    assert!(written.contains("model = \"radial\""), "{written}");
    let depth = ["depth", "middle/far.png", "middle/near.png", "--out", "out", "--optics"];
    for optics in ["optics.toml", "found.toml"] {
        let median = bench.figures(&[&depth[..], &[optics]].concat())["median_mm"].as_f64().unwrap();
        assert!((median - 905.0).abs() < 0.15, "{optics}: {median}");
    }
}

/// The part of a shift common to both images is not blur: alignment removes it, or a warning reports it.
#[test]
fn a_shifted_pair_is_aligned_or_reported() {
    let bench = Bench::new();
    bench.render("plane:933", "8bit", "far");
    let near = image_file::read_grey(&bench.0.path().join("far/near.png")).unwrap().pixels;
    let moved =
        Array2::from_shape_fn(near.dim(), |(y, x)| (255.0 * near[(y, x.saturating_sub(1))]).round() as u16);
    fs::write(bench.0.path().join("moved.png"), image_file::encode_png(moved.view(), 8).unwrap()).unwrap();
    let find =
        ["calibrate", "psf", "far/far.png", "moved.png", "--optics", "optics.toml", "--model", "gaussian"];
    let found = bench.figures(&find);
    assert!((found["k"].as_f64().unwrap() - 0.4578).abs() < 0.004, "{found}");
    assert!((found["moved_px"][0].as_f64().unwrap() - 1.0).abs() < 0.05, "{found}");
    let left = bench.figures(&[&find[..], &["--align", "none"]].concat());
    assert_eq!(left["verdict"], "unexplained", "{left}");
    let unaligned = [&find[..], &["--align", "none", "--out", "found.toml"]].concat();
    let (_, stderr) = succeeds(&mut bench.command(&unaligned));
    let written = fs::read_to_string(bench.0.path().join("found.toml")).unwrap();
    assert!(written.starts_with("# unexplained: the gaussian"), "{written}");
    bench.figures(&["optics", "--optics", "found.toml"]);
    assert!(stderr.contains("warning: the gaussian point spread function leaves"), "{stderr}");
}

#[test]
fn filling_as_in_the_thesis_is_selectable() {
    let bench = Bench::new();
    bench.render("plane:905", "none", "plane");
    for name in ["far.png", "near.png"] {
        let path = bench.0.path().join("plane").join(name);
        let pixels = image_file::read_grey(&path).unwrap().pixels;
        let blank = Array2::from_shape_fn(pixels.dim(), |(y, x)| {
            let inside = (y as f32 - 120.0).hypot(x as f32 - 160.0) < 40.0;
            if inside { 30_000 } else { (65_535.0 * pixels[(y, x)]).round() as u16 }
        });
        fs::write(path, image_file::encode_png(blank.view(), 16).unwrap()).unwrap();
    }
    let depth = ["depth", "plane/far.png", "plane/near.png", "--optics", "optics.toml", "--out", "out"];
    let record = || fs::read_to_string(bench.0.path().join("out/depth.toml")).unwrap();
    let known = |arguments: &[&str]| {
        let found = bench.figures(&[&depth[..], arguments].concat());
        found["valid_fraction"].as_f64().unwrap()
    };
    let hole = 1.0 - known(&[]);
    assert!(hole > 0.015, "{hole}");
    assert!(!record().contains("fill_by") && !record().contains("low_texture ="), "{}", record());
    let filled = known(&["--fill"]);
    // The sharp outline of the disc is a misfit, which is not filled.
    assert!(filled > 0.995 && !record().contains("fill_by"), "{filled}");
    let thesis = known(&["--fill=thesis"]);
    assert!(thesis > 1.0 - 0.7 * hole && record().contains("fill_by = \"thesis\""), "{thesis}: {}", record());
    known(&["--fill=thesis", "--low-texture", "variance:0.00001"]);
    assert!(record().contains("low_texture = \"variance:0.00001\""), "{}", record());
    bench.fails(2, &[&depth[..], &["--fill=cubic"]].concat(), "surface or thesis");
    bench.fails(2, &[&depth[..], &["--fill", "--low-texture", "entropy"]].concat(), "variance:T");
    bench.fails(2, &[&depth[..], &["--low-texture", "variance"]].concat(), "give `fill` too");
}

#[test]
fn corrections_flatten_what_they_never_saw() {
    let bench = Bench::new();
    bench.targets(12.0);
    bench.map("other.npy", &bowl(905.0, 12.0));
    for method in ["clsf", "clsf-blend", "clsf-full", "cdc", "two-step"] {
        let learn = ["calibrate", "correction", "patterns.toml", "--method", method, "--out", "c.toml"];
        let learned = bench.figures(&learn);
        assert_eq!(learned["patterns"], 5);
        assert!(learned["rmse_before_mm"].as_f64().unwrap() > 2.0, "{learned}");
        bench.figures(&["correct", "other.npy", "--correction", "c.toml", "--out", "flat.npy"]);
        let flat = map::read(&bench.0.path().join("flat.npy")).unwrap();
        let worst = flat.iter().map(|depth| (depth - 905.0).abs()).fold(0.0, f32::max);
        // cdc smooths its patterns, which bends their corners.
        assert!(worst < if method == "cdc" { 0.3 } else { 0.1 }, "{method}: {worst} mm");
    }
    let correct = |out: &'static str| ["correct", "other.npy", "--correction", "c.toml", "--out", out];
    bench.figures(&correct("flat.tiff"));
    bench.fails(2, &correct("flat.png"), ".npy or .tiff");
    bench.map("small.npy", &Array2::from_elem((20, 30), 900.0));
    bench.fails(1, &["correct", "small.npy", "--correction", "c.toml", "--out", "x.npy"], "30x20");
    fs::write(bench.0.path().join("patterns.toml"), "").unwrap();
    let learn = ["calibrate", "correction", "patterns.toml", "--method", "clsf", "--out", "d.toml"];
    bench.fails(1, &learn, "lists no [[pattern]]");
    assert!(!bench.0.path().join("d.toml").exists());
}

#[test]
fn other_methods_give_depth_and_say_who_they_are() {
    let bench = Bench::new();
    bench.render("plane:905", "none", "plane");
    let depth = ["depth", "plane/far.png", "plane/near.png", "--optics", "optics.toml", "--out", "out"];
    for method in ["ro", "subbarao", "subbarao-fourier"] {
        let found = bench.figures(&[&depth[..], &["--method", method]].concat());
        let median = found["median_mm"].as_f64().unwrap();
        // The baselines use only the second moment of the PSF.
        assert!((median - 905.0).abs() < if method == "ro" { 0.2 } else { 4.0 }, "{method}: {median}");
        let record = fs::read_to_string(bench.0.path().join("out/depth.toml")).unwrap();
        assert!(record.contains(&format!("method = \"{method}\"")), "{record}");
        assert_eq!(record.contains("[operators"), method == "ro");
    }
    for method in ["ro", "subbarao"] {
        bench.figures(&[&depth[..], &["--method", method, "--fill"]].concat());
    }
    bench.fails(2, &[&depth[..], &["--method", "magic"]].concat(), "subbarao-fourier");
    bench.targets(1.0);
    let learn = ["calibrate", "correction", "patterns.toml", "--method", "clsf-full", "--out", "c.toml"];
    bench.figures(&learn);
    // The correction's maps have another size than this pair's.
    bench.fails(1, &[&depth[..], &["--correction", "c.toml"]].concat(), "160x120");
}

/// Patterns through a quarter of the working range, and a scene through more of it.
#[test]
fn depths_beyond_the_correction_are_counted_and_reported() {
    let bench = Bench::new();
    bench.render("slant", "none", "slant");
    let mut list = String::new();
    for true_mm in [887.0_f32, 890.0, 893.0, 896.0, 899.0] {
        let name = format!("{true_mm}.npy");
        bench.map(&name, &Array2::from_elem((240, 320), true_mm));
        list += &format!("[[pattern]]\ndepth = \"{name}\"\ntrue_mm = {true_mm}.0\n");
    }
    fs::write(bench.0.path().join("patterns.toml"), list).unwrap();
    let learn = ["calibrate", "correction", "patterns.toml", "--method", "clsf-full", "--out", "c.toml"];
    bench.figures(&learn);
    let depth = ["depth", "slant/far.png", "slant/near.png", "--optics", "optics.toml", "--out", "out"];
    let found = bench.figures(&[&depth[..], &["--correction", "c.toml"]].concat());
    assert!(found["valid_fraction"].as_f64().unwrap() < 0.9, "{found}");
    assert!(found["warnings"].to_string().contains("beyond what the correction was taught"), "{found}");
    let record = fs::read_to_string(bench.0.path().join("out/depth.toml")).unwrap();
    assert!(record.contains("reason = \"beyond-correction\""), "{record}");
}

#[test]
fn operators_are_drawn() {
    let bench = Bench::new();
    let plot = |file: &'static str| ["operators", "--optics", "optics.toml", "--plot", file];
    for file in ["plot.svg", "plot.png"] {
        bench.figures(&plot(file));
        assert!(fs::metadata(bench.0.path().join(file)).unwrap().len() > 4_000, "{file}");
    }
    bench.fails(2, &plot("plot.pdf"), ".svg or .png");
    assert!(!Path::new(&bench.0.path().join("plot.pdf")).exists());
}
