//! Two-dimensional row-major FFTs by rustfft's scalar planner: vector ones round per CPU, but a seed fixes the image.

use rayon::prelude::*;
use rustfft::FftPlannerScalar;
use rustfft::num_complex::Complex32;

/// Rows that a thread takes at a time.
const ROWS: usize = 16;

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
        let process = |data: &mut [Complex32], length: usize, each: &dyn rustfft::Fft<f32>| {
            data.par_chunks_mut(ROWS * length).for_each(|rows| each.process(rows));
        };
        process(data, self.width, rows);
        transpose(data, &mut self.scratch, self.height, self.width);
        process(&mut self.scratch, self.height, columns);
        transpose(&self.scratch, data, self.width, self.height);
    }
}

fn transpose(from: &[Complex32], to: &mut [Complex32], height: usize, width: usize) {
    to.par_chunks_mut(ROWS * height).zip((0..width).into_par_iter().step_by(ROWS)).for_each(|(to, first)| {
        for row in 0..height {
            let from = &from[row * width + first..(row + 1) * width];
            for (to, from) in to.chunks_exact_mut(height).zip(from) {
                to[row] = *from;
            }
        }
    });
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
