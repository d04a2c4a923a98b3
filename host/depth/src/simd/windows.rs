//! Rows of the estimator with windows of several sizes: sums along rows, the cubic's root with its slope, and which window
//! counts. Plain loops along rows, which the compiler turns into vectors of the unit at hand.

use super::dispatch;
use super::lanes::Lanes;

/// Largest |alpha| that is found.
const LARGEST_ALPHA: f32 = 1.2;
/// Slope of the cubic, relative to c1, below which Newton's step is shortened.
const SLOPE_FLOOR: f32 = 0.05;
/// Newton steps.
const STEPS: usize = 3;

dispatch! {
    /// Sums over `window` columns: `values` has `window - 1` more than `sums`; `work` has room for twice as many.
    fn row_sums(values: &[f32], window: usize, work: &mut [f32], sums: &mut [f32]) = row_sums_generic
}

#[inline(always)]
fn row_sums_generic<L: Lanes>(values: &[f32], window: usize, work: &mut [f32], sums: &mut [f32]) {
    let width = sums.len();
    let (mut here, mut there) = work.split_at_mut(values.len());
    here[..values.len()].copy_from_slice(values);
    let (mut length, mut power, mut offset, mut rest) = (values.len(), 1, 0, window);
    sums.fill(0.0);
    loop {
        if rest % 2 == 1 {
            let from = &here[offset..offset + width];
            for x in 0..width {
                sums[x] += from[x];
            }
            offset += power;
        }
        rest /= 2;
        if rest == 0 {
            return;
        }
        length -= power;
        let (a, b, to) = (&here[..length], &here[power..power + length], &mut there[..length]);
        for x in 0..length {
            to[x] = a[x] + b[x];
        }
        (here, there) = (there, here);
        power *= 2;
    }
}

/// Sums of a window along a row: the cubic's coefficients c0 to c3, and the energy of the matched filter.
pub(crate) struct CubicSums<'a> {
    pub c: [&'a [f32]; 4],
    pub energy: &'a [f32],
}

/// What a window finds along a row.
pub(crate) struct Found<'a> {
    pub alpha: &'a mut [f32],
    /// Variance of alpha for noise of unit variance.
    pub variance: &'a mut [f32],
}

dispatch! {
    /// Roots of `c0 + c1 a + c2 a^2 + c3 a^3` near `-c0 / c1`, with `c1` at least `floor` times the energy, and their variance:
    /// the energy over the square of the slope.
    fn roots(sums: CubicSums<'_>, floor: f32, found: Found<'_>) = roots_generic
}

#[inline(always)]
fn roots_generic<L: Lanes>(sums: CubicSums<'_>, floor: f32, found: Found<'_>) {
    let width = found.alpha.len();
    let [c0, c1, c2, c3] = sums.c.map(|c| &c[..width]);
    let energy = &sums.energy[..width];
    let (alphas, variances) = (&mut found.alpha[..width], &mut found.variance[..width]);
    for x in 0..width {
        let c1 = c1[x].max(floor * energy[x]).max(f32::MIN_POSITIVE);
        let least = SLOPE_FLOOR * c1;
        let mut alpha = (-c0[x] / c1).clamp(-LARGEST_ALPHA, LARGEST_ALPHA);
        let mut slope = c1;
        for _ in 0..STEPS {
            let value = ((c3[x] * alpha + c2[x]) * alpha + c1) * alpha + c0[x];
            slope = ((3.0 * c3[x] * alpha + 2.0 * c2[x]) * alpha + c1).max(least);
            alpha = (alpha - value / slope).clamp(-LARGEST_ALPHA, LARGEST_ALPHA);
        }
        alphas[x] = alpha;
        variances[x] = energy[x] / (slope * slope);
    }
}

/// What has been chosen so far along a row.
pub(crate) struct Choice<'a> {
    pub alpha: &'a mut [f32],
    pub variance: &'a mut [f32],
    /// The values that all windows so far allow.
    pub low: &'a mut [f32],
    pub high: &'a mut [f32],
    /// 1 while they intersect.
    pub open: &'a mut [f32],
}

/// How windows are weighed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Weighing {
    /// Half width of a window's interval in standard deviations.
    pub gamma: f32,
    /// What is added to the variance, because no window is exact.
    pub floor: f32,
    /// Largest variance of a window that forbids anything.
    pub largest: f32,
}

dispatch! {
    /// Takes a larger window's value wherever it lies within what all smaller ones allow. `noise` is the variance by
    /// which a window's own is multiplied.
    fn choose(alpha: &[f32], variance: &[f32], noise: &[f32], weighing: Weighing, choice: Choice<'_>) = choose_generic
}

#[inline(always)]
fn choose_generic<L: Lanes>(
    alpha: &[f32],
    variance: &[f32],
    noise: &[f32],
    weighing: Weighing,
    choice: Choice<'_>,
) {
    let width = choice.alpha.len();
    let (alpha, variance, noise) = (&alpha[..width], &variance[..width], &noise[..width]);
    let (low, high, open) = (&mut choice.low[..width], &mut choice.high[..width], &mut choice.open[..width]);
    let (chosen, of_chosen) = (&mut choice.alpha[..width], &mut choice.variance[..width]);
    let Weighing { gamma, floor, largest } = weighing;
    for x in 0..width {
        let total = variance[x] * noise[x] + floor;
        let reach = gamma * total.sqrt();
        let says = total <= largest;
        let below = if says { alpha[x] - reach } else { -10.0 };
        let above = if says { alpha[x] + reach } else { 10.0 };
        low[x] = low[x].max(below);
        high[x] = high[x].min(above);
        open[x] = if low[x] <= high[x] { open[x] } else { 0.0 };
        let takes = open[x] > 0.0;
        chosen[x] = if takes { alpha[x] } else { chosen[x] };
        of_chosen[x] = if takes { variance[x] } else { of_chosen[x] };
    }
}

dispatch! {
    /// Takes a larger window's value wherever what was chosen so far is less certain than asked for.
    fn choose_safe(alpha: &[f32], variance: &[f32], noise: &[f32], largest: f32, chosen: &mut [f32], of_chosen: &mut [f32]) =
        choose_safe_generic
}

#[inline(always)]
fn choose_safe_generic<L: Lanes>(
    alpha: &[f32],
    variance: &[f32],
    noise: &[f32],
    largest: f32,
    chosen: &mut [f32],
    of_chosen: &mut [f32],
) {
    let width = chosen.len();
    let (alpha, variance, noise) = (&alpha[..width], &variance[..width], &noise[..width]);
    let of_chosen = &mut of_chosen[..width];
    for x in 0..width {
        let takes = of_chosen[x] * noise[x] > largest;
        chosen[x] = if takes { alpha[x] } else { chosen[x] };
        of_chosen[x] = if takes { variance[x] } else { of_chosen[x] };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Backend;

    #[test]
    fn sums_of_any_window() {
        let values: Vec<f32> = (0..90).map(|i| ((i * 37) % 19) as f32).collect();
        for backend in Backend::available() {
            for window in [1, 3, 7, 9, 13, 21] {
                let width = values.len() + 1 - window;
                let mut sums = vec![0.0; width];
                row_sums(backend, &values, window, &mut vec![0.0; 2 * values.len()], &mut sums);
                for (x, sum) in sums.iter().enumerate() {
                    assert_eq!(*sum, values[x..x + window].iter().sum::<f32>(), "{backend:?} {window}");
                }
            }
        }
    }

    #[test]
    fn roots_are_roots() {
        for backend in Backend::available() {
            let wanted: Vec<f32> = (-11..=11).map(|i| 0.1 * i as f32).collect();
            let value = |a: f32| 2.0 * a + 0.1 * a * a + 0.2 * a * a * a;
            let n = wanted.len();
            let c0: Vec<f32> = wanted.iter().map(|a| -value(*a)).collect();
            let [c1, c2, c3, energy] = [2.0, 0.1, 0.2, 1.0].map(|c| vec![c; n]);
            let (mut alpha, mut variance) = (vec![0.0; n], vec![0.0; n]);
            let sums = CubicSums { c: [&c0, &c1, &c2, &c3], energy: &energy };
            roots(backend, sums, 0.5, Found { alpha: &mut alpha, variance: &mut variance });
            for ((found, wanted), variance) in alpha.iter().zip(&wanted).zip(&variance) {
                assert!((found - wanted).abs() < 1e-5, "{found} {wanted}");
                let slope = 2.0 + 0.2 * wanted + 0.6 * wanted * wanted;
                assert!((variance * slope * slope - 1.0).abs() < 1e-2);
            }
        }
    }

    #[test]
    fn a_larger_window_counts_where_it_does_not_contradict() {
        let weighing = Weighing { gamma: 2.0, floor: 0.0, largest: 0.002 };
        for backend in Backend::available() {
            let (mut alpha, mut variance) = (vec![0.0; 2], vec![0.0; 2]);
            let (mut low, mut high, mut open) = (vec![-10.0; 2], vec![10.0; 2], vec![1.0; 2]);
            for (found, of) in [([0.10, 0.10], 1e-3), ([0.12, 0.50], 3e-4)] {
                let choice = Choice {
                    alpha: &mut alpha,
                    variance: &mut variance,
                    low: &mut low,
                    high: &mut high,
                    open: &mut open,
                };
                choose(backend, &found, &[of; 2], &[1.0; 2], weighing, choice);
            }
            assert_eq!(alpha, [0.12, 0.10]);
        }
    }
}
