//! `farnear rig calibrate fit`: the board fits the correction itself, and this computer checks its bits.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_depth::corrections::Method;
use farnear_workflows::rig::correction_fit::{self, FitSettings};

use crate::{commands::rig::Target, report, terminal};

/// Let the board fit a depth correction to flat targets, and keep it in its memory.
///
/// The depth maps of PATTERNS.toml are sent row by row; the coefficients are compared bit for bit with the same
/// calculation here.
#[derive(Args)]
#[command(
    after_help = "Example: farnear rig calibrate fit series/PATTERNS.toml --port sim --method clsf-full --step 16 --store"
)]
pub struct Arguments {
    /// The list of depth maps, as `farnear rig calibrate targets` writes it.
    patterns: PathBuf,
    #[command(flatten)]
    target: Target,
    #[arg(long, help = Method::board_choices())]
    method: Method,
    /// Take every Nth pixel of every Nth row only.
    #[arg(long, value_name = "PX", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=256))]
    step: u16,
    /// Keep the correction in the board's memory.
    #[arg(long)]
    store: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let Arguments { patterns, target, method, step, store, json } = arguments;
    let settings = FitSettings { rig: target.address()?, patterns, method, step, store };
    let figures = correction_fit::fit(&settings, &terminal::context()?)?;
    report::print(&figures, json)?;
    Ok(figures.check()?)
}
