use std::{fs, path::Path};

use farnear_files::{image_file::encode_png, npy};

use super::{method::Method, noise::CameraNoise, *};
use crate::context::{Cancel, Progress, Unattended};

const OPTICS: &str = "[lens]\nfocal_length_mm = 50.0\naperture_mm = 12.8\n[sensor]\npixel_um = 7.4\n\
                      [focus]\nfar_mm = 933.0\nmax_blur_px = 2.703\n[psf]\nmodel = \"gaussian\"\nk = 0.4578\n";

/// The file names contradict their order, so a warning is reported between computing and writing.
fn settings(folder: &Path) -> DepthRequest {
    fs::write(folder.join("optics.toml"), OPTICS).unwrap();
    for (name, spread) in [("near.png", 1), ("far.png", 2)] {
        // A texture, and its mean over some pixels.
        let texture = |y: usize, x: usize| 40 + (y * 31 + x * 17) * (y + 7) * 7919 % 151;
        let pixels = Array2::from_shape_fn((48, 64), |(y, x)| {
            let sum: usize = (0..spread * spread).map(|i| texture(y + i / spread, x + i % spread)).sum();
            (sum / (spread * spread)) as u16
        });
        fs::write(folder.join(name), encode_png(pixels.view(), 8).unwrap()).unwrap();
    }
    DepthRequest { far: folder.join("near.png"), near: folder.join("far.png"), ..DepthRequest::default() }
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> =
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

struct Impatient(Cancel);

impl Progress for Impatient {
    fn info(&self, _: &str) {
        self.0.cancel();
    }
}

#[test]
fn a_cancelled_map_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let settings = settings(folder.path());
    let before = names(folder.path());
    let early = Context::unattended();
    early.cancel.cancel();
    let late = Cancel::default();
    let impatient = Impatient(late.clone());
    let late = Context::new(&impatient, &Unattended, late);
    for (context, stage) in [(&early, "reading the pair"), (&late, "writing the results")] {
        let error = compute(&settings, context).unwrap_err();
        assert!(matches!(&error, WorkflowError::Cancelled { during } if during == stage), "{error}");
        assert_eq!(names(folder.path()), before, "{stage}");
    }
    compute(&settings, &Context::unattended()).unwrap();
    assert!(folder.path().join("depth/depth.toml").exists());
}

#[test]
fn options_that_cannot_be_met_are_bad_usage() {
    let folder = tempfile::tempdir().unwrap();
    let other = Method::Baseline(farnear_depth::baselines::Method::Subbarao);
    let settings = DepthRequest { method: Some(other), ..settings(folder.path()) };
    for settings in [
        DepthRequest { operators: Some("gro".into()), ..settings.clone() },
        DepthRequest { uncertainty: Some(CameraNoise::Estimated), ..settings.clone() },
        DepthRequest { method: None, threads: 5_000, ..settings },
    ] {
        let error = compute(&settings, &Context::unattended()).unwrap_err();
        assert!(error.is_usage(), "{error}");
    }
}

/// A camera of 12 bits in files of 16: the images are divided by its white level.
#[test]
fn a_dark_frame_is_on_the_scale_of_the_images() {
    let folder = tempfile::tempdir().unwrap();
    let mut settings = settings(folder.path());
    for (name, step) in [("near.png", 37), ("far.png", 41)] {
        let code = |(y, x)| if y == 0 { 4095 } else { 1000 + x as u16 * step % 500 };
        let pixels = Array2::from_shape_fn((48, 64), code);
        fs::write(folder.path().join(name), encode_png(pixels.view(), 16).unwrap()).unwrap();
    }
    let frames = folder.path().join("camera");
    fs::create_dir(&frames).unwrap();
    for (name, value) in [("dark.npy", 200.0 / 65_535.0), ("response.npy", 1.0)] {
        fs::write(frames.join(name), npy::write(Array2::from_elem((48, 64), value as f32).view())).unwrap();
    }
    let none_bad = Array2::<u16>::zeros((48, 64));
    fs::write(frames.join("bad.png"), encode_png(none_bad.view(), 8).unwrap()).unwrap();
    settings.camera_frames = Some(frames);
    let inputs = Inputs::read(&settings, &Context::unattended()).unwrap();
    let dark = inputs.camera.unwrap().dark()[(5, 5)];
    assert!((inputs.pair.far[(0, 0)] - 1.0).abs() < 1e-5, "{}", inputs.pair.far[(0, 0)]);
    assert!((dark - 200.0 / 4095.0).abs() < 1e-5, "{dark}");
}

/// Files of a colour camera in its raw mode, saved as grey.
#[test]
fn a_raw_mosaic_of_colours_is_averaged_to_grey() {
    let folder = tempfile::tempdir().unwrap();
    let settings = settings(folder.path());
    for (name, spread) in [("near.png", 1.0), ("far.png", 0.8)] {
        let pixels = Array2::from_shape_fn((96, 128), |(y, x)| {
            let detail = (0.5 * x as f32).sin() + (0.4 * y as f32).cos();
            ((120.0 + 20.0 * spread * detail) * [0.6, 1.0, 1.0, 0.8][2 * (y % 2) + x % 2]) as u16
        });
        fs::write(folder.path().join(name), encode_png(pixels.view(), 8).unwrap()).unwrap();
    }
    let inputs = Inputs::read(&settings, &Context::unattended()).unwrap();
    assert_eq!(inputs.pair.far.dim(), (48, 64));
    assert!(inputs.doubts.contains(&OpticsDoubt::Mosaic { bin: 2 }), "{:?}", inputs.doubts);
    let kept = DepthRequest { bin: Some(1), ..settings };
    let figures = compute(&kept, &Context::unattended()).unwrap();
    assert!(figures.warnings.iter().any(|warning| warning.contains("raw mosaic")), "{:?}", figures.warnings);
}

#[test]
fn a_lens_without_the_size_of_a_pixel_gives_no_glb() {
    let folder = tempfile::tempdir().unwrap();
    let settings = settings(folder.path());
    let optics: Optics = toml::from_str(OPTICS).unwrap();
    let optics = optics.with_stage(farnear_depth::optics::Stage::identity(1, 1));
    fs::write(folder.path().join("optics.toml"), toml::to_string(&optics).unwrap()).unwrap();
    let before = names(folder.path());
    let settings = DepthRequest { write: "mesh,glb".parse().unwrap(), ..settings };
    let error = compute(&settings, &Context::unattended()).unwrap_err();
    assert!(error.is_usage() && error.to_string().contains("glb"), "{error}");
    assert_eq!(names(folder.path()), before);
}

#[test]
fn a_learned_lens_takes_neither_another_point_spread_function_nor_a_region_of_averaged_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let settings = settings(folder.path());
    let optics: Optics = toml::from_str(OPTICS).unwrap();
    let optics = optics.with_stage(farnear_depth::optics::Stage::identity(2, 1));
    fs::write(folder.path().join("optics.toml"), toml::to_string(&optics).unwrap()).unwrap();
    for settings in [
        DepthRequest { psf: Some("gaussian:k=0.4".parse().unwrap()), ..settings.clone() },
        DepthRequest { region: Some([4, 4, 40, 30].into()), ..settings },
    ] {
        let error = compute(&settings, &Context::unattended()).unwrap_err();
        assert!(error.is_usage() && error.to_string().contains("calibrate stack"), "{error}");
    }
}

#[test]
fn a_tone_curve_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let settings = settings(folder.path());
    for (exponent, is_named) in [(1.0, false), (2.2, true)] {
        for (file, image) in [&settings.far, &settings.near].into_iter().zip(tone::tests::pair(exponent)) {
            let codes = image.mapv(|value| (65_535.0 * value) as u16);
            fs::write(file, encode_png(codes.view(), 16).unwrap()).unwrap();
        }
        let out = Some(folder.path().join(exponent.to_string()));
        let figures = compute(&DepthRequest { out, ..settings.clone() }, &Context::unattended()).unwrap();
        let found = figures.warnings.iter().any(|warning| warning.contains("not linear in light"));
        assert_eq!(found, is_named, "{exponent}: {:?}", figures.warnings);
    }
}

#[test]
fn averaging_to_a_small_blur_is_doubted() {
    let optics: Optics = toml::from_str(OPTICS).unwrap();
    let doubts = |bin: Option<usize>, is_mosaic: bool| {
        let mut doubts = Vec::new();
        let request = DepthRequest { bin, ..DepthRequest::default() };
        (request.bin_for(&optics, is_mosaic, &mut doubts), doubts)
    };
    let little = OpticsDoubt::LittleBlur { blur_px: 0.5 * optics.max_blur_px(), bin: 2 };
    assert!(0.5 * optics.max_blur_px() < 1.5, "{}", optics.max_blur_px());
    assert_eq!(doubts(None, false), (1, vec![]));
    assert_eq!(doubts(Some(2), false), (2, vec![little.clone()]));
    assert_eq!(doubts(None, true), (2, vec![OpticsDoubt::Mosaic { bin: 2 }, little]));
}
