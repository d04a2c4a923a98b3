//! Loops over the images as they come in: their range, and their normalised difference and sum.

use super::dispatch;
use super::lanes::Lanes;

/// Smallest and largest value of a row, and whether all are finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extremes {
    /// Smallest value; meaningless unless all are finite.
    pub low: f32,
    /// Largest value; meaningless unless all are finite.
    pub high: f32,
    /// Whether no value is NaN or infinite.
    pub finite: bool,
}

dispatch! {
    /// Smallest and largest of `values`.
    fn extremes(values: &[f32]) -> Extremes = extremes_generic
}

#[inline(always)]
fn extremes_generic<L: Lanes>(has: L::Has, values: &[f32]) -> Extremes {
    // Four of each, so that none waits for itself.
    let [mut low, mut high] = [[L::splat(has, f32::INFINITY); 4], [L::splat(has, f32::NEG_INFINITY); 4]];
    let mut poison = [L::splat(has, 0.0); 4];
    let whole = values.len() / (4 * L::N) * 4 * L::N;
    for x in (0..whole).step_by(4 * L::N) {
        for i in 0..4 {
            let value = L::load(has, &values[x + i * L::N..]);
            low[i] = low[i].min(value);
            high[i] = high[i].max(value);
            // 0 times a number is 0, times NaN or infinity NaN.
            poison[i] = value.mul_add(L::splat(has, 0.0), poison[i]);
        }
    }
    let low = low[0].min(low[1]).min(low[2].min(low[3])).to_array();
    let high = high[0].max(high[1]).max(high[2].max(high[3])).to_array();
    let poison = poison[0].add(poison[1]).add(poison[2].add(poison[3])).to_array();
    let mut result = Extremes { low: f32::INFINITY, high: f32::NEG_INFINITY, finite: true };
    for value in low[..L::N].iter().chain(&high[..L::N]).chain(&values[whole..]) {
        if value.is_finite() {
            result.low = result.low.min(*value);
            result.high = result.high.max(*value);
        }
    }
    result.finite = poison[..L::N].iter().all(|p| *p == 0.0) && values[whole..].iter().all(|v| v.is_finite());
    result
}

dispatch! {
    /// `difference = (near - far) gain`, `sum = (near + far - 2 offset) gain`; all rows have one length.
    fn normalise_row(far: &[f32], near: &[f32], offset: f32, gain: f32, difference: &mut [f32], sum: &mut [f32]) =
        normalise_generic
}

#[inline(always)]
fn normalise_generic<L: Lanes>(
    _: L::Has,
    far: &[f32],
    near: &[f32],
    offset: f32,
    gain: f32,
    difference: &mut [f32],
    sum: &mut [f32],
) {
    let n = far.len();
    assert!(near.len() == n && difference.len() == n && sum.len() == n);
    for i in 0..n {
        difference[i] = (near[i] - far[i]) * gain;
        sum[i] = ((near[i] - offset) + (far[i] - offset)) * gain;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Backend;

    #[test]
    fn extremes_know_what_is_not_finite() {
        let mut values: Vec<f32> = (0..150).map(|i| ((i * 37) % 150) as f32 - 20.0).collect();
        for backend in Backend::available() {
            assert_eq!(extremes(backend, &values), Extremes { low: -20.0, high: 129.0, finite: true });
        }
        for at in [3, 149] {
            values[at] = f32::NAN;
            for backend in Backend::available() {
                assert!(!extremes(backend, &values).finite, "{backend:?} {at}");
            }
            values[at] = 0.0;
        }
    }
}
