//! This crate and the renderer read `optics.toml` with their own formulas: both must accept the same files for the same
//! numbers and reject the same ones with the same messages.
#![allow(clippy::unwrap_used)] // Helpers of tests may fail like tests.

use farnear_depth::optics::{Optics, OpticsFile};
use farnear_scene as scene;

const GOOD: &str = scene::standard::OPTICS;

fn here(text: &str) -> Result<Optics, String> {
    let file: OpticsFile = toml::from_str(text).map_err(|error| error.to_string().trim_end().to_owned())?;
    file.check().map_err(|error| error.to_string())
}

fn there(text: &str) -> Result<scene::OpticsFile, String> {
    scene::OpticsFile::parse(text).map_err(|error| error.to_string())
}

#[test]
fn good_files_mean_the_same() {
    for (from, to) in [
        ("", ""),
        ("aperture_mm = 12.8", "f_number = 3.90625"),
        ("aperture_mm = 12.8", "aperture_mm = 12.8\nf_number = 3.95"),
        ("max_blur_px = 2.703", "near_mm = 886.81"),
        ("max_blur_px = 2.703", "max_blur_px = 2.7\nnear_mm = 886.81"),
    ] {
        let text = GOOD.replace(from, to);
        let (here, there) = (here(&text).unwrap(), there(&text).unwrap());
        let range = here.working_range();
        for (a, b) in [
            (here.focal_length_mm(), there.focal_length_mm),
            (here.aperture_mm(), there.aperture_mm),
            (here.pixel_um(), there.pixel_um),
            (here.max_blur_px(), there.max_blur_px),
            (range.far_mm, there.far_mm),
            (range.near_mm, there.near_mm),
        ] {
            // Two evaluations of the thin lens differ by rounding, magnified by distances over differences.
            assert!((a / b - 1.0).abs() < 1e-9, "{a} {b} for {text}");
        }
    }
}

#[test]
fn bad_files_are_refused_in_the_same_words() {
    for (from, to, fact) in [
        ("max_blur_px = 2.703", "near_mm = 950.0", "near_mm = 950 is not nearer than far_mm = 933"),
        ("aperture_mm = 12.8", "f_number = 0.0", "f_number = 0"),
        ("aperture_mm = 12.8", "aperture_mm = nan", "aperture_mm = NaN"),
        ("pixel_um = 7.4", "pixel_um = -7.4", "pixel_um = -7.4"),
        ("aperture_mm = 12.8\n", "", "aperture_mm or f_number"),
        ("aperture_mm = 12.8", "aperture_mm = 12.8\nf_number = 4.5", "f_number = 3.90625"),
        ("max_blur_px = 2.703", "max_blur_px = 2.703\nnear_mm = 900.0", "near_mm = 886.81"),
        ("max_blur_px = 2.703\n", "", "max_blur_px or near_mm"),
        ("far_mm = 933.0", "far_mm = 40.0", "far_mm = 40 is not beyond the focal length of 50 mm"),
        ("max_blur_px = 2.703", "near_mm = 12.0", "near_mm = 12 is not beyond the focal length of 50 mm"),
    ] {
        assert!(GOOD.contains(from), "{from}");
        let text = GOOD.replace(from, to);
        let (here, there) = (here(&text).unwrap_err(), there(&text).unwrap_err());
        assert_eq!(here, there);
        assert!(here.contains(fact), "{here:?} should contain {fact:?}");
    }
}

/// Syntax and PSF errors differ in wording (this one gives the place in the file), but not in facts.
#[test]
fn both_tell_the_facts_of_what_cannot_be_read() {
    for (text, fact) in [
        (GOOD.replace("pixel_um", "pixel_mm"), "pixel_mm"),
        (GOOD.replace("[sensor]", "[sensors]"), "sensors"),
        (format!("{GOOD}[psf]\nmodel = \"airy\"\n"), "unknown PSF \"airy\""),
        (format!("{GOOD}[psf]\nmodel = \"pillbox\"\nk = 0.5\n"), "PSF pillbox takes no \"k\""),
        (format!("{GOOD}[psf]\nmodel = \"gaussian\"\n"), "PSF gaussian needs k=NUMBER"),
        (format!("{GOOD}[psf]\nmodel = \"gaussian\"\nk = -1.0\n"), "PSF parameter k = -1"),
        (format!("{GOOD}[psf]\nmodel = \"generalised\"\np = 0.1\nk = 0.5\n"), "PSF parameter p = 0.1"),
    ] {
        for error in [here(&text).unwrap_err(), there(&text).unwrap_err()] {
            assert!(error.contains(fact), "{error:?} should contain {fact:?}");
        }
    }
}
