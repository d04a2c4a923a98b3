//! Figures of a depth map: of a region, of the plane through it, along a line, and of what lies between two maps.
//!
//! Neighbouring depths share their windows, so that their mean is less certain than their number says. Standard errors are
//! therefore taken from the means of blocks that are wider than a window.

mod plane;

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
    str::FromStr,
};

use farnear_files::{map, staging};
use ndarray::{Array2, ArrayView2, s};
use serde::Serialize;

use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::rounded,
};

pub use plane::{PlaneFigures, plane};

/// Side of the blocks whose means count as independent, px: wider than usual windows.
const BLOCK_PX: usize = 24;

/// A part of a map.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Region {
    /// Column of the upper left pixel, and row.
    pub left: usize,
    /// Its row.
    pub top: usize,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
}

/// A text that names no region.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("expected LEFT,TOP,WIDTH,HEIGHT in pixels, such as 100,80,200,150")]
pub struct NoRegion;

impl FromStr for Region {
    type Err = NoRegion;

    fn from_str(text: &str) -> Result<Self, NoRegion> {
        let numbers: Vec<usize> = text
            .split(',')
            .map(|part| part.trim().parse())
            .collect::<Result<_, _>>()
            .map_err(|_| NoRegion)?;
        match numbers[..] {
            [left, top, width, height] if width > 0 && height > 0 => Ok(Self { left, top, width, height }),
            _ => Err(NoRegion),
        }
    }
}

/// The depths of a region, or of the whole map.
fn part<'a>(map: &'a Array2<f32>, region: Option<Region>, file: &Path) -> Result<ArrayView2<'a, f32>> {
    let Some(region) = region else { return Ok(map.view()) };
    let (height, width) = map.dim();
    let Region { left, top, width: across, height: down } = region;
    let fits = |from: usize, size: usize, all: usize| from.checked_add(size).is_some_and(|end| end <= all);
    if !(fits(left, across, width) && fits(top, down, height)) {
        let text = format!("{left},{top},{across},{down}");
        let expected = format!("{} has {width}x{height} pixels", file.display());
        return Err(WorkflowError::parameter("region", text, expected));
    }
    Ok(map.slice(s![top..top + down, left..left + across]))
}

/// What there is to say of depths or differences.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct RegionFigures {
    /// Pixels with a value.
    pub pixels: usize,
    /// Pixels without.
    pub missing: usize,
    /// Mean.
    pub mean_mm: f64,
    /// Its standard error.
    pub standard_error_mm: f64,
    /// Median.
    pub median_mm: f64,
    /// Standard deviation about the mean.
    pub sd_mm: f64,
    /// Root mean square.
    pub rms_mm: f64,
    /// Smallest.
    pub min_mm: f64,
    /// Largest.
    pub max_mm: f64,
}

impl RegionFigures {
    /// Of some values; `None` where there are none.
    fn of(values: ArrayView2<f32>) -> Option<Self> {
        let mut finite: Vec<f64> = values.iter().filter(|v| v.is_finite()).map(|v| f64::from(*v)).collect();
        if finite.is_empty() {
            return None;
        }
        finite.sort_unstable_by(f64::total_cmp);
        let n = finite.len() as f64;
        let mean = finite.iter().sum::<f64>() / n;
        let mean_square = |about: f64| finite.iter().map(|v| (v - about).powi(2)).sum::<f64>() / n;
        let mm = |value: f64| rounded(value, 4);
        Some(Self {
            pixels: finite.len(),
            missing: values.len() - finite.len(),
            mean_mm: mm(mean),
            standard_error_mm: mm(standard_error(values)),
            median_mm: mm(finite[finite.len() / 2]),
            sd_mm: mm(mean_square(mean).sqrt()),
            rms_mm: mm(mean_square(0.0).sqrt()),
            min_mm: mm(finite[0]),
            max_mm: mm(finite[finite.len() - 1]),
        })
    }
}

/// Standard error of the mean, from the means of blocks; NaN for fewer than four.
fn standard_error(values: ArrayView2<f32>) -> f64 {
    let means: Vec<f64> = values
        .axis_chunks_iter(ndarray::Axis(0), BLOCK_PX)
        .flat_map(|rows| {
            rows.axis_chunks_iter(ndarray::Axis(1), BLOCK_PX)
                .filter_map(|block| {
                    let finite = || block.iter().filter(|v| v.is_finite()).map(|v| f64::from(*v));
                    let count = finite().count();
                    (2 * count > block.len()).then(|| finite().sum::<f64>() / count as f64)
                })
                .collect::<Vec<_>>()
        })
        .collect();
    if means.len() < 4 {
        return f64::NAN;
    }
    let n = means.len() as f64;
    let mean = means.iter().sum::<f64>() / n;
    (means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt()
}

fn nothing(file: &Path) -> WorkflowError {
    WorkflowError::file(file, "a depth there")("every pixel of the region is without a value")
}

/// Figures of a region of a map, or of all of it.
///
/// # Errors
/// The map; [`WorkflowError::Parameter`] for a region outside; [`WorkflowError::File`] where there is no depth in it.
pub fn region(depth: &Path, region: Option<Region>) -> Result<RegionFigures> {
    let map = map::read(depth)?;
    RegionFigures::of(part(&map, region, depth)?).ok_or_else(|| nothing(depth))
}

/// Figures of one map less another, where both have a depth.
///
/// # Errors
/// As [`region`]; [`WorkflowError::Parameter`] for maps of different size.
pub fn difference(depth: &Path, other: &Path, region: Option<Region>) -> Result<RegionFigures> {
    let (map, subtracted) = (map::read(depth)?, map::read(other)?);
    if map.dim() != subtracted.dim() {
        let size = |map: &Array2<f32>| format!("{}x{}", map.ncols(), map.nrows());
        let expected = format!("{} pixels, as {} has", size(&map), depth.display());
        return Err(WorkflowError::parameter("other", size(&subtracted), expected));
    }
    let difference = &map - &subtracted;
    RegionFigures::of(part(&difference, region, depth)?).ok_or_else(|| nothing(depth))
}

/// A line across a map.
#[derive(Clone, PartialEq, Debug)]
pub struct ProfileSettings {
    /// The map.
    pub depth: PathBuf,
    /// First place, column and row.
    pub from: [usize; 2],
    /// Last place.
    pub to: [usize; 2],
    /// Where the values go, as CSV: place in px along the line, column, row, depth in mm.
    pub out: Option<PathBuf>,
}

/// What there is to say of a profile.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct ProfileFigures {
    /// Length of the line, px.
    pub length_px: f64,
    /// Values along it, the missing ones included.
    pub places: usize,
    /// Places without a depth.
    pub missing: usize,
    /// Depth at the first place that has one.
    pub first_mm: f64,
    /// Depth at the last.
    pub last_mm: f64,
    /// Smallest.
    pub min_mm: f64,
    /// Largest.
    pub max_mm: f64,
    /// Largest change from one place to the next.
    pub largest_step_mm: f64,
}

/// Depth along a line, pixel by pixel.
///
/// # Errors
/// The map; [`WorkflowError::Parameter`] for a place outside; files; [`WorkflowError::File`] where there is no depth.
pub fn profile(settings: &ProfileSettings, context: &Context<'_>) -> Result<ProfileFigures> {
    let map = map::read(&settings.depth)?;
    let (height, width) = map.dim();
    for [x, y] in [settings.from, settings.to] {
        if x >= width || y >= height {
            let expected = format!("a place in {width}x{height} pixels");
            return Err(WorkflowError::parameter("place", format!("{x},{y}"), expected));
        }
    }
    let [dx, dy] = [0, 1].map(|i| settings.to[i] as f64 - settings.from[i] as f64);
    let steps = dx.abs().max(dy.abs()) as usize;
    let length_px = dx.hypot(dy);
    let values: Vec<(f64, [usize; 2], f32)> = (0..=steps)
        .map(|i| {
            let t = i as f64 / steps.max(1) as f64;
            let at = [settings.from[0] as f64 + t * dx, settings.from[1] as f64 + t * dy]
                .map(|v| v.round() as usize);
            (t * length_px, at, map[(at[1], at[0])])
        })
        .collect();
    if let Some(out) = &settings.out {
        let mut text = String::from("place_px,x,y,depth_mm\n");
        for (place, [x, y], depth) in &values {
            // Writing to a text cannot fail.
            let _ = writeln!(text, "{place:.3},{x},{y},{depth}");
        }
        staging::write_file(out, text.as_bytes())?;
        context.say(&format!("wrote {}", out.display()));
    }
    let finite: Vec<f64> =
        values.iter().filter(|(.., d)| d.is_finite()).map(|(.., d)| f64::from(*d)).collect();
    let (Some(first), Some(last)) = (finite.first(), finite.last()) else {
        return Err(nothing(&settings.depth));
    };
    let steps = values
        .windows(2)
        .map(|pair| f64::from((pair[1].2 - pair[0].2).abs()))
        .filter(|step| step.is_finite());
    let mm = |value: f64| rounded(value, 4);
    Ok(ProfileFigures {
        length_px: rounded(length_px, 3),
        places: values.len(),
        missing: values.len() - finite.len(),
        first_mm: mm(*first),
        last_mm: mm(*last),
        min_mm: mm(finite.iter().copied().fold(f64::INFINITY, f64::min)),
        max_mm: mm(finite.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
        largest_step_mm: mm(steps.fold(0.0, f64::max)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_are_four_numbers() {
        assert_eq!("1, 2,3,4".parse(), Ok(Region { left: 1, top: 2, width: 3, height: 4 }));
        for wrong in ["", "1,2,3", "1,2,0,4", "1,2,3,4,5", "a,2,3,4", "-1,2,3,4"] {
            assert!(wrong.parse::<Region>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn figures_of_a_worked_example() {
        let map = ndarray::array![[1.0_f32, 2.0, f32::NAN], [3.0, 6.0, 3.0]];
        let found = RegionFigures::of(map.view()).unwrap();
        assert_eq!((found.pixels, found.missing, found.mean_mm, found.median_mm), (5, 1, 3.0, 3.0));
        assert_eq!((found.min_mm, found.max_mm), (1.0, 6.0));
        assert!((found.sd_mm - 2.8_f64.sqrt()).abs() < 1e-4 && found.standard_error_mm.is_nan());
        assert!(RegionFigures::of(ndarray::array![[f32::NAN]].view()).is_none());
    }

    #[test]
    fn maps_are_measured() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("depth.npy");
        let map = Array2::from_shape_fn((100, 120), |(y, x)| 900.0 + 0.1 * x as f32 - 0.05 * y as f32);
        std::fs::write(&file, farnear_files::npy::write(map.view())).unwrap();
        let found = region(&file, "10,20,40,30".parse().ok()).unwrap();
        assert!((found.mean_mm - (900.0 + 0.1 * 29.5 - 0.05 * 34.5)).abs() < 1e-3, "{found:?}");
        assert!(region(&file, "100,20,40,30".parse().ok()).unwrap_err().is_usage());
        let same = difference(&file, &file, None).unwrap();
        assert_eq!((same.mean_mm, same.rms_mm), (0.0, 0.0));
        let fitted = plane(&file, None).unwrap();
        assert!(
            (fitted.slope_x_mm_per_px - 0.1).abs() < 1e-5 && (fitted.slope_y_mm_per_px + 0.05).abs() < 1e-5
        );
        assert!(fitted.rms_mm < 1e-3);
        let out = folder.path().join("profile.csv");
        let settings = ProfileSettings { depth: file, from: [0, 0], to: [119, 99], out: Some(out.clone()) };
        let along = profile(&settings, &Context::unattended()).unwrap();
        assert_eq!((along.places, along.missing), (120, 0));
        assert!((along.last_mm - f64::from(map[(99, 119)])).abs() < 1e-3);
        assert_eq!(std::fs::read_to_string(out).unwrap().lines().count(), 121);
        let outside = ProfileSettings { to: [120, 5], ..settings };
        assert!(profile(&outside, &Context::unattended()).unwrap_err().is_usage());
    }
}
