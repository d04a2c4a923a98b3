//! Quantiles of values. Each of n sorted values is the middle of its n-th part (Hazen 1914); between two, a quantile lies in
//! proportion. The median of an even number is the mean of the middle two, and the outer half n-th parts are the end values.

use farnear_files::quantiles::Quantiles;
use ndarray::ArrayView2;

/// Of the finite values of a map, for a part from 0 to 1; `None` without any.
pub(crate) fn of_map(map: ArrayView2<f32>, part: f64) -> Option<f64> {
    let quantiles = Quantiles::new(map);
    of_ranks(quantiles.finite(), part, |rank| quantiles.at(rank).map(f64::from))
}

/// As [`of_map`], of a list.
pub(crate) fn of_values(values: impl IntoIterator<Item = f64>, part: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    of_ranks(sorted.len(), part, |rank| sorted.get(rank).copied())
}

fn of_ranks(count: usize, part: f64, at: impl Fn(usize) -> Option<f64>) -> Option<f64> {
    let last = count.checked_sub(1)?;
    let place = (part * count as f64 - 0.5).clamp(0.0, last as f64);
    let (rank, above) = (place as usize, place.fract());
    let low = at(rank)?;
    if above == 0.0 { Some(low) } else { Some(low + above * (at(rank + 1)? - low)) }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn the_median_of_an_even_number_is_between_the_middle_two() {
        assert_eq!(of_values([3.0, 1.0, 2.0], 0.5), Some(2.0));
        assert_eq!(of_values([4.0, 1.0, 8.0, 2.0], 0.5), Some(3.0));
        assert_eq!(of_values([7.0], 0.5), Some(7.0));
        assert_eq!(of_map(array![[4.0, f32::NAN, 1.0], [8.0, 2.0, f32::INFINITY]].view(), 0.5), Some(3.0));
        assert_eq!(of_map(array![[f32::NAN]].view(), 0.5), None);
        assert_eq!(of_values([], 0.5), None);
    }

    #[test]
    fn the_ends_of_few_values_are_the_least_and_the_largest() {
        let of_twenty = |part| of_values((0..20).map(f64::from), part);
        assert_eq!([0.0, 0.005, 0.995, 1.0].map(of_twenty), [0.0, 0.0, 19.0, 19.0].map(Some));
        let many = of_values((0..1000).map(f64::from), 0.995);
        assert!(many.is_some_and(|value| (value - 994.5).abs() < 1e-9), "{many:?}");
    }
}
