//! `farnear target`: a flat target to print.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_workflows::target::{self, Paper, TargetSettings};

use crate::{report, terminal};

/// Write a textured target as a PDF page, true to scale, as fine as the optics can use.
#[derive(Args)]
#[command(after_help = "Example: farnear target --optics optics.toml --paper a3 --out target.pdf

Print it in black, at its actual size (100 %), and glue it to something flat: the line at its foot is 100 mm long then.")]
pub struct Arguments {
    /// The optics file.
    #[arg(long, value_name = "FILE")]
    optics: PathBuf,
    /// How far from the lens the target will stand [default: the far focus].
    #[arg(long, value_name = "MM")]
    distance: Option<f64>,
    /// The sheet: a4, a3, a2, a1, a0, letter, or WIDTHxHEIGHT in mm.
    #[arg(long, default_value = "a4")]
    paper: Paper,
    /// The printer's dots per inch.
    #[arg(long, default_value_t = 600)]
    dpi: u32,
    /// Decides the texture.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The PDF file.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let Arguments { optics, distance, paper, dpi, seed, out, json } = arguments;
    let settings = TargetSettings { optics, distance_mm: distance, paper, dpi, seed, out };
    report::print(&target::print(&settings, &terminal::context()?)?, json)
}
