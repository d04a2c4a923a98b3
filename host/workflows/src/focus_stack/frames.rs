//! Omits frames of a stack that show another scene, are rotated or shaken.
//!
//! Each image is correlated with the nearest good one in the band that defocus keeps in both. A correlation
//! far below the median shows another scene. A shaken frame is less sharp than both neighbours almost
//! everywhere, unlike any change of focus.

use farnear_depth::{
    focus_measure::FocusMeasure,
    prepare::{
        align::{self, Model},
        warp::{Warp, resample},
    },
};
use ndarray::{Array2, ArrayView2, s};

use crate::{context::Context, error::Result};

/// Correlation relative to the median of all links, below which a frame is foreign.
const FOREIGN: f64 = 0.5;
/// Median correlation below which links are not reliable: no texture, or steps too wide.
const TELLING: f64 = 0.4;
const BLOCKS: usize = 6;
/// Sharpness of a block relative to its less sharp neighbour, and share of blocks, below which a frame is
/// shaken.
const SHAKEN: f64 = 0.75;
const SHAKEN_BLOCKS: f64 = 0.75;

pub(super) struct Frames {
    /// Warp of each image onto the reference; identity without alignment.
    pub warps: Vec<Warp>,
    /// Omitted images with the reason, in order.
    pub left_out: Vec<(usize, String)>,
}

/// Compares the frames and, with a model, aligns them.
pub(super) fn check(images: &[Array2<f32>], model: Option<Model>, context: &Context<'_>) -> Result<Frames> {
    let count = images.len();
    let same_size = images.windows(2).all(|two| two[0].dim() == two[1].dim());
    let mut frames = Frames { warps: vec![Warp::IDENTITY; count], left_out: Vec::new() };
    // The measurement rejects short stacks and mixed sizes.
    if count < 3 || !same_size {
        return Ok(frames);
    }
    let shaken = shaken(images);
    // From the middle outwards; links of a foreign start correlate least.
    let middle = count / 2;
    let mut starts: Vec<usize> = (0..count).filter(|index| !shaken.contains(index)).collect();
    starts.sort_by_key(|index| index.abs_diff(middle));
    let mut best: Option<Chain> = None;
    for start in starts.into_iter().take(2) {
        let chain = chain(images, start, model, &shaken, context)?;
        if best.as_ref().is_none_or(|best| chain.usual > best.usual) {
            best = Some(chain);
        }
    }
    let Some(chain) = best else { return Ok(frames) };
    frames.warps = chain.warps;
    // With more than half foreign, the frames are not at fault.
    if chain.foreign.len() * 2 < count {
        for (index, correlation) in chain.foreign {
            let reason = format!(
                "it shows another scene or is turned (correlation with its neighbour {correlation:.2}, of the others {:.2})",
                chain.usual
            );
            frames.left_out.push((index, reason));
        }
    }
    if shaken.len() * 4 < count {
        let reason = "it is shaken: less sharp than both neighbours almost everywhere".to_owned();
        frames.left_out.extend(shaken.into_iter().map(|index| (index, reason.clone())));
    }
    frames.left_out.sort_by_key(|(index, _)| *index);
    frames.left_out.dedup_by_key(|(index, _)| *index);
    Ok(frames)
}

struct Chain {
    warps: Vec<Warp>,
    foreign: Vec<(usize, f64)>,
    usual: f64,
}

/// Links each image to the nearest good one towards the start.
fn chain(
    images: &[Array2<f32>],
    start: usize,
    model: Option<Model>,
    shaken: &[usize],
    context: &Context<'_>,
) -> Result<Chain> {
    let count = images.len();
    let link = |nearer: usize, index: usize| {
        let found = align::estimate(
            images[nearer].view(),
            images[index].view(),
            model.unwrap_or(Model::Shift),
            Warp::IDENTITY,
        );
        match (found, model) {
            (None, _) => (Warp::IDENTITY, None),
            (Some(found), None) => (Warp::IDENTITY, Some(found.correlation_before)),
            (Some(found), Some(_)) => (found.warp, Some(found.correlation)),
        }
    };
    let mut warps = vec![Warp::IDENTITY; count];
    let mut links: Vec<(usize, f64)> = Vec::new();
    let (up, down): (Vec<usize>, Vec<usize>) = ((start + 1..count).collect(), (0..start).rev().collect());
    let mut done = 0;
    // The median so far decides whether a frame is good enough for the next link.
    for direction in [up, down] {
        let mut nearer = start;
        for index in direction {
            context.cancel.check("comparing the stack's images")?;
            let (warp, correlation) = link(nearer, index);
            let correlation = correlation.unwrap_or(0.0);
            warps[index] = warp.after(&warps[nearer]);
            links.push((index, correlation));
            if correlation >= FOREIGN * median(&links) && !shaken.contains(&index) {
                nearer = index;
            }
            done += 1;
            context.progress.advance("images compared", done, Some(count - 1));
        }
    }
    let usual = median(&links);
    let foreign =
        links.into_iter().filter(|(_, correlation)| usual > TELLING && *correlation < FOREIGN * usual);
    Ok(Chain { warps, foreign: foreign.collect(), usual })
}

fn median(links: &[(usize, f64)]) -> f64 {
    let mut values: Vec<f64> = links.iter().map(|(_, correlation)| *correlation).collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Frames less sharp than both neighbours almost everywhere.
fn shaken(images: &[Array2<f32>]) -> Vec<usize> {
    let sharpness: Vec<Vec<f64>> = images.iter().map(|image| of_blocks(image.view())).collect();
    (1..images.len().saturating_sub(1))
        .filter(|index| {
            let [before, own, after] = [&sharpness[index - 1], &sharpness[*index], &sharpness[index + 1]];
            let dull = (0..own.len())
                .filter(|block| own[*block] < SHAKEN * before[*block].min(after[*block]))
                .count();
            !own.is_empty() && dull as f64 >= SHAKEN_BLOCKS * own.len() as f64
        })
        .collect()
}

fn of_blocks(image: ArrayView2<f32>) -> Vec<f64> {
    let (height, width) = image.dim();
    let edges = |size: usize, block: usize| size * block / BLOCKS..size * (block + 1) / BLOCKS;
    let blocks =
        (0..BLOCKS * BLOCKS).map(|block| (edges(height, block / BLOCKS), edges(width, block % BLOCKS)));
    let measured =
        blocks.map(|(rows, columns)| FocusMeasure::Tenengrad.of(image.slice(s![rows, columns])).ok());
    measured.collect::<Option<Vec<f64>>>().unwrap_or_default()
}

/// Warps the images onto the reference, with NaN for missing pixels; returns the largest displacement.
pub(super) fn moved(images: &mut [Array2<f32>], warps: &[Warp]) -> f64 {
    let mut farthest = 0.0_f64;
    for (image, warp) in images.iter_mut().zip(warps).filter(|(_, warp)| **warp != Warp::IDENTITY) {
        let (height, width) = image.dim();
        let [right, bottom] = [width as f64 - 1.0, height as f64 - 1.0];
        for [x, y] in [[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]] {
            let [to_x, to_y] = warp.at([x, y]);
            farthest = farthest.max((to_x - x).hypot(to_y - y));
        }
        *image = resample(image.view(), warp);
    }
    farthest
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: usize = 11;

    fn stack() -> Vec<Array2<f32>> {
        let texture = scene(1);
        (0..COUNT)
            .map(|number| {
                let blur = |at: usize| 1 + 2 * number.abs_diff(at);
                let [near, far] = [blur(3), blur(7)].map(|side| mean(&texture, side));
                Array2::from_shape_fn(texture.dim(), |(y, x)| if x < 48 { near[(y, x)] } else { far[(y, x)] })
            })
            .collect()
    }

    fn scene(seed: u64) -> Array2<f32> {
        Array2::from_shape_fn((72, 96), |(y, x)| {
            let mixed = ((96 * y + x) as u64 + seed * 1_000_003).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            0.3 + 0.4 * (mixed >> 40) as f32 / (1 << 24) as f32
        })
    }

    fn mean(image: &Array2<f32>, side: usize) -> Array2<f32> {
        let reach = side / 2;
        let (height, width) = image.dim();
        Array2::from_shape_fn(image.dim(), |(y, x)| {
            let rows = y.saturating_sub(reach)..(y + reach + 1).min(height);
            let columns = x.saturating_sub(reach)..(x + reach + 1).min(width);
            image.slice(s![rows, columns]).mean().unwrap()
        })
    }

    fn left_out(images: &[Array2<f32>], model: Option<Model>) -> Vec<usize> {
        let frames = check(images, model, &Context::unattended()).unwrap();
        frames.left_out.into_iter().map(|(index, _)| index).collect()
    }

    #[test]
    fn a_good_stack_loses_no_frame() {
        assert_eq!(left_out(&stack(), None), [0; 0]);
        assert_eq!(left_out(&stack(), Some(Model::Similarity)), [0; 0]);
    }

    #[test]
    fn finds_a_foreign_or_turned_frame_at_any_place() {
        for at in [0, 4, COUNT / 2, COUNT - 1] {
            for model in [None, Some(Model::Similarity)] {
                // A good neighbour may also be omitted, because its link passes the bad frame.
                let found = |images: &[Array2<f32>], what: &str| {
                    let found = left_out(images, model);
                    assert!(found.contains(&at), "{what} {at}, {model:?}: {found:?}");
                    assert!(found.len() <= 2, "{what} {at}, {model:?}: {found:?}");
                };
                let mut images = stack();
                images[at] = mean(&scene(2), 3);
                found(&images, "foreign");
                let mut images = stack();
                images[at] = images[at].slice(s![..;-1, ..;-1]).to_owned();
                found(&images, "turned");
            }
        }
    }

    #[test]
    fn finds_a_shaken_frame() {
        for at in [2, 5, 8] {
            let mut images = stack();
            let still = images[at].clone();
            images[at] = Array2::from_shape_fn(still.dim(), |(y, x)| {
                let columns = x.saturating_sub(6)..(x + 7).min(96);
                let rows = y.saturating_sub(1)..(y + 2).min(72);
                still.slice(s![rows, columns]).mean().unwrap()
            });
            assert_eq!(left_out(&images, None), [at]);
        }
    }

    #[test]
    fn images_without_texture_are_not_judged() {
        let images: Vec<_> = (0..7).map(|seed| scene(seed).mapv(|v| 0.5 + 0.01 * v)).collect();
        assert_eq!(left_out(&images, None), [0; 0]);
    }
}
