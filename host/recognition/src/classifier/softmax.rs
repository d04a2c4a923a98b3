//! Multinomial logistic regression by Nesterov's gradient descent on the Gram matrix, with a squared penalty.

use super::method::{Fold, Method};
use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

/// A trained classifier.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Softmax {
    /// Weights, one row per class.
    pub weights: Array2<f32>,
    /// Offsets, one per class.
    pub offsets: Array1<f32>,
}

const STEPS: usize = 300;

/// Dual weights per sample and class, and the offsets.
fn dual(gram: ArrayView2<f32>, labels: &[usize], classes: usize, cost: f32) -> (Array2<f32>, Array1<f32>) {
    let n = labels.len();
    // Lipschitz constant of the gradient: half the Gram matrix' largest eigenvalue (at most its trace),
    // offsets and length.
    let largest = gram.diag().sum().max(1e-6);
    let hold = 1.0 / cost.max(1e-6);
    let step = 1.0 / (0.5 * (largest + n as f32) + hold);
    let mut signed = Array2::<f32>::zeros((n, classes));
    let mut offsets = Array1::<f32>::zeros(classes);
    let (mut ahead, mut ahead_offsets) = (signed.clone(), offsets.clone());
    for number in 0..STEPS {
        let mut off = gram.dot(&ahead) + &ahead_offsets;
        for (mut row, &label) in off.rows_mut().into_iter().zip(labels) {
            softmax(row.as_slice_mut().unwrap_or_default());
            row[label] -= 1.0;
        }
        let next = &ahead - &((&off + &(&ahead * hold)) * step);
        let next_offsets = &ahead_offsets - &(off.sum_axis(Axis(0)) * step);
        let momentum = number as f32 / (number as f32 + 3.0);
        ahead = &next + &((&next - &signed) * momentum);
        ahead_offsets = &next_offsets + &((&next_offsets - &offsets) * momentum);
        (signed, offsets) = (next, next_offsets);
    }
    (signed, offsets)
}

/// Converts values to probabilities.
pub fn softmax(values: &mut [f32]) {
    let best = values.iter().fold(f32::NEG_INFINITY, |m, v| m.max(*v));
    values.iter_mut().for_each(|v| *v = (*v - best).exp());
    let total: f32 = values.iter().sum();
    values.iter_mut().for_each(|v| *v /= total);
}

impl Method for Softmax {
    type Parameter = f32;
    const NAME: &'static str = "softmax";
    const TRIED: &'static [f32] = &[10.0, 100.0];

    fn described(cost: f32) -> String {
        format!("cost {cost}")
    }

    fn train(patterns: ArrayView2<f32>, labels: &[usize], classes: usize, cost: f32) -> Self {
        let (signed, offsets) = dual(patterns.dot(&patterns.t()).view(), labels, classes, cost);
        Self { weights: signed.t().dot(&patterns), offsets }
    }

    fn probabilities(&self, pattern: ArrayView1<f32>) -> Vec<f32> {
        let mut values = (self.weights.dot(&pattern) + &self.offsets).to_vec();
        softmax(&mut values);
        values
    }

    fn answers(fold: &Fold, cost: f32) -> Vec<usize> {
        let part = |rows: &[usize]| fold.gram.select(Axis(0), rows).select(Axis(1), fold.kept);
        let own: Vec<usize> = fold.kept.iter().map(|&row| fold.labels[row]).collect();
        let (signed, offsets) = dual(part(fold.kept).view(), &own, fold.classes, cost);
        let decided = part(fold.held).dot(&signed) + &offsets;
        decided.rows().into_iter().map(|row| super::largest(&row.to_vec()).0).collect()
    }

    fn fits(&self, width: usize, classes: usize) -> bool {
        self.weights.dim() == (classes, width) && self.offsets.len() == classes
    }
}
