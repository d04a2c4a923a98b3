//! Connected regions by runs, joined with overlapping runs of the row above by union-find (He, Chao and
//! Suzuki, IEEE Transactions on Image Processing 17, 2008). Linear in pixels, nearly linear in runs.

use ndarray::ArrayView2;

use super::{BoundingBox, Mask};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Connectivity {
    Four,
    Eight,
}

/// Run of set pixels in a row, half-open columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    pub row: usize,
    pub start: usize,
    pub end: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    pub runs: Vec<Run>,
    pub area: usize,
    pub bounds: BoundingBox,
}

impl Region {
    fn new(run: Run) -> Self {
        let bounds = BoundingBox { top: run.row, left: run.start, bottom: run.row + 1, right: run.end };
        Self { runs: vec![run], area: run.end - run.start, bounds }
    }

    fn push(&mut self, run: Run) {
        let other = Self::new(run);
        self.bounds = self.bounds.union(other.bounds);
        self.area += other.area;
        self.runs.push(run);
    }

    /// Mean of pixel centres as (row, column).
    #[must_use]
    pub fn centroid(&self) -> (f64, f64) {
        let (mut rows, mut columns) = (0.0, 0.0);
        for run in &self.runs {
            let length = (run.end - run.start) as f64;
            rows += length * (run.row as f64 + 0.5);
            columns += length * 0.5 * (run.start + run.end) as f64;
        }
        (rows / self.area as f64, columns / self.area as f64)
    }

    pub fn paint(&self, mask: &mut Mask, value: bool) {
        for run in &self.runs {
            mask.slice_mut(ndarray::s![run.row, run.start..run.end]).fill(value);
        }
    }
}

#[must_use]
pub fn regions(mask: ArrayView2<'_, bool>, value: bool, connectivity: Connectivity) -> Vec<Region> {
    let reach = usize::from(connectivity == Connectivity::Eight);
    let mut runs: Vec<Run> = Vec::new();
    let mut parent: Vec<usize> = Vec::new();
    // First run of the row above.
    let mut above = 0;
    for (row, pixels) in mask.outer_iter().enumerate() {
        let here = runs.len();
        let mut column = 0;
        let mut candidate = above;
        let width = pixels.len();
        while column < width {
            if pixels[column] != value {
                column += 1;
                continue;
            }
            let start = column;
            while column < width && pixels[column] == value {
                column += 1;
            }
            let run = Run { row, start, end: column };
            let label = runs.len();
            parent.push(label);
            // Skips runs that end before this one, joins overlapping ones; the last may touch the next run
            // too.
            while candidate < here && runs[candidate].end + reach <= run.start {
                candidate += 1;
            }
            let mut touching = candidate;
            while touching < here && runs[touching].start < run.end + reach {
                let (a, b) = (find(&mut parent, touching), find(&mut parent, label));
                parent[a.max(b)] = a.min(b);
                touching += 1;
            }
            runs.push(run);
        }
        above = here;
    }
    let mut index = vec![usize::MAX; runs.len()];
    let mut found: Vec<Region> = Vec::new();
    for (label, &run) in runs.iter().enumerate() {
        let root = find(&mut parent, label);
        if index[root] == usize::MAX {
            index[root] = found.len();
            found.push(Region::new(run));
        } else {
            found[index[root]].push(run);
        }
    }
    found
}

/// Root of a set, with path halving.
fn find(parent: &mut [usize], mut label: usize) -> usize {
    while parent[label] != label {
        parent[label] = parent[parent[label]];
        label = parent[label];
    }
    label
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, arr2};
    use proptest::prelude::*;

    fn flooded(mask: &Array2<bool>, connectivity: Connectivity) -> Array2<usize> {
        let (height, width) = mask.dim();
        let mut labels = Array2::zeros(mask.dim());
        let mut next = 0;
        for start in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
            if !mask[start] || labels[start] != 0 {
                continue;
            }
            next += 1;
            let mut open = vec![start];
            while let Some((row, column)) = open.pop() {
                if !mask[(row, column)] || labels[(row, column)] != 0 {
                    continue;
                }
                labels[(row, column)] = next;
                for (r, c) in (row.saturating_sub(1)..(row + 2).min(height))
                    .flat_map(|r| (column.saturating_sub(1)..(column + 2).min(width)).map(move |c| (r, c)))
                {
                    if connectivity == Connectivity::Eight || r == row || c == column {
                        open.push((r, c));
                    }
                }
            }
        }
        labels
    }

    proptest! {
        #[test]
        fn regions_are_those_that_flooding_finds(
            pixels in prop::collection::vec(prop::bool::weighted(0.45), 12 * 17), eight: bool
        ) {
            let mask = Array2::from_shape_vec((12, 17), pixels).unwrap();
            let connectivity = if eight { Connectivity::Eight } else { Connectivity::Four };
            let mut labels = Array2::zeros(mask.dim());
            for (number, region) in regions(mask.view(), true, connectivity).iter().enumerate() {
                for run in &region.runs {
                    labels.slice_mut(ndarray::s![run.row, run.start..run.end]).fill(number + 1);
                }
            }
            prop_assert_eq!(labels, flooded(&mask, connectivity));
        }
    }

    #[test]
    fn area_bounds_and_centroid_of_an_l() {
        let mask = arr2(&[[true, false, false], [true, false, false], [true, true, true]]);
        let found = regions(mask.view(), true, Connectivity::Four);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].area, 5);
        assert_eq!(found[0].bounds, BoundingBox { top: 0, left: 0, bottom: 3, right: 3 });
        let (row, column) = found[0].centroid();
        assert!((row - (0.5 + 1.5 + 3.0 * 2.5) / 5.0).abs() < 1e-12);
        assert!((column - (0.5 + 0.5 + 0.5 + 1.5 + 2.5) / 5.0).abs() < 1e-12);
    }

    #[test]
    fn a_diagonal_hangs_together_only_with_eight_neighbours() {
        let mask = arr2(&[[true, false], [false, true]]);
        assert_eq!(regions(mask.view(), true, Connectivity::Eight).len(), 1);
        assert_eq!(regions(mask.view(), true, Connectivity::Four).len(), 2);
        assert!(regions(Array2::from_elem((0, 0), true).view(), true, Connectivity::Four).is_empty());
    }
}
