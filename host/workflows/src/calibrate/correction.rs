//! A correction from depth maps of flat targets at known depths.

use std::{
    fs,
    path::{Path, PathBuf},
};

use farnear_depth::corrections::{CdcSettings, Correction, Method, Pattern, fit};
use farnear_files::{map, staging};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::rounded,
};

/// What is learned, from what, and where it goes.
#[derive(Clone, PartialEq, Debug)]
pub struct CorrectionSettings {
    /// The list of depth maps; see [`read`].
    pub patterns: PathBuf,
    /// Which kind of correction.
    pub method: Method,
    /// Window and smoothing of cdc.
    pub cdc: CdcSettings,
    /// Where the correction is saved.
    pub out: PathBuf,
}

/// What there is to say of a correction that was learned.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct CorrectionFigures {
    /// Which kind.
    pub method: String,
    /// How many targets taught it.
    pub patterns: usize,
    /// Farthest depth that it was taught.
    pub far_mm: f64,
    /// Nearest depth that it was taught.
    pub near_mm: f64,
    /// Root mean square error of the patterns themselves, as measured.
    pub rmse_before_mm: f64,
    /// The same corrected.
    pub rmse_after_mm: f64,
}

/// Learns a correction and saves it.
///
/// # Errors
/// The list, its maps, [`WorkflowError::Correction`].
pub fn learn(settings: &CorrectionSettings, context: &Context<'_>) -> Result<CorrectionFigures> {
    let maps = read(&settings.patterns)?;
    context.cancel.check("reading the maps")?;
    let patterns: Vec<Pattern<'_>> =
        maps.iter().map(|(map, true_mm)| Pattern { depth_mm: map.view(), true_mm: *true_mm }).collect();
    let correction = fit(settings.method, &patterns, &settings.cdc)?;
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
    context.say(&format!("wrote {}", settings.out.display()));
    Ok(figures)
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

/// The maps that a list of `[[pattern]]` with `depth = FILE` (relative to the list) and `true_mm = MM` names, with their
/// true depths in mm.
///
/// # Errors
/// [`WorkflowError::Read`]; [`WorkflowError::File`] for a list of another form or an empty one; [`WorkflowError::Map`].
pub fn read(list: &Path) -> Result<Vec<(Array2<f32>, f64)>> {
    let folder = list.parent().unwrap_or(Path::new(""));
    self::list(list)?.into_iter().map(|(depth, mm)| Ok((map::read(&folder.join(depth))?, mm))).collect()
}

/// The files (relative to the list) and true depths in mm of a list of patterns.
///
/// # Errors
/// As [`read`], without the maps.
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
