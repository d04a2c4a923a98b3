//! A lens by wave optics: aberrations and diffraction of a finite aperture. The amplitude on the sensor is
//! the Fourier transform of the pupil, whose phase holds defocus, spherical aberration and astigmatism; its
//! square is summed over the wavelengths (Goodman, Introduction to Fourier Optics, ch. 6). It uses no
//! [`psf`](crate::psf). Varying defocus is a mixture, pixel by pixel, of images at two neighbouring levels.

use ndarray::Array2;
use rustfft::num_complex::Complex32;

use crate::fourier::Fourier2;
use crate::kernel::CELLS_PER_PIXEL;
use crate::texture::Spectrum;

const FINE_PER_PIXEL: usize = 8;
/// Side of the intensity's window, px: blur radii up to a quarter of it do not wrap.
const WINDOW_PX: usize = 32;
const SIDE: usize = FINE_PER_PIXEL * WINDOW_PX;
/// Samples per pixel and axis that decide which part of a pupil sample is inside.
const PUPIL_PARTS: usize = 4;
/// Step of the geometric blur radius between levels, px.
const LEVEL_PX: f64 = 0.1;

/// A lens and its light.
#[derive(Debug, Clone, PartialEq)]
pub struct WaveLens {
    /// f-number on the image side.
    pub f_number: f64,
    /// Pixel pitch, um; the fill factor is 1.
    pub pixel_um: f64,
    /// Wavelengths, um, with their shares of the light.
    pub light: Vec<[f64; 2]>,
    /// Spherical aberration at the edge of the pupil, waves of the first wavelength (Seidel W040).
    pub spherical_waves: f64,
    /// Astigmatism at the edge of the pupil, waves of the first wavelength (W222).
    pub astigmatism_waves: f64,
}

/// One period of a random texture, cells of half a pixel: mean 1, SD = `contrast`; `sand` or fractal.
#[must_use]
pub fn random_texture(
    sand: bool,
    width_px: usize,
    height_px: usize,
    contrast: f64,
    seed: u64,
) -> Array2<f32> {
    let spectrum = if sand { Spectrum::Sand } else { Spectrum::Fractal };
    spectrum.synthesise(width_px, height_px, contrast, seed)
}

impl WaveLens {
    /// Geometric blur radius of a defocus on the image side, px.
    #[must_use]
    pub fn blur_px(&self, defocus_um: f64) -> f64 {
        defocus_um.abs() / (2.0 * self.f_number * self.pixel_um)
    }

    /// The image of `cells` (one period, cells of half a pixel, even sides). `defocus_um` is the distance
    /// from the sensor to the paraxial image of the surface, per row and column. As large as the period.
    #[must_use]
    pub fn image(&self, cells: &Array2<f32>, defocus_um: &dyn Fn(usize, usize) -> f64) -> Array2<f32> {
        let (height, width) = cells.dim();
        let size = (height / CELLS_PER_PIXEL, width / CELLS_PER_PIXEL);
        let defocus = Array2::from_shape_fn(size, |(y, x)| defocus_um(y, x));
        let [low, high] = defocus.iter().fold([f64::MAX, f64::MIN], |[a, b], d| [a.min(*d), b.max(*d)]);
        let unit_um = LEVEL_PX * 2.0 * self.f_number * self.pixel_um;
        let steps = ((high - low) / unit_um).ceil() as usize;
        let level_um = if steps == 0 { unit_um } else { (high - low) / steps as f64 };
        let mut fourier = Fourier2::new(height, width);
        let mut spectrum: Vec<Complex32> = cells.iter().map(|cell| Complex32::new(*cell, 0.0)).collect();
        fourier.forward(&mut spectrum);
        let mut image = Array2::zeros(size);
        for step in 0..=steps {
            let level = low + level_um * step as f64;
            let mut data = self.cell_kernel(level, height, width);
            fourier.forward(&mut data);
            data.iter_mut().zip(&spectrum).for_each(|(a, b)| *a *= b);
            fourier.inverse(&mut data);
            for ((y, x), value) in image.indexed_iter_mut() {
                let share = 1.0 - ((defocus[(y, x)] - level) / level_um).abs();
                if share > 0.0 {
                    let at = CELLS_PER_PIXEL * (y * width + x);
                    *value += share as f32 * data[at].re / (height * width) as f32;
                }
            }
        }
        image
    }

    /// Transfer from surface to pixels at each of `cycles` per pixel along x and y.
    #[must_use]
    pub fn transfer(&self, defocus_um: f64, cycles: &[[f64; 2]]) -> Vec<f64> {
        let kernel = self.kernel(defocus_um);
        let half = (SIDE / 2) as f64;
        let centred = |i: usize| (i as f64 - half) / FINE_PER_PIXEL as f64;
        // Even about both axes but for rounding: cosines suffice.
        let waves = |f: f64| (0..SIDE).map(move |i| (std::f64::consts::TAU * f * centred(i)).cos());
        cycles
            .iter()
            .map(|[u, v]| {
                let [across, down] = [*u, *v].map(|f| waves(f).collect::<Vec<f64>>());
                kernel
                    .outer_iter()
                    .zip(&down)
                    .map(|(row, down)| {
                        let sum: f64 =
                            row.iter().zip(&across).map(|(light, wave)| f64::from(*light) * wave).sum();
                        down * sum
                    })
                    .sum()
            })
            .collect()
    }

    fn cell_kernel(&self, defocus_um: f64, height: usize, width: usize) -> Vec<Complex32> {
        let kernel = self.kernel(defocus_um);
        let spacing = FINE_PER_PIXEL / CELLS_PER_PIXEL;
        let side = SIDE / spacing;
        let mut data = vec![Complex32::default(); height * width];
        let mut total = 0.0;
        for row in 0..side {
            for column in 0..side {
                let value = kernel[(row * spacing, column * spacing)];
                let wrap = |i: usize, n: usize| (i + n - (side / 2) % n) % n;
                data[wrap(row, height) * width + wrap(column, width)].re += value;
                total += value;
            }
        }
        data.iter_mut().for_each(|value| *value /= total);
        data
    }

    /// Intensity of a cell averaged over a pixel, centred in the array, sum 1.
    fn kernel(&self, defocus_um: f64) -> Array2<f32> {
        let mut fourier = Fourier2::new(SIDE, SIDE);
        let mut sum = vec![Complex32::default(); SIDE * SIDE];
        for [wavelength_um, part] in &self.light {
            let mut pupil = self.pupil(*wavelength_um, defocus_um);
            fourier.inverse(&mut pupil);
            let total: f32 = pupil.iter().map(Complex32::norm_sqr).sum();
            for (sum, amplitude) in sum.iter_mut().zip(&pupil) {
                sum.re += *part as f32 * amplitude.norm_sqr() / total;
            }
        }
        // The cell's and the pixel's own extent along an axis, by the index of the frequency.
        let mean_over = |samples: usize, index: usize| -> f64 {
            let phase = std::f64::consts::TAU * index as f64 / SIDE as f64;
            // The middles of an even number of samples lie at halves.
            (0..samples).map(|s| (phase * (s as f64 - 0.5 * (samples as f64 - 1.0))).cos()).sum::<f64>()
                / samples as f64
        };
        let extent: Vec<f64> = (0..SIDE)
            .map(|index| {
                let signed = if index > SIDE / 2 { SIDE - index } else { index };
                mean_over(FINE_PER_PIXEL, signed) * mean_over(FINE_PER_PIXEL / CELLS_PER_PIXEL, signed)
            })
            .collect();
        fourier.forward(&mut sum);
        for (i, value) in sum.iter_mut().enumerate() {
            *value *= (extent[i / SIDE] * extent[i % SIDE]) as f32;
        }
        fourier.inverse(&mut sum);
        let total: f32 = sum.iter().map(|value| value.re).sum();
        let half = SIDE / 2;
        Array2::from_shape_fn((SIDE, SIDE), |(y, x)| {
            sum[(y + half) % SIDE * SIDE + (x + half) % SIDE].re / total
        })
    }

    /// Amplitude over the pupil, frequency 0 first.
    fn pupil(&self, wavelength_um: f64, defocus_um: f64) -> Vec<Complex32> {
        let fine_um = self.pixel_um / FINE_PER_PIXEL as f64;
        // Cycles per sample at the edge: 1 / (2 lambda N).
        let radius = SIDE as f64 * fine_um / (2.0 * wavelength_um * self.f_number);
        let first_um = self.light.first().map_or(wavelength_um, |light| light[0]);
        let [spherical, astigmatism] =
            [self.spherical_waves, self.astigmatism_waves].map(|waves| waves * first_um / wavelength_um);
        let defocus = defocus_um / (8.0 * self.f_number * self.f_number * wavelength_um);
        let signed = |i: usize| if i >= SIDE / 2 { i as f64 - SIDE as f64 } else { i as f64 };
        let inside = |v: f64, u: f64| {
            // Parts are less than a sample away.
            if u.hypot(v) + 1.0 <= radius {
                return 1.0;
            }
            let parts = 0..PUPIL_PARTS * PUPIL_PARTS;
            let at = |i: usize| (i as f64 + 0.5) / PUPIL_PARTS as f64 - 0.5;
            let count =
                parts.clone().filter(|i| (u + at(i % PUPIL_PARTS)).hypot(v + at(i / PUPIL_PARTS)) <= radius);
            count.count() as f64 / parts.len() as f64
        };
        (0..SIDE * SIDE)
            .map(|i| {
                let [v, u] = [signed(i / SIDE), signed(i % SIDE)];
                let rho2 = (u * u + v * v) / (radius * radius);
                if rho2 > 1.0 + 4.0 / radius {
                    return Complex32::default();
                }
                let waves = defocus * rho2 + spherical * rho2 * rho2 + astigmatism * (u / radius).powi(2);
                let phase = std::f64::consts::TAU * waves;
                Complex32::from_polar(inside(v, u) as f32, phase as f32)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lens(spherical_waves: f64) -> WaveLens {
        WaveLens {
            f_number: 4.0,
            pixel_um: 6.0,
            light: vec![[0.55, 1.0]],
            spherical_waves,
            astigmatism_waves: 0.0,
        }
    }

    /// The transfer functions of a perfect lens in focus and of a square pixel have closed forms.
    #[test]
    fn a_perfect_lens_in_focus_has_the_transfer_of_diffraction() {
        let lens = lens(0.0);
        for cycles in [0.1, 0.25, 0.45_f64] {
            let s = cycles / lens.pixel_um * 0.55 * lens.f_number;
            let diffraction = 2.0 / std::f64::consts::PI * (s.acos() - s * (1.0 - s * s).sqrt());
            let box_of = |width: f64| {
                (std::f64::consts::PI * cycles * width).sin() / (std::f64::consts::PI * cycles * width)
            };
            let expected = diffraction * box_of(1.0) * box_of(0.5);
            let found = lens.transfer(0.0, &[[cycles, 0.0]])[0];
            assert!((found - expected).abs() < 0.01, "{cycles}: {found} {expected}");
        }
    }

    /// Far from focus the image is a disc of radius z / 2N with second moment R^2 / 2.
    #[test]
    fn defocus_blurs_by_the_geometric_radius() {
        let lens = lens(0.0);
        let defocus_um = 150.0;
        let radius = lens.blur_px(defocus_um);
        assert!((radius - 3.125).abs() < 1e-9);
        let moment = |defocus: f64| {
            // Curvature of the transfer function at 0.
            let f = 0.02;
            (1.0 - lens.transfer(defocus, &[[f, 0.0]])[0]) / (2.0 * (std::f64::consts::PI * f).powi(2))
        };
        let found = 4.0 * (moment(defocus_um) - moment(0.0));
        assert!((found / (radius * radius) - 1.0).abs() < 0.05, "{found} {radius}");
    }

    #[test]
    fn spherical_aberration_makes_the_sides_of_focus_differ_and_nothing_else_does() {
        let at = |spherical: f64, defocus: f64| lens(spherical).transfer(defocus, &[[0.3, 0.0]])[0];
        assert!((at(0.0, 60.0) - at(0.0, -60.0)).abs() < 1e-4);
        let centre = -70.0; // near the best focus of one wave
        assert!((at(1.0, centre + 60.0) - at(1.0, centre - 60.0)).abs() > 0.02);
    }

    #[test]
    fn an_even_surface_stays_even_and_a_tilted_one_is_as_sharp_as_its_places() {
        let lens = lens(0.5);
        let even = Array2::from_elem((128, 128), 1.0);
        let image = lens.image(&even, &|y, x| 2.0 * y as f64 - x as f64);
        assert!(image.iter().all(|v| (v - 1.0).abs() < 1e-3));
        let cells = random_texture(true, 40, 40, 0.2, 3);
        let tilted = lens.image(&cells, &|_, x| 4.0 * x as f64);
        for column in [5_usize, 30] {
            let flat = lens.image(&cells, &|_, _| 4.0 * column as f64);
            for row in 0..flat.nrows() {
                assert!((flat[(row, column)] - tilted[(row, column)]).abs() < 0.01);
            }
        }
    }
}
