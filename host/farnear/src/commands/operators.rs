//! `farnear operators`: designs the kernels for a point spread function and optics.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_depth::{
    kernel::sizes_in_words,
    operators::{Design, Family},
};
use farnear_workflows::{
    operators::{self, OperatorSettings},
    psf::PsfSource,
};

use crate::{report, terminal};

/// Design rational operators and say how well they fit.
#[derive(Args)]
#[command(
    after_help = "Example: farnear operators --psf gaussian:k=0.4578 --optics optics.toml --out operators.toml --json"
)]
pub struct Arguments {
    /// Point spread function: pillbox, gaussian:k=K, generalised:p=P,k=K, ring:inner=I, or a file with an image of it or of
    /// the aperture (FILE.png, .tiff or .npy; FILE,radius=PX where the blur radius is not half its shorter side); without
    /// it the one of the optics file.
    #[arg(long, value_name = "PSF|FILE")]
    psf: Option<PsfSource>,
    /// Family; without it the one that belongs to the point spread function.
    #[arg(long)]
    family: Option<Family>,
    /// Design procedure.
    #[arg(long, default_value_t)]
    design: Design,
    /// The optics file.
    #[arg(long, value_name = "FILE")]
    optics: PathBuf,
    #[arg(
        long,
        value_name = "PX",
        default_value_t = 7,
        help = format!("Width and height of the kernels in pixels: {}", sizes_in_words())
    )]
    kernel_size: usize,
    /// Where to save the operators, as TOML.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Where to draw what was fitted and how the kernels respond: .svg or .png.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let Arguments { psf, family, design, optics, kernel_size, out, plot, json } = arguments;
    let settings = OperatorSettings { optics, psf, family, design, kernel_size, out, plot };
    report::print(&operators::design(&settings, &terminal::context()?)?, json)
}
