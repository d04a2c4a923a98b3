//! Focal stacks with unknown optics: order of depths from two slices, and depth from focus over all slices.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use farnear_depth::{
    fill::{FillBy, LowTexture},
    focus_stack::{StackMap, StackSettings, USUAL_RELIABILITY, depth_from_stack},
    operators::Operators,
    pipeline::{Settings, depth_from_pair},
};
use farnear_files::image_file::read_grey;
use farnear_silhouettes::readers::matlab::{self, Array};
use ndarray::{Array2, ShapeBuilder, Zip};
use rayon::prelude::*;

use crate::{
    page::{Page, median},
    rig,
};

const STACK: usize = 30;
/// Slices at the ends of the working range, the far one first; the stacks run from near to far.
const SLICES: [usize; 2] = [23, 8];
const LEAST_CONFIDENCE: f32 = 0.5;
/// Optics are unknown; wide windows bridge their mismatch.
const SETTINGS: Settings = Settings {
    smoothing_px: 15,
    median_px: 7,
    fill: false,
    low_texture: LowTexture::Energy,
    fill_by: FillBy::Surface,
    threads: 1,
    backend: None,
};

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
         more. Pill-box, smoothing 15, median 7. Early slices are focused near, as the pictures show, and given values rise with distance. For comparison depth from focus over all {STACK} slices (`farnear focus-stack`, defaults): over the same pixels, over all pixels, with `--guided-px 0` over all pixels, and over those whose reliability is at least \
         {USUAL_RELIABILITY}, which are those that the command gives a depth. A wall without texture, as behind Antinous and Greek, has no depth in any stack; over all pixels its noise is counted.",
        SLICES[0], SLICES[1]
    ));
    let mut names: Vec<PathBuf> = std::fs::read_dir(folder)?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.is_dir())
        .collect();
    names.sort();
    let scenes = names
        .par_iter()
        .map(|scene| {
            let name = scene.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let slice = |number: usize| scene.join(format!("{name}{number}.png"));
            let depth = matlab_depth(&scene.join(format!("{name}D.mat")))?;
            let about = || format!("the stack {name}");
            let judged = judge(&slice(SLICES[0]), &slice(SLICES[1]), &depth).with_context(about)?;
            let usual = StackSettings::default();
            let stack = from_focus((1..=STACK).map(slice), &usual).with_context(about)?;
            let unguided = StackSettings { guided_px: 0.0, ..usual };
            let unguided = from_focus((1..=STACK).map(slice), &unguided).with_context(about)?;
            let reliable = stack.reliability.mapv(|reliability| reliability >= USUAL_RELIABILITY);
            let everywhere = Array2::from_elem(depth.dim(), true);
            Ok(Scene {
                name,
                figures: [
                    judged.rank,
                    100.0 * judged.part,
                    rank_over(&judged.confident, &stack.place, &depth),
                    rank_over(&everywhere, &stack.place, &depth),
                    rank_over(&everywhere, &unguided.place, &depth),
                    rank_over(&reliable, &stack.place, &depth),
                    100.0 * reliable.iter().filter(|reliable| **reliable).count() as f64 / depth.len() as f64,
                ],
            })
        })
        .collect::<Result<Vec<Scene>>>()?;
    let mut rows: Vec<Vec<String>> = scenes.iter().map(|scene| row(&scene.name, scene.figures)).collect();
    let column = |at: usize| -> Vec<f64> { scenes.iter().map(|scene| scene.figures[at]).collect() };
    rows.push(row("mean", std::array::from_fn(|at| column(at).iter().sum::<f64>() / scenes.len() as f64)));
    rows.push(row("median", std::array::from_fn(|at| median(column(at)))));
    page.table(
        1,
        &[
            "scene",
            "pair",
            "judged, %",
            "stack, same pixels",
            "stack, all pixels",
            "not guided, all pixels",
            "stack, reliable",
            "reliable, %",
        ],
        &rows,
    );
    Ok(())
}

struct Scene {
    name: String,
    figures: [f64; 7],
}

fn row(name: &str, figures: [f64; 7]) -> Vec<String> {
    let decimals = [3, 1, 3, 3, 3, 3, 1];
    let texts = figures.iter().zip(decimals).map(|(figure, decimals)| format!("{figure:.decimals$}"));
    std::iter::once(name.to_owned()).chain(texts).collect()
}

fn from_focus(slices: impl Iterator<Item = PathBuf>, settings: &StackSettings) -> Result<StackMap> {
    let images: Vec<Array2<f32>> = slices.map(|path| Ok(read_grey(&path)?.pixels)).collect::<Result<_>>()?;
    let views: Vec<_> = images.iter().map(|image| image.view()).collect();
    let settings = StackSettings { min_reliability: 0.0, ..*settings };
    Ok(depth_from_stack(&views, &settings)?)
}

fn measure_phone(page: &mut Page, folder: &Path) -> Result<()> {
    const PHONE_STACK: usize = 25;
    const PHONE_SLICES: [usize; 2] = [16, 10];
    page.heading("Phone focal stack");
    let slice = |number: usize| folder.join(format!("{number}.jpg"));
    let reference = from_focus((1..=PHONE_STACK).map(slice), &StackSettings::default())?.place;
    let Judged { rank, part, .. } = judge(&slice(PHONE_SLICES[0]), &slice(PHONE_SLICES[1]), &reference)?;
    page.paragraph(&format!(
        "{PHONE_STACK} slices of a hand-held phone (github.com/iSarmad/Depth-From-Defocus-Matlab), neither telecentric nor aligned and without a given depth. \
         Slices {} and {} as a pair against depth from focus over all slices: rank correlation {rank:.3} over {:.1} % of the pixels.",
        PHONE_SLICES[0],
        PHONE_SLICES[1],
        100.0 * part
    ));
    Ok(())
}

struct Judged {
    rank: f64,
    part: f64,
    confident: Array2<bool>,
}

fn rank_over(pixels: &Array2<bool>, a: &Array2<f32>, b: &Array2<f32>) -> f64 {
    let both = a.iter().zip(b).zip(pixels).filter(|(_, judged)| **judged);
    rank_correlation(&both.map(|((a, b), _)| (*a, *b)).collect::<Vec<_>>())
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
    let rank = rank_over(&confident, &map.depth_mm, given);
    Ok(Judged { rank, part: count as f64 / given.len() as f64, confident })
}

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
    fn rank_correlation_handles_order_and_ties() {
        let rising: Vec<_> = (0..9).map(|i| (i as f32, (i as f32).powi(3))).collect();
        assert!((rank_correlation(&rising) - 1.0).abs() < 1e-12);
        let falling: Vec<_> = (0..9).map(|i| (i as f32, -(i as f32))).collect();
        assert!((rank_correlation(&falling) + 1.0).abs() < 1e-12);
        // Ranks (0.5, 0.5, 2, 3) and (0, 1, 2, 3): 4.5 / sqrt(4.5 * 5).
        let tied = [(1.0, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 4.0)];
        assert!((rank_correlation(&tied) - 4.5 / 22.5_f64.sqrt()).abs() < 1e-12);
    }
}
