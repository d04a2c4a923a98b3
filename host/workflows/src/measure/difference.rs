//! What differs between two maps of one size.

use ndarray::{Array2, Zip};
use serde::Serialize;

use crate::error::{Result, WorkflowError};

/// Figures of a difference.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct DifferenceFigures {
    /// Pixels with a depth in both maps.
    pub pixels: usize,
    /// Mean of second minus first; none where no pixel has both, as the next two.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_mm: Option<f64>,
    /// Standard deviation of the differences.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard_deviation_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_mm: Option<f64>,
}

/// The second map minus the first, NaN where one has no value, with its figures.
///
/// # Errors
/// [`WorkflowError::Parameter`] for maps of different size.
pub fn difference(first: &Array2<f32>, second: &Array2<f32>) -> Result<(Array2<f32>, DifferenceFigures)> {
    if first.dim() != second.dim() {
        let ((rows, columns), (other_rows, other_columns)) = (first.dim(), second.dim());
        let expected = format!("expected {columns}x{rows} pixels as the first map has");
        return Err(WorkflowError::parameter(
            "difference",
            format!("{other_columns}x{other_rows}"),
            expected,
        ));
    }
    let map = Zip::from(first).and(second).map_collect(|first, second| second - first);
    let values = || map.iter().filter(|value| value.is_finite()).map(|value| f64::from(*value));
    let count = values().count();
    let mean = values().sum::<f64>() / count as f64;
    let mean_square = values().map(|value| value * value).sum::<f64>() / count as f64;
    let some = count > 0;
    let figures = DifferenceFigures {
        pixels: count,
        mean_mm: some.then_some(mean),
        standard_deviation_mm: some.then(|| (mean_square - mean * mean).max(0.0).sqrt()),
        rms_mm: some.then(|| mean_square.sqrt()),
    };
    Ok((map, figures))
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn values_that_one_lacks_do_not_count() {
        let (map, found) = difference(&array![[1.0, f32::NAN, 3.0]], &array![[2.0, 5.0, 6.0]]).unwrap();
        assert!(map[[0, 1]].is_nan());
        assert_eq!((found.pixels, found.mean_mm, found.standard_deviation_mm), (2, Some(2.0), Some(1.0)));
        let (_, none) = difference(&array![[f32::NAN]], &array![[1.0]]).unwrap();
        assert_eq!((none.pixels, none.rms_mm), (0, None));
        assert!(difference(&array![[1.0]], &array![[1.0, 2.0]]).unwrap_err().is_usage());
    }
}
