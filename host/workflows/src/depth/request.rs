//! The request of a depth map.

use std::path::PathBuf;

use farnear_depth::{
    adaptive_window::Window,
    fill::{FillBy, LowTexture},
    measure::{DepthMethod, MeasureSettings},
    optics::Optics,
    pipeline::Settings,
    prepare::{Align, Balance, PrepareSettings},
};
use farnear_files::image_file::Grey;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use super::{DepthFigures, compute, method::Method, noise::CameraNoise, output::Outputs};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    measure::Rectangle,
    optics::{self, OpticsDoubt},
    parameters::{THREADS, within},
    psf::PsfSource,
    request::{self, PathKind, Request},
};

/// Least largest blur, px: on point-sampled texture at 1.35 px depth is off by four deviations.
const LEAST_BLUR_PX: f64 = 1.5;

/// Compute a depth map from a far- and a near-focused image.
///
/// Writes depth.npy and depth.tiff (mm, NaN = no value), depth.png (16 bit), confidence.npy (0 to 1), mesh.ply, view.png
/// (a picture with a scale), reason.png (0 = a depth, else the reason without one, as listed in depth.toml), depth.toml (settings and
/// origin of the map) and, with --uncertainty, uncertainty.npy (mm).
#[serde_as]
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear depth far.png near.png --optics optics.toml --out depth/")
)]
#[serde(default)]
pub struct DepthRequest {
    /// The image focused on the far plane: PNG, TIFF (8, 16 bit, float), JPEG or PGM.
    pub far: PathBuf,
    /// The image focused on the near plane.
    pub near: PathBuf,
    /// The optics file [default: capture.toml or optics.toml in the folder of the far image].
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub optics: Option<PathBuf>,
    /// Point spread function, instead of the optics file's: pillbox, gaussian:k=K, generalised:p=P,k=K, ring:inner=I, or an
    /// image of the PSF or of a coded aperture: FILE.png, .tiff or .npy; FILE,radius=PX if the blur radius is not half its
    /// shorter side.
    #[cfg_attr(feature = "clap", arg(long, value_name = "PSF|FILE"))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub psf: Option<PsfSource>,
    /// Rational operators: a name such as gro:linear (family:design), or a file saved by `farnear operators`
    /// [default: designed for the optics].
    #[cfg_attr(feature = "clap", arg(long, value_name = "NAME|FILE"))]
    pub operators: Option<PathBuf>,
    /// Method: whitened (operators at the noise limit), ro (rational operators), or for comparison subbarao,
    /// subbarao-fourier or favaro [default: ro with --operators, else whitened].
    #[cfg_attr(feature = "clap", arg(long))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub method: Option<Method>,
    /// Window over which evidence is summed: an odd number of pixels from 1 to 63, or for whitened adaptive (21 where the
    /// surface is flat, else the smallest of 7, 13 and 21 that is certain enough) [default: adaptive for whitened, else 7].
    #[cfg_attr(feature = "clap", arg(long, value_name = "PX|adaptive"))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub window: Option<Window>,
    /// Side of the median window in pixels: 1, 3, 5 or 7.
    #[cfg_attr(feature = "clap", arg(long, value_name = "PX", default_value_t = Self::default().median_px))]
    pub median_px: usize,
    /// Registration of the near image to the far one: auto (a similarity if a significant one is found), none, optics (the
    /// magnification of a lens that is not telecentric), shift, similarity or affine.
    #[cfg_attr(feature = "clap", arg(long, value_name = "METHOD", default_value_t))]
    #[serde_as(as = "DisplayFromStr")]
    pub align: Align,
    /// Brightness matching of the two images: auto (a gain, or one that varies over the image, if significant), none, gain or local.
    #[cfg_attr(feature = "clap", arg(long, value_name = "METHOD", default_value_t))]
    #[serde_as(as = "DisplayFromStr")]
    pub balance: Balance,
    /// How colour becomes grey: mean, luma, red, green or blue.
    #[cfg_attr(feature = "clap", arg(long, value_name = "CHANNEL", default_value_t))]
    #[serde_as(as = "DisplayFromStr")]
    pub grey: Grey,
    /// Code at which the camera saturates, such as 4095 for 12 bits in 16 [default: from the files].
    #[cfg_attr(feature = "clap", arg(long, value_name = "CODE"))]
    pub white_level: Option<u32>,
    /// Part of the images: column, row, width and height in pixels. Maps have its size; depth.toml gives its position.
    #[cfg_attr(feature = "clap", arg(long, value_name = "X,Y,W,H"))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub region: Option<Rectangle>,
    /// Average this many pixels per side into one first; 1 keeps all [default: as many as a largest blur of more than 4.5 px needs, 2 for a raw mosaic of colours].
    #[cfg_attr(feature = "clap", arg(long, value_name = "PX"))]
    pub bin: Option<usize>,
    /// Folder with the camera's dark and flat frames, from `farnear calibrate camera`.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub camera_frames: Option<PathBuf>,
    /// Remove depths with a lower confidence, 0 to 1. Confidence is the probability that a depth is off by less than three
    /// of its standard deviations.
    #[cfg_attr(feature = "clap", arg(long, value_name = "C", default_value_t = Self::default().min_confidence))]
    pub min_confidence: f32,
    /// Correction saved by `farnear calibrate correction`, applied to the map.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub correction: Option<PathBuf>,
    /// Fill regions of low texture: surface (interpolate what surrounds them), or for comparison thesis (one region after the other
    /// and after any --correction, each with a polynomial fitted to the rectangle around it).
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "METHOD", num_args = 0..=1, require_equals = true, default_missing_value = "surface")
    )]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub fill: Option<FillBy>,
    /// Criterion of low texture for --fill: energy (less than a twentieth of the median), or for comparison the thesis'
    /// variance:T (the variance of (far - near) / (far + near) over the window is below T; without :T 0.0144).
    #[cfg_attr(feature = "clap", arg(long, value_name = "CRITERION", default_value_t))]
    #[serde_as(as = "DisplayFromStr")]
    pub low_texture: LowTexture,
    /// Write uncertainty.npy: the standard deviation of each depth in mm for noise that is estimated from the pair, or for
    /// the camera's noise, --uncertainty=camera:full_well_e=20000,read_noise_e=12 (add bits=12 if the file has more bits,
    /// black=100 if a pixel without light has that code). Methods ro and whitened only.
    #[cfg_attr(
        feature = "clap",
        arg(long, value_name = "NOISE", num_args = 0..=1, require_equals = true, default_missing_value = "estimated")
    )]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub uncertainty: Option<CameraNoise>,
    /// Threads; 0 = all cores.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().threads))]
    pub threads: usize,
    /// Outputs, comma separated: npy, tiff, png, mesh, glb (mesh.glb: the surface as glTF, in metres), view and exr (depth.exr: OpenEXR
    /// with depth Z in mm, confidence, standard deviation).
    #[cfg_attr(feature = "clap", arg(long, value_name = "LIST", default_value_t))]
    #[serde_as(as = "DisplayFromStr")]
    pub write: Outputs,
    /// Folder for the results [default: the folder of a capture, else depth/ in the folder of the far image].
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub out: Option<PathBuf>,
}

impl Default for DepthRequest {
    fn default() -> Self {
        Self {
            far: PathBuf::new(),
            near: PathBuf::new(),
            optics: None,
            psf: None,
            operators: None,
            method: None,
            window: None,
            median_px: 3,
            align: Align::default(),
            balance: Balance::default(),
            grey: Grey::default(),
            white_level: None,
            region: None,
            bin: None,
            camera_frames: None,
            min_confidence: 0.0,
            correction: None,
            fill: None,
            low_texture: LowTexture::default(),
            uncertainty: None,
            threads: 0,
            write: Outputs::default(),
            out: None,
        }
    }
}

impl Request for DepthRequest {
    const NAME: &'static str = "depth";
    const REQUIRED: &'static [&'static str] = &["far", "near"];
    const PATHS: &'static [(&'static str, PathKind)] = &[
        ("far", PathKind::Input),
        ("near", PathKind::Input),
        ("optics", PathKind::Input),
        ("operators", PathKind::InputOrName),
        ("psf", PathKind::InputOrName),
        ("correction", PathKind::Input),
        ("camera_frames", PathKind::Input),
        ("out", PathKind::OutputFolder),
    ];
    type Figures = DepthFigures;

    fn check(&self) -> Result<()> {
        if !(0.0..=1.0).contains(&self.min_confidence) {
            return Err(WorkflowError::parameter(
                "min-confidence",
                self.min_confidence,
                "a probability, 0 to 1",
            ));
        }
        if ![1, 3, 5, 7].contains(&self.median_px) {
            return Err(WorkflowError::parameter("median-px", self.median_px, "1, 3, 5 or 7 pixels"));
        }
        if self.fill.is_none() && self.low_texture != LowTexture::default() {
            let expected = "it defines the regions that `fill` fills: give `fill` too";
            return Err(WorkflowError::parameter("low-texture", self.low_texture, expected));
        }
        within("threads", self.threads, &THREADS, "")?;
        if let Some(bin) = self.bin.filter(|bin| !(1..=16).contains(bin)) {
            return Err(WorkflowError::parameter("bin", bin, "1 to 16 pixels"));
        }
        if let Some(bin) = self.bin.filter(|bin| *bin > 1 && !self.may_bin()) {
            let expected =
                "region, camera_frames and operators are of the whole image: give none of them, or bin 1";
            return Err(WorkflowError::parameter("bin", bin, expected));
        }
        if let (Some(_), Some(file)) = (self.region, &self.correction) {
            let expected = "a correction knows the lens by the place in the whole image: correct the whole map, or give no region";
            return Err(WorkflowError::parameter("correction", file.display(), expected));
        }
        let method = self.method();
        if let (Method::Whitened | Method::Baseline(_), Some(asked)) = (method, &self.operators) {
            let expected = format!("method {method} uses none");
            return Err(WorkflowError::parameter("operators", asked.display(), expected));
        }
        if let (Method::RationalOperators | Method::Baseline(_), Some(window @ Window::Adaptive)) =
            (method, self.window)
        {
            let expected = format!("method {method} takes a number of pixels");
            return Err(WorkflowError::parameter("window", window, expected));
        }
        let Method::Baseline(method) = method else { return Ok(()) };
        if let Some(noise) = self.uncertainty {
            let expected =
                format!("the standard deviation is known of methods ro and whitened, not of {method}");
            return Err(WorkflowError::parameter("uncertainty", noise, expected));
        }
        Ok(())
    }

    fn run(&self, context: &Context<'_>) -> Result<DepthFigures> {
        compute(self, context)
    }

    fn inputs(&self) -> Vec<PathBuf> {
        let mut inputs = request::inputs(self);
        if self.optics.is_none() {
            inputs.extend(optics::file_of_pair(None, &self.far));
        }
        inputs
    }
}

impl DepthRequest {
    /// The method, or its default.
    pub fn method(&self) -> Method {
        match self.operators {
            Some(_) => self.method.unwrap_or(Method::RationalOperators),
            None => self.method.unwrap_or(Method::Whitened),
        }
    }

    /// Whether nothing else depends on the pixels of the images.
    fn may_bin(&self) -> bool {
        self.region.is_none() && self.camera_frames.is_none() && self.operators.is_none()
    }

    /// Pixels per side to average into one; adds a doubt if needed. A mosaic of colours needs an even number.
    pub fn bin_for(&self, optics: &Optics, is_mosaic: bool, doubts: &mut Vec<OpticsDoubt>) -> usize {
        let bin = self.bin.unwrap_or_else(|| self.chosen_bin(optics, is_mosaic, doubts));
        let blur_px = optics.max_blur_px() / bin as f64;
        if blur_px < LEAST_BLUR_PX {
            doubts.push(OpticsDoubt::LittleBlur { blur_px, bin });
        }
        bin
    }

    fn chosen_bin(&self, optics: &Optics, is_mosaic: bool, doubts: &mut Vec<OpticsDoubt>) -> usize {
        let blur_px = optics.max_blur_px();
        let of_blur = optics::usable_bin(optics);
        let needed = if is_mosaic { of_blur.next_multiple_of(2) } else { of_blur };
        let binned = optics.distortion().is_none() && optics.stage().is_none() && self.may_bin();
        if of_blur > 1 {
            doubts.push(OpticsDoubt::TooMuchBlur { blur_px, bin: needed, binned });
        }
        if is_mosaic && binned {
            doubts.push(OpticsDoubt::Mosaic { bin: needed });
        }
        if binned { needed } else { 1 }
    }

    /// Library settings: windows, filling, threads.
    pub fn computation(&self) -> Settings {
        let usual = Settings::default();
        Settings {
            smoothing_px: match self.window {
                Some(Window::Fixed(side)) => side,
                _ => usual.smoothing_px,
            },
            median_px: self.median_px,
            fill: self.fill.is_some(),
            fill_by: self.fill.unwrap_or_default(),
            low_texture: self.low_texture,
            threads: self.threads,
            ..usual
        }
    }

    pub(super) fn prepare(&self) -> PrepareSettings {
        PrepareSettings { align: self.align, balance: self.balance, ..PrepareSettings::default() }
    }

    /// Settings of [`farnear_depth::measure::measure_pair`] for images with unknown limits and noise.
    pub fn measure(&self, method: DepthMethod<'_>) -> MeasureSettings {
        MeasureSettings {
            prepare: self.prepare(),
            window: self.window.unwrap_or_else(|| method.usual_window()),
            run: self.computation(),
            least_confidence: self.min_confidence,
        }
    }
}
