//! The choice between a small and a large window. Where a surface is flat over the large window, both find the same
//! depth, except for noise: the mean square of their difference, relative to the small window's variance, is about 0.9.
//! Steps, edges and curvature raise it all around. There the small window is taken.
//!
//! What the windows disagree in beyond noise also widens the standard deviation of either, since neither knows the
//! surface within itself.

use crate::simd::{self, Backend, Contrast, Plane};

/// Rows are compared over the large window, and decided when the last of these rows is there.
pub(super) struct Agreement {
    /// Rows from the one that is decided to the last one.
    pub half: usize,
    of: Contrast,
    ring: usize,
    small: [Plane; 2],
    large: [Plane; 2],
    /// Squared difference relative to the variance, 1 where there is one, and there alpha of the large window.
    compared: [Plane; 3],
    /// Sums of these over the rows, then over rows and columns.
    sums: Plane,
    work: Vec<f32>,
}

impl Agreement {
    /// For a large window of `side` px and rows of up to `wide` px.
    pub fn new(side: usize, wide: usize, of: Contrast) -> Self {
        let half = side / 2;
        let ring = 2 * half + 2;
        let plane = || Plane::new(ring, wide);
        Self {
            half,
            of,
            ring,
            small: [plane(), plane()],
            large: [plane(), plane()],
            compared: [plane(), plane(), plane()],
            sums: Plane::new(6, wide),
            // Decided rows are extended to whole vectors.
            work: vec![0.0; 2 * (wide + simd::MAX_LANES)],
        }
    }

    /// Adds a row of alpha and its variance by both windows. Sums start from zero in the first row and where `restart` is set,
    /// because rounding errors would add up.
    pub fn add(
        &mut self,
        backend: Backend,
        row: usize,
        restart: bool,
        small: [&[f32]; 2],
        large: [&[f32]; 2],
    ) {
        let at = row % self.ring;
        let wide = large[0].len();
        for (to, from) in self.large.iter_mut().zip(large) {
            to.row_mut(at)[..wide].copy_from_slice(from);
        }
        let [alpha, variance] = &mut self.small;
        let [difference, counted, larger] = &mut self.compared;
        let to = [alpha, variance, difference, counted, larger].map(|plane| &mut plane.row_mut(at)[..wide]);
        simd::contrast_row(backend, self.of, small, large, to);
        for (index, plane) in self.compared.iter().enumerate() {
            let sums = &mut self.sums.row_mut(index)[..wide];
            if row == 0 || restart {
                sums.fill(0.0);
                for back in 0..=(2 * self.half).min(row) {
                    simd::add_row(backend, &plane.row((row - back) % self.ring)[..wide], 1.0, sums);
                }
            } else {
                simd::add_row(backend, &plane.row(at)[..wide], 1.0, sums);
                if let Some(gone) = row.checked_sub(2 * self.half + 1) {
                    simd::add_row(backend, &plane.row(gone % self.ring)[..wide], -1.0, sums);
                }
            }
        }
    }

    /// Alpha and its variance of the row `half` before the last one, without the outer `half` columns.
    pub fn decide(&mut self, backend: Backend, row: usize, wide: usize, to: [&mut [f32]; 2]) {
        let at = (row - self.half) % self.ring;
        let width = (wide - 2 * self.half).next_multiple_of(simd::MAX_LANES).min(to[0].len());
        let wide = width + 2 * self.half;
        let stride = self.sums.stride();
        let (of_rows, of_windows) = self.sums.all_mut().split_at_mut(3 * stride);
        for index in 0..3 {
            let sums = &mut of_windows[index * stride..][..width];
            simd::row_sums(
                backend,
                &of_rows[index * stride..][..wide],
                2 * self.half + 1,
                &mut self.work,
                sums,
            );
        }
        let (first, last) = (self.half, self.half + width);
        let [small, large] = [&self.small, &self.large]
            .map(|planes| planes.each_ref().map(|plane| &plane.row(at)[first..last]));
        let sums = [0, 1, 2].map(|index| &of_windows[index * stride..][..width]);
        simd::decide_row(backend, self.of, sums, small, large, to.map(|row| &mut row[..width]));
    }
}
