//! Rows of the registration and of the resampling: values between pixels, the sums of a Gauss-Newton step, products.

use super::dispatch;
use super::lanes::Lanes;
use super::windows::MAX_LANES;

dispatch! {
    /// Bilinear values between two rows, each one value longer than `to`. The first value is at the fraction `at` of (x, y), each
    /// other one `step` farther.
    fn between_rows(rows: [&[f32]; 2], at: [f32; 2], step: [f32; 2], to: &mut [f32]) = between_generic
}

#[inline(always)]
fn between_generic<L: Lanes>(rows: [&[f32]; 2], at: [f32; 2], step: [f32; 2], to: &mut [f32]) {
    let width = to.len();
    let (left, right) = ([&rows[0][..width], &rows[1][..width]], [&rows[0][1..=width], &rows[1][1..=width]]);
    for i in 0..width {
        // The conversion from 32 bits is a vector instruction.
        let column = i as i32 as f32;
        let (x, y) = (at[0] + step[0] * column, at[1] + step[1] * column);
        let upper = left[0][i] + x * (right[0][i] - left[0][i]);
        let lower = left[1][i] + x * (right[1][i] - left[1][i]);
        to[i] = upper + y * (lower - upper);
    }
}

dispatch! {
    /// For each place along an axis, the first of six taps and the phase: the nearest of `phases` between two pixels.
    fn find_taps(places: &[f64], phases: f64, first: &mut [i32], phase: &mut [i32]) = find_taps_generic
}

#[inline(always)]
fn find_taps_generic<L: Lanes>(places: &[f64], phases: f64, first: &mut [i32], phase: &mut [i32]) {
    let width = places.len();
    let (first, phase) = (&mut first[..width], &mut phase[..width]);
    for i in 0..width {
        // NaN is outside, too.
        let place = (if places[i] > -16.0 { places[i] } else { -16.0 }).min(1e9);
        let whole = place.floor();
        first[i] = to_integer(whole - 2.0);
        phase[i] = to_integer((place - whole) * phases);
    }
}

/// The nearest integer to a small number. `as` checks for overflow, which is not vectorised.
#[inline(always)]
fn to_integer(value: f64) -> i32 {
    // Beyond 2^52 the last bits of the mantissa are the integer.
    const SHIFT: f64 = 6_755_399_441_055_744.0;
    (value + SHIFT).to_bits() as i32
}

dispatch! {
    /// Divides a row by a polynomial of the fourth degree, or multiplies by it. The first column is at `place[0]`, each other
    /// one `place[1]` farther.
    fn divide_by_polynomial(coefficients: [f32; 5], place: [f64; 2], multiplies: bool, row: &mut [f32]) =
        divide_by_polynomial_generic
}

#[inline(always)]
fn divide_by_polynomial_generic<L: Lanes>(
    [a, b, c, d, e]: [f32; 5],
    place: [f64; 2],
    multiplies: bool,
    row: &mut [f32],
) {
    for x in 0..row.len() {
        let u = (place[0] + place[1] * f64::from(x as i32)) as f32;
        let value = (((e * u + d) * u + c) * u + b) * u + a;
        row[x] = if multiplies { row[x] * value } else { row[x] / value };
    }
}

dispatch! {
    /// `values` divided by the roots of `squares + floor`, which the quotients replace.
    fn divide_by_root(values: &[f32], floor: f32, squares: &mut [f32]) = divide_generic
}

#[inline(always)]
fn divide_generic<L: Lanes>(values: &[f32], floor: f32, squares: &mut [f32]) {
    let width = squares.len();
    let values = &values[..width];
    for x in 0..width {
        squares[x] = values[x] / (squares[x] + floor).sqrt();
    }
}

/// Sums of a Gauss-Newton step over a row, with Cauchy's weights. `x` is a column's place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StepSums {
    /// Products of the far image's gradients, along (x, x), (x, y) and (y, y), with 1, `x` and `x^2`.
    pub normal: [[f64; 3]; 3],
    /// Products of the gradients with the difference, with 1 and `x`.
    pub right: [[f64; 2]; 2],
    /// Squared differences.
    pub squares: f64,
}

const SUMS: usize = 14;
const COLUMNS: [f32; MAX_LANES] =
    [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];

dispatch! {
    /// The sums of a step over the row `near`. `far` are the far image's row above, this one and the one below, from one column
    /// before to one after. The first column is at `place[0]`, each other one `place[1]` farther. A difference of `1 / of_scale`
    /// has half the weight.
    fn step_row(far: [&[f32]; 3], near: &[f32], place: [f32; 2], of_scale: f32) -> StepSums = step_generic
}

#[inline(always)]
fn step_generic<L: Lanes>(far: [&[f32]; 3], near: &[f32], place: [f32; 2], of_scale: f32) -> StepSums {
    let mut sums = [L::splat(0.0); SUMS];
    let width = near.len();
    let whole = width - width % L::N;
    // SAFETY: a constant of `MAX_LANES`.
    let columns = unsafe { L::load(COLUMNS.as_ptr()) };
    let every = L::splat(1.0);
    for left in (0..whole).step_by(L::N) {
        let rows =
            [&far[0][left..left + L::N + 2], &far[1][left..left + L::N + 2], &far[2][left..left + L::N + 2]];
        let x = columns.add(L::splat(left as f32)).mul_add(L::splat(place[1]), L::splat(place[0]));
        add_columns::<L>(rows, &near[left..left + L::N], x, of_scale, every, &mut sums);
    }
    if whole < width {
        let rest = width - whole;
        let (mut rows, mut last, mut present) =
            ([[0.0; MAX_LANES + 2]; 3], [0.0; MAX_LANES], [0.0; MAX_LANES]);
        for (to, from) in rows.iter_mut().zip(far) {
            to[..rest + 2].copy_from_slice(&from[whole..width + 2]);
        }
        last[..rest].copy_from_slice(&near[whole..]);
        present[..rest].fill(1.0);
        // SAFETY: an array of `MAX_LANES`.
        let present = unsafe { L::load(present.as_ptr()) };
        let x = columns.add(L::splat(whole as f32)).mul_add(L::splat(place[1]), L::splat(place[0]));
        add_columns::<L>([&rows[0], &rows[1], &rows[2]], &last, x, of_scale, present, &mut sums);
    }
    let mut total = [0.0_f64; SUMS];
    for (total, sum) in total.iter_mut().zip(sums) {
        for lane in sum.to_array().into_iter().take(L::N) {
            *total += f64::from(lane);
        }
    }
    let [a, b, c, d, e, f, g, h, i, j, k, l, m, squares] = total;
    StepSums { normal: [[a, b, c], [d, e, f], [g, h, i]], right: [[j, k], [l, m]], squares }
}

/// Adds a vector of columns; `far` are its rows from one column before to one after.
#[inline(always)]
fn add_columns<L: Lanes>(
    far: [&[f32]; 3],
    near: &[f32],
    x: L,
    of_scale: f32,
    present: L,
    sums: &mut [L; SUMS],
) {
    let [above, here, below] = far;
    assert!(above.len() >= L::N + 2 && here.len() >= L::N + 2 && below.len() >= L::N + 2);
    assert!(near.len() >= L::N);
    // SAFETY: the lengths above.
    let [before, middle, after, above, below, near] = unsafe {
        [
            L::load(here.as_ptr()),
            L::load(here.as_ptr().add(1)),
            L::load(here.as_ptr().add(2)),
            L::load(above.as_ptr().add(1)),
            L::load(below.as_ptr().add(1)),
            L::load(near.as_ptr()),
        ]
    };
    let half = L::splat(0.5);
    let (gx, gy) = (after.sub(before).mul(half), below.sub(above).mul(half));
    let difference = near.sub(middle);
    let relative = difference.mul(L::splat(of_scale));
    let weight = relative.mul_add(relative, L::splat(1.0)).reciprocal().mul(present);
    let (wx, wy) = (weight.mul(gx), weight.mul(gy));
    let (wx_x, wy_x) = (wx.mul(x), wy.mul(x));
    let (gx_x, gy_x) = (gx.mul(x), gy.mul(x));
    let products = [
        (wx, gx),
        (wx_x, gx),
        (wx_x, gx_x),
        (wx, gy),
        (wx_x, gy),
        (wx_x, gy_x),
        (wy, gy),
        (wy_x, gy),
        (wy_x, gy_x),
        (wx, difference),
        (wx_x, difference),
        (wy, difference),
        (wy_x, difference),
        (weight.mul(difference), difference),
    ];
    for i in 0..SUMS {
        let (a, b) = products[i];
        sums[i] = a.mul_add(b, sums[i]);
    }
}

dispatch! {
    /// Sums of the products of two rows, and of the squares of each.
    fn products(a: &[f32], b: &[f32]) -> [f64; 3] = products_generic
}

#[inline(always)]
fn products_generic<L: Lanes>(a: &[f32], b: &[f32]) -> [f64; 3] {
    let (a, b) = (a, &b[..a.len()]);
    let mut sums = [[0.0_f32; MAX_LANES]; 3];
    let whole = a.len() - a.len() % MAX_LANES;
    for left in (0..whole).step_by(MAX_LANES) {
        let (a, b) = (&a[left..left + MAX_LANES], &b[left..left + MAX_LANES]);
        for i in 0..MAX_LANES {
            sums[0][i] += a[i] * b[i];
            sums[1][i] += a[i] * a[i];
            sums[2][i] += b[i] * b[i];
        }
    }
    for x in whole..a.len() {
        sums[0][0] += a[x] * b[x];
        sums[1][0] += a[x] * a[x];
        sums[2][0] += b[x] * b[x];
    }
    let mut total = [0.0_f64; 3];
    for (total, lanes) in total.iter_mut().zip(sums) {
        for lane in lanes {
            *total += f64::from(lane);
        }
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Backend, weigh_rows};

    fn value(seed: usize, x: usize) -> f32 {
        ((seed + x * x * 104_729 + x * 31) % 101) as f32 / 101.0 - 0.5
    }

    fn row(seed: usize, length: usize) -> Vec<f32> {
        (0..length).map(|x| value(seed, x)).collect()
    }

    #[test]
    fn the_sums_of_a_step_are_those_of_each_column() {
        for backend in Backend::available() {
            for width in [1, 7, 16, 45] {
                let far = [1, 40, 77].map(|seed| row(seed, width + 2));
                let near = row(4, width);
                let [first, step, of_scale] = [-0.7_f32, 0.03, 1.5];
                let found =
                    step_row(backend, far.each_ref().map(|row| &row[..]), &near, [first, step], of_scale);
                let (mut normal, mut right, mut squares) = ([[0.0_f64; 3]; 3], [[0.0_f64; 2]; 2], 0.0_f64);
                for i in 0..width {
                    let at = |row: usize, column: usize| f64::from(far[row][column]);
                    let gradient = [0.5 * (at(1, i + 2) - at(1, i)), 0.5 * (at(2, i + 1) - at(0, i + 1))];
                    let difference = f64::from(near[i]) - at(1, i + 1);
                    let weight = 1.0 / (1.0 + (difference * f64::from(of_scale)).powi(2));
                    let x = f64::from(first) + f64::from(step) * i as f64;
                    for (a, b) in [(0, 0), (0, 1), (1, 1)] {
                        for power in 0..3 {
                            normal[a + b][power] += weight * gradient[a] * gradient[b] * x.powi(power as i32);
                        }
                    }
                    for axis in 0..2 {
                        for power in 0..2 {
                            right[axis][power] += weight * gradient[axis] * difference * x.powi(power as i32);
                        }
                    }
                    squares += weight * difference * difference;
                }
                let expected = normal.as_flattened().iter().chain(right.as_flattened()).chain([&squares]);
                let found = found
                    .normal
                    .as_flattened()
                    .iter()
                    .chain(found.right.as_flattened())
                    .chain([&found.squares]);
                for (found, expected) in found.zip(expected) {
                    // Sums of single precision below 50.
                    assert!((found - expected).abs() < 1e-5, "{backend:?} {width}: {found} {expected}");
                }
            }
        }
    }

    #[test]
    fn values_between_pixels_are_bilinear() {
        for backend in Backend::available() {
            for width in [1, 16, 37] {
                let rows = [5, 6].map(|seed| row(seed, width + 1));
                let mut found = vec![0.0; width];
                let ([x0, y0], [dx, dy]) = ([0.2, 0.4], [0.01, -0.005]);
                between_rows(backend, rows.each_ref().map(|row| &row[..]), [x0, y0], [dx, dy], &mut found);
                for (i, found) in found.iter().enumerate() {
                    let (x, y) = (x0 + dx * i as f32, y0 + dy * i as f32);
                    let at = |row: usize| rows[row][i] * (1.0 - x) + rows[row][i + 1] * x;
                    let expected = at(0) * (1.0 - y) + at(1) * y;
                    assert!((found - expected).abs() < 1e-6, "{backend:?} {width} {i}: {found} {expected}");
                }
            }
        }
    }

    #[test]
    fn taps_surround_their_place_and_lie_outside_for_places_that_are_not_numbers() {
        let places = [
            -1e300,
            -17.0,
            f64::NEG_INFINITY,
            f64::NAN,
            -0.6,
            -1e-17,
            0.0,
            2.25,
            40.999_9,
            1e12,
            f64::INFINITY,
        ];
        for backend in Backend::available() {
            for width in [1, 11, 37] {
                let places: Vec<f64> = places.iter().copied().cycle().take(width).collect();
                let (mut first, mut phase) = (vec![0; width], vec![0; width]);
                find_taps(backend, &places, 512.0, &mut first, &mut phase);
                for ((place, first), phase) in places.iter().zip(first).zip(phase) {
                    assert!((0..=512).contains(&phase), "{backend:?} {place}: {phase}");
                    if (-16.0..1e9).contains(place) {
                        assert_eq!(f64::from(first), place.floor() - 2.0, "{backend:?} {place}");
                        assert!((f64::from(phase) / 512.0 - (place - place.floor())).abs() <= 0.5 / 512.0);
                    } else {
                        assert!(!(0..=900_000_000).contains(&first), "{backend:?} {place}: {first}");
                    }
                }
            }
        }
    }

    #[test]
    fn rows_are_weighed_and_divided() {
        for backend in Backend::available() {
            for width in [1, 16, 37] {
                let rows = [1, 2, 3, 4, 5, 6].map(|seed| row(10 * seed, width));
                let weights = [0.5, -0.25, 1.0, 2.0, 0.125, -1.5];
                let mut sum = vec![0.0; width];
                weigh_rows(backend, rows.each_ref().map(|row| &row[..]), weights, &mut sum);
                let mut quotient: Vec<f32> = rows[1].iter().map(|value| value + 1.0).collect();
                divide_by_root(backend, &rows[0], 0.5, &mut quotient);
                let coefficients = [1.0, 0.2, -0.1, 0.3, -0.05];
                let [mut divided, mut multiplied] = [rows[0].clone(), rows[0].clone()];
                divide_by_polynomial(backend, coefficients, [-0.8, 0.04], false, &mut divided);
                divide_by_polynomial(backend, coefficients, [-0.8, 0.04], true, &mut multiplied);
                for x in 0..width {
                    let u = -0.8 + 0.04 * x as f64;
                    let gain: f64 =
                        coefficients.iter().enumerate().map(|(i, c)| f64::from(*c) * u.powi(i as i32)).sum();
                    let value = f64::from(rows[0][x]);
                    let expected = [
                        rows.iter().zip(weights).map(|(row, weight)| f64::from(row[x] * weight)).sum(),
                        value / f64::from(rows[1][x] + 1.5).sqrt(),
                        value / gain,
                        value * gain,
                    ];
                    let found = [sum[x], quotient[x], divided[x], multiplied[x]];
                    for (found, expected) in found.into_iter().zip(expected) {
                        assert!(
                            (f64::from(found) - expected).abs() < 1e-5,
                            "{backend:?} {width} {x}: {found} {expected}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn products_are_those_of_each_column() {
        for backend in Backend::available() {
            for width in [3, 16, 45] {
                let [a, b] = [7, 8].map(|seed| row(seed, width));
                let sum = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
                let expected = [sum(&a, &b), sum(&a, &a), sum(&b, &b)];
                for (found, expected) in products(backend, &a, &b).into_iter().zip(expected) {
                    assert!((found - expected).abs() < 1e-6, "{backend:?} {width}: {found} {expected}");
                }
            }
        }
    }
}
