//! Medians.

use std::cmp::Ordering;

/// The upper median in this order; `None` without values. Linear.
pub(crate) fn median<T: Copy>(mut values: Vec<T>, order: impl FnMut(&T, &T) -> Ordering) -> Option<T> {
    let middle = values.len() / 2;
    values.get(middle)?;
    Some(*values.select_nth_unstable_by(middle, order).1)
}

#[cfg(test)]
mod tests {
    use super::*;

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
