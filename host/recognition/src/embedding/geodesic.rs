//! Shortest paths in the neighbour graph. [`dijkstra`] uses a binary heap for one source. [`all_pairs`] and
//! [`from_sources`] relax sixteen sources at a time (Bellman-Ford label correction, sweeping nodes forwards
//! and backwards along the data), so an edge costs one vector operation. N = 1500, K = 12: tens of ms on one
//! thread, 150 with heaps.

use super::neighbours::Graph;
use ndarray::Array2;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

const LANES: usize = 16;

#[derive(PartialEq)]
struct Entry(f32, u32);
impl Eq for Entry {}
impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        other.0.total_cmp(&self.0).then(other.1.cmp(&self.1))
    }
}

/// Distances from `source` to every node, infinite without a path. O(E log N).
pub fn dijkstra(graph: &Graph, source: usize) -> Vec<f32> {
    let mut distance = vec![f32::INFINITY; graph.nodes()];
    distance[source] = 0.0;
    let mut heap = BinaryHeap::from([Entry(0.0, source as u32)]);
    while let Some(Entry(reached, node)) = heap.pop() {
        if reached > distance[node as usize] {
            continue;
        }
        for (other, length) in graph.edges(node as usize) {
            let through = reached + length;
            if through < distance[other] {
                distance[other] = through;
                heap.push(Entry(through, other as u32));
            }
        }
    }
    distance
}

/// Path lengths between all nodes, N x N.
pub fn all_pairs(graph: &Graph) -> Array2<f32> {
    let sources: Vec<usize> = (0..graph.nodes()).collect();
    from_sources(graph, &sources)
}

/// Path lengths from some nodes to all: (sources, N).
pub fn from_sources(graph: &Graph, sources: &[usize]) -> Array2<f32> {
    let n = graph.nodes();
    let order = sweep_order(graph);
    let arch = pulp::Arch::new();
    let mut all = Array2::<f32>::zeros((sources.len(), n));
    if let Some(rows) = all.as_slice_mut() {
        // Nearby sources have similar paths, so few nodes are revisited for a single lane.
        let mut rank = vec![0_u32; n];
        for (place, &node) in (0..).zip(&order) {
            rank[node as usize] = place;
        }
        let mut jobs: Vec<(usize, &mut [f32])> =
            sources.iter().copied().zip(rows.chunks_mut(n.max(1))).collect();
        jobs.sort_by_key(|(source, _)| rank[*source]);
        jobs.par_chunks_mut(LANES).for_each(|jobs| {
            let together: Vec<usize> = jobs.iter().map(|(source, _)| *source).collect();
            let mut distance = vec![[f32::INFINITY; LANES]; n];
            for (lane, &source) in together.iter().enumerate() {
                distance[source][lane] = 0.0;
            }
            arch.dispatch(|| relax(graph, &order, &together, &mut distance));
            for (lane, (_, row)) in jobs.iter_mut().enumerate() {
                for (out, lanes) in row.iter_mut().zip(&distance) {
                    *out = lanes[lane];
                }
            }
        });
    }
    all
}

/// Sweeps forth and back until nothing changes. Visits a node only after a change of a neighbour.
#[inline(always)]
fn relax(graph: &Graph, order: &[u32], sources: &[usize], distance: &mut [[f32; LANES]]) {
    let mut stale = vec![false; distance.len()];
    for &source in sources {
        for (other, _) in graph.edges(source) {
            stale[other] = true;
        }
    }
    let mut settle = |node: u32| {
        let node = node as usize;
        if !stale[node] {
            return false;
        }
        stale[node] = false;
        let range = graph.offsets[node] as usize..graph.offsets[node + 1] as usize;
        let before = distance[node];
        let mut best = before;
        for (&other, &length) in graph.targets[range.clone()].iter().zip(&graph.lengths[range.clone()]) {
            let from = &distance[other as usize];
            for lane in 0..LANES {
                let through = from[lane] + length;
                best[lane] = if through < best[lane] { through } else { best[lane] };
            }
        }
        let mut changed = false;
        for lane in 0..LANES {
            changed |= best[lane] < before[lane];
        }
        if changed {
            distance[node] = best;
            for &other in &graph.targets[range] {
                stale[other as usize] = true;
            }
        }
        changed
    };
    loop {
        let mut changed = false;
        for &node in order {
            changed |= settle(node);
        }
        if !changed {
            return;
        }
        changed = false;
        for &node in order.iter().rev() {
            changed |= settle(node);
        }
        if !changed {
            return;
        }
    }
}

/// Nodes by distance from one end, so that most paths follow the order.
fn sweep_order(graph: &Graph) -> Vec<u32> {
    let mut order: Vec<u32> = (0..graph.nodes() as u32).collect();
    if order.is_empty() {
        return order;
    }
    let furthest = |from: &[f32]| {
        from.iter()
            .enumerate()
            .filter(|(_, d)| d.is_finite())
            .max_by(|a, b| a.1.total_cmp(b.1))
            .map_or(0, |(i, _)| i)
    };
    let end = furthest(&dijkstra(graph, 0));
    let along = dijkstra(graph, end);
    order.sort_by(|&a, &b| along[a as usize].total_cmp(&along[b as usize]).then(a.cmp(&b)));
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    #[test]
    fn relaxation_and_dijkstra_agree_on_random_graphs() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        for n in [3_usize, 17, 150] {
            let samples = Array2::from_shape_fn((n, 3), |_| rng.random_range(0.0..1.0_f32));
            let graph = Graph::new(samples.view(), 2).expect("enough samples");
            let all = all_pairs(&graph);
            for source in 0..n {
                let one = dijkstra(&graph, source);
                for (a, b) in all.row(source).iter().zip(&one) {
                    // Sums in another order: a few units in the last place.
                    assert!((a == b) || (a - b).abs() <= 1e-5 * b, "{a} {b}");
                }
            }
        }
    }

    #[test]
    fn no_path_is_infinite() {
        let graph = Graph::from_edges(4, &[(0, 1, 1.0), (2, 3, 2.0)]);
        assert_eq!(all_pairs(&graph).row(0).to_vec(), vec![0.0, 1.0, f32::INFINITY, f32::INFINITY]);
    }
}
