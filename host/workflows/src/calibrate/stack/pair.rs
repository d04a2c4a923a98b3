//! The pair of slices to try first, and remarks on the slices.

use farnear_depth::{
    calibrate::stack::StackLens,
    mosaic::{self, is_mosaic},
};
use ndarray::Array2;

use crate::depth::tone;

/// The far image of the pair whose range has the focus between its middle, where both images look the same, and an end.
fn telling_pair(focus: f64, pair_step: usize, slices: usize) -> usize {
    let off = |far: &usize| {
        let alpha = 2.0 * (focus - *far as f64) / pair_step as f64 - 1.0;
        (alpha.abs() - 0.6).abs()
    };
    (0..slices.saturating_sub(pair_step)).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0)
}

/// The far and the near slice of the pair to try first.
pub(super) fn pair_to_try(found: &StackLens, (height, width): (usize, usize), slices: usize) -> [usize; 2] {
    let pair_step = found.optics.stage().map_or(1, |stage| stage.pair_step);
    let far = telling_pair(found.plane.at(0.5 * height as f64, 0.5 * width as f64), pair_step, slices);
    [far, far + pair_step]
}

/// A remark on the first slice of a stack.
pub fn raw_mosaic(first: &Array2<f32>) -> Option<String> {
    is_mosaic(first.view()).then(|| mosaic::WORDS.to_owned())
}

/// A remark on single pixels that were filled in all slices together.
pub fn filled_pixels(count: usize) -> Option<String> {
    (count > 0).then(|| {
        format!(
            "{count} single pixels of the slices have no value (NaN, transparent, or 1000 times the usual one): the mean of their \
             neighbours replaces each"
        )
    })
}

/// A doubt about slices that are not linear in light.
pub fn curved_light(found: &StackLens, slices: &[Array2<f32>]) -> Option<String> {
    let [far, near] = pair_to_try(found, slices.first()?.dim(), slices.len());
    tone::doubt_of_slices(slices.get(far)?, slices.get(near)?, &found.optics)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pair_to_try_has_the_target_off_the_middle_of_its_range() {
        for (focus, pair_step, slices) in
            [(10.0, 10, 21), (6.2, 4, 13), (2.0, 4, 13), (10.5, 3, 13), (10.1, 2, 21)]
        {
            let far = telling_pair(focus, pair_step, slices);
            let alpha = 2.0 * (focus - far as f64) / pair_step as f64 - 1.0;
            assert!(
                far + pair_step < slices && (0.2..0.95).contains(&alpha.abs()),
                "{focus} {pair_step}: {far}"
            );
        }
    }
}
