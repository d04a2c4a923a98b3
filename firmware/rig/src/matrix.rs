//! Small square f64 matrices in `const` functions for the gain design; no floating point reaches the board.

pub(crate) type Matrix<const N: usize> = [[f64; N]; N];

pub(crate) const fn identity<const N: usize>() -> Matrix<N> {
    let mut unit = [[0.0; N]; N];
    let mut i = 0;
    while i < N {
        unit[i][i] = 1.0;
        i += 1;
    }
    unit
}

pub(crate) const fn add_scaled<const N: usize>(a: &Matrix<N>, b: &Matrix<N>, factor: f64) -> Matrix<N> {
    let mut sum = *a;
    let mut i = 0;
    while i < N * N {
        sum[i / N][i % N] += factor * b[i / N][i % N];
        i += 1;
    }
    sum
}

pub(crate) const fn product<const N: usize>(a: &Matrix<N>, b: &Matrix<N>) -> Matrix<N> {
    let mut out = [[0.0; N]; N];
    let mut i = 0;
    while i < N * N {
        let mut k = 0;
        while k < N {
            out[i / N][i % N] += a[i / N][k] * b[k][i % N];
            k += 1;
        }
        i += 1;
    }
    out
}

pub(crate) const fn apply<const N: usize>(a: &Matrix<N>, v: &[f64; N]) -> [f64; N] {
    let mut out = [0.0; N];
    let mut i = 0;
    while i < N * N {
        out[i / N] += a[i / N][i % N] * v[i % N];
        i += 1;
    }
    out
}

/// Matrix exponential by Taylor series; accurate to f64 for norms up to about 4.
pub(crate) const fn exponential<const N: usize>(a: &Matrix<N>) -> Matrix<N> {
    let mut sum = identity::<N>();
    let mut term = identity::<N>();
    let mut order = 1;
    while order <= 40 {
        let next = product(&term, a);
        term = add_scaled(&[[0.0; N]; N], &next, 1.0 / order as f64);
        sum = add_scaled(&sum, &term, 1.0);
        order += 1;
    }
    sum
}

/// Solves `a x = b`, `a` regular, by Gaussian elimination with pivoting.
pub(crate) const fn solve<const N: usize>(a: &Matrix<N>, b: &[f64; N]) -> [f64; N] {
    let (mut a, mut x) = (*a, *b);
    let mut column = 0;
    while column < N {
        let mut pivot = column;
        let mut row = column + 1;
        while row < N {
            if a[row][column].abs() > a[pivot][column].abs() {
                pivot = row;
            }
            row += 1;
        }
        (a[column], a[pivot]) = (a[pivot], a[column]);
        (x[column], x[pivot]) = (x[pivot], x[column]);
        let mut row = 0;
        while row < N {
            if row != column {
                let factor = a[row][column] / a[column][column];
                let mut k = column;
                while k < N {
                    a[row][k] -= factor * a[column][k];
                    k += 1;
                }
                x[row] -= factor * x[column];
            }
            row += 1;
        }
        column += 1;
    }
    let mut i = 0;
    while i < N {
        x[i] /= a[i][i];
        i += 1;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_of_a_rotation_is_sine_and_cosine() {
        let e = exponential(&[[0.0, 1.0], [-1.0, 0.0]]);
        assert!((e[0][0] - 1f64.cos()).abs() < 1e-15 && (e[0][1] - 1f64.sin()).abs() < 1e-15);
    }

    #[test]
    fn a_solution_fulfils_its_equations() {
        let a = [[0.0, 2.0, 1.0], [1.0, -1.0, 3.0], [4.0, 0.5, -2.0]];
        let x = solve(&a, &[1.0, 2.0, 3.0]);
        let b = apply(&a, &x);
        assert!(b.iter().zip([1.0, 2.0, 3.0]).all(|(got, want)| (got - want).abs() < 1e-12), "{b:?}");
    }
}
