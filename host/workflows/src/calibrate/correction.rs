//! Fits a depth correction to depth maps of flat targets at known depths.

use std::{
    fs,
    path::{Path, PathBuf},
};

use farnear_depth::corrections::{CdcSettings, Correction, Method, Pattern, fit};
use farnear_files::staging;
use ndarray::{Array2, ArrayView2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::rounded_for,
    measure::read_map,
    quantile,
    request::{PathKind, Request},
};

/// Largest ratio of a target's distance and the depths measured of it.
const LARGEST_RATIO: f64 = 2.0;
/// Remaining error of a pattern relative to the usual one.
const UNLIKE: f64 = 5.0;

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
    /// Of the same maps, over the pixels whose depth the correction keeps. Errors of other maps are larger.
    pub rmse_after_mm: f64,
}

pub fn learn(settings: &CalibrateCorrectionRequest, context: &Context<'_>) -> Result<CorrectionFigures> {
    let maps = read(&settings.patterns, context)?;
    context.cancel.check("reading the maps")?;
    let patterns: Vec<Pattern<'_>> =
        maps.iter().map(|(map, true_mm)| Pattern { depth_mm: map.view(), true_mm: *true_mm }).collect();
    let cdc = CdcSettings { window: settings.window_px, smoothing_px: settings.smoothing_px };
    for (index, pattern) in patterns.iter().enumerate() {
        check_distance(&format!("pattern {}", index + 1), pattern)?;
    }
    let correction = fit(settings.method, &patterns, &cdc)?;
    let (far_mm, near_mm) = correction.range_mm();
    let after = errors(&maps, Some(&correction))?;
    for warning in unlike_others(&after, |index| format!("pattern {}", index + 1)) {
        context.progress.warn(&warning);
    }
    let rounded = |mm: f64| rounded_for(far_mm - near_mm, mm, 4);
    let figures = CorrectionFigures {
        method: correction.method().to_string(),
        patterns: patterns.len(),
        far_mm,
        near_mm,
        rmse_before_mm: rounded(rmse_mm(&errors(&maps, None)?)),
        rmse_after_mm: rounded(rmse_mm(&after)),
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

/// Reads the maps (mm, holes are NaN) and true depths (mm) of `[[pattern]]` entries: `depth = FILE` (relative),
/// `true_mm = MM`. Fails for maps of several regions of the images.
pub fn read(list: &Path, context: &Context<'_>) -> Result<Vec<(Array2<f32>, f64)>> {
    let folder = list.parent().unwrap_or(Path::new(""));
    let (mut maps, mut remarks) = (Vec::new(), Vec::new());
    let mut part = None;
    for (depth, true_mm) in self::list(list)? {
        let file = folder.join(depth);
        let map = read_map(&file)?;
        if let Some(own) = map.part {
            let first = *part.get_or_insert(own);
            if own != first && (own.bin == first.bin || (own.x, own.y) != (first.x, first.y)) {
                let value = format!("{}, which begins at {},{}", file.display(), own.x, own.y);
                let expected = format!("maps of one region: the first begins at {},{}", first.x, first.y);
                return Err(WorkflowError::parameter("patterns", value, expected));
            }
        }
        maps.push((map.depth_mm("patterns", &mut remarks)?, true_mm));
    }
    remarks.iter().for_each(|remark| context.progress.warn(remark));
    Ok(maps)
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

/// Refuses a distance in another unit.
pub fn check_distance(name: &str, pattern: &Pattern<'_>) -> Result<()> {
    let Some(median) = quantile::of_values(depths(pattern.depth_mm).map(f64::from), 0.5) else {
        return Ok(());
    };
    if (1.0 / LARGEST_RATIO..=LARGEST_RATIO).contains(&(pattern.true_mm / median)) {
        return Ok(());
    }
    let value = format!("{} of {name}", pattern.true_mm);
    let expected = format!("expected the target's distance in mm; the median of its map is {median:.3} mm");
    Err(WorkflowError::parameter("true_mm", value, expected))
}

fn depths(map: ArrayView2<'_, f32>) -> impl Iterator<Item = f32> {
    map.into_iter().copied().filter(|depth| depth.is_finite() && *depth > 0.0)
}

/// Sum of squared errors and number of depths of each pattern.
pub fn errors(maps: &[(Array2<f32>, f64)], correction: Option<&Correction>) -> Result<Vec<[f64; 2]>> {
    let of_map = |(map, true_mm): &(Array2<f32>, f64)| {
        let corrected = correction.map(|correction| correction.apply(map.view())).transpose()?;
        let squares = depths(corrected.as_ref().unwrap_or(map).view());
        let squares = squares.map(|depth| (f64::from(depth) - true_mm).powi(2));
        Ok(squares.fold([0.0; 2], |[sum, count], square| [sum + square, count + 1.0]))
    };
    maps.iter().map(of_map).collect()
}

fn rmse_mm(errors: &[[f64; 2]]) -> f64 {
    let [sum, count] = errors.iter().fold([0.0; 2], |[a, b], [sum, count]| [a + sum, b + count]);
    (sum / count).sqrt()
}

/// Findings on patterns whose error remains: a distance that was written down wrongly, or exchanged. `name` is of a pattern's index.
pub fn unlike_others(errors: &[[f64; 2]], name: impl Fn(usize) -> String) -> Vec<String> {
    let rmse: Vec<f64> = errors.iter().map(|error| rmse_mm(std::slice::from_ref(error))).collect();
    let Some(median) = quantile::of_values(rmse.iter().copied(), 0.5) else { return Vec::new() };
    let unlike = |(_, mm): &(usize, &f64)| **mm > UNLIKE * median;
    let named = |(index, mm): (usize, &f64)| {
        let [mm, usual] = [*mm, median].map(|mm| rounded_for(median, mm, 3));
        let name = name(index);
        format!("{name}: an error of {mm} mm remains, {usual} mm is usual: is its true_mm right?")
    };
    rmse.iter().enumerate().filter(unlike).map(named).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distance_in_metres_is_refused_and_a_wrong_one_is_named() {
        let map = Array2::from_elem((4, 4), 905.0_f32);
        let pattern = |true_mm| Pattern { depth_mm: map.view(), true_mm };
        assert!(check_distance("pattern 1", &pattern(900.0)).is_ok());
        let error = check_distance("pattern 3", &pattern(0.9)).unwrap_err().to_string();
        assert!(error.contains("0.9 of pattern 3") && error.contains("905.000 mm"), "{error}");
        let maps = vec![(map.clone(), 904.0), (map.clone(), 905.5), (map.clone(), 904.5), (map, 925.0)];
        let found = unlike_others(&errors(&maps, None).unwrap(), |index| format!("pattern {}", index + 1));
        assert!(
            found.len() == 1 && found[0].starts_with("pattern 4: an error of 20 mm remains"),
            "{found:?}"
        );
    }

    /// A list of maps, each in its folder with a record.
    fn listed(folder: &Path, maps: &[(&str, Array2<f32>, &str)]) -> PathBuf {
        let mut text = String::new();
        for (name, map, record) in maps {
            fs::create_dir(folder.join(name)).unwrap();
            fs::write(folder.join(name).join("depth.npy"), farnear_files::npy::write(map.view())).unwrap();
            if !record.is_empty() {
                let optics = include_str!("../../../../examples/rig.toml").replace('[', "[optics.");
                let (file, record) = match record.starts_with("unit") {
                    true => ("stack.toml", (*record).to_string()),
                    false => ("depth.toml", optics + *record),
                };
                fs::write(folder.join(name).join(file), record).unwrap();
            }
            text += &format!("[[pattern]]\ndepth = \"{name}/depth.npy\"\ntrue_mm = 900.0\n");
        }
        let list = folder.join("patterns.toml");
        fs::write(&list, text).unwrap();
        list
    }

    #[test]
    fn maps_are_read_with_their_holes_unit_and_region() {
        let map = ndarray::arr2(&[[0.0, -1.0], [905.0, 907.0]]);
        let part = |x: usize| format!("[part]\nx = {x}\ny = 0\nimage_width = 9\nimage_height = 9\n");
        let read = |maps: &[(&str, Array2<f32>, &str)]| {
            let folder = tempfile::tempdir().unwrap();
            read(&listed(folder.path(), maps), &Context::unattended())
        };
        let [left, right] = [part(0), part(4)];
        let found = read(&[("a", map.clone(), ""), ("b", map.clone(), right.as_str())]).unwrap();
        for (depth, _) in found {
            assert!(depth[(0, 0)].is_nan() && depth[(0, 1)].is_nan() && depth[(1, 0)] == 905.0, "{depth}");
        }
        let error = read(&[("a", map.clone(), "unit = \"um\"\n")]).unwrap_err();
        assert!(error.is_usage() && error.to_string().contains("states um"), "{error}");
        let error = read(&[("a", map.clone(), left.as_str()), ("b", map, right.as_str())]).unwrap_err();
        assert!(error.is_usage() && error.to_string().contains("begins at 4,0"), "{error}");
    }

    #[test]
    fn holes_are_no_depths() {
        let map = ndarray::arr2(&[[0.0, f32::NAN], [905.0, 907.0]]);
        assert_eq!(rmse_mm(&errors(&[(map, 906.0)], None).unwrap()), 1.0);
    }
}
