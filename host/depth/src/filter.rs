//! Convolution of a whole image with an eight-fold symmetric kernel.
//!
//! Borders are reflected without repeating the edge pixel. Cost for 7x7: 16 multiply-adds and 10 additions per pixel
//! (see `run::simd::convolve`), about 0.2 ms for 640x480 on one core with AVX-512.

use ndarray::{ArrayView2, ArrayViewMut2};

use crate::kernel::Kernel;
use crate::run::Backend;
use crate::run::plain::reflect;
use crate::run::simd::{self, Plane, Taps};

/// Rows that are convolved at a time: input and output stay in the first-level cache.
const BLOCK: usize = 8;

/// Widest column strip.
const MAX_STRIP_PX: usize = 512;

/// Writes the convolution of `image` with `kernel` to `output`; both are (height, width).
///
/// # Panics
/// If `image` and `output` differ in size or are empty.
pub fn convolve(image: ArrayView2<f32>, kernel: &Kernel, backend: Backend, mut output: ArrayViewMut2<f32>) {
    let (height, width) = image.dim();
    assert!(
        output.dim() == (height, width) && height > 0 && width > 0,
        "image and output must have one size"
    );
    let radius = kernel.size() / 2;
    for left in (0..width).step_by(MAX_STRIP_PX) {
        let strip = MAX_STRIP_PX.min(width - left);
        let full = strip + 2 * radius;
        let [mut input, mut result] = [full, strip].map(|w| Plane::new(BLOCK, w));
        let mut taps = Taps::new(kernel, strip);
        let inputs = height + 2 * radius;
        for begin in (0..inputs).step_by(BLOCK) {
            let rows = BLOCK.min(inputs - begin);
            for y in 0..rows {
                let source = image.row(reflect((begin + y) as isize - radius as isize, height));
                let row = &mut input.row_mut(y)[..full];
                let inside = left.saturating_sub(radius)..(left + strip + radius).min(width);
                let at = inside.start + radius - left;
                let middle = at..at + inside.len();
                match source.as_slice() {
                    Some(source) => row[middle.clone()].copy_from_slice(&source[inside]),
                    None => row[middle.clone()].iter_mut().zip(inside).for_each(|(to, x)| *to = source[x]),
                }
                for x in (0..middle.start).chain(middle.end..full) {
                    row[x] = source[reflect((left + x) as isize - radius as isize, width)];
                }
            }
            simd::convolve(backend, &mut taps, &input, &mut result, 0, rows, strip);
            for y in 0..rows {
                if let Some(at) = (begin + y).checked_sub(2 * radius) {
                    let row = &result.row(y)[..strip];
                    let mut to = output.slice_mut(ndarray::s![at, left..left + strip]);
                    match to.as_slice_mut() {
                        Some(to) => to.copy_from_slice(row),
                        None => to.iter_mut().zip(row).for_each(|(to, from)| *to = *from),
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::kernel::{SIZES, free_coefficients};

    #[test]
    fn every_variant_size_and_layout_agrees_with_the_definition() {
        for (height, width) in [(1, 1), (3, 40), (33, 17), (20, 1100)] {
            let image =
                Array2::from_shape_fn((height, width), |(y, x)| ((y * 31 + x * 17) % 23) as f32 - 11.0);
            for size in SIZES {
                let octant = (0..free_coefficients(size)).map(|i| (1.3 * i as f64).cos()).collect();
                let kernel = Kernel::new(size, octant).unwrap();
                let r = (size / 2) as isize;
                let expected = Array2::from_shape_fn((height, width), |(y, x)| {
                    let mut sum = 0.0;
                    for dy in -r..=r {
                        for dx in -r..=r {
                            let at = (reflect(y as isize + dy, height), reflect(x as isize + dx, width));
                            sum += kernel.at(dx, dy) * f64::from(image[at]);
                        }
                    }
                    sum
                });
                let largest = expected.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
                for backend in Backend::available() {
                    let mut output = Array2::zeros((height, width));
                    convolve(image.view(), &kernel, backend, output.view_mut());
                    let mut transposed = Array2::zeros((width, height));
                    convolve(image.t(), &kernel, backend, transposed.view_mut());
                    for (at, want) in expected.indexed_iter() {
                        for got in [output[at], transposed[(at.1, at.0)]] {
                            assert!(
                                (f64::from(got) - want).abs() <= 1e-5 * largest,
                                "{backend:?} {size} {at:?}"
                            );
                        }
                    }
                }
            }
        }
    }
}
