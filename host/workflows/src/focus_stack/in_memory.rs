//! Stacks whose images are in memory.

use farnear_depth::{
    brightness::{Trend, of_blocks},
    focus_stack::StackMap,
    prepare::{
        align::Model,
        warp::{Warp, resample},
    },
};
use ndarray::{Array2, ArrayView2};

use super::{
    black_border::{self, Borders},
    frames,
    images::{darkest, even, fill_specks, mark_specks},
    withhold,
};
use crate::{context::Context, error::Result};

/// A stack for [`farnear_depth::focus_stack::depth_from_positions`].
#[derive(Debug)]
pub struct PreparedStack {
    /// Without those that were left out.
    pub images: Vec<Array2<f32>>,
    /// Of each image, as given.
    pub positions: Vec<f64>,
    /// Indices of the images that were left out.
    pub left_out: Vec<usize>,
    pub warnings: Vec<String>,
    /// Step of the pixels' codes after the brightness was evened out.
    pub code_step: f32,
    /// Farthest distance that alignment moved a pixel; `None` without.
    pub moved_px: Option<f64>,
    /// Pixels that an image has no value for.
    unseen: Option<Array2<bool>>,
}

impl PreparedStack {
    /// Removes the places of pixels that an image has no value for.
    pub fn withhold(&self, map: &mut StackMap) {
        withhold(map, self.unseen.as_ref());
    }
}

/// Leaves out images that show another scene, are turned or shaken, unless `use_all` is set; evens out the brightness of the
/// others and aligns them. Pixels are NaN where an image does not show the scene, also in black borders. `code_step` is that
/// of integers from 0 to 1, and 0 for other images.
pub fn prepare_stack(
    mut images: Vec<Array2<f32>>,
    code_step: f32,
    mut positions: Vec<f64>,
    model: Option<Model>,
    use_all: bool,
    context: &Context<'_>,
) -> Result<PreparedStack> {
    let borders: Vec<Borders> = images.iter().map(|image| black_border::of_image(image, code_step)).collect();
    let mut specks: Vec<_> = images.iter_mut().map(|image| fill_specks(image, code_step == 0.0)).collect();
    let erased = black_border::of_registration(&borders);
    for image in &mut images {
        black_border::erase(image, code_step, erased);
    }
    let views: Vec<ArrayView2<f32>> = images.iter().map(|image| image.view()).collect();
    let mut frames = frames::of_stack(&views[..], &positions, model, use_all, context)?;
    let warnings = frames.remarks(|index| format!("images[{index}]"));
    let left_out: Vec<usize> = frames.left_out.iter().map(|(index, _)| *index).collect();
    for index in left_out.iter().rev() {
        images.remove(*index);
        positions.remove(*index);
        specks.remove(*index);
        frames.warps.remove(*index);
        frames.gains.remove(*index);
    }
    images.iter_mut().zip(&frames.gains).for_each(|(image, gain)| even(image, *gain as f32, code_step > 0.0));
    let mut unseen = None;
    for (index, image) in images.iter_mut().enumerate() {
        context.cancel.check("aligning the stack")?;
        let warp = &frames.warps[index];
        mark_specks(&mut unseen, image.dim(), &specks[index], None, warp);
        if *warp != Warp::IDENTITY {
            *image = resample(image.view(), warp);
        }
    }
    // Of aligned images, because a lens that breathes in uneven light looks alike.
    let blocks: Vec<Vec<f64>> = images.iter().map(|image| of_blocks(image.view())).collect();
    if let Some(trend) = Trend::of(&blocks, &positions) {
        images.iter_mut().zip(&positions).for_each(|(image, position)| trend.divide(image, *position));
    }
    let moved_px = model.and(images.first()).map(|first| frames::farthest_px(&frames.warps, first.dim()));
    let code_step = code_step / darkest(frames.gains.iter().map(|gain| *gain as f32));
    Ok(PreparedStack { images, positions, left_out, warnings, code_step, moved_px, unseen })
}

#[cfg(test)]
mod tests {
    use farnear_depth::focus_stack::{StackSettings, depth_from_positions};
    use std::sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    };

    use super::*;
    use crate::context::{Cancel, Unattended};

    /// Noise, blurred more with the distance from the image in the middle.
    fn stack() -> Vec<Array2<f32>> {
        let noise = Array2::from_shape_fn((48, 64), |(y, x)| {
            let mixed = ((64 * y + x) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f32 / (1 << 24) as f32
        });
        let blurred = |reach: usize| {
            Array2::from_shape_fn(noise.dim(), |(y, x)| {
                let rows = y.saturating_sub(reach)..(y + reach + 1).min(48);
                let columns = x.saturating_sub(reach)..(x + reach + 1).min(64);
                noise.slice(ndarray::s![rows, columns]).mean().unwrap()
            })
        };
        (0..7_usize).map(|index| blurred(index.abs_diff(3))).collect()
    }

    #[test]
    fn a_pixel_without_a_value_has_no_place_and_its_neighbours_have_one() {
        let mut images = stack();
        images[2][(20, 30)] = f32::NAN;
        images[3][(30, 40)] = 1e30;
        let positions: Vec<f64> = (0..7).map(f64::from).collect();
        let prepared = prepare_stack(images, 0.0, positions, None, false, &Context::unattended()).unwrap();
        assert_eq!(prepared.left_out, [0; 0]);
        let views: Vec<ArrayView2<f32>> = prepared.images.iter().map(|image| image.view()).collect();
        let settings = StackSettings { median_px: 1, guided_px: 0.0, ..StackSettings::default() };
        let mut map = depth_from_positions(&views[..], &prepared.positions, &settings).unwrap();
        prepared.withhold(&mut map);
        assert!(map.place[(20, 30)].is_nan() && map.reliability[(20, 30)] == 0.0);
        assert!(map.place[(20, 31)].is_finite() && map.place[(21, 30)].is_finite());
        assert!(map.place[(30, 40)].is_nan() && map.place[(30, 41)].is_finite());
    }

    #[test]
    fn vignetting_that_changes_over_the_stack_is_evened_out() {
        let mut images = stack();
        for (number, image) in images.iter_mut().enumerate() {
            let factor = |x: usize| 1.0 - 0.05 * number as f32 * (x as f32 / 64.0 - 0.2);
            image.indexed_iter_mut().for_each(|((_, x), value)| *value *= factor(x));
        }
        let positions: Vec<f64> = (0..7).map(f64::from).collect();
        let even = prepare_stack(images, 0.0, positions, None, false, &Context::unattended()).unwrap().images;
        let ratio = |columns: std::ops::Range<usize>| {
            let mean = |index: usize| even[index].slice(ndarray::s![.., columns.clone()]).sum();
            mean(6) / mean(0)
        };
        // Before, 1.05 and 0.8.
        let ratios = [ratio(0..6), ratio(58..64)];
        assert!((ratios[0] / ratios[1] - 1.0).abs() < 0.05, "{ratios:?}");
    }

    #[test]
    fn the_flag_stops_the_comparison() {
        let flag = Arc::new(AtomicBool::new(false));
        let context = Context::new(&Unattended, &Unattended, Cancel::from(Arc::clone(&flag)));
        let prepare = || prepare_stack(stack(), 0.0, (0..7).map(f64::from).collect(), None, false, &context);
        assert!(prepare().is_ok());
        flag.store(true, Ordering::Relaxed);
        assert!(prepare().unwrap_err().is_cancelled());
    }
}
