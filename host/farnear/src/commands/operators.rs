//! `farnear operators`: designs the kernels for a point spread function and optics.

use std::{path::PathBuf, time::Instant};

use anyhow::Result;
use clap::Args;
use farnear_capture::aside;
use farnear_depth::{
    kernel::sizes_in_words,
    operators::{self, Design, Family, Request},
    psf::Psf,
};
use serde::Serialize;

use crate::{files, plot, report};

/// Design rational operators and say how well they fit.
#[derive(Args)]
#[command(
    after_help = "Example: farnear operators --psf gaussian:k=0.4578 --optics optics.toml --out operators.toml --json"
)]
pub struct Arguments {
    /// Point spread function: pillbox, gaussian:k=K or generalised:p=P,k=K; without it the one of the optics file.
    #[arg(long)]
    psf: Option<Psf>,
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

#[derive(Serialize)]
struct Figures {
    name: String,
    nir_rms: f64,
    seconds: f64,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let optics = files::optics::read(&arguments.optics)?;
    let psf = arguments.psf.unwrap_or(optics.psf());
    let request = Request {
        family: arguments.family.unwrap_or(Family::of(psf)),
        design: arguments.design,
        psf,
        max_blur_px: optics.max_blur_px(),
        kernel_size: arguments.kernel_size,
    };
    let start = Instant::now();
    // Not from the cache: how long a design takes is one of the figures.
    let operators = operators::design(&request)?;
    let seconds = start.elapsed().as_secs_f64();
    if let Some(out) = &arguments.out {
        aside::write_file(out, toml::to_string(&operators)?.as_bytes())?;
        eprintln!("wrote {}", out.display());
    }
    if let Some(file) = &arguments.plot {
        aside::write_file(file, &plot::plot(&operators, file)?)?;
        eprintln!("wrote {}", file.display());
    }
    let figures = Figures {
        name: operators.name().into(),
        nir_rms: operators.nir_rms(),
        seconds: report::rounded(seconds, 6),
    };
    report::print(&figures, arguments.json)
}
