//! Start of the non-linear designs: a kernel from six samples of a radial response. Li 2014, section 5.2.3: the
//! samples, equally spaced from 0 to pi rad/px, form three straight bands. The Parks-McClellan algorithm makes them a
//! one-dimensional filter; the McClellan transform makes that nearly round in two dimensions:
//! `H(u, v) = sum a_n T_n(F)`, `F = (cos u + cos v + cos u cos v - 1) / 2`, `a_0 = h(0)`, `a_n = 2 h(n)`. Cost:
//! microseconds.

use std::f64::consts::PI;

use ndarray::Array2;
use pm_remez::{BandSetting, linear, pm_parameters, pm_remez};

use super::DesignError;
use crate::kernel::{self, Kernel};

/// A kernel of `size` whose response at the radial frequency `w` (rad/px) is about `target(w)`.
pub fn kernel_of_radial_response(target: impl Fn(f64) -> f64, size: usize) -> Result<Kernel, DesignError> {
    mcclellan(&parks_mcclellan(target, size)?)
}

/// The one-dimensional filter `h(0), h(1), ...` from its centre outwards.
fn parks_mcclellan(target: impl Fn(f64) -> f64, size: usize) -> Result<Vec<f64>, DesignError> {
    let failed = |error: pm_remez::error::Error| DesignError::Start(error.to_string());
    // Frequencies in cycles per pixel, as the algorithm expects.
    let samples: [(f64, f64); 6] = std::array::from_fn(|i| (0.1 * i as f64, target(0.2 * PI * i as f64)));
    let bands = [0, 2, 4]
        .map(|i| {
            let [(begin, first), (end, last)] = [samples[i], samples[i + 1]];
            BandSetting::new(begin, end, linear(first, last))
        })
        .into_iter()
        .collect::<Result<Vec<_>, _>>()
        .map_err(failed)?;
    let design = pm_remez(&pm_parameters(size, &bands).map_err(failed)?).map_err(failed)?;
    Ok(design.impulse_response[size / 2..].to_vec())
}

fn mcclellan(filter: &[f64]) -> Result<Kernel, DesignError> {
    let radius = filter.len() - 1;
    let size = 2 * radius + 1;
    let centred = |y: usize, x: usize| [y.abs_diff(radius), x.abs_diff(radius)];
    let unit = |y: usize, x: usize| if centred(y, x) == [0, 0] { 1.0 } else { 0.0 };
    // Taps of F: the response's cosines as symmetric pairs.
    let shape = |y: usize, x: usize| match centred(y, x) {
        [0, 0] => -0.5,
        [0, 1] | [1, 0] => 0.25,
        [1, 1] => 0.125,
        _ => 0.0,
    };
    let mut previous = Array2::from_shape_fn((size, size), |(y, x)| unit(y, x));
    let mut current = Array2::from_shape_fn((size, size), |(y, x)| shape(y, x));
    let mut sum = &previous * filter[0];
    for tap in &filter[1..] {
        sum.scaled_add(2.0 * tap, &current);
        let next = 2.0 * convolve_with_shape(&current, shape) - &previous;
        previous = std::mem::replace(&mut current, next);
    }
    let octant = kernel::offsets(size).map(|(dx, dy)| sum[(radius + dy, radius + dx)]).collect();
    Ok(Kernel::new(size, octant)?)
}

fn convolve_with_shape(image: &Array2<f64>, shape: impl Fn(usize, usize) -> f64) -> Array2<f64> {
    let (size, radius) = (image.nrows(), image.nrows() / 2);
    Array2::from_shape_fn((size, size), |(y, x)| {
        let mut sum = 0.0;
        for dy in 0..3 {
            for dx in 0..3 {
                let at = ((y + dy).wrapping_sub(1), (x + dx).wrapping_sub(1));
                let tap = if radius == 0 { 0.0 } else { shape(radius + dy - 1, radius + dx - 1) };
                sum += tap * image.get(at).copied().unwrap_or(0.0);
            }
        }
        sum
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transform_keeps_the_response_along_the_axis() {
        let filter = [0.4, 0.25, 0.05, -0.02];
        let kernel = mcclellan(&filter).unwrap();
        for i in 0..=16 {
            let w = PI * f64::from(i) / 16.0;
            let line: f64 = filter[0] + (1..4).map(|n| 2.0 * filter[n] * (w * n as f64).cos()).sum::<f64>();
            assert!((kernel.response(w, 0.0) - line).abs() < 1e-12);
        }
        // Nearly round at low frequencies, and exact at the corner: F = -1 there as at (pi, 0).
        assert!(
            (kernel.response(0.5, 0.0) - kernel.response(0.5 / 2_f64.sqrt(), 0.5 / 2_f64.sqrt())).abs()
                < 0.01
        );
        assert!((kernel.response(PI, PI) - kernel.response(PI, 0.0)).abs() < 1e-12);
    }

    #[test]
    fn a_low_pass_comes_out_as_one() {
        let kernel = kernel_of_radial_response(|w| (-w * w).exp(), 7).unwrap();
        assert!((kernel.response(0.0, 0.0) - 1.0).abs() < 0.1);
        assert!(kernel.response(PI, 0.0).abs() < 0.1);
    }
}
