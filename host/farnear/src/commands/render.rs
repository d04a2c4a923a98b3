//! `farnear render`: what a camera would see of a known scene, and the truth with it.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use farnear_capture::{aside::Aside, image_file::encode_png};
use farnear_depth::psf::Psf as OpticsPsf;
use farnear_scene::{Camera, EllipticalDistortion, Lens, Noise, OpticsFile, Psf, Renderer, truth};
use serde::Serialize;

use crate::{
    files::{self, map, scene::SceneArgument},
    report,
};

/// Render a far- and a near-focused image of a known scene, with its true depth.
#[derive(Args)]
#[command(
    after_help = "Example: farnear render --scene staircase --psf gaussian:k=0.4578 --optics optics.toml --noise 8bit --seed 1 --out scene/

A scene of your own is a TOML file; the files it names lie beside it:
  depth = \"bust.npy\"      # depths in mm, .npy or float .tiff, stretched over the image; or scene = \"cone\"
  texture = \"bricks.png\"  # any picture; or \"sand\" (also without this line) or \"fractal\"
  contrast = 0.3          # of sand or fractal: the standard deviation, the mean being 1

Example: farnear render --scene bust.toml --optics optics.toml --out bust/"
)]
pub struct Arguments {
    /// What stands before the camera: plane:MM, staircase, slant, cone, sphere, or a scene file (see below).
    ///
    /// A name takes options, such as cone,texture=fractal,contrast=0.3.
    #[arg(long, value_name = "NAME|FILE", default_value = "staircase")]
    scene: SceneArgument,
    /// A lens whose focus varies over the field in ellipses, which corrections undo.
    #[arg(long)]
    elliptical_distortion: bool,
    /// Point spread function: pillbox, gaussian:k=K or generalised:p=P,k=K; without it the one of the optics file.
    #[arg(long)]
    psf: Option<String>,
    /// The optics file.
    #[arg(long, value_name = "FILE")]
    optics: PathBuf,
    /// Noise and bits: none, 8bit or 12bit.
    #[arg(long, default_value = "8bit")]
    noise: Noise,
    /// Decides everything random.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Width of the images in pixels.
    #[arg(long, value_name = "PX", default_value_t = 640)]
    width: usize,
    /// Height of the images in pixels.
    #[arg(long, value_name = "PX", default_value_t = 480)]
    height: usize,
    /// Folder for far.png, near.png, truth.npy and optics.toml.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Figures {
    width: usize,
    height: usize,
    nearest_mm: f64,
    farthest_mm: f64,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let optics = files::optics::read(&arguments.optics)?;
    let text = files::optics::text(&arguments.optics)?;
    let psf = match &arguments.psf {
        Some(name) => name.parse::<OpticsPsf>()?,
        None => optics.psf(),
    };
    let spread: Psf =
        psf.to_string().parse().context("the renderer does not know this point spread function")?;
    let mut lens = Lens::from_optics(&OpticsFile::parse(&text)?)?;
    if arguments.elliptical_distortion {
        lens = lens.with_distortion(EllipticalDistortion::default());
    }
    let scene = arguments.scene.read()?;
    let camera = Camera::new(arguments.width, arguments.height, arguments.noise);
    let renderer = Renderer::new(&scene, &lens, &spread, &camera, arguments.seed)?;
    let aside = Aside::into_folder(&arguments.out)?;
    for (number, name, sensor_mm) in
        [(0, "far.png", lens.sensor_far_mm), (1, "near.png", lens.sensor_near_mm)]
    {
        let pixels = renderer.expose(sensor_mm, number)?;
        let png = encode_png(pixels.view(), arguments.noise.bits()).map_err(anyhow::Error::msg)?;
        aside.write(name, &png)?;
    }
    let depth = truth(&scene, &lens, &camera);
    aside.write("truth.npy", &map::npy(depth.view())?)?;
    aside.write("optics.toml", toml::to_string(&optics.with_psf(psf))?.as_bytes())?;
    aside.finish()?;
    eprintln!("wrote {}", arguments.out.display());
    let figures = Figures {
        width: arguments.width,
        height: arguments.height,
        nearest_mm: f64::from(depth.iter().copied().fold(f32::INFINITY, f32::min)),
        farthest_mm: f64::from(depth.iter().copied().fold(f32::NEG_INFINITY, f32::max)),
    };
    report::print(&figures, arguments.json)
}
