//! Light and cover of the pixels around cells that share one kernel.
//!
//! Each pixel adds its cells in row-major order, as if they were scattered one after the other, so that no bit depends on
//! the blocks, the number of threads or the CPU.

use ndarray::{Array2, ArrayView2, s};
use rayon::prelude::*;

use crate::composite::Sums;
use crate::kernel::{CELLS_PER_PIXEL, CellKernel};

/// Pixels of a row that are summed together.
const BLOCK: usize = 32;

/// Rows and columns of cells or pixels, the last ones excluded.
#[derive(Clone, Copy)]
pub(crate) struct Region {
    pub(crate) first: (usize, usize),
    pub(crate) last: (usize, usize),
}

impl Region {
    fn size(&self) -> (usize, usize) {
        (self.last.0 - self.first.0, self.last.1 - self.first.1)
    }

    /// Pixels of an image of `size` that these cells reach.
    fn reached(&self, margin_px: usize, reach_px: usize, size: (usize, usize)) -> Self {
        let end = |cells: usize, size: usize| {
            (cells.div_ceil(CELLS_PER_PIXEL) + reach_px).saturating_sub(margin_px).min(size)
        };
        let last = (end(self.last.0, size.0), end(self.last.1, size.1));
        let begin = |cells: usize, last: usize| {
            (cells / CELLS_PER_PIXEL).saturating_sub(margin_px + reach_px).min(last)
        };
        Self { first: (begin(self.first.0, last.0), begin(self.first.1, last.1)), last }
    }
}

/// Sums of the pixels that the cells of `region` reach in an image of `size`, which has `margin_px` of cells around it.
/// With `members`, cells of that number only.
pub(crate) fn gather(
    radiance: ArrayView2<'_, f32>,
    members: Option<(ArrayView2<'_, u8>, u8)>,
    region: Region,
    (size, margin_px): ((usize, usize), usize),
    (kernel, reach_px): (&CellKernel, usize),
) -> Sums {
    let pixels = region.reached(margin_px, reach_px, size);
    let (height, width) = pixels.size();
    let weights = Weights::new(kernel, reach_px);
    let cells = Cells::new(radiance, members, region, pixels, margin_px - reach_px, reach_px);
    let mut light = Array2::zeros((height, width));
    let mut cover = members.map(|_| Array2::zeros((height, width)));
    let rows = light.as_slice_mut().map(|light| light.par_chunks_exact_mut(width.max(1)).enumerate());
    match (rows, cover.as_mut().and_then(Array2::as_slice_mut)) {
        (Some(rows), Some(cover)) => rows
            .zip(cover.par_chunks_exact_mut(width.max(1)))
            .for_each(|((row, light), cover)| cells.row(row, &weights, light, Some(cover))),
        (Some(rows), None) => rows.for_each(|(row, light)| cells.row(row, &weights, light, None)),
        _ => {}
    }
    Sums { first: pixels.first, light, cover }
}

/// Weights of the cells around a pixel, in the order of the cells: rows of pairs, one pair per pixel.
struct Weights {
    side_px: usize,
    pairs: Vec<[f32; 2]>,
    /// Sum of all weights, in the order of the cells.
    all: f32,
}

impl Weights {
    fn new(kernel: &CellKernel, reach_px: usize) -> Self {
        let (reach, side_px) = (reach_px as isize, 2 * reach_px + 1);
        let rows = (-reach..=reach).rev().flat_map(|row| [2 * row, 2 * row - 1]);
        let pairs: Vec<_> = rows
            .flat_map(|row| {
                (-reach..=reach).rev().map(move |column| {
                    [2 * column, 2 * column - 1].map(|column| kernel.on_pixel(row, column) as f32)
                })
            })
            .collect();
        let all = pairs.iter().flatten().fold(0.0, |sum, weight| sum + 1.0 * weight);
        Self { side_px, pairs, all }
    }
}

/// The cells around some pixels: for each row, those in even columns, then those in odd ones.
struct Cells {
    light: Vec<f32>,
    /// 1 for a cell of the group, else 0.
    cover: Vec<f32>,
    /// Cells of the group in each pixel.
    counts: Vec<u16>,
    stride: usize,
    reach_px: usize,
}

impl Cells {
    fn new(
        radiance: ArrayView2<'_, f32>,
        members: Option<(ArrayView2<'_, u8>, u8)>,
        region: Region,
        pixels: Region,
        border_px: usize,
        reach_px: usize,
    ) -> Self {
        let (height, width) = pixels.size();
        let stride = width.next_multiple_of(BLOCK) + 2 * reach_px;
        let count = (height + 2 * reach_px) * stride;
        let cover = if members.is_some() { 4 * count } else { 0 };
        let mut cells = Self {
            light: vec![0.0; 4 * count],
            cover: vec![0.0; cover],
            counts: vec![0; count],
            stride,
            reach_px,
        };
        let (top, left) = ((pixels.first.0 + border_px) * 2, (pixels.first.1 + border_px) * 2);
        let (bottom, right) = (top + 2 * (height + 2 * reach_px), left + 2 * (width + 2 * reach_px));
        for (row, odd) in
            (region.first.0.max(top)..region.last.0.min(bottom)).flat_map(|row| [(row, 0), (row, 1)])
        {
            let place = s![row, left + odd..right; 2];
            let line = (2 * (row - top) + odd) * stride;
            let counts = &mut cells.counts[(row - top) / 2 * stride..];
            let lights = cells.light[line..].iter_mut().zip(radiance.slice(place)).zip(counts);
            let Some((members, number)) = members else {
                lights.for_each(|((light, &radiance), count)| (*light, *count) = (radiance, *count + 1));
                continue;
            };
            let covers = cells.cover[line..].iter_mut().zip(members.slice(place));
            for (((light, &radiance), count), (cover, &member)) in lights.zip(covers) {
                let share = f32::from(u8::from(member == number));
                (*light, *cover, *count) = (share * radiance, share, *count + u16::from(member == number));
            }
        }
        cells
    }

    /// Light and cover of a row of pixels.
    fn row(&self, row: usize, weights: &Weights, light: &mut [f32], mut cover: Option<&mut [f32]>) {
        let Self { stride, reach_px, .. } = *self;
        let side = weights.side_px;
        let mut around = vec![0u16; stride];
        for counts in self.counts[row * stride..(row + side) * stride].chunks_exact(stride) {
            around.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
        }
        let lines = 4 * row * stride..4 * (row + side) * stride;
        for first in (0..light.len()).step_by(BLOCK) {
            let count = BLOCK.min(light.len() - first);
            let seen = &around[first..first + count + 2 * reach_px];
            let seen: usize = seen.iter().map(|&count| usize::from(count)).sum();
            if seen == 0 {
                continue;
            }
            let sums = sum(&self.light[lines.clone()], stride, first, weights);
            light[first..first + count].copy_from_slice(&sums[..count]);
            let Some(cover) = cover.as_mut().map(|cover| &mut cover[first..first + count]) else { continue };
            if seen == 4 * side * (count + 2 * reach_px) {
                cover.fill(weights.all);
            } else {
                cover.copy_from_slice(&sum(&self.cover[lines.clone()], stride, first, weights)[..count]);
            }
        }
    }
}

/// Sums of [`BLOCK`] pixels from column `first`.
fn sum(lines: &[f32], stride: usize, first: usize, weights: &Weights) -> [f32; BLOCK] {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        #[allow(unsafe_code)]
        // SAFETY: the CPU has AVX2.
        return unsafe { sum_avx2(lines, stride, first, weights) };
    }
    sum_any(lines, stride, first, weights)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn sum_avx2(lines: &[f32], stride: usize, first: usize, weights: &Weights) -> [f32; BLOCK] {
    sum_any(lines, stride, first, weights)
}

#[inline(always)]
fn sum_any(lines: &[f32], stride: usize, first: usize, weights: &Weights) -> [f32; BLOCK] {
    let mut sums = [0.0; BLOCK];
    for (line, weights) in lines.chunks_exact(2 * stride).zip(weights.pairs.chunks_exact(weights.side_px)) {
        let (even, odd) = line.split_at(stride);
        for (column, &[left, right]) in (first..).zip(weights) {
            let (even, odd) = (&even[column..column + BLOCK], &odd[column..column + BLOCK]);
            for lane in 0..BLOCK {
                sums[lane] += even[lane] * left;
                sums[lane] += odd[lane] * right;
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::psf::Psf;

    #[test]
    fn each_pixel_has_the_bits_of_cells_scattered_in_order() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for (size, margin_px, blur_px) in [((9, 70), 4, 1.3), ((5, 3), 3, 0.0), ((40, 33), 8, 2.7)] {
            let grid = (2 * (size.0 + 2 * margin_px), 2 * (size.1 + 2 * margin_px));
            let radiance = Array2::from_shape_simple_fn(grid, || random.random_range(0.0f32..2.0));
            let left = random.random_range(0..grid.1 / 2);
            let numbers = Array2::from_shape_fn(grid, |(row, column)| {
                u8::from(column > left && (row < grid.0 / 2 || random.random_bool(0.5)))
            });
            let kernel = CellKernel::new(&Psf::PillBox, blur_px);
            let reach_px = kernel.radius.div_ceil(2);
            let region = Region { first: (0, 0), last: grid };
            let right = Region { first: (0, left + 1), last: grid };
            for (members, region) in [
                (None, region),
                (Some((numbers.view(), 0)), region),
                (Some((numbers.view(), 1)), right),
                (Some((numbers.view(), 2)), Region { first: grid, last: (0, 0) }),
            ] {
                let sums = gather(radiance.view(), members, region, (size, margin_px), (&kernel, reach_px));
                let mut light = Array2::<f32>::zeros(size);
                let mut cover = light.clone();
                for ((row, column), &radiance) in radiance.indexed_iter() {
                    if members.is_some_and(|(members, number)| members[[row, column]] != number) {
                        continue;
                    }
                    for ((y, x), light) in light.indexed_iter_mut() {
                        let offset =
                            |pixel: usize, cell: usize| 2 * (pixel + margin_px) as isize - cell as isize;
                        let weight = kernel.on_pixel(offset(y, row), offset(x, column)) as f32;
                        *light += radiance * weight;
                        cover[[y, x]] += weight;
                    }
                }
                let of_the_image = |found: &Array2<f32>| {
                    let ((top, left), (height, width)) = (sums.first, found.dim());
                    let mut image = Array2::<f32>::zeros(size);
                    image.slice_mut(s![top..top + height, left..left + width]).assign(found);
                    image
                };
                assert_eq!(of_the_image(&sums.light), light, "{size:?}");
                assert_eq!(sums.cover.as_ref().map(of_the_image), members.map(|_| cover), "{size:?}");
            }
        }
    }
}
