//! Rows of the preparation: means and halving of images, the noise of a pair, the comparison of its bands. Plain loops
//! along rows, vectorised by the compiler.

use super::dispatch;
use super::lanes::Lanes;
use super::windows::{MAX_LANES, add_products_generic};

dispatch! {
    /// Adds the first row to `sums` and takes the second one off; `to` is their `share`.
    fn roll_row(rows: [&[f32]; 2], sums: &mut [f64], share: f64, to: &mut [f32]) = roll_generic
}

#[inline(always)]
fn roll_generic<L: Lanes>(rows: [&[f32]; 2], sums: &mut [f64], share: f64, to: &mut [f32]) {
    let width = to.len();
    let ([come, gone], sums) = (rows.map(|row| &row[..width]), &mut sums[..width]);
    for x in 0..width {
        sums[x] = (sums[x] + f64::from(come[x])) - f64::from(gone[x]);
        to[x] = (sums[x] * share) as f32;
    }
}

dispatch! {
    /// The weighted sum of rows.
    fn weigh_rows<const N: usize>(rows: [&[f32]; N], weights: [f32; N], to: &mut [f32]) = weigh_generic
}

#[inline(always)]
fn weigh_generic<L: Lanes, const N: usize>(rows: [&[f32]; N], weights: [f32; N], to: &mut [f32]) {
    let width = to.len();
    let whole = width - width % MAX_LANES;
    for x in (0..whole).step_by(MAX_LANES) {
        let mut sums = [0.0_f32; MAX_LANES];
        for row in 0..N {
            let values = &rows[row][x..x + MAX_LANES];
            for i in 0..MAX_LANES {
                sums[i] += weights[row] * values[i];
            }
        }
        to[x..x + MAX_LANES].copy_from_slice(&sums);
    }
    for x in whole..width {
        let mut sum = 0.0;
        for row in 0..N {
            sum += weights[row] * rows[row][x];
        }
        to[x] = sum;
    }
}

dispatch! {
    /// Every second weighted sum of four neighbours: `values` has at least `2 to.len() + 2`.
    fn halve_row(values: &[f32], weights: [f32; 4], to: &mut [f32]) = halve_generic
}

#[inline(always)]
fn halve_generic<L: Lanes>(values: &[f32], [a, b, c, d]: [f32; 4], to: &mut [f32]) {
    let width = to.len();
    let values = &values[..2 * width + 2];
    for x in 0..width {
        to[x] = a * values[2 * x] + b * values[2 * x + 1] + c * values[2 * x + 2] + d * values[2 * x + 3];
    }
}

dispatch! {
    /// For each column, adds the squares and the product of a pair's second differences along both axes, and the
    /// brightness of both. `rows` are three of the far image and three of the near one, two columns wider than the sums.
    fn add_energies(rows: [[&[f32]; 3]; 2], sums: [&mut [f32]; 5]) = add_energies_generic
}

#[inline(always)]
fn add_energies_generic<L: Lanes>(rows: [[&[f32]; 3]; 2], sums: [&mut [f32]; 5]) {
    const TOGETHER: usize = 64;
    let [far, near, both, far_light, near_light] = sums;
    let width = far.len();
    let [of_far, of_near] = rows;
    for begin in (0..width).step_by(TOGETHER) {
        let end = width.min(begin + TOGETHER);
        let (mut a, mut b) = ([0.0; TOGETHER], [0.0; TOGETHER]);
        second_differences(of_far, begin, &mut a[..end - begin]);
        second_differences(of_near, begin, &mut b[..end - begin]);
        add_products_generic::<L>(&a, &a, &mut far[begin..end]);
        add_products_generic::<L>(&b, &b, &mut near[begin..end]);
        add_products_generic::<L>(&a, &b, &mut both[begin..end]);
        for (light, row) in [(&mut *far_light, of_far[1]), (&mut *near_light, of_near[1])] {
            light[begin..end].iter_mut().zip(&row[begin + 1..=end]).for_each(|(sum, value)| *sum += value);
        }
    }
}

#[inline(always)]
fn second_differences(rows: [&[f32]; 3], begin: usize, to: &mut [f32]) {
    let width = to.len();
    let end = begin + width + 2;
    let (above, here, below) = (&rows[0][begin..end], &rows[1][begin..end], &rows[2][begin..end]);
    for x in 0..width {
        let left = above[x] - 2.0 * here[x] + below[x];
        let middle = above[x + 1] - 2.0 * here[x + 1] + below[x + 1];
        let right = above[x + 2] - 2.0 * here[x + 2] + below[x + 2];
        to[x] = left - 2.0 * middle + right;
    }
}

dispatch! {
    /// Compares a pair's bands from the mean product of both, and of each with itself, around each pixel. Marks correlations
    /// below `limits[1]` of the largest that `noise` permits, where the part `limits[0]` of both is above the noise, and
    /// returns the sums there: of the correlations, of the largest ones, and the number of pixels.
    fn compare_row(noise: f32, limits: [f32; 2], means: [&[f32]; 3], different: &mut [bool]) -> [f32; 3] =
        compare_generic
}

#[inline(always)]
fn compare_generic<L: Lanes>(
    noise: f32,
    limits: [f32; 2],
    [product, of_far, of_near]: [&[f32]; 3],
    different: &mut [bool],
) -> [f32; 3] {
    let width = different.len();
    let (product, of_far, of_near) = (&product[..width], &of_far[..width], &of_near[..width]);
    let mut sums = [[0.0_f32; MAX_LANES]; 3];
    let whole = width - width % MAX_LANES;
    for x in (0..whole).step_by(MAX_LANES) {
        let mut differs = [false; MAX_LANES];
        let [product, of_far, of_near] = [product, of_far, of_near].map(|row| &row[x..x + MAX_LANES]);
        for i in 0..MAX_LANES {
            let found = compare_pixel(noise, limits, [product[i], of_far[i], of_near[i]]);
            differs[i] = found.differs;
            sums[0][i] += found.correlation;
            sums[1][i] += found.largest;
            sums[2][i] += found.counted;
        }
        different[x..x + MAX_LANES].copy_from_slice(&differs);
    }
    for x in whole..width {
        let found = compare_pixel(noise, limits, [product[x], of_far[x], of_near[x]]);
        different[x] = found.differs;
        sums[0][0] += found.correlation;
        sums[1][0] += found.largest;
        sums[2][0] += found.counted;
    }
    sums.map(|sums| sums.iter().sum())
}

/// Zeros where the pixel lacks detail.
struct Compared {
    differs: bool,
    correlation: f32,
    largest: f32,
    counted: f32,
}

#[inline(always)]
fn compare_pixel(
    noise: f32,
    [least_detail, least_correlation]: [f32; 2],
    [product, of_far, of_near]: [f32; 3],
) -> Compared {
    let detail_far = 1.0 - noise / of_far.max(f32::MIN_POSITIVE);
    let detail_near = 1.0 - noise / of_near.max(f32::MIN_POSITIVE);
    let counts = (detail_far > least_detail) & (detail_near > least_detail);
    let largest = (detail_far * detail_near).sqrt();
    let correlation = product / (of_far * of_near).sqrt();
    Compared {
        differs: counts & (correlation < least_correlation * largest),
        correlation: if counts { correlation } else { 0.0 },
        largest: if counts { largest } else { 0.0 },
        counted: if counts { 1.0 } else { 0.0 },
    }
}

pub(crate) fn sum(values: &[f32]) -> f64 {
    sum_of(values, |value| value)
}

pub(crate) fn sum_of_squares(values: &[f32]) -> f64 {
    sum_of(values, |value| value * value)
}

fn sum_of(values: &[f32], each: impl Fn(f32) -> f32) -> f64 {
    let (parts, rest) = values.as_chunks::<8>();
    let mut sums = [0.0_f32; 8];
    for part in parts {
        sums.iter_mut().zip(part).for_each(|(sum, value)| *sum += each(*value));
    }
    sums.into_iter().chain(rest.iter().map(|value| each(*value))).map(f64::from).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Backend;

    #[test]
    fn second_differences_are_those_of_each_pixel() {
        let value = |seed: usize, y: usize, x: usize| ((seed + y * 7919 + x * x * 104_729) % 101) as f32;
        for backend in Backend::available() {
            for width in [16, 48, 50] {
                let rows = [3, 59].map(|seed| {
                    [0, 1, 2].map(|y| (0..width + 2).map(|x| value(seed, y, x)).collect::<Vec<f32>>())
                });
                let mut sums = [(); 5].map(|()| vec![1.0; width]);
                let views = rows.each_ref().map(|rows| rows.each_ref().map(|row| &row[..]));
                add_energies(backend, views, sums.each_mut().map(|sums| &mut sums[..]));
                for x in 0..width {
                    let taps = [1.0, -2.0, 1.0];
                    let [a, b] = rows.each_ref().map(|rows| {
                        let at = |i: usize| taps[i / 3] * taps[i % 3] * rows[i / 3][x + i % 3];
                        (0..9).map(at).sum::<f32>()
                    });
                    let light = rows.each_ref().map(|rows| rows[1][x + 1]);
                    let expected = [a * a, b * b, a * b, light[0], light[1]].map(|value| 1.0 + value);
                    assert_eq!(sums.each_ref().map(|sums| sums[x]), expected, "{backend:?} {width} {x}");
                }
            }
        }
    }

    #[test]
    fn only_pixels_with_detail_in_both_images_are_compared() {
        // Noise 1: the third pixel has no detail in the near image, the last two are unlike and alike.
        let means: [Vec<f32>; 3] =
            [[8.0, -8.0, 8.0].repeat(7), [10.0, 10.0, 10.0].repeat(7), [10.0, 10.0, 1.0].repeat(7)];
        for backend in Backend::available() {
            for width in [3, 16, 21] {
                let mut different = vec![true; width];
                let rows = means.each_ref().map(|row| &row[..width]);
                let [correlation, largest, count] =
                    compare_row(backend, 1.0, [0.6, 0.5], rows, &mut different);
                let expected: Vec<bool> = (0..width).map(|x| x % 3 == 1).collect();
                assert_eq!(different, expected, "{backend:?}");
                let [alike, unlike] = [0, 1].map(|first| (width + 2 - first) / 3);
                assert_eq!(count, (alike + unlike) as f32);
                assert!((correlation - 0.8 * (alike as f32 - unlike as f32)).abs() < 1e-5);
                assert!((largest - 0.9 * count).abs() < 1e-5);
            }
        }
    }
}
