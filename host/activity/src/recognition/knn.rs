//! k nearest neighbours over patterns.

use ndarray::{ArrayView1, ArrayView2};

/// Votes per class of the `k` nearest rows (squared Euclidean distance), each weighing 1 plus a hair for nearness, so that ties go to
/// the nearer class; and the squared distance of the nearest row.
pub fn votes(
    rows: ArrayView2<f32>,
    labels: &[usize],
    classes: usize,
    k: usize,
    query: ArrayView1<f32>,
) -> (Vec<f32>, f32) {
    let distances: Vec<(f32, usize)> = rows
        .rows()
        .into_iter()
        .zip(labels)
        .map(|(row, &label)| (row.iter().zip(query).map(|(a, b)| (a - b) * (a - b)).sum(), label))
        .collect();
    let nearest = distances.iter().fold(f32::INFINITY, |m, d| m.min(d.0));
    (vote(distances, classes, k), nearest)
}

/// Votes per class of the `k` smallest of (distance, class).
pub fn vote(mut distances: Vec<(f32, usize)>, classes: usize, k: usize) -> Vec<f32> {
    distances.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut votes = vec![0.0; classes];
    for (rank, &(_, label)) in distances.iter().take(k.max(1)).enumerate() {
        votes[label] += 1.0 + 1e-3 / (1.0 + rank as f32);
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
        let (three, nearest) = votes(rows.view(), &[0, 1, 1, 0], 2, 3, array![0.4_f32].view());
        assert!(three[1] > three[0] && (nearest - 0.16).abs() < 1e-6);
        let (two, _) = votes(rows.view(), &[0, 1, 1, 0], 2, 2, array![0.4_f32].view());
        assert!(two[0] > two[1]);
    }
}
