//! Linear support vector classifier, one against the rest, by dual coordinate descent with squared hinge loss
//! (Hsieh et al., ICML 2008). Runs on the Gram matrix, because clips are few and patterns long.

use super::method::{Fold, Method};
use ndarray::{Array1, Array2, ArrayView1, ArrayView2};
use rand::{SeedableRng, seq::SliceRandom};
use serde::{Deserialize, Serialize};

/// A trained classifier.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinearSvc {
    /// Weights, one row per class.
    pub weights: Array2<f32>,
    /// Offsets, one per class.
    pub offsets: Array1<f32>,
}

const PASSES: usize = 200;
const TOLERANCE: f32 = 0.02;

struct DualSvc<'a> {
    /// Rows of the Gram matrix used for training.
    rows: &'a [usize],
    /// Per class: multiplier times sign of each row.
    signed: Vec<Vec<f32>>,
    offsets: Vec<f32>,
}

impl<'a> DualSvc<'a> {
    /// `labels` of all rows, below `classes`; `c` weighs errors against the margin.
    fn train(gram: ArrayView2<f32>, rows: &'a [usize], labels: &[usize], classes: usize, c: f32) -> Self {
        let part = Array2::from_shape_fn((rows.len(), rows.len()), |(i, j)| gram[[rows[i], rows[j]]]);
        let own: Vec<usize> = rows.iter().map(|&row| labels[row]).collect();
        let (signed, offsets) =
            (0..classes).map(|class| one_against_rest(&part, &own, class, classes, c)).unzip();
        Self { rows, signed, offsets }
    }

    fn decide(&self, gram_row: ArrayView1<f32>) -> Vec<f32> {
        self.signed
            .iter()
            .zip(&self.offsets)
            .map(|(signed, offset)| {
                self.rows.iter().zip(signed).map(|(&row, s)| s * gram_row[row]).sum::<f32>() + offset
            })
            .collect()
    }
}

impl LinearSvc {
    /// Decision value per class, positive inside its half-space.
    pub fn decide(&self, pattern: ArrayView1<f32>) -> Array1<f32> {
        self.weights.dot(&pattern) + &self.offsets
    }
}

impl Method for LinearSvc {
    type Parameter = f32;
    const NAME: &'static str = "svc";
    const TRIED: &'static [f32] = &[1.0, 5.0];

    fn described(c: f32) -> String {
        format!("cost {c}")
    }

    fn train(patterns: ArrayView2<f32>, labels: &[usize], classes: usize, c: f32) -> Self {
        let gram = patterns.dot(&patterns.t());
        let rows: Vec<usize> = (0..patterns.nrows()).collect();
        let dual = DualSvc::train(gram.view(), &rows, labels, classes, c);
        let signed = Array2::from_shape_fn((classes, rows.len()), |(k, i)| dual.signed[k][i]);
        Self { weights: signed.dot(&patterns), offsets: dual.offsets.into() }
    }

    fn probabilities(&self, pattern: ArrayView1<f32>) -> Vec<f32> {
        /// Decision values are about -1 to 1; a margin of one becomes odds of twenty.
        const SLOPE: f32 = 3.0;
        let decision = self.decide(pattern);
        let best = decision.iter().fold(f32::NEG_INFINITY, |m, v| m.max(*v));
        let raised: Vec<f32> = decision.iter().map(|v| (SLOPE * (v - best)).exp()).collect();
        let total: f32 = raised.iter().sum();
        raised.into_iter().map(|v| v / total).collect()
    }

    fn answers(fold: &Fold, c: f32) -> Vec<usize> {
        let dual = DualSvc::train(fold.gram, fold.kept, fold.labels, fold.classes, c);
        fold.held.iter().map(|&i| super::largest(&dual.decide(fold.gram.row(i))).0).collect()
    }

    fn fits(&self, width: usize, classes: usize) -> bool {
        self.weights.dim() == (classes, width) && self.offsets.len() == classes
    }
}

fn one_against_rest(
    gram: &Array2<f32>,
    labels: &[usize],
    class: usize,
    classes: usize,
    c: f32,
) -> (Vec<f32>, f32) {
    let n = gram.nrows();
    let inside = labels.iter().filter(|&&label| label == class).count().max(1);
    // Errors of the class weigh twice, corrected for unequal class sizes.
    let balance = 2.0 * ((n - inside).max(1) as f32 / inside as f32 / (classes.max(2) - 1) as f32).max(0.1);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(class as u64);
    let mut order: Vec<usize> = (0..n).collect();
    // `value` is the decision of each sample without offset.
    let (mut value, mut offset, mut alpha) = (Array1::<f32>::zeros(n), 0.0_f32, vec![0.0_f32; n]);
    for _ in 0..PASSES {
        order.shuffle(&mut rng);
        let mut worst = 0.0_f32;
        for &i in &order {
            let (y, cost) = if labels[i] == class { (1.0, c * balance) } else { (-1.0, c) };
            let diagonal = 0.5 / cost;
            let gradient = y * (value[i] + offset) - 1.0 + alpha[i] * diagonal;
            let projected = if alpha[i] <= 0.0 { gradient.min(0.0) } else { gradient };
            worst = worst.max(projected.abs());
            if projected.abs() > 1e-6 {
                let updated = (alpha[i] - gradient / (gram[[i, i]] + 1.0 + diagonal)).max(0.0);
                let step = (updated - alpha[i]) * y;
                value.scaled_add(step, &gram.row(i));
                offset += step;
                alpha[i] = updated;
            }
        }
        if worst < TOLERANCE {
            break;
        }
    }
    (alpha.iter().zip(labels).map(|(a, &label)| if label == class { *a } else { -*a }).collect(), offset)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;

    #[test]
    fn separable_classes_are_separated_and_both_forms_agree() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let centres = [[0.0, 0.0], [3.0, 0.0], [0.0, 3.0]];
        let labels: Vec<usize> = (0..90).map(|i| i % 3).collect();
        let patterns =
            Array2::from_shape_fn((90, 2), |(i, k)| centres[labels[i]][k] + rng.random_range(-1.0..1.0_f32));
        let svc = LinearSvc::train(patterns.view(), &labels, 3, 10.0);
        let gram = patterns.dot(&patterns.t());
        let rows: Vec<usize> = (0..90).collect();
        let dual = DualSvc::train(gram.view(), &rows, &labels, 3, 10.0);
        for (i, (row, &label)) in patterns.rows().into_iter().zip(&labels).enumerate() {
            let decision = svc.decide(row);
            let best = (0..3).max_by(|&a, &b| decision[a].total_cmp(&decision[b]));
            assert_eq!(best, Some(label));
            assert!(decision.iter().zip(dual.decide(gram.row(i))).all(|(a, b)| (a - b).abs() < 1e-2));
        }
    }
}
