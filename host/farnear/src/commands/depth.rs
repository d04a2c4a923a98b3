//! `farnear depth`: a depth map from a far- and a near-focused image.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_depth::{
    adaptive_window::Window,
    fill::{FillBy, LowTexture},
    pipeline::{MAX_SMOOTHING_PX, Settings},
    prepare::{Align, Balance},
};
use farnear_workflows::{
    depth::{self, DepthSettings, method::Method, noise::CameraNoise, output::Outputs},
    measure::Rectangle,
    psf::PsfSource,
};

use crate::{report, terminal};

/// Compute a depth map from a far- and a near-focused image.
///
/// Writes depth.npy and depth.tiff (mm, NaN = no value), depth.png (16 bit), confidence.npy (0 to 1), mesh.ply, view.png
/// (a picture with a scale), reason.png (0 = a depth, else why there is none, as listed in depth.toml), depth.toml (what made them) and, if asked, uncertainty.npy (mm).
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
    /// Point spread function in place of the optics file's: pillbox, gaussian:k=K, generalised:p=P,k=K, ring:inner=I, or a
    /// file with an image of it or of the (coded) aperture: FILE.png, .tiff or .npy, FILE,radius=PX where the blur radius is
    /// not half its shorter side.
    #[arg(long, value_name = "PSF|FILE")]
    psf: Option<PsfSource>,
    /// Operators: a name such as gro:linear (family:design), or a file saved by `farnear operators`; without it they
    /// are designed for the optics.
    #[arg(long, value_name = "NAME|FILE")]
    operators: Option<PathBuf>,
    /// How: ro (rational operators), whitened (operators at the limit that noise sets), or a method to compare with:
    /// subbarao, subbarao-fourier or favaro.
    #[arg(long, default_value_t)]
    method: Method,
    /// Window over which evidence is summed: an odd number of pixels, adaptive (the largest of 7, 13 and 21 that nothing
    /// contradicts: a third of the noise), or safe (the smallest of 9, 13 and 21 that is certain enough); without it
    /// adaptive for whitened, and that of --smooth for the others.
    #[arg(long, value_name = "PX|adaptive|safe", conflicts_with = "smooth")]
    window: Option<Window>,
    /// How the near image is laid on the far one: auto (a similarity, where one is found beyond doubt), none, optics (the
    /// magnification of a lens that is not telecentric), shift, similarity or affine.
    #[arg(long, value_name = "HOW", default_value_t)]
    align: Align,
    /// How both images are brought to one brightness: auto (a gain, or one that varies, where one is found beyond doubt),
    /// none, gain or local.
    #[arg(long, value_name = "HOW", default_value_t)]
    balance: Balance,
    /// Depth of a part of the images only: its column, row, width and height in pixels. Maps have its size, and depth.toml says
    /// where it lies.
    #[arg(long, value_name = "X,Y,W,H")]
    region: Option<Rectangle>,
    /// Folder of the camera's dark and flat frames, from `farnear calibrate camera`.
    #[arg(long, value_name = "DIR")]
    camera: Option<PathBuf>,
    /// Take depths away that are less confident than this: the probability that a depth is off by less than three of its
    /// standard deviations, 0 to 1.
    #[arg(long, value_name = "C", default_value_t = 0.0)]
    min_confidence: f32,
    /// Correction saved by `farnear calibrate correction`, applied to the map.
    #[arg(long, value_name = "FILE")]
    correction: Option<PathBuf>,
    /// Fill regions without texture: with the surface of what surrounds them (surface), or for comparison as the thesis does
    /// (thesis: one after the other and after any --correction, each with a polynomial fitted to the rectangle around it).
    #[arg(long, value_name = "HOW", num_args = 0..=1, require_equals = true, default_missing_value = "surface")]
    fill: Option<FillBy>,
    /// What --fill takes for a region without texture: energy (less than a twentieth of the median), or for comparison the
    /// thesis' variance:T (the variance of (far - near) / (far + near) over the window is below T; without :T 0.0144).
    #[arg(long, value_name = "CRITERION", requires = "fill", default_value_t)]
    low_texture: LowTexture,
    /// Write uncertainty.npy too: the standard deviation of each depth in mm, for noise that is estimated from the pair
    /// or follows from the camera, --uncertainty=camera:full_well_e=20000,read_noise_e=12 (and bits=12 where the file has
    /// more); ro and whitened only.
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
    /// What to write: some of npy, tiff, png, mesh, view and exr (depth.exr: OpenEXR with depth Z in mm, confidence,
    /// deviation), with commas between.
    #[arg(long, value_name = "LIST", default_value_t)]
    write: Outputs,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Largest median window that there is a network for.
const MAX_MEDIAN_PX: usize = 7;

/// The side of a window around a pixel.
fn odd_up_to<const LARGEST: usize>(text: &str) -> Result<usize, String> {
    let side = text.parse().ok().filter(|side| side % 2 == 1 && (1..=LARGEST).contains(side));
    side.ok_or_else(|| format!("a window's side is an odd whole number from 1 to {LARGEST}"))
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let computation = Settings {
        smoothing_px: arguments.smooth,
        median_px: arguments.median,
        fill: arguments.fill.is_some(),
        low_texture: arguments.low_texture,
        fill_by: arguments.fill.unwrap_or_default(),
        threads: arguments.threads,
        ..Settings::default()
    };
    let settings = DepthSettings {
        far: arguments.far,
        near: arguments.near,
        optics: arguments.optics,
        psf: arguments.psf,
        operators: arguments.operators,
        method: arguments.method,
        computation,
        window: arguments.window,
        align: arguments.align,
        balance: arguments.balance,
        region: arguments.region,
        camera: arguments.camera,
        min_confidence: arguments.min_confidence,
        correction: arguments.correction,
        uncertainty: arguments.uncertainty,
        write: arguments.write,
        out: arguments.out,
    };
    report::print(&depth::compute(&settings, &terminal::context()?)?, arguments.json)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_odd() {
        assert_eq!(odd_up_to::<7>("7"), Ok(7));
        for wrong in ["0", "4", "9", "-1", "x", ""] {
            assert!(odd_up_to::<7>(wrong).is_err(), "{wrong}");
        }
    }
}
