//! Two-dimensional row-major FFTs by rustfft's scalar planner: vector ones round per CPU, but a seed fixes the image.

use rustfft::FftPlannerScalar;
use rustfft::num_complex::Complex32;

pub(crate) struct Fourier2 {
    pub(crate) height: usize,
    pub(crate) width: usize,
    planner: FftPlannerScalar<f32>,
    scratch: Vec<Complex32>,
}

impl Fourier2 {
    pub(crate) fn new(height: usize, width: usize) -> Self {
        let scratch = vec![Complex32::default(); height * width];
        Self { height, width, planner: FftPlannerScalar::new(), scratch }
    }

    /// Forward transform in place, unscaled.
    pub(crate) fn forward(&mut self, data: &mut [Complex32]) {
        let (rows, columns) =
            (self.planner.plan_fft_forward(self.width), self.planner.plan_fft_forward(self.height));
        self.run(data, &*rows, &*columns);
    }

    /// Unscaled: a round trip multiplies by `height * width`.
    pub(crate) fn inverse(&mut self, data: &mut [Complex32]) {
        let (rows, columns) =
            (self.planner.plan_fft_inverse(self.width), self.planner.plan_fft_inverse(self.height));
        self.run(data, &*rows, &*columns);
    }

    fn run(&mut self, data: &mut [Complex32], rows: &dyn rustfft::Fft<f32>, columns: &dyn rustfft::Fft<f32>) {
        rows.process(data);
        transpose(data, &mut self.scratch, self.height, self.width);
        columns.process(&mut self.scratch);
        transpose(&self.scratch, data, self.width, self.height);
    }
}

fn transpose(from: &[Complex32], to: &mut [Complex32], height: usize, width: usize) {
    const BLOCK: usize = 16;
    for row_block in (0..height).step_by(BLOCK) {
        for column_block in (0..width).step_by(BLOCK) {
            for row in row_block..(row_block + BLOCK).min(height) {
                for column in column_block..(column_block + BLOCK).min(width) {
                    to[column * height + row] = from[row * width + column];
                }
            }
        }
    }
}

/// Smallest even size of at least `least` without prime factors above 5.
pub(crate) fn good_size(least: usize) -> usize {
    (least.max(2)..)
        .find(|&size| {
            let mut rest = size;
            for factor in [2, 3, 5] {
                while rest % factor == 0 {
                    rest /= factor;
                }
            }
            rest == 1 && size % 2 == 0
        })
        .unwrap_or(least)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_has_a_plane_wave_as_its_transform() {
        let (height, width) = (6, 10);
        let mut data = vec![Complex32::default(); height * width];
        data[2 * width + 3] = Complex32::new(1.0, 0.0);
        let mut fourier = Fourier2::new(height, width);
        fourier.forward(&mut data);
        for row in 0..height {
            for column in 0..width {
                let phase = -std::f32::consts::TAU * (2.0 * row as f32 / 6.0 + 3.0 * column as f32 / 10.0);
                assert!((data[row * width + column] - Complex32::from_polar(1.0, phase)).norm() < 1e-5);
            }
        }
        fourier.inverse(&mut data);
        assert!((data[2 * width + 3].re - 60.0).abs() < 1e-4);
        assert!(data[5].norm() < 1e-4);
    }

    #[test]
    fn good_sizes_are_even_and_smooth() {
        assert_eq!([1, 7, 11, 1344, 1345].map(good_size), [2, 8, 12, 1350, 1350]);
    }
}
