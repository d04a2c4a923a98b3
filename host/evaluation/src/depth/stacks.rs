//! Two slices of focal stacks whose optics nobody knows: is nearer nearer?

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use farnear_activity::readers::matlab::{self, Array};
use farnear_depth::{
    operators::Operators,
    pipeline::{Settings, depth_from_pair},
};
use farnear_files::image_file::read_grey;
use ndarray::{Array2, ShapeBuilder, Zip};
use rayon::prelude::*;

use crate::{page::Page, rig};

const STACK: usize = 30;
/// Slices of the stack between which the working range lies: a quarter and three quarters of the way.
const SLICES: [usize; 2] = [8, 23];
/// Pixels are judged whose confidence is at least this.
const LEAST_CONFIDENCE: f32 = 0.5;
/// Optics are unknown; wide windows bridge their mismatch.
const SETTINGS: Settings =
    Settings { smoothing_px: 15, median_px: 7, fill: false, threads: 1, backend: None };

pub fn measure(page: &mut Page, data: &Path) -> Result<()> {
    let folder = data.join("hci14");
    if folder.is_dir() {
        measure_hci(page, &folder)?;
    }
    let phone = data.join("phone_balls");
    if phone.is_dir() {
        measure_phone(page, &phone)?;
    }
    Ok(())
}

fn measure_hci(page: &mut Page, folder: &Path) -> Result<()> {
    page.heading("HCI focal stacks");
    page.paragraph(&format!(
        "Focal stacks of {STACK} slices made from the HCI 4D light fields (as published with Ashfaq & Mahmood, Pattern Recognition 170, 2026, 112112), of which \
         slices {} and {} are taken as a pair. Their optics and PSF are not known and the pair's blur is far beyond what the operators are made for, so \
         only the order of depths is judged: Spearman's rank correlation with the given depth over pixels of confidence {LEAST_CONFIDENCE} or \
         more. Pill-box, smoothing 15, median 7. Neither the stacks nor the maps say which way they count, so it is measured: the last column is the rank \
         correlation of the given map with the number of the slice in which each place is sharpest (variation over 15x15 pixels, all {STACK} slices, the same \
         pixels). It is positive, so given values rise with the slice of best focus; later slices are taken as focused nearer, where depth in mm is less, and \
         -1 would be perfect.",
        SLICES[0], SLICES[1]
    ));
    let mut names: Vec<PathBuf> = std::fs::read_dir(folder)?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.is_dir())
        .collect();
    names.sort();
    let rows = names
        .par_iter()
        .map(|scene| {
            let name = scene.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let slice = |number: usize| scene.join(format!("{name}{number}.png"));
            let depth = matlab_depth(&scene.join(format!("{name}D.mat")))?;
            let about = || format!("the stack {name}");
            let judged = judge(&slice(SLICES[0]), &slice(SLICES[1]), &depth).with_context(about)?;
            let sharpest = sharpest((1..=STACK).map(|number| (number, slice(number)))).with_context(about)?;
            let reference = judged.against(&sharpest, &depth);
            Ok(vec![
                name,
                format!("{:.3}", judged.rank),
                format!("{:.1}", 100.0 * judged.part),
                format!("{reference:.3}"),
            ])
        })
        .collect::<Result<Vec<_>>>()?;
    page.table(1, &["scene", "rank correlation", "pixels judged, %", "given map with sharpest slice"], &rows);
    Ok(())
}

fn measure_phone(page: &mut Page, folder: &Path) -> Result<()> {
    const PHONE_STACK: usize = 25;
    const PHONE_SLICES: [usize; 2] = [10, 16];
    page.heading("Phone focal stack");
    let slice = |number: usize| folder.join(format!("{number}.jpg"));
    let reference = sharpest((1..=PHONE_STACK).map(|number| (number, slice(number))))?;
    let Judged { rank, part, .. } = judge(&slice(PHONE_SLICES[0]), &slice(PHONE_SLICES[1]), &reference)?;
    page.paragraph(&format!(
        "{PHONE_STACK} slices of a hand-held phone (github.com/iSarmad/Depth-From-Defocus-Matlab), neither telecentric nor aligned and without a given depth. \
         Slices {} and {} as a pair against depth from focus, the slice in which each place is sharpest (variation over 15x15 pixels): rank correlation \
         {rank:.3} (later slices are focused nearer, so -1 is right) over {:.1} % of the pixels.",
        PHONE_SLICES[0],
        PHONE_SLICES[1],
        100.0 * part
    ));
    Ok(())
}

/// For each place the number of the slice in which it is sharpest.
fn sharpest(slices: impl Iterator<Item = (usize, PathBuf)>) -> Result<Array2<f32>> {
    let mut best: Option<(Array2<f32>, Array2<f32>)> = None;
    for (number, path) in slices {
        let sharpness = sharpness(&read_grey(&path)?.pixels);
        let Some((most, index)) = &mut best else {
            let first = Array2::from_elem(sharpness.dim(), number as f32);
            best = Some((sharpness, first));
            continue;
        };
        Zip::from(most).and(index).and(&sharpness).for_each(|most, index, sharpness| {
            if sharpness > most {
                (*most, *index) = (*sharpness, number as f32);
            }
        });
    }
    Ok(best.context("a stack without slices")?.1)
}

/// How a pair's depth agrees with a given one.
struct Judged {
    /// Rank correlation.
    rank: f64,
    /// Part of the pixels that was judged.
    part: f64,
    /// Which ones.
    confident: Array2<bool>,
}

impl Judged {
    /// Rank correlation of two other maps over the same pixels.
    fn against(&self, a: &Array2<f32>, b: &Array2<f32>) -> f64 {
        let both = a.iter().zip(b).zip(&self.confident).filter(|(_, confident)| **confident);
        rank_correlation(&both.map(|((a, b), _)| (*a, *b)).collect::<Vec<_>>())
    }
}

fn judge(far: &Path, near: &Path, given: &Array2<f32>) -> Result<Judged> {
    let optics = rig::optics("pillbox")?;
    let operators = Operators::for_optics(&optics)?;
    let (far, near) = (read_grey(far)?.pixels, read_grey(near)?.pixels);
    let map = depth_from_pair(far.view(), near.view(), &operators, &optics, &SETTINGS)?;
    if map.depth_mm.dim() != given.dim() {
        bail!("images of {:?} and a depth of {:?} (height, width)", map.depth_mm.dim(), given.dim());
    }
    let confident =
        Zip::from(&map.depth_mm).and(&map.confidence).and(given).map_collect(|depth, confidence, given| {
            *confidence >= LEAST_CONFIDENCE && depth.is_finite() && given.is_finite()
        });
    let count = confident.iter().filter(|confident| **confident).count();
    let mut judged = Judged { rank: f64::NAN, part: count as f64 / given.len() as f64, confident };
    judged.rank = judged.against(&map.depth_mm, given);
    Ok(judged)
}

/// The first map of a MATLAB file.
fn matlab_depth(path: &Path) -> Result<Array2<f32>> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let arrays = matlab::read(&bytes).with_context(|| format!("{}", path.display()))?;
    for (_, array) in arrays {
        if let Array::Numeric { dimensions, values } = array
            && let [rows, columns] = dimensions[..]
            && rows > 1
        {
            return Ok(Array2::from_shape_vec((rows, columns).f(), values)?.mapv(|v| v as f32));
        }
    }
    bail!("{} holds no map", path.display())
}

/// Sum of squared differences of neighbours over 15x15 pixels.
fn sharpness(image: &Array2<f32>) -> Array2<f32> {
    const HALF: usize = 7;
    let (height, width) = image.dim();
    // Sums over all pixels above and to the left.
    let mut sums = Array2::<f64>::zeros((height + 1, width + 1));
    for row in 0..height {
        let mut line = 0.0;
        for column in 0..width {
            let here = image[(row, column)];
            let right = image[(row, (column + 1).min(width - 1))] - here;
            let below = image[((row + 1).min(height - 1), column)] - here;
            line += f64::from(right * right + below * below);
            sums[(row + 1, column + 1)] = sums[(row, column + 1)] + line;
        }
    }
    Array2::from_shape_fn((height, width), |(row, column)| {
        let (top, bottom) = (row.saturating_sub(HALF), (row + HALF + 1).min(height));
        let (left, right) = (column.saturating_sub(HALF), (column + HALF + 1).min(width));
        let sum = sums[(bottom, right)] - sums[(top, right)] - sums[(bottom, left)] + sums[(top, left)];
        (sum / ((bottom - top) * (right - left)) as f64) as f32
    })
}

/// Spearman's rank correlation; equal values share their mean rank.
fn rank_correlation(pairs: &[(f32, f32)]) -> f64 {
    let ranks = |value: fn(&(f32, f32)) -> f32| -> Vec<f64> {
        let mut order: Vec<usize> = (0..pairs.len()).collect();
        order.sort_by(|a, b| value(&pairs[*a]).total_cmp(&value(&pairs[*b])));
        let mut ranks = vec![0.0; pairs.len()];
        let mut start = 0;
        while start < order.len() {
            let same =
                order[start..].iter().take_while(|i| value(&pairs[**i]) == value(&pairs[order[start]]));
            let end = start + same.count();
            for index in &order[start..end] {
                ranks[*index] = 0.5 * (start + end - 1) as f64;
            }
            start = end;
        }
        ranks
    };
    let (a, b) = (ranks(|p| p.0), ranks(|p| p.1));
    let mean = 0.5 * (pairs.len() as f64 - 1.0);
    let moment = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - mean) * (y - mean)).sum::<f64>();
    moment(&a, &b) / (moment(&a, &a) * moment(&b, &b)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rank_correlation_knows_order_and_ties() {
        let rising: Vec<_> = (0..9).map(|i| (i as f32, (i as f32).powi(3))).collect();
        assert!((rank_correlation(&rising) - 1.0).abs() < 1e-12);
        let falling: Vec<_> = (0..9).map(|i| (i as f32, -(i as f32))).collect();
        assert!((rank_correlation(&falling) + 1.0).abs() < 1e-12);
        // Ranks (0.5, 0.5, 2, 3) and (0, 1, 2, 3): 4.5 / sqrt(4.5 * 5).
        let tied = [(1.0, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 4.0)];
        assert!((rank_correlation(&tied) - 4.5 / 22.5_f64.sqrt()).abs() < 1e-12);
    }
}
