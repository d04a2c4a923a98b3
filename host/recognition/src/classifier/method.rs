//! Interface of a classifier in the table of [`super`].

use ndarray::{ArrayView1, ArrayView2};

/// A classifier: trained from patterns for use, and from their Gram matrix alone for cross-validation.
pub trait Method: Sized {
    /// Its chosen parameters.
    type Parameter: Copy + 'static;
    /// Its name, as users write it.
    const NAME: &'static str;
    /// Parameters to choose from, the usual one first.
    const TRIED: &'static [Self::Parameter];

    /// The parameter in words, for tables: `k = 3`.
    fn described(parameter: Self::Parameter) -> String;

    /// Trains on patterns (N x P) with labels below `classes`.
    fn train(patterns: ArrayView2<f32>, labels: &[usize], classes: usize, parameter: Self::Parameter)
    -> Self;

    /// Probability of every class for a pattern, adding up to 1.
    fn probabilities(&self, pattern: ArrayView1<f32>) -> Vec<f32>;

    /// Trains on a fold's kept clips and answers for those it held back, in their order. Clips are few and patterns long: from
    /// products an answer costs as much as there are clips, and all folds and parameters share the products.
    fn answers(fold: &Fold, parameter: Self::Parameter) -> Vec<usize>;

    /// Whether all sizes are those of patterns of `width` numbers and of `classes` classes, so that [`Method::probabilities`] cannot
    /// panic.
    fn fits(&self, width: usize, classes: usize) -> bool;
}

/// A fold of cross-validation.
#[derive(Clone, Copy, Debug)]
pub struct Fold<'a> {
    /// Products of all patterns with one another.
    pub gram: ArrayView2<'a, f32>,
    /// Rows to train on.
    pub kept: &'a [usize],
    /// Rows to answer for.
    pub held: &'a [usize],
    /// Class of every row.
    pub labels: &'a [usize],
    /// Number of classes.
    pub classes: usize,
}

/// The place of the largest value, the first of equals.
pub(super) fn largest(values: &[f32]) -> usize {
    values.iter().enumerate().fold(0, |best, (k, v)| if *v > values[best] { k } else { best })
}
