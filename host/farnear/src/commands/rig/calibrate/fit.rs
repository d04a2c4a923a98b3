//! `farnear rig calibrate fit`: the board fits the correction itself, and this computer checks its bits.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args;
use farnear_capture::board_correction::{CodedTarget, encode};
use farnear_depth::corrections::Method;
use farnear_maths::clsf::{Columns, DepthScale, Frame, FullFit, RegionFit};
use serde::Serialize;

use crate::{
    commands::{calibrate::correction, rig::Target},
    report::{self, Usage},
};

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
    /// Take every so manieth pixel of every so manieth row.
    #[arg(long, value_name = "PX", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=256))]
    step: u16,
    /// Keep the correction in the board's memory.
    #[arg(long)]
    store: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Figures {
    method: String,
    targets: usize,
    samples: usize,
    coefficients: usize,
    /// Coefficients that differ from this computer's.
    different: usize,
    stored: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    if matches!(arguments.method, Method::Cdc | Method::TwoStep) {
        bail!(Usage(format!("--method {}: the board fits clsf, clsf-blend and clsf-full", arguments.method)));
    }
    let maps = correction::read(&arguments.patterns)?;
    let (first, _) = maps.first().context("the list is empty")?;
    let side = |length: usize| u16::try_from(length).unwrap_or(u16::MAX);
    let frame = Frame::new(side(first.ncols()), side(first.nrows()))?;
    let depths = || maps.iter().map(|(_, true_mm)| *true_mm as f32);
    let (nearest, farthest) =
        (depths().fold(f32::INFINITY, f32::min), depths().fold(f32::NEG_INFINITY, f32::max));
    let scale = DepthScale::for_range(farthest, nearest)?;
    let targets: Vec<CodedTarget> = maps
        .iter()
        .map(|(map, true_mm)| CodedTarget {
            codes: encode(map.view(), scale),
            truth: scale.encode(*true_mm as f32),
        })
        .collect();
    let rig = arguments.target.connect(None)?;
    let rows = targets.len() * usize::from(frame.height().div_ceil(arguments.step));
    let found =
        rig.client.fit_correction(arguments.method, frame, scale, &targets, arguments.step, &mut |row| {
            if row % 200 == 0 || row == rows {
                eprintln!("{row} of {rows} rows");
            }
        })?;
    let expected = on_host(arguments.method, frame, &targets, arguments.step)?;
    let different = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
    if different == 0 && arguments.store {
        rig.client.store_correction()?;
    }
    let figures = Figures {
        method: arguments.method.to_string(),
        targets: targets.len(),
        samples: rows * usize::from(frame.width().div_ceil(arguments.step)),
        coefficients: found.len(),
        different,
        stored: different == 0 && arguments.store,
    };
    report::print(&figures, arguments.json)?;
    if different > 0 {
        bail!("{different} coefficients differ from this computer's calculation; nothing was stored");
    }
    Ok(())
}

/// The same fit here, by the code that the board runs.
fn on_host(method: Method, frame: Frame, targets: &[CodedTarget], step: u16) -> Result<Vec<i32>> {
    let columns = Columns { first: 0, step };
    let rows = || {
        targets
            .iter()
            .flat_map(|target| (0..frame.height()).step_by(usize::from(step)).map(move |row| (target, row)))
    };
    let codes = |target: &CodedTarget, row: u16| -> Vec<i16> {
        target.codes.row(usize::from(row)).iter().copied().step_by(usize::from(step)).collect()
    };
    if method == Method::ClsfFull {
        let mut fit = FullFit::new(frame);
        for (target, row) in rows() {
            fit.add_row(row, columns, &codes(target, row), target.truth)?;
        }
        return Ok(fit.solve()?.iter().map(|c| c.to_bits()).collect());
    }
    let mut fit = RegionFit::new(frame);
    for (target, row) in rows() {
        fit.add_row(row, columns, &codes(target, row), target.truth)?;
    }
    Ok(fit.solve()?.as_flattened().as_flattened().iter().map(|c| c.to_bits()).collect())
}
