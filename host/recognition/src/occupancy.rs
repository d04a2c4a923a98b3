//! Embedded pattern learning (EPL) as in Li 2014 (eq. 9.11 to 9.13): visited cells of a grid over the embedding.
//! Members per dimension are at `min + (n - 1/2) R / Nt`; a frame selects the nearest in each; a visited cell is 1.
//! (The printed `n R / Nt + min` leaves half a cell unused.) Independent of the order of frames.

use ndarray::{Array1, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

/// Grid over the first dimensions of an embedding.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OccupancyGrid {
    /// Smallest embedded value per dimension.
    pub low: Vec<f32>,
    /// Range of embedded values per dimension.
    pub range: Vec<f32>,
    /// Members Nt per dimension.
    pub bins: Vec<usize>,
}

impl OccupancyGrid {
    /// Grid over the gallery's points (N x D), one entry of `bins` per used dimension.
    pub fn new(points: ArrayView2<f32>, bins: &[usize]) -> Self {
        let fold = |k: usize, start: f32, pick: fn(f32, f32) -> f32| {
            points.index_axis(Axis(1), k).iter().fold(start, |m, v| pick(m, *v))
        };
        let used = bins.len().min(points.ncols());
        let low: Vec<f32> = (0..used).map(|k| fold(k, f32::INFINITY, f32::min)).collect();
        let range = (0..used).map(|k| (fold(k, f32::NEG_INFINITY, f32::max) - low[k]).max(1e-9)).collect();
        Self { low, range, bins: bins[..used].to_vec() }
    }

    /// Number of cells, the length of a pattern.
    pub fn cells(&self) -> usize {
        self.bins.iter().product()
    }

    /// Pattern with 1 for visited cells. Points outside the gallery's range use the outermost cells.
    pub fn pattern(&self, points: ArrayView2<f32>) -> Array1<f32> {
        let mut pattern = Array1::zeros(self.cells());
        for point in points.rows() {
            let mut cell = 0;
            for (k, &bins) in self.bins.iter().enumerate() {
                let at = ((point[k] - self.low[k]) / self.range[k] * bins as f32).floor();
                cell = cell * bins + at.clamp(0.0, (bins - 1) as f32) as usize;
            }
            pattern[cell] = 1.0;
        }
        pattern
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn frames_go_to_the_nearest_member_once() {
        let gallery = array![[0.0_f32, 0.0], [3.0, 2.0]];
        let grid = OccupancyGrid::new(gallery.view(), &[3, 2]);
        // Members are at 0.5, 1.5, 2.5 and 0.5, 1.5.
        let pattern = grid.pattern(array![[0.4_f32, 0.9], [0.9, 0.1], [2.6, 1.9], [99.0, -5.0]].view());
        assert_eq!(pattern.to_vec(), vec![1.0, 0.0, 0.0, 0.0, 1.0, 1.0]);
    }
}
