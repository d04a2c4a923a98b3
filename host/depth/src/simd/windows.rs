//! Rows of the estimator with several window sizes: sums along rows, the cubic's root with its slope, residual and
//! deviation. Plain loops along rows, vectorised by the compiler; roots by [`Lanes`], for their reciprocals.

use super::dispatch;
use super::lanes::Lanes;
use crate::reason::Reason;

const LARGEST_ALPHA: f32 = 1.2;
/// Slope of the cubic, relative to c1, below which Newton's step is shortened.
const SLOPE_FLOOR: f32 = 0.05;
const STEPS: usize = 3;
/// Least c1: its reciprocal, and that of [`SLOPE_FLOOR`] of it, are finite.
const LEAST_SLOPE: f32 = 1e-30;
pub(crate) const MAX_LANES: usize = 16;

dispatch! {
    /// Sums over `window` columns: `values` is at least `window - 1` longer than `sums`; `work` has twice the size.
    fn row_sums(values: &[f32], window: usize, work: &mut [f32], sums: &mut [f32]) = row_sums_generic
}

#[inline(always)]
fn row_sums_generic<L: Lanes>(values: &[f32], window: usize, work: &mut [f32], sums: &mut [f32]) {
    let width = sums.len();
    if window < 4 {
        sums.copy_from_slice(&values[..width]);
        for from in (1..window).rev() {
            sums.iter_mut().zip(&values[from..]).for_each(|(sum, value)| *sum += value);
        }
        return;
    }
    let (mut here, mut there) = work.split_at_mut(values.len());
    let at = |d: usize| &values[d..][..width];
    // The usual windows in two passes: sums of four, then of those. Their order is that of the loop below.
    // Whole vectors, where the values suffice.
    let mut length = (width + window - 4).next_multiple_of(MAX_LANES).min(values.len() - 3);
    let quads = &mut here[..length];
    let (a, b) = (&values[..length], &values[1..][..length]);
    let (c, d) = (&values[2..][..length], &values[3..][..length]);
    for x in 0..length {
        quads[x] = (a[x] + b[x]) + (c[x] + d[x]);
    }
    let quad = |d: usize| &quads[d..][..width];
    match window {
        7 => {
            let (a, b, c, d) = (at(0), at(1), at(2), quad(3));
            (0..width).for_each(|x| sums[x] = (a[x] + (b[x] + c[x])) + d[x]);
            return;
        }
        9 => {
            let (a, b, c) = (at(0), quad(1), quad(5));
            (0..width).for_each(|x| sums[x] = a[x] + (b[x] + c[x]));
            return;
        }
        13 => {
            let (a, b, c, d) = (at(0), quad(1), quad(5), quad(9));
            (0..width).for_each(|x| sums[x] = (a[x] + b[x]) + (c[x] + d[x]));
            return;
        }
        15 => {
            let (a, b, c, d, e, f) = (at(0), at(1), at(2), quad(3), quad(7), quad(11));
            (0..width).for_each(|x| sums[x] = ((a[x] + (b[x] + c[x])) + d[x]) + (e[x] + f[x]));
            return;
        }
        21 => {
            let (a, b, c, d, e, f) = (at(0), quad(1), quad(5), quad(9), quad(13), quad(17));
            (0..width).for_each(|x| sums[x] = (a[x] + b[x]) + ((c[x] + d[x]) + (e[x] + f[x])));
            return;
        }
        _ => {}
    }
    let (mut power, mut offset, mut rest) = (4, window % 4, window / 4);
    sums.copy_from_slice(at(0));
    match window % 4 {
        0 => sums.fill(0.0),
        1 => {}
        2 => (0..width).for_each(|x| sums[x] += at(1)[x]),
        _ => (0..width).for_each(|x| sums[x] += at(1)[x] + at(2)[x]),
    }
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

/// Window sums along a row: the cubic's coefficients c0 to c3, and the matched filter's energy.
pub(crate) struct CubicSums<'a> {
    pub c: [&'a [f32]; 4],
    pub energy: &'a [f32],
    /// Mean noise variance of a window's pixels.
    pub noise: &'a [f32],
}

/// What noise of unit variance adds to a window's sums, and their limits.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OfNoise {
    pub c1: f32,
    pub c3: f32,
    pub energy: f32,
    /// Least part of the energy that remains without noise.
    pub least_evidence: f32,
    /// Least c1, in energies without noise.
    pub least_slope: f32,
}

impl OfNoise {
    /// That of a window of `pixels`.
    pub fn times(self, pixels: f32) -> Self {
        Self { c1: self.c1 * pixels, c3: self.c3 * pixels, energy: self.energy * pixels, ..self }
    }
}

pub(crate) struct Found<'a> {
    pub alpha: &'a mut [f32],
    /// For noise of unit variance.
    pub variance: &'a mut [f32],
}

dispatch! {
    /// Roots of `c0 + c1 a + c2 a^2 + c3 a^3` near `-c0 / c1`, without what noise adds to `c1` and `c3`, and their variance.
    /// The variance is infinite where the energy is below half of the noise's: a rounding error of running sums.
    fn roots(sums: CubicSums<'_>, of_noise: OfNoise, found: Found<'_>) = roots_generic
}

#[inline(always)]
fn roots_generic<L: Lanes>(sums: CubicSums<'_>, of_noise: OfNoise, found: Found<'_>) {
    let width = found.alpha.len();
    let [c0, c1, c2, c3] = sums.c.map(|c| &c[..width]);
    let (energy, noise) = (&sums.energy[..width], &sums.noise[..width]);
    let (alphas, variances) = (&mut found.alpha[..width], &mut found.variance[..width]);
    let whole = width - width % L::N;
    for x in (0..whole).step_by(L::N) {
        let end = x + L::N;
        let given = [&c0[x..end], &c1[x..end], &c2[x..end], &c3[x..end], &energy[x..end], &noise[x..end]];
        root_columns::<L>(given, of_noise, &mut alphas[x..end], &mut variances[x..end]);
    }
    if whole < width {
        let rest = width - whole;
        let (mut given, mut alpha, mut variance) =
            ([[0.0; MAX_LANES]; 6], [0.0; MAX_LANES], [0.0; MAX_LANES]);
        for (to, from) in given.iter_mut().zip([c0, c1, c2, c3, energy, noise]) {
            to[..rest].copy_from_slice(&from[whole..]);
        }
        let [a, b, c, d, e, f] = &given;
        root_columns::<L>([a, b, c, d, e, f], of_noise, &mut alpha, &mut variance);
        alphas[whole..].copy_from_slice(&alpha[..rest]);
        variances[whole..].copy_from_slice(&variance[..rest]);
    }
    for x in 0..width {
        let expected = of_noise.energy * noise[x];
        let known = (expected > 0.0) & (energy[x].max(f32::MIN_POSITIVE) > 0.5 * expected);
        variances[x] = if known { variances[x] } else { f32::INFINITY };
    }
}

/// Roots of a vector of columns, and the variance of each for noise of unit variance.
#[inline(always)]
fn root_columns<L: Lanes>(given: [&[f32]; 6], of_noise: OfNoise, alpha: &mut [f32], variance: &mut [f32]) {
    let [c0, c1, c2, c3, energy, noise] = given;
    assert!(c0.len() >= L::N && c1.len() >= L::N && c2.len() >= L::N && c3.len() >= L::N);
    assert!(energy.len() >= L::N && noise.len() >= L::N && alpha.len() >= L::N && variance.len() >= L::N);
    // SAFETY: the lengths above.
    let [c0, c1, c2, c3, energy, noise] = unsafe {
        [
            L::load(c0.as_ptr()),
            L::load(c1.as_ptr()),
            L::load(c2.as_ptr()),
            L::load(c3.as_ptr()),
            L::load(energy.as_ptr()),
            L::load(noise.as_ptr()),
        ]
    };
    let [lowest, highest] = [L::splat(-LARGEST_ALPHA), L::splat(LARGEST_ALPHA)];
    // In constant regions rounding leaves energies of 0 or below.
    let energy = energy.max(L::splat(f32::MIN_POSITIVE));
    let expected = noise.mul(L::splat(of_noise.energy));
    let evidence = energy.sub(expected).max(energy.mul(L::splat(of_noise.least_evidence)));
    let least = evidence.mul(L::splat(of_noise.least_slope)).max(L::splat(LEAST_SLOPE));
    let c1 = noise.neg_mul_add(L::splat(of_noise.c1), c1).max(least);
    let c3 = noise.neg_mul_add(L::splat(of_noise.c3), c3);
    let least = c1.mul(L::splat(SLOPE_FLOOR));
    let (three_c3, two_c2) = (c3.mul(L::splat(3.0)), c2.add(c2));
    let mut inverse = c1.reciprocal();
    let mut root = c0.neg_mul_add(inverse, L::splat(0.0)).max(lowest).min(highest);
    for _ in 0..STEPS {
        let value = c3.mul_add(root, c2).mul_add(root, c1).mul_add(root, c0);
        let slope = three_c3.mul_add(root, two_c2).mul_add(root, c1).max(least);
        inverse = slope.reciprocal();
        root = value.neg_mul_add(inverse, root).max(lowest).min(highest);
    }
    // SAFETY: the lengths above.
    unsafe {
        root.store(alpha.as_mut_ptr());
        energy.mul(inverse).mul(inverse).store(variance.as_mut_ptr());
    }
}

dispatch! {
    fn add_row(values: &[f32], times: f32, sums: &mut [f32]) = add_row_generic
}

#[inline(always)]
fn add_row_generic<L: Lanes>(values: &[f32], times: f32, sums: &mut [f32]) {
    let width = sums.len();
    let values = &values[..width];
    for x in 0..width {
        sums[x] += times * values[x];
    }
}

dispatch! {
    /// Difference and sum of a pair's row, minus the mean and times the gain; 0 where a pixel has no value.
    fn dimensionless_row(far: &[f32], near: &[f32], mean_and_gain: [f32; 2], to: [&mut [f32]; 2]) = dimensionless_generic
}

#[inline(always)]
fn dimensionless_generic<L: Lanes>(
    far: &[f32],
    near: &[f32],
    [mean, gain]: [f32; 2],
    [difference, sum]: [&mut [f32]; 2],
) {
    let width = far.len();
    let (near, difference, sum) = (&near[..width], &mut difference[..width], &mut sum[..width]);
    for x in 0..width {
        let (far, near) = ((far[x] - mean) * gain, (near[x] - mean) * gain);
        let whole = far.is_finite() && near.is_finite();
        difference[x] = if whole { far - near } else { 0.0 };
        sum[x] = if whole { far + near } else { 0.0 };
    }
}

dispatch! {
    fn add_products(a: &[f32], b: &[f32], sums: &mut [f32]) = add_products_generic
}

#[inline(always)]
pub(super) fn add_products_generic<L: Lanes>(a: &[f32], b: &[f32], sums: &mut [f32]) {
    let width = sums.len();
    let (a, b) = (&a[..width], &b[..width]);
    for x in 0..width {
        sums[x] += a[x] * b[x];
    }
}

dispatch! {
    fn move_products(gone: [&[f32]; 2], come: [&[f32]; 2], sums: &mut [f32]) = move_products_generic
}

#[inline(always)]
fn move_products_generic<L: Lanes>(gone: [&[f32]; 2], come: [&[f32]; 2], sums: &mut [f32]) {
    let width = sums.len();
    let [[gone_a, gone_b], [come_a, come_b]] = [gone, come].map(|rows| rows.map(|row| &row[..width]));
    for x in 0..width {
        sums[x] += come_a[x] * come_b[x] - gone_a[x] * gone_b[x];
    }
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Residual {
    /// Its mean square for noise of unit variance, a polynomial in alpha^2.
    pub gain: [f32; 4],
    /// Noise variance of a pixel of brightness b: `constant + per_unit b`.
    pub noise: [f32; 2],
    /// Lower limit of it.
    pub least_noise: f32,
}

dispatch! {
    /// Squared residual relative to noise, the square itself, and that of noise; `sum` is of the pair's brightness.
    fn residual_row(of: Residual, rho: [&[f32]; 4], sum: &[f32], alpha: &[f32], to: [&mut [f32]; 3]) = residual_generic
}

#[inline(always)]
fn residual_generic<L: Lanes>(
    of: Residual,
    rho: [&[f32]; 4],
    sum: &[f32],
    alpha: &[f32],
    [relative, squares, expected]: [&mut [f32]; 3],
) {
    let width = alpha.len();
    let ([r0, r1, r2, r3], sum) = (rho.map(|rho| &rho[..width]), &sum[..width]);
    let (relative, squares, expected) =
        (&mut relative[..width], &mut squares[..width], &mut expected[..width]);
    let [constant, per_unit] = of.noise;
    for x in 0..width {
        let a = alpha[x];
        let left = ((r3[x] * a + r2[x]) * a + r1[x]) * a + r0[x];
        let noise = (constant + per_unit * (0.5 * sum[x])).max(of.least_noise);
        squares[x] = left * left;
        expected[x] = polynomial(of.gain, a * a) * noise;
        relative[x] = squares[x] / expected[x];
    }
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Deviation {
    /// Variance of alpha relative to the window's own, a polynomial in alpha^2.
    pub gain: [f32; 4],
    /// Depth changes with alpha by `squared slope / (offset + slope alpha)^2`.
    pub squared: f32,
    pub offset: f32,
    pub slope: f32,
    /// Added variance of alpha.
    pub floor: f32,
}

dispatch! {
    fn deviation_row(of: Deviation, alpha: &[f32], variance: &[f32], to: &mut [f32]) = deviation_generic
}

#[inline(always)]
fn deviation_generic<L: Lanes>(of: Deviation, alpha: &[f32], variance: &[f32], to: &mut [f32]) {
    let width = to.len();
    let (alpha, variance) = (&alpha[..width], &variance[..width]);
    for x in 0..width {
        let a = alpha[x];
        let gain = polynomial(of.gain, a * a);
        let w = of.offset + of.slope * a;
        to[x] = (gain * variance[x] + of.floor).sqrt() * (of.squared * of.slope / (w * w));
    }
}

#[inline(always)]
pub(super) fn polynomial(gain: [f32; 4], x: f32) -> f32 {
    ((gain[3] * x + gain[2]) * x + gain[1]) * x + gain[0]
}

/// Which depths are believed.
#[derive(Clone, Copy)]
pub(crate) struct Believed {
    pub near_mm: f32,
    pub far_mm: f32,
    pub focal_length_mm: f32,
    /// [`Optics::steepness`](crate::optics::Optics::steepness).
    pub steepness: f32,
    /// Standard deviation of alpha from which noise alone may have made a depth.
    pub largest_deviation: f32,
    /// Mean square of what the model leaves, relative to the noise, from which it does not hold.
    pub largest_misfit: f32,
}

impl Believed {
    /// Magnitude of the change of depth with alpha at `depth_mm`, mm.
    #[inline(always)]
    pub fn slope_mm(self, depth_mm: f32) -> f32 {
        let beyond = depth_mm - self.focal_length_mm;
        self.steepness * (beyond * beyond)
    }
}

dispatch! {
    /// Confidence of a row's depths, or the code of the [`Reason`] for which a depth is removed. `noise_mm` is the deviation by
    /// noise alone; `maps` are depth, confidence (written) and deviation. Pixels with a reason lose their depth.
    fn believe_row(
        of: Believed,
        least: f32,
        noise_mm: &[f32],
        misfit: &[f32],
        reasons: &mut [u8],
        maps: [&mut [f32]; 3],
    ) = believe_generic
}

#[inline(always)]
#[expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN, which is not measured, counts as explained")]
fn believe_generic<L: Lanes>(
    of: Believed,
    least: f32,
    noise_mm: &[f32],
    misfit: &[f32],
    reasons: &mut [u8],
    [depth, confidence, deviation]: [&mut [f32]; 3],
) {
    let width = reasons.len();
    let (noise_mm, misfit) = (&noise_mm[..width], &misfit[..width]);
    let (depth, confidence, deviation) =
        (&mut depth[..width], &mut confidence[..width], &mut deviation[..width]);
    for x in 0..width {
        let slope_mm = of.slope_mm(depth[x]);
        let [of_noise, of_alpha] = [noise_mm[x] / slope_mm, deviation[x] / slope_mm];
        let probability = probability(of_alpha / of.largest_deviation, misfit[x]);
        let in_range = (depth[x] >= of.near_mm) & (depth[x] <= of.far_mm);
        let explained = !(misfit[x] > of.largest_misfit) & !(of_alpha > 3.0 * of.largest_deviation);
        let unsure = if probability < least { Reason::Unsure as u32 } else { 0 };
        let misfit = if explained { unsure } else { Reason::Misfit as u32 };
        let out_of_range = if in_range { misfit } else { Reason::OutOfRange as u32 };
        let code = if of_noise < of.largest_deviation { out_of_range } else { Reason::NoTexture as u32 };
        let own = u32::from(reasons[x]);
        let finite = depth[x].abs() < f32::INFINITY;
        let code = if (own != 0) | !finite { own } else { code };
        let valid = (code == 0) & finite;
        reasons[x] = code as u8;
        depth[x] = if valid { depth[x] } else { f32::NAN };
        confidence[x] = if valid { probability } else { 0.0 };
        deviation[x] = if valid { deviation[x] } else { f32::NAN };
    }
}

/// Probability that a depth is off by less than three standard deviations. Of a normal error it is 0.997; it falls where the
/// deviation, here relative to the largest, is no longer small against the range, and where the model leaves more than noise.
#[inline(always)]
fn probability(deviation: f32, misfit: f32) -> f32 {
    let unexplained = (misfit - 1.5).max(0.0);
    0.997 / ((1.0 + 0.3 * (deviation * deviation)) * (1.0 + 0.02 * unexplained))
}

dispatch! {
    fn sum_rows(rows: [&[f32]; 7], sums: &mut [f32]) = sum_rows_generic
}

#[inline(always)]
fn sum_rows_generic<L: Lanes>(rows: [&[f32]; 7], sums: &mut [f32]) {
    let width = sums.len();
    let [a, b, c, d, e, f, g] = rows.map(|row| &row[..width]);
    for x in 0..width {
        sums[x] = a[x] + b[x] + c[x] + d[x] + e[x] + f[x] + g[x];
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
            for window in (1..=crate::pipeline::MAX_SMOOTHING_PX).step_by(2) {
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
            // Noise of variance 0.1 has added 0.05 to c1, -0.02 to c3 and 0.04 to the energy.
            let [c1, c2, c3, energy, noise] = [2.05, 0.1, 0.18, 1.0, 0.1].map(|c| vec![c; n]);
            let (mut alpha, mut variance) = (vec![0.0; n], vec![0.0; n]);
            let sums = CubicSums { c: [&c0, &c1, &c2, &c3], energy: &energy, noise: &noise };
            let of_noise = OfNoise { c1: 0.5, c3: -0.2, energy: 0.4, least_evidence: 0.02, least_slope: 0.5 };
            roots(backend, sums, of_noise, Found { alpha: &mut alpha, variance: &mut variance });
            for ((found, wanted), variance) in alpha.iter().zip(&wanted).zip(&variance) {
                assert!((found - wanted).abs() < 1e-5, "{found} {wanted}");
                let slope = 2.0 + 0.2 * wanted + 0.6 * wanted * wanted;
                assert!((variance * slope * slope - 1.0).abs() < 1e-2);
            }
            let nothing = vec![0.0; n];
            let sums = CubicSums { c: [&nothing; 4].map(|c| &c[..]), energy: &nothing, noise: &noise };
            roots(backend, sums, of_noise, Found { alpha: &mut alpha, variance: &mut variance });
            assert!(
                alpha.iter().all(|alpha| alpha.is_finite()) && variance.iter().all(|v| *v == f32::INFINITY)
            );
        }
    }
}
