//! `farnear depth`: a depth map from a far- and a near-focused image.

mod method;
mod noise;
mod results;

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use anyhow::{Context, Result, bail};
use clap::Args;
use farnear_capture::{
    image_file::{Samples, read_grey},
    record::CAPTURE_FILE,
};
use farnear_depth::{
    corrections::Correction,
    pipeline::{DepthMap, MAX_SMOOTHING_PX, Settings, Warning},
};
use ndarray::Array2;
use serde::Serialize;

use crate::{
    files,
    report::{self, Usage},
};
use method::{Method, Prepared, method};
use noise::{CameraNoise, Source, Uncertainty};
use results::Results;

/// Compute a depth map from a far- and a near-focused image.
///
/// Writes depth.npy and depth.tiff (mm, NaN = no value), depth.png (16 bit), confidence.npy (0 to 1), mesh.ply, view.png
/// (a picture with a scale), depth.toml (what made them) and, if asked, uncertainty.npy (mm).
#[derive(Args)]
#[command(after_help = "Example: farnear depth far.png near.png --optics optics.toml --out depth/")]
pub struct Arguments {
    /// The image focused on the far plane: PNG, TIFF (8, 16 bit, float), JPEG or PGM.
    far: PathBuf,
    /// The image focused on the near plane.
    near: PathBuf,
    /// The optics file; without it what capture.toml or optics.toml beside the far image says.
    #[arg(long, value_name = "FILE")]
    optics: Option<PathBuf>,
    /// Operators: a name such as gro:linear (family:design), or a file saved by `farnear operators`; without it they
    /// are designed for the optics.
    #[arg(long, value_name = "NAME|FILE")]
    operators: Option<PathBuf>,
    /// How: ro (rational operators), or a method to compare with: subbarao, subbarao-fourier or favaro.
    #[arg(long, default_value = "ro", value_parser = method)]
    method: Method,
    /// Correction saved by `farnear calibrate correction`, applied to the map.
    #[arg(long, value_name = "FILE")]
    correction: Option<PathBuf>,
    /// Fill regions without texture with the surface of what surrounds them.
    #[arg(long)]
    fill: bool,
    /// Write uncertainty.npy too: the standard deviation of each depth in mm, for noise that is estimated from the pair
    /// or follows from the camera, --uncertainty=camera:full_well_e=20000,read_noise_e=12 (and bits=12 where the file has
    /// more); ro only.
    #[arg(long, value_name = "NOISE", num_args = 0..=1, require_equals = true, default_missing_value = "estimated")]
    uncertainty: Option<CameraNoise>,
    /// Side of the window over which coefficients are summed, in pixels: odd, 1 to 63.
    #[arg(long, value_name = "PX", default_value_t = 7, value_parser = odd_up_to::<MAX_SMOOTHING_PX>)]
    smooth: usize,
    /// Side of the median window in pixels: 1, 3, 5 or 7.
    #[arg(long, value_name = "PX", default_value_t = 3, value_parser = odd_up_to::<MAX_MEDIAN_PX>)]
    median: usize,
    /// Threads; 0 = all.
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Folder for the results; without it the folder of a capture, else depth/ beside the far image.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Figures {
    seconds: f64,
    width: usize,
    height: usize,
    median_mm: f64,
    low_texture_fraction: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    uncertainty: Option<Uncertainty>,
    warnings: Vec<String>,
}

/// Largest median window that there is a network for.
const MAX_MEDIAN_PX: usize = 7;

/// The side of a window around a pixel.
fn odd_up_to<const LARGEST: usize>(text: &str) -> Result<usize, String> {
    let side = text.parse().ok().filter(|side| side % 2 == 1 && (1..=LARGEST).contains(side));
    side.ok_or_else(|| format!("a window's side is an odd whole number from 1 to {LARGEST}"))
}

/// Corrects a map; what lies beyond the correction loses depth and confidence alike.
fn correct(depth: &mut DepthMap, correction: &Correction) -> Result<()> {
    correction.apply_in_place(depth.depth_mm.view_mut())?;
    for (confidence, depth_mm) in depth.confidence.iter_mut().zip(&depth.depth_mm) {
        if depth_mm.is_nan() {
            *confidence = 0.0;
        }
    }
    Ok(())
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let optics = files::optics::of_pair(arguments.optics.as_deref(), &arguments.far)?;
    let ([far, near], samples) = read_pair(&arguments.far, &arguments.near)?;
    if far == near {
        bail!(
            "{} and {} hold the same image: depth needs one focused far and one focused near",
            arguments.far.display(),
            arguments.near.display()
        );
    }
    let method = Prepared::new(arguments.method, arguments.operators.as_deref(), &optics)?;
    if arguments.uncertainty.is_some() && method.operators().is_none() {
        return Err(Usage(format!("--uncertainty is known of ro, not of --method {}", method.name())).into());
    }
    let correction = arguments.correction.as_deref().map(files::correction::read).transpose()?;
    if let Some(correction) = &correction {
        correction.check_range(&optics.working_range())?;
    }
    let settings = Settings {
        smoothing_px: arguments.smooth,
        median_px: arguments.median,
        fill: arguments.fill,
        threads: arguments.threads,
        ..Settings::default()
    };
    let start = Instant::now();
    let mut depth = method
        .depth(&far, &near, &optics, &settings)
        .with_context(|| format!("{} and {}", arguments.far.display(), arguments.near.display()))?;
    let deviation = match (arguments.uncertainty, method.operators()) {
        (Some(noise), Some(operators)) => {
            let source =
                Source { pair: [&far, &near], samples, operators, optics: &optics, settings: &settings };
            Some(noise::deviation(noise, &source, &depth, correction.as_ref())?)
        }
        _ => None,
    };
    if let Some(correction) = &correction {
        correct(&mut depth, correction)?;
    }
    let seconds = start.elapsed().as_secs_f64();
    let mut warnings: Vec<String> = depth.warnings.iter().map(ToString::to_string).collect();
    if named_the_other_way_round(&arguments.far, &arguments.near)
        && !depth.warnings.iter().any(|warning| matches!(warning, Warning::LooksSwapped { .. }))
    {
        warnings.push(format!(
            "the pair looks swapped by its names: {} was given as FAR and {} as NEAR",
            name_of(&arguments.far),
            name_of(&arguments.near)
        ));
    }
    for warning in &warnings {
        eprintln!("warning: {warning}");
    }
    let out = arguments.out.clone().unwrap_or_else(|| default_folder(&arguments.far));
    let results = Results {
        far: &arguments.far,
        near: &arguments.near,
        picture: &far,
        depth: &depth,
        deviation: deviation.as_ref(),
        method: &method,
        settings,
        optics: &optics,
        correction: arguments.correction.as_deref(),
        warnings: &warnings,
    };
    results.write(&out)?;
    eprintln!("wrote {}", out.display());
    let (height, width) = depth.depth_mm.dim();
    let figures = Figures {
        seconds: report::rounded(seconds, 6),
        width,
        height,
        median_mm: report::rounded(median(&depth.depth_mm), 3),
        low_texture_fraction: report::rounded(depth.low_texture_fraction, 6),
        uncertainty: deviation.map(|(_, found)| found),
        warnings,
    };
    report::print(&figures, arguments.json)
}

/// The images' pixels, which must mean the same (integers of any depth share one scale, float files have their own), and
/// the coarser kind of samples.
fn read_pair(far: &Path, near: &Path) -> Result<([Array2<f32>; 2], Samples)> {
    let (far_image, near_image) = (read_grey(far)?, read_grey(near)?);
    if (far_image.samples == Samples::Float) != (near_image.samples == Samples::Float) {
        bail!(
            "{} has {} pixels and {} {} ones: give both as integers or both as float",
            far.display(),
            far_image.samples,
            near.display(),
            near_image.samples
        );
    }
    let samples = match (far_image.samples, near_image.samples) {
        (Samples::Integer(a), Samples::Integer(b)) => Samples::Integer(a.min(b)),
        (samples, _) => samples,
    };
    Ok(([far_image.pixels, near_image.pixels], samples))
}

/// A scene inside the working range gives a plausible map also from a swapped pair, mirrored between far and near:
/// only the names tell.
fn named_the_other_way_round(far: &Path, near: &Path) -> bool {
    let says = |path: &Path, word: &str, other: &str| {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
        stem.contains(word) && !stem.contains(other)
    };
    says(far, "near", "far") && says(near, "far", "near")
}

fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// A capture's own folder, or `depth` beside the image.
fn default_folder(far: &Path) -> PathBuf {
    let folder = far.parent().unwrap_or(Path::new(""));
    if folder.join(CAPTURE_FILE).exists() { folder.to_path_buf() } else { folder.join("depth") }
}

/// Median of the values that there are, NaN where there are none.
fn median(map: &Array2<f32>) -> f64 {
    let mut finite: Vec<f32> = map.iter().copied().filter(|value| value.is_finite()).collect();
    if finite.is_empty() {
        return f64::NAN;
    }
    let middle = finite.len() / 2;
    f64::from(*finite.select_nth_unstable_by(middle, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_a_swapped_pair() {
        let swapped = |far: &str, near: &str| named_the_other_way_round(far.as_ref(), near.as_ref());
        assert!(swapped("a/near.png", "a/far.png"));
        assert!(swapped("Breakfast_NEAR.tif", "breakfast_far.tif"));
        assert!(!swapped("far.png", "near.png"));
        assert!(!swapped("farnear_1.png", "farnear_2.png"));
        assert!(!swapped("near/1.png", "far/2.png"), "folders are no names of images");
        assert!(!swapped("near1.png", "near2.png"));
    }

    #[test]
    fn windows_are_odd() {
        assert_eq!(odd_up_to::<7>("7"), Ok(7));
        for wrong in ["0", "4", "9", "-1", "x", ""] {
            assert!(odd_up_to::<7>(wrong).is_err(), "{wrong}");
        }
    }
}
