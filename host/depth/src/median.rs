//! Medians.

use std::cmp::Ordering;

use ndarray::{Array2, Axis, s};
use rayon::prelude::*;

/// The upper median in this order; `None` without values. Linear.
pub(crate) fn median<T: Copy>(mut values: Vec<T>, order: impl FnMut(&T, &T) -> Ordering) -> Option<T> {
    let middle = values.len() / 2;
    values.get(middle)?;
    Some(*values.select_nth_unstable_by(middle, order).1)
}

/// Standard deviation of the normal distribution about 0 with the median magnitude of the values; `None` without any.
pub(crate) fn deviation(values: impl Iterator<Item = f64>) -> Option<f64> {
    Some(1.4826 * median(values.map(f64::abs).collect(), f64::total_cmp)?)
}

/// Medians over windows of `side` pixels, smaller at the borders. NaN stays NaN and is left out of the windows.
pub(crate) fn medians(map: Array2<f32>, side: usize) -> Array2<f32> {
    if side == 1 {
        return map;
    }
    let (reach, (height, width)) = (side / 2, map.dim());
    let mut result = map.clone();
    result.axis_iter_mut(Axis(0)).into_par_iter().enumerate().for_each(|(y, mut row)| {
        let mut window = Vec::with_capacity(side * side);
        for (x, value) in row.iter_mut().enumerate().filter(|(_, value)| !value.is_nan()) {
            let rows = y.saturating_sub(reach)..(y + reach + 1).min(height);
            let columns = x.saturating_sub(reach)..(x + reach + 1).min(width);
            window.clear();
            window.extend(map.slice(s![rows, columns]).iter().copied().filter(|value| !value.is_nan()));
            let middle = window.len() / 2;
            *value = *window.select_nth_unstable_by(middle, f32::total_cmp).1;
        }
    });
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_that_of_the_part_of_the_window_inside_the_map() {
        let map = Array2::from_shape_fn((9, 12), |(y, x)| match (y, x) {
            (4, 6..9) => f32::NAN,
            _ => ((x * 7919 + y * 104_729 + x * y * 31) % 97) as f32,
        });
        for side in [1, 3, 5] {
            let found = medians(map.clone(), side);
            for ((y, x), found) in found.indexed_iter() {
                let near = |(at, v): &((usize, usize), &f32)| {
                    !v.is_nan() && at.0.abs_diff(y).max(at.1.abs_diff(x)) <= side / 2
                };
                let mut window: Vec<f32> = map.indexed_iter().filter(near).map(|(_, v)| *v).collect();
                window.sort_by(f32::total_cmp);
                let expected = if map[(y, x)].is_nan() { f32::NAN } else { window[window.len() / 2] };
                assert_eq!(found.to_bits(), expected.to_bits(), "{side} at {x}, {y}");
            }
        }
    }

    #[test]
    fn the_middle_is_found_in_any_order() {
        for (values, middle) in [
            (vec![], None),
            (vec![4.0], Some(4.0)),
            (vec![3.0, 1.0], Some(3.0)),
            (vec![9.0, 1.0, 5.0], Some(5.0)),
        ] {
            assert_eq!(median(values, f64::total_cmp), middle);
        }
    }
}
