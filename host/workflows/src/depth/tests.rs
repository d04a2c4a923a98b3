use std::{fs, path::Path};

use farnear_files::image_file::encode_png;

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
fn options_without_effect_on_a_method_are_bad_usage() {
    let folder = tempfile::tempdir().unwrap();
    let other = Method::Baseline(farnear_depth::baselines::Method::Subbarao);
    let settings = DepthRequest { method: other, ..settings(folder.path()) };
    for settings in [
        DepthRequest { operators: Some("gro".into()), ..settings.clone() },
        DepthRequest { uncertainty: Some(CameraNoise::Estimated), ..settings },
    ] {
        let error = compute(&settings, &Context::unattended()).unwrap_err();
        assert!(error.is_usage(), "{error}");
    }
}
