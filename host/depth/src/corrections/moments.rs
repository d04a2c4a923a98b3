//! Sums of products of powers, which give the normal equations of any third-order polynomial.
//!
//! The normal matrix of a polynomial in x, y and u contains only sums of `x^a y^b u^c` with `a + b + c <= 6`, and the
//! right side sums of `x^a y^b u^c t` with `a + b + c <= 3`. Collecting them once costs less than the outer product of
//! 20 terms and serves any terms. Everything is f64: with |x|, |y| <= 1 a region's condition number is below 1e9.

use nalgebra::{DMatrix, DVector};

pub(super) type Powers = [usize; 3];

/// The ten terms of a region (Li 2014, eq. 6.11): 1, x, x^2, x^3, y, y^2, y^3, u, u^2, u^3.
pub(super) const TEN: [Powers; 10] = [
    [0, 0, 0],
    [1, 0, 0],
    [2, 0, 0],
    [3, 0, 0],
    [0, 1, 0],
    [0, 2, 0],
    [0, 3, 0],
    [0, 0, 1],
    [0, 0, 2],
    [0, 0, 3],
];

/// All twenty terms of third order, in the order of [`farnear_maths::clsf::FULL_TERMS`].
pub(super) const TWENTY: [Powers; 20] = [
    [0, 0, 0],
    [1, 0, 0],
    [2, 0, 0],
    [3, 0, 0],
    [0, 1, 0],
    [1, 1, 0],
    [2, 1, 0],
    [0, 2, 0],
    [1, 2, 0],
    [0, 3, 0],
    [0, 0, 1],
    [1, 0, 1],
    [2, 0, 1],
    [0, 1, 1],
    [1, 1, 1],
    [0, 2, 1],
    [0, 0, 2],
    [1, 0, 2],
    [0, 1, 2],
    [0, 0, 3],
];

const MATRIX: usize = 7;
const RIGHT: usize = 4;

#[derive(Clone)]
pub(super) struct Moments {
    matrix: [[[f64; MATRIX]; MATRIX]; MATRIX],
    right: [[[f64; RIGHT]; RIGHT]; RIGHT],
    samples: usize,
    weight: f64,
}

impl Moments {
    pub(super) fn new() -> Self {
        Self {
            matrix: [[[0.0; MATRIX]; MATRIX]; MATRIX],
            right: [[[0.0; RIGHT]; RIGHT]; RIGHT],
            samples: 0,
            weight: 0.0,
        }
    }

    /// Adds one row's samples, `(x, u, t, weight)` each; powers of y are multiplied in at the end.
    pub(super) fn add_row(&mut self, y: f64, samples: impl Iterator<Item = (f64, f64, f64, f64)>) {
        let mut matrix = [[0.0; MATRIX]; MATRIX];
        let mut right = [[0.0; RIGHT]; RIGHT];
        for (x, u, t, weight) in samples {
            self.samples += 1;
            self.weight += weight;
            let powers = [1.0, u, u * u, u * u * u];
            let (u4, u3) = (powers[2] * powers[2], powers[3]);
            let all = [1.0, u, powers[2], u3, u4, u4 * u, u3 * u3];
            let mut of_x = weight;
            for (a, sums) in matrix.iter_mut().enumerate() {
                for (sum, power) in sums[..MATRIX - a].iter_mut().zip(all) {
                    *sum += of_x * power;
                }
                of_x *= x;
            }
            let mut of_x = weight * t;
            for (a, sums) in right.iter_mut().enumerate() {
                for (sum, power) in sums[..RIGHT - a].iter_mut().zip(powers) {
                    *sum += of_x * power;
                }
                of_x *= x;
            }
        }
        for (totals, sums) in self.matrix.iter_mut().zip(&matrix) {
            add_power_of_y(totals, sums, y);
        }
        for (totals, sums) in self.right.iter_mut().zip(&right) {
            add_power_of_y(totals, sums, y);
        }
    }

    pub(super) fn samples(&self) -> usize {
        self.samples
    }

    /// Least-squares coefficients of `terms`; `None` if the samples do not determine them.
    pub(super) fn solve<const N: usize>(&self, terms: &[Powers; N]) -> Option<[f64; N]> {
        if self.samples < N {
            return None;
        }
        let sum = |[a, b, c]: Powers, [d, e, f]: Powers| self.matrix[a + d][b + e][c + f];
        let n = self.weight;
        let matrix = DMatrix::from_fn(N, N, |i, j| sum(terms[i], terms[j]) / n);
        let right = DVector::from_fn(N, |i, _| {
            let [a, b, c] = terms[i];
            self.right[a][b][c] / n
        });
        // A matrix singular up to rounding has no Cholesky factor or a vanishing pivot.
        let factor = matrix.cholesky()?;
        let smallest = factor.l_dirty().diagonal().min();
        if smallest < 1e-7 {
            return None;
        }
        let solution = factor.solve(&right);
        solution.iter().all(|c| c.is_finite()).then(|| std::array::from_fn(|i| solution[i]))
    }
}

fn add_power_of_y<const N: usize>(totals: &mut [[f64; N]; N], sums: &[f64; N], y: f64) {
    let mut of_y = 1.0;
    for totals in totals {
        for (total, sum) in totals.iter_mut().zip(sums) {
            *total += of_y * sum;
        }
        of_y *= y;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_is_found_again() {
        let truth: [f64; 20] = std::array::from_fn(|i| 0.1 * i as f64 - 0.7);
        let mut moments = Moments::new();
        for row in 0..9 {
            let y = row as f64 / 4.0 - 1.0;
            let of = |x: f64, u: f64| {
                let powers = |[a, b, c]: Powers| x.powi(a as i32) * y.powi(b as i32) * u.powi(c as i32);
                TWENTY.iter().zip(truth).map(|(term, c)| c * powers(*term)).sum::<f64>()
            };
            let samples = (0..70).map(|i| (f64::from(i % 10) / 4.5 - 1.0, f64::from(i / 10) / 3.0 - 1.0));
            moments.add_row(y, samples.map(|(x, u)| (x, u, of(x, u), 1.0)));
        }
        let found = moments.solve(&TWENTY).unwrap();
        for (found, truth) in found.iter().zip(truth) {
            assert!((found - truth).abs() < 1e-10, "{found} {truth}");
        }
    }

    #[test]
    fn too_few_samples_have_no_solution() {
        let mut moments = Moments::new();
        // Three depths cannot determine u^3.
        for row in 0..9 {
            let y = row as f64 / 4.0 - 1.0;
            moments.add_row(
                y,
                (0..30).map(|i| (f64::from(i / 3) / 4.5 - 1.0, f64::from(i % 3) - 1.0, 0.5, 1.0)),
            );
        }
        assert_eq!(moments.solve(&TEN), None);
    }
}
