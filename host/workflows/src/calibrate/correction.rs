//! Fits a depth correction to depth maps of flat targets at known depths.

use std::{
    fs,
    path::{Path, PathBuf},
};

use farnear_depth::corrections::{CdcSettings, Correction, Method, Pattern, fit};
use farnear_files::{map, staging};
use ndarray::Array2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::rounded,
    request::{PathKind, Request},
};

/// Learn a correction of the elliptical distortion from depth maps of flat targets at known depths.
///
/// PATTERNS.toml lists the maps, paths relative to itself. Any method needs 20 to 30 targets through the working range.
#[serde_as]
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "\
PATTERNS.toml has an entry for each map:
  [[pattern]]
  depth = \"target-01/depth.npy\"
  true_mm = 933.0

Example: farnear calibrate correction patterns.toml --method clsf-full --out correction.toml")
)]
#[serde(default)]
pub struct CalibrateCorrectionRequest {
    /// The list of depth maps.
    pub patterns: PathBuf,
    /// Method: clsf (3x3 regions), clsf-blend (3x3 regions without steps), clsf-full (one polynomial), cdc (stored patterns), two-step
    /// (two polynomials in turn) or spline (smooth surface over field and depth).
    #[cfg_attr(feature = "clap", arg(long))]
    #[serde_as(as = "DisplayFromStr")]
    pub method: Method,
    /// cdc: N of its window of 2 N + 1 pixels.
    #[cfg_attr(feature = "clap", arg(long, value_name = "PX", default_value_t = Self::default().window_px))]
    pub window_px: usize,
    /// cdc: standard deviation of the Gaussian that smooths the patterns; 0 = as measured.
    #[cfg_attr(feature = "clap", arg(long, value_name = "PX", default_value_t = Self::default().smoothing_px))]
    pub smoothing_px: f64,
    /// File for the correction.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub out: PathBuf,
}

impl Default for CalibrateCorrectionRequest {
    fn default() -> Self {
        let CdcSettings { window, smoothing_px } = CdcSettings::default();
        Self {
            patterns: PathBuf::new(),
            method: Method::Clsf,
            window_px: window,
            smoothing_px,
            out: PathBuf::new(),
        }
    }
}

impl Request for CalibrateCorrectionRequest {
    const NAME: &'static str = "calibrate correction";
    const REQUIRED: &'static [&'static str] = &["patterns", "method", "out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("patterns", PathKind::Input), ("out", PathKind::OutputFile)];
    type Figures = CorrectionFigures;

    fn run(&self, context: &Context<'_>) -> Result<CorrectionFigures> {
        learn(self, context)
    }
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct CorrectionFigures {
    pub method: String,
    pub patterns: usize,
    pub far_mm: f64,
    pub near_mm: f64,
    /// Error of the maps before correction.
    pub rmse_before_mm: f64,
    pub rmse_after_mm: f64,
}

pub fn learn(settings: &CalibrateCorrectionRequest, context: &Context<'_>) -> Result<CorrectionFigures> {
    let maps = read(&settings.patterns)?;
    context.cancel.check("reading the maps")?;
    let patterns: Vec<Pattern<'_>> =
        maps.iter().map(|(map, true_mm)| Pattern { depth_mm: map.view(), true_mm: *true_mm }).collect();
    let cdc = CdcSettings { window: settings.window_px, smoothing_px: settings.smoothing_px };
    let correction = fit(settings.method, &patterns, &cdc)?;
    let (far_mm, near_mm) = correction.range_mm();
    let figures = CorrectionFigures {
        method: correction.method().to_string(),
        patterns: patterns.len(),
        far_mm,
        near_mm,
        rmse_before_mm: rounded(rmse_mm(&maps, None)?, 4),
        rmse_after_mm: rounded(rmse_mm(&maps, Some(&correction))?, 4),
    };
    context.cancel.check("learning the correction")?;
    staging::write_file(&settings.out, toml::to_string(&correction)?.as_bytes())?;
    context.info(&format!("wrote {}", settings.out.display()));
    Ok(figures)
}

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

/// Reads the maps and true depths (mm) of `[[pattern]]` entries: `depth = FILE` (relative), `true_mm = MM`.
pub fn read(list: &Path) -> Result<Vec<(Array2<f32>, f64)>> {
    let folder = list.parent().unwrap_or(Path::new(""));
    self::list(list)?.into_iter().map(|(depth, mm)| Ok((map::read(&folder.join(depth))?, mm))).collect()
}

pub fn list(list: &Path) -> Result<Vec<(PathBuf, f64)>> {
    const EXPECTED: &str = "a list of [[pattern]] with depth = FILE and true_mm = MM";
    let text = fs::read_to_string(list).map_err(WorkflowError::read("the list of patterns", list))?;
    let List { pattern } = toml::from_str(&text).map_err(WorkflowError::file(list, EXPECTED))?;
    if pattern.is_empty() {
        return Err(WorkflowError::file(list, EXPECTED)("it lists no [[pattern]]"));
    }
    Ok(pattern.into_iter().map(|entry| (entry.depth, entry.true_mm)).collect())
}

fn rmse_mm(maps: &[(Array2<f32>, f64)], correction: Option<&Correction>) -> Result<f64> {
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
