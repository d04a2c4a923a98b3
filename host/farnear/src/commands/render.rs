use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_scene::Noise;

use crate::{render, report, scene::SceneArgument, terminal};

/// Render a far- and a near-focused image of a known scene, with its true depth.
#[derive(Args)]
#[command(
    after_help = "Example: farnear render --scene staircase --psf gaussian:k=0.4578 --optics optics.toml --noise 8bit --seed 1 --out scene/

A scene of your own is a TOML file; the files that it names are next to it:
  depth = \"bust.npy\"      # depths in mm, .npy or float .tiff, stretched over the image; or scene = \"cone\"
  texture = \"bricks.png\"  # any picture; or \"sand\" (also without this line) or \"fractal\"
  contrast = 0.3          # of sand or fractal: the standard deviation, the mean being 1

Example: farnear render --scene bust.toml --optics optics.toml --out bust/"
)]
pub struct Arguments {
    /// The scene: plane:MM, staircase, slant, cone, sphere, or a scene file (see below).
    ///
    /// A name takes options, such as cone,texture=fractal,contrast=0.3.
    #[arg(long, value_name = "NAME|FILE", default_value = "staircase")]
    pub scene: SceneArgument,
    /// A lens whose focus varies over the field in ellipses, which corrections undo.
    #[arg(long)]
    pub elliptical_distortion: bool,
    /// Point spread function: pillbox, gaussian:k=K, generalised:p=P,k=K or ring:inner=I; without it the one of the optics file.
    #[arg(long)]
    pub psf: Option<String>,
    /// The optics file.
    #[arg(long, value_name = "FILE")]
    pub optics: PathBuf,
    /// Noise and bits: none, 8bit or 12bit.
    #[arg(long, default_value = "8bit")]
    pub noise: Noise,
    /// Decides everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Width of the images in pixels.
    #[arg(long, value_name = "PX", default_value_t = 640)]
    pub width: usize,
    /// Height of the images in pixels.
    #[arg(long, value_name = "PX", default_value_t = 480)]
    pub height: usize,
    /// Folder for far.png, near.png, truth.npy and optics.toml.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: Arguments) -> Result<()> {
    let json = arguments.json;
    report::print(&render::render(arguments, &terminal::context()?)?, json)
}
