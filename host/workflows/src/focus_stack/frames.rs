//! Omits frames of a stack that show another scene, are rotated or shaken. Neighbours in a stack correlate highly in
//! the band that defocus leaves to both. Links between neighbours that correlate far less than usual split the stack
//! into runs. The longest run is the scene. A frame outside belongs to it if it correlates with the nearest frame of
//! the scene as frames of the scene at the same distance do; so the good neighbour of a bad frame stays. A shaken frame
//! correlates, but is less sharp than its neighbours allow ([`shaken`]).

mod shaken;

use farnear_depth::{
    focus_stack::Slices,
    prepare::{
        align::{self, Model},
        warp::Warp,
    },
};
use ndarray::{ArrayView2, CowArray, Ix2};

use crate::{
    context::Context,
    error::{Result, WorkflowError},
};

/// Correlation, as part of the usual one, below which a frame is foreign.
const FOREIGN: f64 = 0.5;
/// Part of the links that correlate less than the usual one: in a stack of four, a bad frame breaks two of three.
const USUAL: f64 = 2.0 / 3.0;
/// Usual correlation below which no link tells anything: images without texture, or steps too wide.
const TELLING: f64 = 0.4;

pub(super) struct Frames {
    /// Warp of each image onto the reference; identity without alignment.
    pub warps: Vec<Warp>,
    pub left_out: Vec<(usize, String)>,
    /// First or last images of which it cannot be told whether they are shaken.
    pub untold: Vec<usize>,
}

impl Frames {
    pub fn unchecked(count: usize) -> Self {
        Self { warps: vec![Warp::IDENTITY; count], left_out: Vec::new(), untold: Vec::new() }
    }
}

pub(super) fn check<S>(
    images: &S,
    positions: &[f64],
    model: Option<Model>,
    context: &Context<'_>,
) -> Result<Frames>
where
    S: Slices + ?Sized,
    WorkflowError: From<S::Error>,
{
    let count = images.count();
    let mut frames = Frames::unchecked(count);
    // Stacks that are too short or of mixed sizes are refused by the measure.
    if count < 3 || (1..count).any(|index| images.dim(index) != images.dim(0)) {
        return Ok(frames);
    }
    let comparison = Comparison { images, model, context };
    let neighbours = comparison.neighbours()?;
    let scene = comparison.scene(&neighbours.links)?;
    let members: Vec<usize> = (0..count).filter(|index| scene.warps[*index].is_some()).collect();
    let shaken = shaken::find(&neighbours.sharpness, positions, &members);
    // Half or more: it is not the frames that are wrong.
    let few_foreign = (count - members.len()) * 2 < count;
    let few_shaken = shaken.frames.len() * 4 < count;
    let start = members.iter().min_by_key(|index| index.abs_diff(count / 2));
    let back = start.and_then(|start| scene.warps[*start]?.inverse()).unwrap_or(Warp::IDENTITY);
    for index in 0..count {
        let warp = match scene.warps[index] {
            Some(warp) => warp,
            None => {
                let (nearest, warp) = nearest(&scene.warps, index).unwrap_or((index, Warp::IDENTITY));
                let link = comparison.link(nearest, index)?;
                if few_foreign {
                    let reason = format!(
                        "it shows another scene or is turned (correlation with its neighbour {:.2}, of the others {:.2})",
                        link.correlation, scene.usual
                    );
                    frames.left_out.push((index, reason));
                }
                link.warp.after(&warp)
            }
        };
        frames.warps[index] = warp.after(&back);
        if few_shaken && shaken.frames.contains(&index) {
            let reason = "it is shaken or defocused: less sharp in most places than its neighbours suggest";
            frames.left_out.push((index, reason.into()));
        }
    }
    frames.untold = shaken.untold;
    Ok(frames)
}

fn nearest(warps: &[Option<Warp>], index: usize) -> Option<(usize, Warp)> {
    let placed = warps.iter().enumerate().filter_map(|(other, warp)| Some((other, (*warp)?)));
    placed.min_by_key(|(other, _)| other.abs_diff(index))
}

/// The frames that show one scene.
struct Scene {
    /// Where they lie, on the first frame of the longest run.
    warps: Vec<Option<Warp>>,
    /// Usual correlation of neighbours.
    usual: f64,
}

struct Neighbours {
    /// From each frame to the next.
    links: Vec<Link>,
    /// Of each frame, by blocks.
    sharpness: Vec<Vec<f64>>,
}

struct Comparison<'a, S: ?Sized> {
    images: &'a S,
    model: Option<Model>,
    context: &'a Context<'a>,
}

#[derive(Clone, Copy)]
struct Link {
    /// From a place in the first frame to that in the second.
    warp: Warp,
    correlation: f64,
}

impl<S> Comparison<'_, S>
where
    S: Slices + ?Sized,
    WorkflowError: From<S::Error>,
{
    fn image(&self, index: usize) -> Result<CowArray<'_, f32, Ix2>> {
        self.context.cancel.check("comparing the stack's images")?;
        Ok(self.images.rows(index, 0..self.images.dim(index).0)?)
    }

    fn link(&self, first: usize, second: usize) -> Result<Link> {
        Ok(self.compared(self.image(first)?.view(), self.image(second)?.view()))
    }

    fn compared(&self, first: ArrayView2<f32>, second: ArrayView2<f32>) -> Link {
        let found = align::estimate(first, second, self.model.unwrap_or(Model::Shift), Warp::IDENTITY);
        match (found, self.model) {
            (None, _) => Link { warp: Warp::IDENTITY, correlation: 0.0 },
            (Some(found), None) => Link { warp: Warp::IDENTITY, correlation: found.correlation_before },
            (Some(found), Some(_)) => Link { warp: found.warp, correlation: found.correlation },
        }
    }

    fn neighbours(&self) -> Result<Neighbours> {
        let count = self.images.count();
        let mut found = Neighbours { links: Vec::with_capacity(count), sharpness: Vec::with_capacity(count) };
        let mut before: Option<CowArray<'_, f32, Ix2>> = None;
        for index in 0..count {
            let image = self.image(index)?;
            found.sharpness.push(shaken::of_blocks(image.view()));
            found.links.extend(before.map(|before| self.compared(before.view(), image.view())));
            before = Some(image);
            self.context.progress.advance("images compared", index + 1, Some(count));
        }
        Ok(found)
    }

    fn scene(&self, links: &[Link]) -> Result<Scene> {
        let usual = usual(links);
        let limit = if usual > TELLING { FOREIGN * usual } else { f64::NEG_INFINITY };
        let breaks = (0..links.len()).filter(|at| links[*at].correlation < limit).map(|at| at + 1);
        let ends: Vec<usize> = [0].into_iter().chain(breaks).chain([links.len() + 1]).collect();
        let runs = ends.array_windows().map(|[from, to]| *from..*to);
        let run = runs.max_by_key(ExactSizeIterator::len).unwrap_or_default();
        let mut warps = vec![None; links.len() + 1];
        let mut warp = Warp::IDENTITY;
        for index in run.clone() {
            if index > run.start {
                warp = links[index - 1].warp.after(&warp);
            }
            warps[index] = Some(warp);
        }
        for index in (0..run.start).rev().chain(run.end..warps.len()) {
            let Some((other, placed)) = nearest(&warps, index) else { continue };
            let least = match other.abs_diff(index) {
                1 => limit,
                distance => FOREIGN * self.expected(&warps, other, distance, usual)?,
            };
            let link = self.link(other, index)?;
            if link.correlation >= least {
                warps[index] = Some(link.warp.after(&placed));
            }
        }
        Ok(Scene { warps, usual })
    }

    /// Correlation of two frames of the scene at this distance, as near as possible to one of its frames.
    fn expected(&self, warps: &[Option<Warp>], near: usize, distance: usize, usual: f64) -> Result<f64> {
        let pairs = (0..warps.len().saturating_sub(distance))
            .filter(|first| warps[*first].is_some() && warps[first + distance].is_some());
        match pairs.min_by_key(|first| first.abs_diff(near).min((first + distance).abs_diff(near))) {
            Some(first) => Ok(self.link(first, first + distance)?.correlation),
            // As if what each step changes had nothing to do with the other steps.
            None => Ok(usual.powi(i32::try_from(distance).unwrap_or(i32::MAX))),
        }
    }
}

fn usual(links: &[Link]) -> f64 {
    let mut values: Vec<f64> = links.iter().map(|link| link.correlation).collect();
    values.sort_by(f64::total_cmp);
    values.get((USUAL * values.len() as f64) as usize).copied().unwrap_or(0.0)
}

/// Farthest distance that the warps move a pixel of (height, width), px.
pub(super) fn farthest_px(warps: &[Warp], (height, width): (usize, usize)) -> f64 {
    let [right, bottom] = [width as f64 - 1.0, height as f64 - 1.0];
    let corners = [[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]];
    let moves = warps.iter().flat_map(|warp| corners.map(|[x, y]| (warp.at([x, y]), [x, y])));
    moves.map(|(to, from)| (to[0] - from[0]).hypot(to[1] - from[1])).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use farnear_depth::focus_stack::{StackSettings, depth_from_positions};
    use ndarray::{Array2, s};

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

    fn checked(images: &[Array2<f32>], positions: &[f64], model: Option<Model>) -> Frames {
        let views: Vec<ArrayView2<f32>> = images.iter().map(|image| image.view()).collect();
        check(&views[..], positions, model, &Context::unattended()).unwrap()
    }

    fn left_out(images: &[Array2<f32>], model: Option<Model>) -> Vec<usize> {
        let positions: Vec<f64> = (0..images.len()).map(|index| index as f64).collect();
        checked(images, &positions, model).left_out.into_iter().map(|(index, _)| index).collect()
    }

    #[test]
    fn a_good_stack_loses_no_frame() {
        assert_eq!(left_out(&stack(), None), [0; 0]);
        assert_eq!(left_out(&stack(), Some(Model::Similarity)), [0; 0]);
    }

    #[test]
    fn finds_a_foreign_or_turned_frame_at_any_place() {
        for at in [0, 1, 4, COUNT / 2, COUNT - 2, COUNT - 1] {
            for model in [None, Some(Model::Similarity)] {
                let found = |images: &[Array2<f32>], what: &str| {
                    assert_eq!(left_out(images, model), [at], "{what}, {model:?}");
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

    /// A tilted plane with a step, in images: 2.5 to 12 in a stack of 15.
    fn depth_at(y: usize, x: usize) -> f32 {
        2.5 + 5.0 * x as f32 / 95.0 + 2.0 * y as f32 / 71.0 + if x > 60 { 2.5 } else { 0.0 }
    }

    const TRUE_COUNT: usize = 15;

    /// Blurred by passes of (1 2 1) / 4, as many as their variance, half a pixel squared, makes of a blur that grows evenly.
    fn true_stack(positions: &[f64]) -> Vec<Array2<f32>> {
        let mut blurred = vec![scene(1)];
        while blurred.len() < 70 {
            let next = smoothed(&blurred[blurred.len() - 1]);
            blurred.push(next);
        }
        let image = |(index, position): (usize, &f64)| {
            let noise = scene(100 + index as u64);
            Array2::from_shape_fn(noise.dim(), |(y, x)| {
                let passes = 2.0 * (0.45 * (depth_at(y, x) - *position as f32)).powi(2);
                let below = passes as usize;
                let part = passes - below as f32;
                let value = (1.0 - part) * blurred[below][(y, x)] + part * blurred[below + 1][(y, x)];
                value + 0.01 * (noise[(y, x)] - 0.5)
            })
        };
        positions.iter().enumerate().map(image).collect()
    }

    fn even_positions() -> Vec<f64> {
        (0..TRUE_COUNT).map(|index| index as f64).collect()
    }

    fn smoothed(image: &Array2<f32>) -> Array2<f32> {
        let (height, width) = image.dim();
        let row = |y: usize, x: usize| {
            0.25 * image[(y, x.saturating_sub(1))]
                + 0.5 * image[(y, x)]
                + 0.25 * image[(y, (x + 1).min(width - 1))]
        };
        Array2::from_shape_fn(image.dim(), |(y, x)| {
            0.25 * row(y.saturating_sub(1), x) + 0.5 * row(y, x) + 0.25 * row((y + 1).min(height - 1), x)
        })
    }

    /// Root mean square error in images and the part of the pixels with a depth, without some frames.
    fn error(images: &[Array2<f32>], out: Vec<usize>) -> (f64, f64, Vec<usize>) {
        error_at(images, &even_positions(), out)
    }

    fn error_at(images: &[Array2<f32>], at: &[f64], out: Vec<usize>) -> (f64, f64, Vec<usize>) {
        let kept: Vec<usize> = (0..images.len()).filter(|index| !out.contains(index)).collect();
        let views: Vec<ArrayView2<f32>> = kept.iter().map(|index| images[*index].view()).collect();
        let positions: Vec<f64> = kept.iter().map(|index| at[*index]).collect();
        let map = depth_from_positions(&views[..], &positions, &StackSettings::default()).unwrap();
        let (mut sum, mut known) = (0.0, 0.0);
        for ((y, x), place) in map.place.indexed_iter().filter(|(_, place)| place.is_finite()) {
            let below = (*place as usize).min(kept.len() - 2);
            let depth = positions[below]
                + f64::from(*place - below as f32) * (positions[below + 1] - positions[below]);
            sum += (depth - f64::from(depth_at(y, x))).powi(2);
            known += 1.0;
        }
        ((sum / known).sqrt(), known / map.place.len() as f64, out)
    }

    #[test]
    fn uneven_positions_cost_at_most_a_tenth_of_the_error() {
        let (even, ..) = error(&true_stack(&even_positions()), Vec::new());
        let last = TRUE_COUNT as f64 - 1.0;
        // Steps of 0.4 and 1.6, and steps that grow from 0.5 to 1.5.
        let alternating = |index: f64| index - 0.3 * (1.0 - (std::f64::consts::PI * index).cos());
        let growing = |index: f64| 0.5 * index + 0.5 * index * index / last;
        for uneven in [&alternating as &dyn Fn(f64) -> f64, &growing] {
            let positions: Vec<f64> = (0..TRUE_COUNT).map(|index| uneven(index as f64)).collect();
            let (found, known, _) = error_at(&true_stack(&positions), &positions, Vec::new());
            assert!(found < 1.1 * even && known > 0.98, "{found} {even} {known}");
        }
    }

    #[test]
    fn a_bad_frame_at_any_place_costs_no_more_than_its_absence() {
        let good = true_stack(&even_positions());
        let (clean, known, out) = error(&good, left_out(&good, None));
        assert!(clean < 0.3 && known > 0.98 && out.is_empty(), "{clean} {known} {out:?}");
        let foreign = mean(&scene(2), 3);
        for at in 0..TRUE_COUNT {
            let still = &good[at];
            let defocused = (0..40).fold(still.clone(), |image, _| smoothed(&image));
            let shaken = Array2::from_shape_fn(still.dim(), |(y, x)| {
                still.slice(s![y, x.saturating_sub(5)..(x + 6).min(96)]).mean().unwrap()
            });
            let turned = still.slice(s![..;-1, ..;-1]).to_owned();
            let (absent, ..) = error(&good, vec![at]);
            assert!(absent < 1.05 * clean, "{at}: {absent} {clean}");
            let kinds =
                [("foreign", &foreign), ("turned", &turned), ("shaken", &shaken), ("defocused", &defocused)];
            for (kind, bad) in kinds {
                let mut images = good.clone();
                images[at] = bad.clone();
                let (found, known, out) = error(&images, left_out(&images, None));
                assert!(found < 1.05 * clean.max(absent) && known > 0.98, "{kind} {at}: {found} {known}");
                assert_eq!(out, [at], "{kind} {at}");
            }
        }
    }
}
