//! `farnear calibrate correction`: learns a correction from depth maps of flat targets at known depths.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail};
use clap::Args;
use farnear_capture::aside;
use farnear_depth::corrections::{CdcSettings, Correction, Method, Pattern, fit};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use crate::{files::map, report};

/// Learn a correction of the elliptical distortion from depth maps of flat targets at known depths.
///
/// PATTERNS.toml lists the maps, paths relative to itself. 20 to 30 targets through the working range teach any method.
#[derive(Args)]
#[command(after_help = "\
PATTERNS.toml has an entry for each map:
  [[pattern]]
  depth = \"target-01/depth.npy\"
  true_mm = 933.0

Example: farnear calibrate correction patterns.toml --method clsf-full --out correction.toml")]
pub struct Arguments {
    /// The list of depth maps.
    patterns: PathBuf,
    #[arg(long, help = Method::choices())]
    method: Method,
    /// Where to save the correction.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// cdc: N of its window of 2 N + 1 pixels.
    #[arg(long, value_name = "PX", default_value_t = CdcSettings::default().window)]
    window: usize,
    /// cdc: standard deviation by which patterns are smoothed; 0 = as measured.
    #[arg(long, value_name = "PX", default_value_t = CdcSettings::default().smoothing_px)]
    smooth_patterns: f64,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The list of patterns as users write it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    #[serde(default)]
    pattern: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    depth: PathBuf,
    true_mm: f64,
}

#[derive(Serialize)]
struct Figures {
    method: String,
    patterns: usize,
    far_mm: f64,
    near_mm: f64,
    /// Root mean square error of the patterns themselves, as measured and corrected.
    rmse_before_mm: f64,
    rmse_after_mm: f64,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let maps = read(&arguments.patterns)?;
    let patterns: Vec<Pattern<'_>> =
        maps.iter().map(|(map, true_mm)| Pattern { depth_mm: map.view(), true_mm: *true_mm }).collect();
    let settings = CdcSettings { window: arguments.window, smoothing_px: arguments.smooth_patterns };
    let correction = fit(arguments.method, &patterns, &settings)?;
    let (far_mm, near_mm) = correction.range_mm();
    let figures = Figures {
        method: correction.method().to_string(),
        patterns: patterns.len(),
        far_mm,
        near_mm,
        rmse_before_mm: report::rounded(rmse(&maps, None)?, 4),
        rmse_after_mm: report::rounded(rmse(&maps, Some(&correction))?, 4),
    };
    aside::write_file(&arguments.out, toml::to_string(&correction)?.as_bytes())?;
    eprintln!("wrote {}", arguments.out.display());
    report::print(&figures, arguments.json)
}

/// The maps that a list names, with their true depths in mm.
pub fn read(list: &Path) -> Result<Vec<(Array2<f32>, f64)>> {
    let text = fs::read_to_string(list).with_context(|| format!("cannot read {}", list.display()))?;
    let List { pattern } = toml::from_str(&text).with_context(|| {
        format!("{} is no list of [[pattern]] with depth = FILE and true_mm = MM", list.display())
    })?;
    if pattern.is_empty() {
        bail!("{} lists no [[pattern]]", list.display());
    }
    let folder = list.parent().unwrap_or(Path::new(""));
    pattern.iter().map(|entry| Ok((map::read(&folder.join(&entry.depth))?, entry.true_mm))).collect()
}

fn rmse(maps: &[(Array2<f32>, f64)], correction: Option<&Correction>) -> Result<f64> {
    let (mut squares, mut count) = (0.0, 0.0);
    for (map, true_mm) in maps {
        let corrected = correction.map(|correction| correction.apply(map.view())).transpose()?;
        for depth in corrected.as_ref().unwrap_or(map).iter().filter(|depth| depth.is_finite()) {
            squares += (f64::from(*depth) - true_mm).powi(2);
            count += 1.0;
        }
    }
    Ok((squares / count).sqrt())
}
