//! Window sums over columns of the products of two rows at all horizontal lags, for noise propagation
//! ([`crate::uncertainty`]). Plain loops along rows, vectorised by the compiler. Cost per pixel and pair of rows: for
//! each of the `2 w - 1` lags one product, up to `w - 1` additions and four multiply-adds.

use super::dispatch;
use super::lanes::Lanes;

/// A horizontal lag and its factors in the four results.
pub(crate) type Lag = (isize, [f32; 4]);

dispatch! {
    /// Adds to the four rows of `sums`, for each lag, its factors times the sums of `upper[i] lower[i + lag]` over the
    /// window. `upper` and `lower` are `window - 1` longer than the sums, `work` is twice as long.
    fn lagged_products(upper: &[f32], lower: &[f32], lags: &[Lag], window: usize, work: &mut [f32], sums: &mut [Vec<f32>; 4]) =
        lagged_generic
}

#[inline(always)]
fn lagged_generic<L: Lanes>(
    upper: &[f32],
    lower: &[f32],
    lags: &[Lag],
    window: usize,
    work: &mut [f32],
    sums: &mut [Vec<f32>; 4],
) {
    let width = sums[0].len();
    let (product, rest) = work.split_at_mut(upper.len());
    for (lag, factors) in lags {
        let shift = lag.unsigned_abs();
        let count = window - shift;
        let length = width + count - 1;
        let [a, b] = if *lag >= 0 { [upper, &lower[shift..]] } else { [&upper[shift..], lower] };
        let (a, b, product) = (&a[..length], &b[..length], &mut product[..length]);
        for i in 0..length {
            product[i] = a[i] * b[i];
        }
        match count {
            1 => add_sums::<1>(product, *factors, sums),
            2 => add_sums::<2>(product, *factors, sums),
            3 => add_sums::<3>(product, *factors, sums),
            4 => add_sums::<4>(product, *factors, sums),
            5 => add_sums::<5>(product, *factors, sums),
            6 => add_sums::<6>(product, *factors, sums),
            7 => add_sums::<7>(product, *factors, sums),
            _ => {
                let total = &mut rest[..width];
                total.copy_from_slice(&product[..width]);
                for shift in 1..count {
                    let shifted = &product[shift..shift + width];
                    for x in 0..width {
                        total[x] += shifted[x];
                    }
                }
                add_sums::<1>(total, *factors, sums);
            }
        }
    }
}

#[inline(always)]
fn add_sums<const N: usize>(values: &[f32], [f0, f1, f2, f3]: [f32; 4], sums: &mut [Vec<f32>; 4]) {
    let width = values.len() + 1 - N;
    let mut shifted = [&values[..width]; N];
    for i in 1..N {
        shifted[i] = &values[i..i + width];
    }
    let [s0, s1, s2, s3] = sums;
    let (s0, s1, s2, s3) = (&mut s0[..width], &mut s1[..width], &mut s2[..width], &mut s3[..width]);
    for x in 0..width {
        let mut total = shifted[0][x];
        for i in 1..N {
            total += shifted[i][x];
        }
        s0[x] += f0 * total;
        s1[x] += f1 * total;
        s2[x] += f2 * total;
        s3[x] += f3 * total;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Backend;

    #[test]
    fn pairs_within_the_window_are_counted() {
        const WIDTH: usize = 37;
        for window in [3, 7, 9] {
            let row = |seed: usize| -> Vec<f32> {
                (0..WIDTH + window - 1).map(|i| ((i * seed) % 13) as f32 - 6.0).collect()
            };
            let [upper, lower] = [row(5), row(7)];
            let reach = window as isize - 1;
            let lags: Vec<Lag> = (-reach..=reach).map(|lag| (lag, [1.0, 0.5, lag as f32, -1.0])).collect();
            for backend in Backend::available() {
                let mut sums = [(); 4].map(|()| vec![0.0; WIDTH]);
                let mut work = vec![0.0; 2 * upper.len()];
                lagged_products(backend, &upper, &lower, &lags, window, &mut work, &mut sums);
                for x in 0..WIDTH {
                    let mut expected = [0.0_f32; 4];
                    for (lag, factors) in &lags {
                        for i in 0..window {
                            let Some(j) = i.checked_add_signed(*lag).filter(|j| *j < window) else {
                                continue;
                            };
                            for k in 0..4 {
                                expected[k] += factors[k] * upper[x + i] * lower[x + j];
                            }
                        }
                    }
                    for k in 0..4 {
                        assert!((sums[k][x] - expected[k]).abs() < 1e-2, "{backend:?} {window} {x} {k}");
                    }
                }
            }
        }
    }
}
