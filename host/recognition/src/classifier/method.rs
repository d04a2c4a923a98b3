//! Interface of a classifier in the table of [`super`].

use ndarray::{ArrayView1, ArrayView2};

/// Trained on patterns for use, and on their Gram matrix for cross-validation.
pub trait Method: Sized {
    /// Its chosen parameters.
    type Parameter: Copy + 'static;
    /// Name in options, messages and files.
    const NAME: &'static str;
    /// Candidate parameters, default first.
    const TRIED: &'static [Self::Parameter];

    /// Parameter as text, e.g. `k = 3`.
    fn described(parameter: Self::Parameter) -> String;

    /// Trains on patterns (N x P) with labels below `classes`.
    fn train(patterns: ArrayView2<f32>, labels: &[usize], classes: usize, parameter: Self::Parameter)
    -> Self;

    /// Probabilities per class with sum 1.
    fn probabilities(&self, pattern: ArrayView1<f32>) -> Vec<f32>;

    /// Trains on a fold's kept clips and answers for the held ones in order. Works on the Gram matrix, so
    /// that an answer costs the number of clips, not the pattern length.
    fn answers(fold: &Fold, parameter: Self::Parameter) -> Vec<usize>;

    /// Whether sizes match, so that [`Method::probabilities`] cannot panic.
    fn fits(&self, width: usize, classes: usize) -> bool;
}

/// A fold of cross-validation.
#[derive(Clone, Copy, Debug)]
pub struct Fold<'a> {
    /// Gram matrix of all patterns.
    pub gram: ArrayView2<'a, f32>,
    /// Rows whose labels train the classifier.
    pub kept: &'a [usize],
    /// Rows for which the classifier answers.
    pub held: &'a [usize],
    /// Class of every row, less than `classes`.
    pub labels: &'a [usize],
    /// Number of classes over all rows.
    pub classes: usize,
}
