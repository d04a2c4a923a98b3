//! Pixels without a value in a tile, and those whose filters reach beyond the image.

use std::ops::Range;

use ndarray::{Array2, ArrayView2, s};

use super::rows::Place;
use crate::{border::reflect, metrics::dilate_square};

/// Pixels whose filters see only the image. Blur mixed in the real scene beyond it, not its reflection, and differently
/// in each image; and a reflected pixel is no second observation. So the others are no evidence.
#[derive(Clone, Copy)]
pub(super) struct Inner {
    /// (height, width) of the image.
    pub size: (usize, usize),
    pub reach: usize,
}

impl Inner {
    fn of(&self, n: usize) -> Range<isize> {
        self.reach as isize..n as isize - self.reach as isize
    }

    /// Clears the matched filter of a row, from column `left` on, outside.
    pub fn keep(&self, row: isize, left: isize, matched: &mut [f32]) {
        if !self.of(self.size.0).contains(&row) {
            matched.fill(0.0);
            return;
        }
        let Range { start, end } = self.of(self.size.1);
        let inside = |column: isize| (column - left).clamp(0, matched.len() as isize) as usize;
        let [first, last] = [start, end].map(inside);
        matched[..first].fill(0.0);
        matched[last..].fill(0.0);
    }

    fn overlap(range: &Range<isize>, middle: isize, side: usize) -> usize {
        let half = (side / 2) as isize;
        ((middle + half + 1).min(range.end) - (middle - half).max(range.start)).max(0) as usize
    }

    /// Rows inside of a window around `row`.
    pub fn rows_of_window(&self, row: isize, side: usize) -> usize {
        Self::overlap(&self.of(self.size.0), row, side)
    }

    /// `noise` of a row from column `left` on, times the part of each window's columns that are inside.
    pub fn share_columns(&self, left: isize, side: usize, noise: &[f32], to: &mut [f32]) {
        to.copy_from_slice(noise);
        let inner = self.of(self.size.1);
        let half = (side / 2) as isize;
        let whole = (inner.start + half - left).clamp(0, to.len() as isize) as usize
            ..(inner.end - half - left).clamp(0, to.len() as isize) as usize;
        let end = whole.end.max(whole.start);
        for x in (0..whole.start).chain(end..to.len()) {
            to[x] *= Self::overlap(&inner, left + x as isize, side) as f32 / side as f32;
        }
    }
}

/// Surroundings of pixels without a value.
pub(super) struct Holes {
    /// Pixels of the tile whose smallest window contains one: they have no depth.
    pub own: Array2<bool>,
    /// Pixels, with the halo, whose filters contain one; larger windows leave them out.
    pub of_filters: Array2<bool>,
}

impl Holes {
    /// `None` without holes. `halo`: rows and columns around the tile; filters reach `reach` px, the smallest window has
    /// `side` px.
    pub fn of(
        [far, near]: [ArrayView2<'_, f32>; 2],
        place: Place,
        halo: [usize; 2],
        [reach, side]: [usize; 2],
    ) -> Option<Self> {
        let (height, width) = far.dim();
        // Reflection adds no hole that is not within the halo of the image itself.
        let [rows, columns] =
            [(place.top, place.rows, halo[0], height), (place.left, place.columns, halo[1], width)]
                .map(|(first, count, halo, n)| first.saturating_sub(halo)..(first + count + halo).min(n));
        let whole = [far, near].iter().all(|image| {
            let rows = image.slice(s![rows.clone(), columns.clone()]);
            rows.rows()
                .into_iter()
                .all(|row| row.iter().map(|v| u32::from(v.is_finite())).sum::<u32>() as usize == row.len())
        });
        if whole {
            return None;
        }
        let mut holes = Array2::from_elem((place.rows + 2 * halo[0], place.columns + 2 * halo[1]), false);
        let first = columns.start + halo[1] - place.left;
        let inside = first..first + columns.len();
        for (y, mut row) in holes.rows_mut().into_iter().enumerate() {
            let y = reflect((place.top + y) as isize - halo[0] as isize, height);
            let [far, near] = [far.row(y), near.row(y)];
            let is_hole = |x: usize| !(far[x].is_finite() && near[x].is_finite());
            for (hole, x) in row.slice_mut(s![inside.clone()]).iter_mut().zip(columns.clone()) {
                *hole = is_hole(x);
            }
            for x in (0..inside.start).chain(inside.end..row.len()) {
                row[x] = is_hole(reflect((place.left + x) as isize - halo[1] as isize, width));
            }
        }
        holes.iter().any(|hole| *hole).then(|| {
            let wide = dilate_square(&holes, reach + side / 2);
            let own = s![halo[0]..halo[0] + place.rows, halo[1]..halo[1] + place.columns];
            Self { own: wide.slice(own).to_owned(), of_filters: dilate_square(&holes, reach) }
        })
    }
}
