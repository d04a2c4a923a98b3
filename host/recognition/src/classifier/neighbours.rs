//! k nearest neighbours by Euclidean distance.

use super::method::{Fold, Method};
use ndarray::{Array2, ArrayView1, ArrayView2};
use serde::{Deserialize, Serialize};

/// Training patterns that vote for their classes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Neighbours {
    /// One training clip per row.
    pub patterns: Array2<f32>,
    /// Class of each training clip.
    pub labels: Vec<usize>,
    /// Number of classes to answer for.
    pub classes: usize,
    /// Number of voting neighbours.
    pub k: usize,
}

impl Method for Neighbours {
    type Parameter = usize;
    const NAME: &'static str = "knn";
    const TRIED: &'static [usize] = &[1, 3, 5];

    fn described(k: usize) -> String {
        format!("k = {k}")
    }

    fn train(patterns: ArrayView2<f32>, labels: &[usize], classes: usize, k: usize) -> Self {
        Self { patterns: patterns.to_owned(), labels: labels.to_vec(), classes, k }
    }

    fn probabilities(&self, pattern: ArrayView1<f32>) -> Vec<f32> {
        let squared = |row: ArrayView1<f32>| row.iter().zip(pattern).map(|(a, b)| (a - b) * (a - b)).sum();
        let distances = self.patterns.rows().into_iter().map(squared).zip(self.labels.iter().copied());
        let votes = vote(distances.collect(), self.classes, self.k);
        let total: f32 = votes.iter().sum();
        votes.into_iter().map(|v| v / total.max(1e-9)).collect()
    }

    fn answers(fold: &Fold, k: usize) -> Vec<usize> {
        // |a - b|^2 without |b|^2, which is equal for all neighbours.
        let distance = |i: usize, j: usize| fold.gram[[j, j]] - 2.0 * fold.gram[[i, j]];
        let answer = |&i: &usize| {
            let distances = fold.kept.iter().map(|&j| (distance(i, j), fold.labels[j])).collect();
            super::largest(&vote(distances, fold.classes, k)).0
        };
        fold.held.iter().map(answer).collect()
    }

    fn fits(&self, width: usize, classes: usize) -> bool {
        let sizes = self.patterns.ncols() == width && self.patterns.nrows() == self.labels.len();
        let labels = !self.labels.is_empty() && self.labels.iter().all(|&label| label < classes);
        sizes && labels && self.classes == classes && self.k > 0
    }
}

/// Votes of the `k` smallest (squared distance, class): 1 each, plus a small bonus that decides ties. Every class has a
/// trace of a vote, larger for nearer ones, which decides where answers are restricted to classes without votes. It is too
/// small to count where views are fused.
fn vote(mut distances: Vec<(f32, usize)>, classes: usize, k: usize) -> Vec<f32> {
    distances.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut votes = vec![0.0; classes];
    let mut seen = 0.0;
    for (rank, &(_, label)) in distances.iter().enumerate() {
        if votes[label] == 0.0 {
            seen += 1.0;
            votes[label] = 1e-9 / seen;
        }
        if rank < k.max(1) {
            votes[label] += 1.0 + 1e-3 / (1.0 + rank as f32);
        }
    }
    votes
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn the_majority_of_the_nearest_wins_and_ties_go_to_the_nearer() {
        let rows = array![[0.0_f32], [1.0], [1.2], [5.0]];
        let by =
            |k| Neighbours::train(rows.view(), &[0, 1, 1, 0], 2, k).probabilities(array![0.4_f32].view());
        let (two, three) = (by(2), by(3));
        assert!(three[1] > three[0] && two[0] > two[1], "{three:?} {two:?}");
    }

    #[test]
    fn classes_without_votes_are_ranked_by_their_nearest() {
        let rows = array![[0.0_f32], [9.0], [5.0], [1.0]];
        let found = Neighbours::train(rows.view(), &[0, 1, 2, 0], 3, 1).probabilities(array![0.4_f32].view());
        assert!(found[0] > 0.9999 && found[2] > found[1] && found[1] > 0.0, "{found:?}");
    }
}
