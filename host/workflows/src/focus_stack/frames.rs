//! Omits frames of a stack that show another scene, are rotated or shaken. Neighbours in a stack correlate highly in
//! the band that defocus leaves to both. Links between neighbours that correlate far less than usual split the stack
//! into runs. The longest run is the scene. A frame outside belongs to it if it correlates with one of the two nearest
//! frames of the scene as frames of the scene at the same distance do; so the good neighbour of a bad frame stays. One
//! that is far out of focus correlates only without detail. A shaken frame correlates, but is less sharp than its
//! neighbours allow ([`shaken`]). Where neighbours correlate little, no frame is judged. A picture that another program
//! composed of the frames is left out before.

mod shaken;
#[cfg(test)]
mod tests;

use farnear_depth::{
    brightness,
    focus_stack::Slices,
    prepare::{
        align::{self, Model},
        warp::Warp,
    },
    slice_order,
};
use ndarray::{Array2, ArrayView2, CowArray, Ix2, s};

use crate::{
    context::Context,
    error::{Result, WorkflowError},
};

/// Correlation, as part of the usual one, below which a frame is foreign.
const FOREIGN: f64 = 0.5;
/// Correlation without detail from which a frame shows the scene. With frames that are far out of focus it was 0.66 to 0.98, with
/// moved, turned and foreign ones at most 0.59.
const COARSELY_ALIKE: f64 = 0.65;
/// Side of the squares whose means are left without detail, px; it is doubled until there are at most [`MOST`].
const DETAIL_PX: usize = 4;
/// Most squares: a stack of large images is compared in the time of a small one.
const MOST: usize = 50_000;
/// Sharpness of a frame far out of focus, relative to one of the scene, in most blocks.
const DEFOCUSED: f64 = 0.5;
/// Least sharpness of a block with detail, relative to the sharpest one: others may show noise alone.
const DETAIL: f64 = 0.1;
/// Part of the links that correlate less than the usual one: in a stack of four, a bad frame breaks two of three.
const USUAL: f64 = 2.0 / 3.0;
/// Usual correlation below which no link tells anything: images without texture, or steps of twice the depth of field.
const TELLING: f64 = 0.6;

/// Usual correlation below which a missing frame costs more than a tenth of the error.
const COARSE: f64 = 0.85;
/// Largest distance of an image from where two steps put it, as part of the larger step. Registrations of images that have nothing in
/// common do not agree: none of 73 unrelated ones did.
const AGREEING: f64 = 0.25;
/// Most pairs of steps that are compared.
const COMPARED: usize = 5;
/// Displacement over an unaligned stack from which a warning is given, px: edges move out of the sharpness window's core.
const DRIFT_PX: f64 = 2.0;

pub(super) struct Frames {
    /// Warp of each image onto the reference; identity without alignment.
    pub warps: Vec<Warp>,
    /// Brightness of each image relative to the usual one.
    pub gains: Vec<f64>,
    pub left_out: Vec<(usize, String)>,
    /// First or last images of which it cannot be told whether they are shaken.
    pub untold: Vec<usize>,
    /// Images that look exchanged.
    pub exchanged: Vec<[usize; 2]>,
    /// The image at which the order should begin; none but an all-in-focus picture is left out then.
    pub wrapped: Option<usize>,
    /// Usual correlation of neighbours; `None` if it was not measured.
    pub usual: Option<f64>,
    /// Farthest displacement of a corner over the stack without alignment, px.
    pub drift_px: f64,
}

impl Frames {
    pub fn unchecked(count: usize) -> Self {
        let (warps, gains) = (vec![Warp::IDENTITY; count], vec![1.0; count]);
        let (left_out, untold, exchanged) = (Vec::new(), Vec::new(), Vec::new());
        Self { warps, gains, left_out, untold, exchanged, wrapped: None, usual: None, drift_px: 0.0 }
    }

    /// Adds an image that does not belong to the stack.
    fn insert_composed(&mut self, composed: usize) {
        let left_out = self.left_out.iter_mut().map(|(index, _)| index);
        let others =
            self.untold.iter_mut().chain(self.exchanged.iter_mut().flatten()).chain(&mut self.wrapped);
        left_out.chain(others).filter(|index| **index >= composed).for_each(|index| *index += 1);
        self.warps.insert(composed, Warp::IDENTITY);
        self.gains.insert(composed, 1.0);
        let reason = "it is sharper than its place in the stack allows, in all parts: an all-in-focus picture, of another scene, \
                      out of order, or darker with more noise";
        self.left_out.push((composed, reason.into()));
        self.left_out.sort_by_key(|(index, _)| *index);
    }

    /// All warnings; `name` gives the name of an image.
    pub fn remarks(&self, name: impl Fn(usize) -> String) -> Vec<String> {
        let mut remarks = Vec::new();
        if !self.untold.is_empty() {
            let names: Vec<String> = self.untold.iter().map(|index| name(*index)).collect();
            remarks.push(format!(
                "could not check whether {} is shaken or defocused: the images next to it do not tell how sharp it should be (the scene is \
                 sharpest there, or the images are irregular, of other brightness or fewer than 5)",
                names.join(" or ")
            ));
        }
        remarks.extend(self.warnings());
        for pair in &self.exchanged {
            let [one, other] = pair.map(&name);
            let shaken = if pair[1] - pair[0] == 1 { ", or one of them is shaken or defocused" } else { "" };
            remarks.push(format!(
                "{one} and {other} look exchanged{shaken}: in the order given, sharpness rises and falls more than once; depth may be \
                 wrong: exchange them or correct the positions (--positions-um)"
            ));
        }
        remarks.extend(self.wrapped.map(|first| {
            format!(
                "the order looks wrapped: sharpness rises and falls once only if the stack begins with {}; in the order given depth is \
                 wrong, and bad images are not recognised: number the images in the order of their focus, or correct the positions \
                 (--positions-um)",
                name(first)
            )
        }));
        let left_out = self.left_out.iter();
        remarks.extend(left_out.map(|(index, reason)| format!("left out {}: {reason}", name(*index))));
        remarks
    }

    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if let Some(usual) = self.usual.filter(|usual| *usual < COARSE) {
            let unchecked = if usual > TELLING { "" } else { ", and bad images are not recognised" };
            warnings.push(format!(
                "neighbouring images have little in common (correlation {usual:.2}): the steps are wide, or the images are noisy or not aligned (see --align); \
                 a missing image costs much accuracy{unchecked}"
            ));
        }
        if self.drift_px > DRIFT_PX {
            warnings.push(format!(
                "the images move by {:.1} px over the stack (a breathing lens or a moving camera), so depth is wrong at edges: use \
                 --align similarity; not for transparent objects (phase contrast, bright field), whose detail changes with the focus",
                self.drift_px
            ));
        }
        warnings
    }
}

/// [`check`]; `use_all` leaves out no image, and without alignment it skips the comparison.
pub(super) fn of_stack<S>(
    images: &S,
    positions: &[f64],
    model: Option<Model>,
    use_all: bool,
    context: &Context<'_>,
) -> Result<Frames>
where
    S: Slices + ?Sized,
    WorkflowError: From<S::Error>,
{
    if use_all && model.is_none() {
        return Ok(Frames { gains: gains(images)?, ..Frames::unchecked(images.count()) });
    }
    let mut frames = check(images, positions, model, context)?;
    if use_all {
        frames.left_out.clear();
        frames.untold.clear();
    }
    Ok(frames)
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
    // Stacks that are too short or of mixed sizes are refused by the measure.
    if count < 3 || (1..count).any(|index| images.dim(index) != images.dim(0)) {
        return Ok(Frames::unchecked(count));
    }
    let mut comparison = Comparison { images, chosen: (0..count).collect(), model, context };
    let mut neighbours = comparison.neighbours()?;
    let Some(composed) = slice_order::composed(&neighbours.sharpness) else {
        return comparison.judged(neighbours, positions);
    };
    // Registrations cost most of the time: those of the other neighbours are kept.
    let mut positions = positions.to_vec();
    positions.remove(composed);
    comparison.chosen.remove(composed);
    neighbours.sharpness.remove(composed);
    neighbours.brightness.remove(composed);
    neighbours.links.remove(composed.min(count - 2));
    if (1..count - 1).contains(&composed) {
        neighbours.links[composed - 1] = comparison.link(composed - 1, composed)?;
    }
    let mut frames = comparison.judged(neighbours, &positions)?;
    frames.insert_composed(composed);
    Ok(frames)
}

/// Brightness of each of the images, which are not compared, relative to the usual one.
pub(super) fn gains<S: Slices + ?Sized>(images: &S) -> Result<Vec<f64>, S::Error> {
    let blocks = blocks(images)?;
    Ok(brightness::gains(&blocks, &(0..blocks.len()).collect::<Vec<_>>()))
}

/// Brightness of each of the images by blocks.
pub(super) fn blocks<S: Slices + ?Sized>(images: &S) -> Result<Vec<Vec<f64>>, S::Error> {
    let of_frame =
        |index: usize| Ok(brightness::of_blocks(images.rows(index, 0..images.dim(index).0)?.view()));
    (0..images.count()).map(of_frame).collect()
}

/// The two nearest frames of the scene.
fn nearest(warps: &[Option<Warp>], index: usize) -> impl Iterator<Item = (usize, Warp)> + use<> {
    let mut placed: Vec<(usize, Warp)> =
        warps.iter().enumerate().filter_map(|(other, warp)| Some((other, (*warp)?))).collect();
    placed.sort_by_key(|(other, _)| other.abs_diff(index));
    placed.into_iter().take(2)
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
    brightness: Vec<Vec<f64>>,
}

struct Comparison<'a, S: ?Sized> {
    images: &'a S,
    /// Numbers of the images that are compared.
    chosen: Vec<usize>,
    model: Option<Model>,
    context: &'a Context<'a>,
}

#[derive(Clone, Copy)]
struct Link {
    /// From a place in the first frame to that in the second.
    warp: Warp,
    /// After the alignment asked for: in place if none.
    correlation: f64,
    /// After registration, whether asked for or not.
    registered: f64,
}

impl Neighbours {
    /// Whether a frame is much less sharp than another in most blocks where that has detail; also true without the sharpness of one of them.
    fn is_less_sharp(&self, frame: usize, other: usize) -> bool {
        let [frame, other] = [frame, other].map(|index| &self.sharpness[index]);
        let least = DETAIL * other.iter().copied().fold(0.0, f64::max);
        let clear = || frame.iter().zip(other).filter(|(_, other)| **other >= least);
        let less = clear().filter(|(frame, other)| **frame < DEFOCUSED * **other).count();
        2 * less >= clear().count()
    }
}

impl<S> Comparison<'_, S>
where
    S: Slices + ?Sized,
    WorkflowError: From<S::Error>,
{
    fn image(&self, index: usize) -> Result<CowArray<'_, f32, Ix2>> {
        self.context.cancel.check("comparing the stack's images")?;
        let index = self.chosen[index];
        Ok(self.images.rows(index, 0..self.images.dim(index).0)?)
    }

    fn link(&self, first: usize, second: usize) -> Result<Link> {
        Ok(self.compared(self.image(first)?.view(), self.image(second)?.view()))
    }

    fn compared(&self, first: ArrayView2<f32>, second: ArrayView2<f32>) -> Link {
        let model = self.model.unwrap_or(Model::Similarity);
        match align::estimate(first, second, model, Warp::IDENTITY) {
            None => Link { warp: Warp::IDENTITY, correlation: 0.0, registered: 0.0 },
            Some(found) => {
                let aligned = self.model.is_some();
                let correlation = if aligned { found.correlation } else { found.correlation_before };
                Link { warp: found.warp, correlation, registered: found.correlation }
            }
        }
    }

    /// Correlation of two frames in place without their detail.
    fn without_detail(&self, first: usize, second: usize) -> Result<f64> {
        let [first, second] = [self.image(first)?, self.image(second)?].map(|image| thinned(image.view()));
        let found = align::estimate(first.view(), second.view(), Model::Shift, Warp::IDENTITY);
        Ok(found.map_or(0.0, |found| found.correlation_before))
    }

    fn neighbours(&self) -> Result<Neighbours> {
        let count = self.chosen.len();
        let mut found = Neighbours { links: Vec::new(), sharpness: Vec::new(), brightness: Vec::new() };
        let mut before: Option<CowArray<'_, f32, Ix2>> = None;
        for index in 0..count {
            let image = self.image(index)?;
            found.sharpness.push(slice_order::sharpness(image.view()));
            found.brightness.push(brightness::of_blocks(image.view()));
            found.links.extend(before.map(|before| self.compared(before.view(), image.view())));
            before = Some(image);
            self.context.progress.advance("images compared", index + 1, Some(count));
        }
        found.sharpness = slice_order::comparable(&found.sharpness);
        Ok(found)
    }

    /// Finds the frames to leave out and the warps of the others.
    fn judged(&self, mut neighbours: Neighbours, positions: &[f64]) -> Result<Frames> {
        let count = self.chosen.len();
        let mut frames = Frames::unchecked(count);
        let registered = usual(neighbours.links.iter().map(|link| link.registered));
        if self.model.is_none() {
            // The warps tell only the motion, and a link to a foreign frame tells none.
            let foreign = neighbours.links.iter_mut().filter(|link| link.registered < FOREIGN * registered);
            foreign.for_each(|link| link.warp = Warp::IDENTITY);
        }
        let scene = self.scene(&neighbours, registered)?;
        let members: Vec<usize> = (0..count).filter(|index| scene.warps[*index].is_some()).collect();
        frames.gains = brightness::gains(&neighbours.brightness, &members);
        let of_scene: Vec<Vec<f64>> =
            members.iter().map(|index| neighbours.sharpness[*index].clone()).collect();
        let exchanged = slice_order::exchanged(&of_scene);
        frames.exchanged = exchanged.into_iter().map(|pair| pair.map(|index| members[index])).collect();
        // Next to an unknown foreign frame a good one looks shaken.
        let shaken = if scene.usual > TELLING {
            shaken::find(&neighbours.sharpness, positions, &frames.gains, &members)
        } else {
            shaken::Shaken::default()
        };
        // Half or more: it is not the frames that are wrong.
        let few_foreign = (count - members.len()) * 2 < count;
        let few_shaken = shaken.frames.len() * 4 < count;
        let start = members.iter().min_by_key(|index| index.abs_diff(count / 2));
        let back = start.and_then(|start| scene.warps[*start]?.inverse()).unwrap_or(Warp::IDENTITY);
        for index in 0..count {
            let warp = match scene.warps[index] {
                Some(warp) => warp,
                None => {
                    let (nearest, warp) =
                        nearest(&scene.warps, index).next().unwrap_or((index, Warp::IDENTITY));
                    let link = self.link(nearest, index)?;
                    if few_foreign {
                        let reason = if self.model.is_none() && link.registered >= FOREIGN * registered {
                            "it has moved against the others: --align similarity keeps it".to_owned()
                        } else {
                            format!(
                                "it shows another scene, or is turned, black or far out of focus (correlation with its neighbour {:.2}, of the others {:.2})",
                                link.correlation, scene.usual
                            )
                        };
                        frames.left_out.push((index, reason));
                    }
                    link.warp.after(&warp)
                }
            };
            frames.warps[index] = warp.after(&back);
            if few_shaken && shaken.frames.contains(&index) {
                let reason = if frames.exchanged.iter().any(|[a, b]| (a..=b).contains(&&index)) {
                    "it is less sharp in most places than its neighbours suggest: images look exchanged here, or it is shaken or defocused"
                } else {
                    "it is shaken or defocused: less sharp in most places than its neighbours suggest"
                };
                frames.left_out.push((index, reason.into()));
            }
        }
        frames.untold = shaken.untold;
        frames.usual = Some(scene.usual);
        if self.model.is_none() {
            // In place, moving images correlate little.
            let is_apart = scene.usual < FOREIGN * registered;
            if registered > TELLING || is_apart && self.steps_agree(&neighbours.links)? {
                let measured: Vec<Warp> = members.iter().map(|index| frames.warps[*index]).collect();
                frames.drift_px = farthest_px(&measured, self.images.dim(0));
            }
            frames.warps.fill(Warp::IDENTITY);
        }
        let wrapped = slice_order::wrapped(&neighbours.sharpness);
        if wrapped.is_some() && self.link(count - 1, 0)?.registered >= FOREIGN * registered {
            // Only a black frame is bad in any order.
            frames.left_out.retain(|(index, _)| neighbours.sharpness[*index].is_empty());
            frames = Frames { wrapped, untold: Vec::new(), exchanged: Vec::new(), ..frames };
        }
        Ok(frames)
    }

    /// Whether most pairs of successive steps lead to where the image after next is.
    fn steps_agree(&self, links: &[Link]) -> Result<bool> {
        let every = links.len().div_ceil(COMPARED);
        let (mut agreeing, mut all) = (0, 0);
        for (first, [one, other]) in links.array_windows().enumerate().step_by(every) {
            let size = self.images.dim(first);
            let direct = self.link(first, first + 2)?.warp;
            let back = other.warp.after(&one.warp).inverse();
            let apart_px = back.map_or(f64::INFINITY, |back| farthest_px(&[direct.after(&back)], size));
            agreeing += usize::from(apart_px < AGREEING * farthest_px(&[one.warp, other.warp], size));
            all += 1;
        }
        Ok(2 * agreeing > all)
    }

    /// `registered` is the usual correlation of neighbours after registration.
    fn scene(&self, neighbours: &Neighbours, registered: f64) -> Result<Scene> {
        let links = &neighbours.links;
        let usual = usual(links.iter().map(|link| link.correlation));
        let limit = if usual > TELLING { FOREIGN * usual } else { f64::NEG_INFINITY };
        let breaks = (0..links.len()).filter(|at| links[*at].correlation < limit).map(|at| at + 1);
        let ends: Vec<usize> = [0].into_iter().chain(breaks).chain([links.len() + 1]).collect();
        let runs = ends.array_windows().map(|[from, to]| *from..*to);
        let run = runs.max_by_key(ExactSizeIterator::len).unwrap_or_default();
        let mut warps = vec![None; links.len() + 1];
        let mut defocused = vec![false; warps.len()];
        let mut warp = Warp::IDENTITY;
        for index in run.clone() {
            if index > run.start {
                warp = links[index - 1].warp.after(&warp);
            }
            warps[index] = Some(warp);
        }
        for index in (0..run.start).rev().chain(run.end..warps.len()) {
            // The nearest may be bad itself, so the next one counts too.
            for (other, placed) in nearest(&warps, index) {
                let least = match other.abs_diff(index) {
                    1 => limit,
                    distance => FOREIGN * self.expected(&warps, other, distance, usual)?,
                };
                let link = self.link(other, index)?;
                if link.correlation >= least {
                    warps[index] = Some(link.warp.after(&placed));
                    break;
                }
                // A moved frame is registered, and a foreign one mostly as sharp as the others.
                let is_defocused = neighbours.is_less_sharp(index, other)
                    || (defocused[other] && !neighbours.is_less_sharp(other, index));
                if is_defocused
                    && link.registered < FOREIGN * registered
                    && self.without_detail(other, index)? >= COARSELY_ALIKE
                {
                    (warps[index], defocused[index]) = (Some(placed), true);
                    break;
                }
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

/// Means of squares of the image, NaN where it does not show the scene.
fn thinned(image: ArrayView2<f32>) -> Array2<f32> {
    let mut side = DETAIL_PX;
    while image.len() / (side * side) > MOST {
        side *= 2;
    }
    let (height, width) = image.dim();
    Array2::from_shape_fn((height / side, width / side), |(y, x)| {
        let square = image.slice(s![y * side..(y + 1) * side, x * side..(x + 1) * side]);
        let seen = || square.iter().filter(|value| value.is_finite());
        seen().sum::<f32>() / seen().count() as f32
    })
}

fn usual(correlations: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = correlations.collect();
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
