//! Neighbour graph: K nearest, symmetric, in compressed sparse rows. O(N^2 d) flops, O(N K) memory.
//! Edges are recomputed from the samples to avoid the cancellation of the blockwise matrix product.

use super::{EmbeddingError, squared_distance, squared_norms, times_transposed};
use ndarray::{ArrayView2, s};
use rayon::prelude::*;

/// Undirected weighted graph in compressed sparse rows; each edge is in both rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Graph {
    /// Start of each row, plus the end.
    pub offsets: Vec<u32>,
    /// Other end of each edge.
    pub targets: Vec<u32>,
    /// Length of each edge.
    pub lengths: Vec<f32>,
}

const BLOCK: usize = 256;

impl Graph {
    /// The graph of a sample matrix (N x d) with the `neighbours` nearest of each, at least 1 and below N.
    pub fn new(samples: ArrayView2<f32>, neighbours: usize) -> Result<Self, EmbeddingError> {
        let n = samples.nrows();
        if n < 2 {
            let what = "number of samples (at least 2)";
            return Err(EmbeddingError::Shape { what, expected: 2, found: n });
        }
        if neighbours == 0 || neighbours >= n {
            return Err(EmbeddingError::Shape {
                what: "number of neighbours (at least 1, below the number of samples)",
                expected: neighbours.clamp(1, n - 1),
                found: neighbours,
            });
        }
        let samples = samples.as_standard_layout();
        let samples = samples.view();
        let norms = squared_norms(samples);
        let (arch, width) = (pulp::Arch::new(), samples.ncols());
        let values = samples.as_slice().unwrap_or_default();
        let row = |i: usize| values.get(i * width..(i + 1) * width).unwrap_or_default();
        let mut edges: Vec<(u32, u32, f32)> = Vec::with_capacity(n * 16);
        for start in (0..n).step_by(BLOCK) {
            let rows = start..(start + BLOCK).min(n);
            let products = times_transposed(samples.slice(s![rows.clone(), ..]), samples);
            let found: Vec<Vec<(u32, u32, f32)>> = rows
                .into_par_iter()
                .map(|i| {
                    let product = products.row(i - start);
                    let squared: Vec<f32> =
                        product.iter().zip(&norms).map(|(p, norm)| norm - 2.0 * p).collect();
                    let own = row(i);
                    pick(&squared, i, neighbours)
                        .into_iter()
                        .map(|j| {
                            let squared = arch.dispatch(|| squared_distance(own, row(j as usize)));
                            (i as u32, j, squared.sqrt())
                        })
                        .collect()
                })
                .collect();
            found.into_iter().for_each(|part| edges.extend(part));
        }
        Ok(Self::from_edges(n, &edges))
    }

    /// Graph of `n` nodes from undirected edges; the shortest of duplicates counts.
    pub fn from_edges(n: usize, edges: &[(u32, u32, f32)]) -> Self {
        let mut rows: Vec<Vec<(u32, f32)>> = vec![Vec::new(); n];
        for &(a, b, length) in edges.iter().filter(|(a, b, _)| a != b) {
            rows[a as usize].push((b, length));
            rows[b as usize].push((a, length));
        }
        let mut graph = Self { offsets: vec![0], targets: Vec::new(), lengths: Vec::new() };
        for mut row in rows {
            row.sort_by(|p, q| p.0.cmp(&q.0).then(p.1.total_cmp(&q.1)));
            row.dedup_by_key(|edge| edge.0);
            for (target, length) in row {
                graph.targets.push(target);
                graph.lengths.push(length);
            }
            graph.offsets.push(graph.targets.len() as u32);
        }
        graph
    }

    /// Number of nodes, one per sample.
    pub fn nodes(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Edges of a node: other end and length.
    pub fn edges(&self, node: usize) -> impl Iterator<Item = (usize, f32)> + '_ {
        let range = self.offsets[node] as usize..self.offsets[node + 1] as usize;
        range.map(|e| (self.targets[e] as usize, self.lengths[e]))
    }

    /// Connected parts, largest first, members ascending.
    pub fn components(&self) -> Vec<Vec<usize>> {
        let mut seen = vec![false; self.nodes()];
        let mut components = Vec::new();
        for root in 0..self.nodes() {
            if std::mem::replace(&mut seen[root], true) {
                continue;
            }
            let (mut members, mut next) = (vec![root], 0);
            while next < members.len() {
                let node = members[next];
                next += 1;
                for (other, _) in self.edges(node) {
                    if !std::mem::replace(&mut seen[other], true) {
                        members.push(other);
                    }
                }
            }
            members.sort_unstable();
            components.push(members);
        }
        components.sort_by_key(|members| std::cmp::Reverse(members.len()));
        components
    }

    /// Returns [`EmbeddingError::Disconnected`] with the parts unless the graph is connected.
    pub fn connected(&self, neighbours: usize) -> Result<(), EmbeddingError> {
        let components = self.components();
        if components.len() <= 1 {
            return Ok(());
        }
        Err(EmbeddingError::Disconnected { components, neighbours })
    }
}

/// The `k` nearest of sample `i` from `|b|^2 - 2 a.b` for all b.
fn pick(squared: &[f32], i: usize, k: usize) -> Vec<u32> {
    let mut order: Vec<u32> = (0..squared.len() as u32).filter(|&j| j as usize != i).collect();
    let by = |a: &u32, b: &u32| squared[*a as usize].total_cmp(&squared[*b as usize]).then(a.cmp(b));
    if k < order.len() {
        order.select_nth_unstable_by(k - 1, by);
        order.truncate(k);
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn a_line_of_points_has_its_neighbours_and_two_lines_are_two_parts() {
        let line = Array2::from_shape_fn((10, 2), |(i, j)| if j == 0 { i as f32 } else { 0.5 });
        let graph = Graph::new(line.view(), 1).expect("enough samples");
        assert_eq!(graph.edges(5).filter(|(_, d)| (*d - 1.0).abs() < 1e-6).count(), graph.edges(5).count());
        let both = Graph::new(line.view(), 2).expect("enough samples");
        assert_eq!(both.edges(5).map(|(j, _)| j).collect::<Vec<_>>(), vec![4, 6]);
        let two = Array2::from_shape_fn((10, 1), |(i, _)| if i < 6 { i as f32 } else { 100.0 + i as f32 });
        let graph = Graph::new(two.view(), 2).expect("enough samples");
        let error = graph.connected(2).expect_err("two parts");
        assert!(error.to_string().contains("6 samples from 0, 1 on; 4 samples from 6, 7 on"), "{error}");
        assert!(Graph::new(two.view(), 10).is_err());
    }
}
