//! The run time as a stream of rows: each stage takes a few rows from the previous one while they are cached.
//!
//! A tile (all rows of a band, at most [`MAX_TILE_PX`] columns) needs `halo` pixels around it. Beyond the image the
//! input is reflected, which with symmetric kernels equals reflection at every stage. Rows pass in blocks of [`BLOCK`]
//! through normalisation, pre-filter, the three operators, the window sums and the cubic; each stage keeps what it
//! still needs, so nothing is computed twice within a tile. A tile holds about 100 rows besides the maps: less than 1
//! MB for any image size. Bands are independent: threads share only the input.

use ndarray::{Array2, ArrayViewMut2, Axis, s};
use rayon::prelude::*;

use super::check::Input;
use super::{Backend, Settings};
use crate::border::reflect;
use crate::depth_of_alpha::DepthOfAlpha;
use crate::metrics::spread;
use crate::operators::Operators;
use crate::simd::{self, CubicRow, Plane, Taps, WindowRow};

const BLOCK: usize = simd::SEVEN_BLOCK;

/// Widest tile: its rows fit a 1 MB second-level cache; narrower tiles would interrupt hardware prefetching more often.
const MAX_TILE_PX: usize = 1024;

/// Shortest band worth a thread: its halo of about 20 rows is computed twice.
const MIN_BAND_PX: usize = 48;

pub(crate) struct Job<'a> {
    pub input: &'a Input<'a>,
    pub operators: &'a Operators,
    pub settings: &'a Settings,
    /// Pixels that an invalid one takes part in; medians are over the others.
    pub invalid: Option<&'a Array2<bool>>,
    pub depth_of: DepthOfAlpha,
    pub backend: Backend,
}

/// (height, width).
pub(crate) struct Maps<'a> {
    /// Depth in mm after the median.
    pub depth_mm: ArrayViewMut2<'a, f32>,
    pub texture: ArrayViewMut2<'a, f32>,
    pub misfit: ArrayViewMut2<'a, f32>,
}

impl Job<'_> {
    /// Fills the maps with as many threads as the settings request; `tiles` keeps the buffers for the next pair.
    pub fn run(&self, tiles: &mut Vec<Tile>, maps: Maps<'_>) {
        let (height, width) = maps.depth_mm.dim();
        let bands = self.settings.thread_count().min(height / MIN_BAND_PX).max(1);
        let rows = height.div_ceil(bands);
        let tile_width = width.div_ceil(width.div_ceil(MAX_TILE_PX));
        if tiles.len() != bands || tiles.iter().any(|tile| tile.width != tile_width) {
            *tiles = (0..bands).map(|_| Tile::new(self, tile_width)).collect();
        }
        let Maps { mut depth_mm, mut texture, mut misfit } = maps;
        if let [tile] = &mut tiles[..] {
            self.band(tile, 0, Maps { depth_mm, texture, misfit });
            return;
        }
        tiles
            .par_iter_mut()
            .zip(depth_mm.axis_chunks_iter_mut(Axis(0), rows).into_par_iter())
            .zip(texture.axis_chunks_iter_mut(Axis(0), rows).into_par_iter())
            .zip(misfit.axis_chunks_iter_mut(Axis(0), rows).into_par_iter())
            .enumerate()
            .for_each(|(i, (((tile, depth_mm), texture), misfit))| {
                self.band(tile, i * rows, Maps { depth_mm, texture, misfit });
            });
    }

    fn band(&self, tile: &mut Tile, top: usize, maps: Maps<'_>) {
        let width = maps.depth_mm.ncols();
        let Maps { mut depth_mm, mut texture, mut misfit } = maps;
        for left in (0..width).step_by(tile.width) {
            let columns = s![.., left..(left + tile.width).min(width)];
            let [depth_mm, texture, misfit] =
                [&mut depth_mm, &mut texture, &mut misfit].map(|map| map.slice_mut(columns));
            tile.run(self, top, left, Maps { depth_mm, texture, misfit });
        }
    }
}

#[derive(Debug)]
pub(crate) struct Tile {
    width: usize,
    /// Pixels around the tile that contribute.
    halo: usize,
    radius: usize,
    smoothing: usize,
    median: usize,
    difference: Plane,
    sum: Plane,
    filtered: [Plane; 2],
    filters: [Taps; 2],
    m: Plane,
    p: [Plane; 2],
    operators: [Taps; 3],
    window: WindowRow,
    sums: Plane,
    alpha: Plane,
    scratch: Plane,
    sorted: Plane,
}

impl Tile {
    fn new(job: &Job, width: usize) -> Self {
        let radius = job.operators.kernel_size() / 2;
        let [smoothing, median] = [job.settings.smoothing_px, job.settings.median_px];
        let halo = 2 * radius + smoothing / 2 + median / 2;
        let full = width + 2 * halo;
        let plane = || Plane::new(BLOCK, full);
        let ring = || Plane::new(2 * BLOCK, full);
        let taps = |kernel| Taps::new(kernel, full);
        let o = job.operators;
        Self {
            width,
            halo,
            radius,
            smoothing,
            median,
            difference: plane(),
            sum: plane(),
            filtered: [plane(), plane()],
            filters: [taps(o.prefilter()), taps(o.prefilter())],
            m: ring(),
            p: [ring(), ring()],
            operators: [taps(o.gm1()), taps(o.gp1()), taps(o.gp2())],
            window: WindowRow::new(smoothing, full),
            sums: Plane::new(4 * BLOCK, full),
            alpha: Plane::new(median, full),
            scratch: Plane::new(3, full),
            sorted: Plane::new(median, full),
        }
    }

    fn run(&mut self, job: &Job, top: usize, left: usize, mut maps: Maps<'_>) {
        let (height, width) = maps.depth_mm.dim();
        for taps in self.filters.iter_mut().chain(&mut self.operators) {
            taps.reset();
        }
        self.window.reset();
        let backend = job.backend;
        let inputs = height + 2 * self.halo;
        let filtered = width + 2 * (self.halo - self.radius);
        let operated = filtered - 2 * self.radius;
        let solved = operated - (self.smoothing - 1);
        // Rows before the first complete alpha.
        let lag = 4 * self.radius + self.smoothing - 1;
        for begin in (0..inputs).step_by(BLOCK) {
            let rows = BLOCK.min(inputs - begin);
            for y in 0..rows {
                let image_row = (top + begin + y) as isize - self.halo as isize;
                self.load_row(job, image_row, left, width, y);
            }
            for (input, (filter, output)) in
                [&self.difference, &self.sum].into_iter().zip(self.filters.iter_mut().zip(&mut self.filtered))
            {
                simd::convolve(backend, filter, input, output, 0, rows, filtered);
            }
            let [difference, sum] = &self.filtered;
            let [gm1, gp1, gp2] = &mut self.operators;
            let [p1, p2] = &mut self.p;
            // Sums over seven rows need the previous block: it stays in the other half of the ring.
            let half = begin / BLOCK % 2;
            let first = half * BLOCK;
            simd::convolve(backend, gm1, difference, &mut self.m, first, rows, operated);
            simd::convolve(backend, gp1, sum, p1, first, rows, operated);
            simd::convolve(backend, gp2, sum, p2, first, rows, operated);
            let operated_rows = [&self.m, p1, p2];
            if self.smoothing == 7 {
                simd::vertical_sums_of_seven(backend, operated_rows, half, &mut self.sums, operated);
            } else {
                simd::vertical_sums(
                    backend,
                    &mut self.window,
                    operated_rows,
                    first,
                    &mut self.sums,
                    rows,
                    operated,
                );
            }
            for y in 0..rows {
                if let Some(row) = (begin + y).checked_sub(lag) {
                    self.finish_row(job, row, y, solved, &mut maps);
                    if let (Some(invalid), Some(row)) = (job.invalid, row.checked_sub(self.median - 1)) {
                        self.median_without(job, invalid, [top, left], row, &mut maps);
                    }
                }
            }
        }
    }

    fn load_row(&mut self, job: &Job, image_row: isize, left: usize, width: usize, y: usize) {
        let input = job.input;
        let [image_height, image_width] = [input.height, input.width];
        let row = reflect(image_row, image_height);
        let [far, near] =
            [input.far, input.near].map(|image| &image[row * image_width..(row + 1) * image_width]);
        let [difference, sum] = [self.difference.row_mut(y), self.sum.row_mut(y)];
        let full = width + 2 * self.halo;
        let from = left.saturating_sub(self.halo);
        let to = (left + width + self.halo).min(image_width);
        let at = from + self.halo - left;
        let inside = at..at + (to - from);
        let (difference_part, sum_part) = (&mut difference[inside.clone()], &mut sum[inside.clone()]);
        simd::normalise_row(
            job.backend,
            &far[from..to],
            &near[from..to],
            input.offset,
            input.gain,
            difference_part,
            sum_part,
        );
        if input.bad().is_some() {
            // Holes get the middle value; pixels that depend on them are removed later.
            for value in difference_part.iter_mut().chain(sum_part) {
                if !value.is_finite() {
                    *value = 0.0;
                }
            }
        }
        for x in (0..inside.start).chain(inside.end..full) {
            let column = reflect((left + x) as isize - self.halo as isize, image_width);
            // Reflection exceeds the loaded rows only if the tile is narrower than its halo.
            [difference[x], sum[x]] = match (column + self.halo).checked_sub(left) {
                Some(source) if inside.contains(&source) => [difference[source], sum[source]],
                _ => input.normalised(row, column),
            };
        }
    }

    /// Solves the cubic for one row of sums and finishes the map row that it completes.
    fn finish_row(&mut self, job: &Job, row: usize, y: usize, solved: usize, maps: &mut Maps<'_>) {
        let (height, width) = maps.depth_mm.dim();
        let stride = self.scratch.stride();
        let reach = self.median / 2;
        let (texture, rest) = self.scratch.all_mut().split_at_mut(stride);
        let (misfit, depth) = rest.split_at_mut(stride);
        let mut cubic = CubicRow { alpha: self.alpha.row_mut(row % self.median), texture, misfit };
        cubic.solve(job.backend, &self.sums, y, self.smoothing, solved);
        if let Some(at) = row.checked_sub(reach).filter(|at| *at < height) {
            copy(&texture[reach..reach + width], &mut maps.texture, at);
            copy(&misfit[reach..reach + width], &mut maps.misfit, at);
        }
        if let Some(at) = row.checked_sub(self.median - 1) {
            let rows: [&[f32]; 7] = std::array::from_fn(|i| self.alpha.row(i.min(self.median - 1)));
            simd::median_row(job.backend, &rows[..self.median], &mut self.sorted, job.depth_of, depth, width);
            copy(&depth[..width], &mut maps.depth_mm, at);
        }
    }
}

impl Tile {
    /// Medians of the map's row `at` over the pixels that are not invalid, next to those that are. The tile begins at `top` and
    /// `left`; the last rows of alpha are those of the median.
    fn median_without(
        &mut self,
        job: &Job,
        invalid: &Array2<bool>,
        [top, left]: [usize; 2],
        at: usize,
        maps: &mut Maps<'_>,
    ) {
        let Some(marks) = invalid.as_slice() else { unreachable!("made in standard layout") };
        let (height, width) = invalid.dim();
        let side = self.median;
        let rows: Vec<_> = (at..at + side)
            .map(|row| {
                let of_image = reflect((top + row) as isize - (side / 2) as isize, height);
                (self.alpha.row(row % side), &marks[of_image * width..(of_image + 1) * width])
            })
            .collect();
        let mut any = rows[0].1.to_vec();
        for (_, row) in &rows[1..] {
            any.iter_mut().zip(*row).for_each(|(any, invalid)| *any |= invalid);
        }
        let mut near = any.clone();
        spread(&any, &mut near, side / 2);
        let mut window = Vec::with_capacity(side * side);
        let depths = maps.depth_mm.row_mut(at).into_iter().enumerate();
        for (x, depth) in depths.filter(|(x, _)| near[left + x]) {
            window.clear();
            for column in x..x + side {
                let of_image = reflect((left + column) as isize - (side / 2) as isize, width);
                let values = rows.iter().filter(|(_, invalid)| !invalid[of_image]);
                window.extend(values.map(|(alpha, _)| alpha[column]));
            }
            if !window.is_empty() && window.len() < side * side {
                // Depth falls with alpha: of an even number, the depth that counts is the farther of the two in the middle.
                let middle = (window.len() - 1) / 2;
                let alpha = *window.select_nth_unstable_by(middle, f32::total_cmp).1;
                *depth = job.depth_of.depth_mm(alpha);
            }
        }
    }
}

fn copy(from: &[f32], to: &mut ArrayViewMut2<f32>, row: usize) {
    if let Some(to) = to.row_mut(row).as_slice_mut() {
        to.copy_from_slice(from);
    }
}
