//! Astigmatism of a lens: depth from focus of the target's detail along x less that along y, and of the two diagonals.

use super::StackError;
use super::focus_plane::{FocusPlane, Slices};

/// Directions (down, right) that are compared: for the means of `cos 2t` and of `sin 2t`.
const COMPARED: [[[isize; 2]; 2]; 2] = [[[0, 1], [1, 0]], [[1, 1], [-1, 1]]];
/// Standard errors from which a difference is astigmatism.
const SIGNIFICANT: f64 = 4.0;

/// Difference of the slices in focus per unit of anisotropy: the detail of a round texture along a direction has an
/// anisotropy of one half, that across of minus one half.
#[derive(Debug, Clone, Copy)]
pub(super) struct FocusByDirection {
    /// In the middle of the field, slices.
    pub shift_per_anisotropy: [f64; 2],
    /// Its standard deviation, over the field and by its measurement, slices.
    pub spread: f64,
}

impl FocusByDirection {
    /// `None` without a significant difference, or where the target lacks a direction.
    pub fn of(slices: &Slices<'_>, proceed: &(dyn Fn() -> bool + Sync)) -> Result<Option<Self>, StackError> {
        let (height, width) = slices.dim();
        let [height, width] = [height, width].map(|side| side as f64);
        let plane = |apart| match slices.plane_along(apart, proceed) {
            Ok(plane) => Ok(Some(plane)),
            Err(StackError::NoFocus { .. }) => Ok(None),
            Err(error) => Err(error),
        };
        let (mut shift_per_anisotropy, mut variance, mut is_significant) = ([0.0; 2], 0.0, false);
        for (shift, [one, other]) in shift_per_anisotropy.iter_mut().zip(COMPARED) {
            let (Some(one), Some(other)) = (plane(one)?, plane(other)?) else { return Ok(None) };
            let middle = |plane: &FocusPlane| plane.at(0.5 * height, 0.5 * width);
            let of_mean = |plane: &FocusPlane| plane.spread.powi(2) / plane.blocks as f64;
            let squared_error = of_mean(&one) + of_mean(&other);
            *shift = middle(&one) - middle(&other);
            is_significant |= shift.powi(2) > SIGNIFICANT.powi(2) * squared_error;
            // Evenly distributed over the field.
            let over_field = ((one.x_per_px - other.x_per_px) * width).powi(2)
                + ((one.y_per_px - other.y_per_px) * height).powi(2);
            variance += squared_error + over_field / 12.0;
        }
        Ok(is_significant.then(|| Self { shift_per_anisotropy, spread: variance.sqrt() }))
    }

    /// In normalised depth, which changes by 2 over a pair of slices `pair_step` apart.
    pub fn of_pairs(self, pair_step: usize) -> Self {
        let per_slice = 2.0 / pair_step as f64;
        let shift_per_anisotropy = self.shift_per_anisotropy.map(|slices| slices * per_slice);
        Self { shift_per_anisotropy, spread: self.spread * per_slice }
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::border::reflect;

    /// Blurs along x with a radius that is least in slice 6 - `apart`, along y in slice 6 + `apart`.
    fn slices(apart: f64) -> Vec<Array2<f32>> {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let target = Array2::from_shape_simple_fn((120, 160), || rng.random::<f32>());
        let blurred = |image: &Array2<f32>, away: f64, [down, right]: [isize; 2]| {
            let variance = 0.5 + 0.3 * away * away;
            let taps: Vec<(isize, f32)> =
                (-8..=8).map(|i: isize| (i, (-((i * i) as f64) / (2.0 * variance)).exp() as f32)).collect();
            let sum: f32 = taps.iter().map(|(_, tap)| tap).sum();
            let (height, width) = image.dim();
            Array2::from_shape_fn(image.dim(), |(y, x)| {
                let at = |i: isize| {
                    let y = reflect(y as isize + i * down, height);
                    image[(y, reflect(x as isize + i * right, width))]
                };
                taps.iter().map(|(i, tap)| tap * at(*i)).sum::<f32>() / sum
            })
        };
        (0..13)
            .map(|slice| {
                let away = f64::from(slice) - 6.0;
                let along_x = blurred(&target, away + apart, [0, 1]);
                blurred(&along_x, away - apart, [1, 0])
            })
            .collect()
    }

    #[test]
    fn detail_along_x_and_y_has_its_own_focus() {
        let found = FocusByDirection::of(&Slices::new(&slices(0.4)), &|| true).unwrap().unwrap();
        assert!(
            (found.shift_per_anisotropy[0] + 0.35).abs() < 0.1 && found.shift_per_anisotropy[1].abs() < 0.1,
            "{found:?}"
        );
        let none = FocusByDirection::of(&Slices::new(&slices(0.0)), &|| true).unwrap();
        assert!(
            none.is_none_or(|found| found.shift_per_anisotropy.iter().all(|shift| shift.abs() < 0.05)),
            "{none:?}"
        );
        let stopped = FocusByDirection::of(&Slices::new(&slices(0.4)), &|| false);
        assert!(matches!(stopped, Err(StackError::Stopped)));
    }
}
