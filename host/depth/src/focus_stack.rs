//! Depth from focus: where each pixel of a stack of images is sharpest.
//!
//! The sharpness of a pixel over the stack (a focus measure, [`Sharpness`]) is a curve. Blur grows linearly with the distance
//! from the focus, and a focus measure falls with its square: the reciprocal of the sharpness is a parabola. It is fitted
//! through the points around the maximum by least squares, weighted as Guo weights a logarithm (A simple algorithm for fitting
//! a Gaussian function, IEEE Signal Processing Magazine 28, 2011): by the fourth power of the sharpness, so that the noise of
//! the tails has little weight. A Gaussian (a parabola of the logarithm) falls faster than real curves and is biased where
//! images are missing on one side; it serves for the reliability. Three points (Nayar & Nakagawa 1994) have two to three times
//! the error of eleven. Where only the largest value and one neighbour stand out (steps of about the curve's width and more), three
//! points are better: the others tell nothing but the floor.
//!
//! A stack needs neither point spread function nor aperture. Its range is that of its images. Cost: the focus measure
//! for each image, and about 40 operations per pixel and image. Images are read by rows ([`Slices`]), not held in
//! memory. Memory: 28 bytes a pixel for the maps, and the sharpness of the rows at work in all images (`BAND_BYTES`).

mod error;
mod guided;
mod sharpness;
mod slices;
mod tip;

use std::ops::Range;

use ndarray::{Array2, ArrayView2, ArrayViewMut1, Axis, Zip, s};
use rayon::prelude::*;

use crate::{median::medians, metrics::dilate_square, prepare::band::box_mean};
pub use error::StackError;
use guided::{Guide, mended};
pub use sharpness::{Sharpness, UnknownSharpness};
use sharpness::{blur_reach_px, blurred};
pub use slices::Slices;
use tip::tip;

/// Images that make a stack.
pub const LEAST_IMAGES: usize = 3;
/// Memory for the sharpness of the rows at work in all images, bytes.
const BAND_BYTES: usize = 128 << 20;
/// Fewest rows at work: each image needs about 30 more around them.
const LEAST_BAND: usize = 16;
/// Most that images are blurred by first, px.
pub const MOST_SMOOTHING_PX: f32 = 10.0;
/// Most that places are corrected over, px.
pub const MOST_GUIDED_PX: f32 = 100.0;
/// Reliability below which a place has no depth, where nothing else is requested.
pub const USUAL_RELIABILITY: f32 = 0.1;

/// How a stack is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StackSettings {
    /// The focus measure.
    pub measure: Sharpness,
    /// Standard deviation of the Gaussian blur before the measure, px; 0 = none. Finer detail is mostly noise and rounding.
    pub smoothing_px: f32,
    /// Side of the measure's window, odd.
    pub window_px: usize,
    /// Most points of the curve for the fit of its tip; odd.
    pub fit_points: usize,
    /// Side of the median over the places found, odd; 1 = none.
    pub median_px: usize,
    /// Standard deviation of the window over which places are corrected along the edges of the sharp image, px; 0 = not at all.
    pub guided_px: f32,
    /// Places below this reliability have no value.
    pub min_reliability: f32,
}

impl Default for StackSettings {
    /// The modified Laplacian, which the survey finds best on the whole, over 9 pixels of images blurred by 1; 11 points; a median
    /// of 9x9, corrected along the sharp image's edges within 10 px.
    fn default() -> Self {
        Self {
            measure: Sharpness::ModifiedLaplacian,
            smoothing_px: 1.0,
            window_px: 9,
            fit_points: 11,
            median_px: 9,
            guided_px: 10.0,
            min_reliability: USUAL_RELIABILITY,
        }
    }
}

impl StackSettings {
    /// Checks all settings. Returns the [`StackError`] of the first setting out of range.
    pub fn check(&self) -> Result<(), StackError> {
        let odd = |what, value: usize, least, most| {
            let fits = value % 2 == 1 && (least..=most).contains(&value);
            if fits { Ok(()) } else { Err(StackError::Odd { what, value, least, most }) }
        };
        odd("the window", self.window_px, 3, 101)?;
        odd("the number of points", self.fit_points, 3, 31)?;
        odd("the median's window", self.median_px, 1, 31)?;
        if !(0.0..=MOST_SMOOTHING_PX).contains(&self.smoothing_px) {
            return Err(StackError::Smoothing(self.smoothing_px));
        }
        if self.guided_px != 0.0 && !(1.0..=MOST_GUIDED_PX).contains(&self.guided_px) {
            return Err(StackError::Guided(self.guided_px));
        }
        if !(0.0..=1.0).contains(&self.min_reliability) {
            return Err(StackError::Reliability(self.min_reliability));
        }
        Ok(())
    }
}

/// Maps of a stack, (height, width).
#[derive(Debug, Clone)]
pub struct StackMap {
    /// The image in which it would be sharpest, from 0, between images as a fraction; NaN = unreliable.
    pub place: Array2<f32>,
    /// How far the curve rises above its own middle, times how well the tip is fitted (the determination of the fit), times how far
    /// its tip is above noise of one code: 0 to 1. 0 where the largest value is at an end of the stack: the tip may lie outside.
    pub reliability: Array2<f32>,
    /// Each pixel from its sharpest image.
    pub all_in_focus: Array2<f32>,
}

/// Finds where each pixel of a stack is sharpest. The images (height, width) are in the order of their focus, aligned, in any scale.
///
/// # Errors
/// [`StackError`] for too few or too small images, different sizes, pixels without a value, settings out of range.
pub fn depth_from_stack(
    images: &[ArrayView2<f32>],
    settings: &StackSettings,
) -> Result<StackMap, StackError> {
    for (index, image) in images.iter().enumerate() {
        if let Some(((row, column), _)) = image.indexed_iter().find(|(_, v)| !v.is_finite()) {
            return Err(StackError::NotFinite { number: index + 1, column, row });
        }
    }
    let positions: Vec<f64> = (0..images.len()).map(|index| index as f64).collect();
    depth_from_positions(images, &positions, settings)
}

/// [`depth_from_stack`] of images at uneven positions along the axis, strictly rising or falling, in any unit: the tip is fitted
/// over these. Places stay numbers of images. A pixel that is not finite was not seen in that image. A place has no value
/// if fewer than half of the images saw the pixel and its surroundings, or if no neighbour of the sharpest image did.
///
/// # Errors
/// [`StackError`], without [`StackError::NotFinite`]; those of reading the images.
pub fn depth_from_positions<S: Slices + ?Sized>(
    images: &S,
    positions: &[f64],
    settings: &StackSettings,
) -> Result<StackMap, S::Error> {
    check(images, settings)?;
    let count = images.count();
    let signs = || positions.windows(2).map(|two| two[1].total_cmp(&two[0]));
    let one_way = signs().all(|sign| sign.is_ne()) && signs().zip(signs().skip(1)).all(|(a, b)| a == b);
    if positions.len() != count || !one_way || !positions.iter().all(|p| p.is_finite()) {
        return Err(StackError::Positions { images: count, positions: positions.len() }.into());
    }
    let band = (BAND_BYTES / (4 * images.dim(0).1 * count)).max(LEAST_BAND);
    let Curves { place, reliability, sharpness, rise } = curves(images, positions, settings, band)?;
    let mut place = medians(place, settings.median_px);
    let mut all_in_focus = sharp_everywhere(images, &place, band)?;
    if settings.guided_px > 0.0 {
        let guide = Guide {
            sharp: all_in_focus.view(),
            sharpness: sharpness.view(),
            reach_px: settings.guided_px,
            images: count,
        };
        let height = place.nrows();
        place = mended(place.view(), rise, &guide, |rows| images.measured(rows, height))?;
        all_in_focus = sharp_everywhere(images, &place, band)?;
    }
    place.zip_mut_with(&reliability, |place, reliability| {
        if *reliability < settings.min_reliability {
            *place = f32::NAN;
        }
    });
    Ok(StackMap { place, reliability, all_in_focus })
}

/// What the curves of all pixels say (see [`tip::Tip`]).
struct Curves {
    place: Array2<f32>,
    reliability: Array2<f32>,
    sharpness: Array2<f32>,
    rise: Array2<f32>,
}

fn curves<S: Slices + ?Sized>(
    images: &S,
    positions: &[f64],
    settings: &StackSettings,
    band: usize,
) -> Result<Curves, S::Error> {
    let (height, width) = images.dim(0);
    let floor = noise_floor(images.code_step(), settings);
    let [mut place, mut reliability, mut sharpness, mut rise] =
        std::array::from_fn(|_| Array2::zeros((height, width)));
    for top in (0..height).step_by(band) {
        let rows = top..(top + band).min(height);
        let measured = (0..images.count())
            .into_par_iter()
            .map(|index| measured_rows(images, index, rows.clone(), settings))
            .collect::<Result<Vec<_>, _>>()?;
        let mut maps = [&mut place, &mut reliability, &mut sharpness, &mut rise]
            .map(|map| map.slice_mut(s![rows.clone(), ..]));
        let [place, reliability, sharpness, rise] = maps.each_mut().map(|map| map.axis_iter_mut(Axis(0)));
        let mut found: Vec<[ArrayViewMut1<f32>; 4]> = place
            .zip(reliability)
            .zip(sharpness.zip(rise))
            .map(|((place, reliability), (sharpness, rise))| [place, reliability, sharpness, rise])
            .collect();
        found.par_iter_mut().enumerate().for_each(|(y, maps)| {
            let mut curve = vec![0.0; measured.len()];
            for x in 0..width {
                curve.iter_mut().zip(&measured).for_each(|(value, map)| *value = map[(y, x)]);
                let tip = tip(&curve, positions, settings.fit_points);
                let above_floor = if floor < tip.sharpness { 1.0 - floor / tip.sharpness } else { 0.0 };
                let values = [tip.place, tip.reliability * above_floor, tip.sharpness, tip.rise];
                maps.iter_mut().zip(values).for_each(|(map, value)| map[x] = value);
            }
        });
        images.measured(rows.end, height)?;
    }
    Ok(Curves { place, reliability, sharpness, rise })
}

fn check<S: Slices + ?Sized>(images: &S, settings: &StackSettings) -> Result<(), StackError> {
    settings.check()?;
    if images.count() < LEAST_IMAGES {
        return Err(StackError::TooFew { count: images.count() });
    }
    let of = images.dim(0);
    for index in 0..images.count() {
        let (number, (height, width)) = (index + 1, images.dim(index));
        if (height, width) != of {
            return Err(StackError::Size { number, width, height, of });
        }
        if height.min(width) < settings.window_px {
            return Err(StackError::TooSmall { width, height, window_px: settings.window_px });
        }
    }
    Ok(())
}

/// The focus measure of some rows of an image.
fn measured_rows<S: Slices + ?Sized>(
    images: &S,
    index: usize,
    rows: Range<usize>,
    settings: &StackSettings,
) -> Result<Array2<f32>, S::Error> {
    // Rows around these that the values depend on; at the picture's own border there are none.
    let reach = 2 * (settings.window_px / 2) + Sharpness::REACH_PX + blur_reach_px(settings.smoothing_px);
    let from = rows.start.saturating_sub(reach);
    let seen = images.rows(index, from..(rows.end + reach).min(images.dim(index).0))?;
    let measured = measured_over_windows(seen.view(), settings);
    Ok(measured.slice(s![rows.start - from..rows.end - from, ..]).to_owned())
}

/// Sharpness of noise of one code: rounding and the blocks of JPEG reach it where an image shows nothing.
fn noise_floor(code_step: f32, settings: &StackSettings) -> f32 {
    if code_step <= 0.0 {
        return 0.0;
    }
    // Uniform noise has the standard deviation of its range / sqrt(12).
    let range = code_step * 12.0_f32.sqrt();
    let side = settings.window_px.max(64);
    let noise = Array2::from_shape_fn((side, side), |(y, x)| {
        // Mixed as in Fibonacci hashing, twice: neighbours are as good as independent.
        let mixed = ((y * side + x + 1) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        0.5 + range * ((mixed >> 40) as f32 / (1 << 24) as f32 - 0.5)
    });
    measured_where_seen(noise.view(), settings).mean().unwrap_or(0.0)
}

/// The focus measure over windows that fade towards their border: the mean over the window is taken twice, for a window with a hard
/// border puts a sharp detail's place on everything within its reach. NaN where a pixel that it depends on was not seen.
fn measured_over_windows(image: ArrayView2<f32>, settings: &StackSettings) -> Array2<f32> {
    if image.iter().all(|value| value.is_finite()) {
        return measured_where_seen(image, settings);
    }
    let seen = || image.iter().copied().filter(|value| value.is_finite());
    let mean = seen().map(f64::from).sum::<f64>() / seen().count().max(1) as f64;
    let whole = image.mapv(|value| if value.is_finite() { value } else { mean as f32 });
    let mut measured = measured_where_seen(whole.view(), settings);
    let reach = 2 * (settings.window_px / 2) + Sharpness::REACH_PX + blur_reach_px(settings.smoothing_px);
    let unseen = dilate_square(&image.mapv(|value| !value.is_finite()), reach);
    Zip::from(&mut measured).and(&unseen).for_each(|value, unseen| {
        if *unseen {
            *value = f32::NAN;
        }
    });
    measured
}

fn measured_where_seen(image: ArrayView2<f32>, settings: &StackSettings) -> Array2<f32> {
    let side = settings.window_px;
    let measured = if settings.smoothing_px > 0.0 {
        settings.measure.of(blurred(image, settings.smoothing_px).view(), side)
    } else {
        settings.measure.of(image, side)
    };
    box_mean(measured.view(), side)
}

/// Each pixel as at its place in the stack.
fn sharp_everywhere<S: Slices + ?Sized>(
    images: &S,
    place: &Array2<f32>,
    band: usize,
) -> Result<Array2<f32>, S::Error> {
    let mut sharp = Array2::zeros(place.dim());
    for (index, mut sharp) in sharp.axis_chunks_iter_mut(Axis(0), band).enumerate() {
        let rows = index * band..index * band + sharp.nrows();
        let read = (0..images.count())
            .map(|index| images.rows(index, rows.clone()))
            .collect::<Result<Vec<_>, _>>()?;
        let views: Vec<ArrayView2<f32>> = read.iter().map(|image| image.view()).collect();
        Zip::indexed(&mut sharp)
            .and(place.slice(s![rows, ..]))
            .par_for_each(|at, sharp, place| *sharp = between(&views, *place, at));
    }
    Ok(sharp)
}

/// A pixel between two images of the stack; of images that did not see it the nearest that did.
fn between(images: &[ArrayView2<f32>], place: f32, at: (usize, usize)) -> f32 {
    let below = (place as usize).min(images.len() - 2);
    let part = place - below as f32;
    let value = (1.0 - part) * images[below][at] + part * images[below + 1][at];
    if value.is_finite() {
        return value;
    }
    let distance = |index: &usize| (*index as f32 - place).abs();
    let seen = (0..images.len()).filter(|index| images[*index][at].is_finite());
    seen.min_by(|a, b| distance(a).total_cmp(&distance(b))).map_or(0.0, |index| images[index][at])
}

#[cfg(test)]
mod tests;
