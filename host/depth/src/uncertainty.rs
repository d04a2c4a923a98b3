//! Standard deviation of each pixel's depth, from the noise of the camera.
//!
//! The run time solves `sum p1 (m - p1 alpha - p2 alpha^3) = 0` over a window. Independent pixel noise `n` of variance
//! `s^2` changes `m - p1 alpha - p2 alpha^3` by `r = K2 * n2 + K1 * n1`, where
//! `K2 = Q * (Gm1 - alpha Gp1 - alpha^3 Gp2)` and `K1` has the sign of `Gm1` changed. To first order
//!
//! `var(alpha) = sum sum p1(y) p1(y') cov(r(y), r(y')) / (c1 + 3 c3 alpha^2)^2`,
//! `cov(r(y), r(y + d)) = 2 s^2 (A_mm + alpha^2 A_11 + 2 alpha^4 A_12 + alpha^6 A_22)(d)`
//!
//! with `A_ij` the correlations of the filters `Q * Gm1`, `Q * Gp1`, `Q * Gp2`; the mixed terms with `Gm1` cancel
//! between the images. The double sum is a sum over lags `d` of `A(d)` times the window sum of `p1(y) p1(y + d)`. The
//! final median lowers the deviation further ([`median_gain`]). Shot noise makes `s^2` a function of brightness
//! ([`Noise::Camera`]); for an unknown camera the fits' residuals give it ([`Noise::Estimated`]), with model errors.
//! Cost: (2 w - 1)^2 / 2 lags of a product, a window sum and four multiply-adds per pixel, about 30 ms for 640x480 and
//! w = 7 on one core.

use ndarray::{Array2, ArrayView2, Zip, s};
use serde::{Deserialize, Serialize};

use crate::border::reflect;
use crate::cubic::root;
use crate::filter::convolve;
use crate::kernel::Kernel;
use crate::operators::{Operators, linearise};
use crate::optics::Optics;
use crate::pipeline::{Processor, RunError, Settings};
use crate::simd::{Backend, Lag, lagged_products};

/// The noise of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Noise {
    /// Variance `constant + per_unit x value`, in the units of the images.
    Camera {
        /// Read noise and quantisation.
        constant: f64,
        /// Shot noise.
        per_unit: f64,
    },
    /// One variance for the whole image, from the misfit of the windows.
    Estimated,
}

impl Noise {
    /// Shot noise, read noise and quantisation (1/12) of a camera with `full_well_e` electrons at the code `max_code`.
    pub fn camera(full_well_e: f64, read_noise_e: f64, max_code: f64) -> Self {
        let code_per_electron = max_code / full_well_e;
        Self::Camera {
            constant: (read_noise_e * code_per_electron).powi(2) + 1.0 / 12.0,
            per_unit: code_per_electron,
        }
    }
}

/// Factor of a `size` x `size` median on the standard deviation, weak because its pixels share most windows. Measured
/// on planes of sand texture (7x7 operators, smoothing 7).
pub fn median_gain(size: usize) -> f64 {
    match size {
        1 => 1.0,
        3 => 0.97,
        5 => 0.92,
        _ => 0.86,
    }
}

/// Standard deviation of depth, mm, (height, width); NaN if unknown. Errors as [`crate::pipeline::depth_from_pair`].
pub fn standard_deviation_mm(
    far: ArrayView2<f32>,
    near: ArrayView2<f32>,
    operators: &Operators,
    optics: &Optics,
    settings: &Settings,
    noise: Noise,
) -> Result<Array2<f32>, RunError> {
    // The run's checks; its depth is unused, because alpha is needed before median and border.
    Processor::new(operators, optics, settings)?.run(far, near)?;
    let backend = settings.backend.unwrap_or_else(Backend::best);
    let filtered = |image: &Array2<f32>, kernel: &Kernel| {
        let mut output = Array2::zeros(image.dim());
        convolve(image.view(), kernel, backend, output.view_mut());
        output
    };
    let prefiltered = |image: Array2<f32>| filtered(&image, operators.prefilter());
    let [difference, sum] = [&near - &far, &near + &far].map(prefiltered);
    let m = filtered(&difference, operators.gm1());
    let [p1, p2] = [operators.gp1(), operators.gp2()].map(|kernel| filtered(&sum, kernel));
    let window = settings.smoothing_px;
    let sums = |a: &Array2<f32>, b: &Array2<f32>| window_sums(&(a * b), window);
    let [c1, c3, c0, energy] = [sums(&p1, &p1), sums(&p1, &p2), sums(&p1, &m), sums(&m, &m)];
    let alpha =
        Zip::from(&c0).and(&c1).and(&c3).map_collect(|c0, c1, c3| root(*c0, c1.max(f32::MIN_POSITIVE), *c3));
    let correlations = Correlations::new(operators, window);
    let variance = pixel_variance(noise, [far, near], &alpha, [&c1, &c0, &energy], &correlations, window);
    let spread = lagged_sums(&p1, &correlations, window, backend);
    let gain = median_gain(settings.median_px);
    let depth = |a: f64| {
        let straight = linearise::value(operators.linearisation(), a);
        linearise::slope(operators.linearisation(), a) * optics.depth_per_alpha_mm(straight)
    };
    let mut deviation = Array2::from_elem(far.dim(), f32::NAN);
    let pixels = alpha.iter().zip(&c1).zip(&c3).zip(&variance).zip(spread.values());
    for (deviation, ((((alpha, c1), c3), variance), spread)) in deviation.iter_mut().zip(pixels) {
        let a = f64::from(*alpha);
        let slope = f64::from(*c1) + 3.0 * f64::from(*c3) * a * a;
        let variance_of_sum = 2.0 * variance * with_alpha(spread, a);
        if slope > 0.0 {
            let of_alpha = gain * variance_of_sum.max(0.0).sqrt() / slope;
            *deviation = (of_alpha * depth(a)).abs() as f32;
        }
    }
    Ok(deviation)
}

fn with_alpha([mm, p11, p12, p22]: [f64; 4], alpha: f64) -> f64 {
    let square = alpha * alpha;
    mm + square * (p11 + square * (2.0 * p12 + square * p22))
}

/// `[A_mm, A_11, A_12, A_22]` of the filters for each lag of the window's half plane.
struct Correlations {
    /// Lags (dy, dx) with dy > 0 or dy = 0 and dx >= 0; the other half mirrors them.
    lags: Vec<([isize; 2], [f64; 4])>,
}

impl Correlations {
    fn new(operators: &Operators, window: usize) -> Self {
        let reach = window as isize - 1;
        let filters = [operators.gm1(), operators.gp1(), operators.gp2()]
            .map(|k| full_convolution(operators.prefilter(), k));
        let correlation = |a: &Array2<f64>, b: &Array2<f64>, [dy, dx]: [isize; 2]| -> f64 {
            a.indexed_iter()
                .filter_map(|((y, x), value)| {
                    let at = (y.checked_add_signed(dy)?, x.checked_add_signed(dx)?);
                    Some(value * b.get(at)?)
                })
                .sum()
        };
        let lags = (0..=reach)
            .flat_map(|dy| (-reach..=reach).map(move |dx| [dy, dx]))
            .filter(|[dy, dx]| *dy > 0 || *dx >= 0)
            .map(|lag| {
                let [m, p1, p2] = &filters;
                // The filters are symmetric, so A_12 is the same in both orders.
                (lag, [(m, m), (p1, p1), (p1, p2), (p2, p2)].map(|(a, b)| correlation(a, b, lag)))
            })
            .collect();
        Self { lags }
    }

    fn at_zero(&self) -> [f64; 4] {
        self.lags[0].1
    }
}

fn full_convolution(a: &Kernel, b: &Kernel) -> Array2<f64> {
    let [ra, rb] = [a, b].map(|k| (k.size() / 2) as isize);
    let size = (2 * (ra + rb) + 1) as usize;
    Array2::from_shape_fn((size, size), |(y, x)| {
        let [y, x] = [y, x].map(|i| i as isize - ra - rb);
        let taps = (-ra..=ra).flat_map(|dy| (-ra..=ra).map(move |dx| (dy, dx)));
        taps.map(|(dy, dx)| a.at(dx, dy) * b.at(x - dx, y - dy)).sum()
    })
}

/// Per pixel: window sums of `p1(y) p1(y + d)` times the correlations at `d`, over all lags.
struct Spread([Array2<f32>; 4]);

impl Spread {
    fn values(&self) -> impl Iterator<Item = [f64; 4]> {
        let [mm, p11, p12, p22] = &self.0;
        mm.iter().zip(p11).zip(p12).zip(p22).map(|(((a, b), c), d)| [*a, *b, *c, *d].map(f64::from))
    }
}

/// A pair of rows `dy` apart contributes to the windows that hold both. In the window with lower end `top + 2 r`, the
/// row `top` has all pairs with `dy` up to the last row. So as `dy` grows, one window after another is completed.
fn lagged_sums(p1: &Array2<f32>, correlations: &Correlations, window: usize, backend: Backend) -> Spread {
    let (height, width) = p1.dim();
    let border = (window / 2) as isize;
    let padded = Array2::from_shape_fn((height + window - 1, width + window - 1), |(y, x)| {
        p1[(reflect(y as isize - border, height), reflect(x as isize - border, width))]
    });
    let mut lags: Vec<Vec<Lag>> = vec![Vec::new(); window];
    for ([dy, dx], factors) in &correlations.lags {
        // Both d and -d.
        let count = if [*dy, *dx] == [0, 0] { 1.0 } else { 2.0 };
        lags[*dy as usize].push((*dx, factors.map(|factor| (count * factor) as f32)));
    }
    let mut spread = [(); 4].map(|()| Array2::zeros(p1.dim()));
    let mut sums = [(); 4].map(|()| vec![0.0; width]);
    let mut work = vec![0.0; 2 * padded.ncols()];
    for top in 0..padded.nrows() {
        sums.iter_mut().for_each(|row| row.fill(0.0));
        for (dy, lags) in lags.iter().enumerate().take(padded.nrows() - top) {
            let rows = [top, top + dy].map(|y| padded.row(y));
            let [Some(upper), Some(lower)] = rows.each_ref().map(|row| row.as_slice()) else {
                unreachable!("made in standard layout");
            };
            lagged_products(backend, upper, lower, lags, window, &mut work, &mut sums);
            // The window that ends with row `top + dy`.
            if let Some(y) = (top + dy).checked_sub(window - 1) {
                for (map, sums) in spread.iter_mut().zip(&sums) {
                    map.row_mut(y).iter_mut().zip(sums).for_each(|(to, sum)| *to += sum);
                }
            }
        }
    }
    Spread(spread)
}

fn window_sums(image: &Array2<f32>, window: usize) -> Array2<f32> {
    let (height, width) = image.dim();
    let r = (window / 2) as isize;
    let mut horizontal = Array2::zeros((height, width));
    let mut padded = vec![0.0_f32; width + window - 1];
    for (row, mut output) in image.rows().into_iter().zip(horizontal.rows_mut()) {
        padded.iter_mut().enumerate().for_each(|(i, v)| *v = row[reflect(i as isize - r, width)]);
        for from in 0..window {
            output.iter_mut().zip(&padded[from..from + width]).for_each(|(sum, v)| *sum += v);
        }
    }
    let mut sums = Array2::zeros((height, width));
    for y in 0..height {
        for d in -r..=r {
            let source = horizontal.row(reflect(y as isize + d, height));
            let mut target = sums.slice_mut(s![y, ..]);
            target += &source;
        }
    }
    sums
}

fn pixel_variance(
    noise: Noise,
    [far, near]: [ArrayView2<f32>; 2],
    alpha: &Array2<f32>,
    [c1, c0, energy]: [&Array2<f32>; 3],
    correlations: &Correlations,
    window: usize,
) -> Array2<f64> {
    match noise {
        Noise::Camera { constant, per_unit } => {
            // Both images are equally bright around a pixel; the noise follows the window's mean.
            let area = (2 * window * window) as f64;
            let brightness = window_sums(&(&far + &near), window);
            // Below the black level, with read noise only, the line would fall below 0.
            let least = (0.01 * per_unit * per_unit).max(f64::MIN_POSITIVE);
            brightness.mapv(|b| (constant + per_unit * f64::from(b) / area).max(least))
        }
        Noise::Estimated => {
            let area = (window * window) as f64;
            let mut estimates: Vec<f64> = Zip::from(alpha)
                .and(c1)
                .and(c0)
                .and(energy)
                .map_collect(|alpha, c1, c0, energy| {
                    let left_over = f64::from(energy - c0 * c0 / c1.max(f32::MIN_POSITIVE)) / area;
                    left_over / (2.0 * with_alpha(correlations.at_zero(), f64::from(*alpha)))
                })
                .into_iter()
                .filter(|v| v.is_finite())
                .collect();
            let middle = estimates.len() / 2;
            let median = if estimates.is_empty() {
                f64::NAN
            } else {
                *estimates.select_nth_unstable_by(middle, f64::total_cmp).1
            };
            Array2::from_elem(alpha.dim(), median)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_is_the_double_sum_over_the_window() {
        let optics = crate::optics::OpticsFile {
            lens: crate::optics::LensSection {
                focal_length_mm: 50.0,
                aperture_mm: Some(12.8),
                f_number: None,
                telecentric: None,
            },
            sensor: crate::optics::SensorSection { pixel_um: 7.4 },
            focus: crate::optics::FocusSection { far_mm: 933.0, max_blur_px: Some(2.703), near_mm: None },
            psf: "pillbox".parse().unwrap(),
            distortion: None,
            stage: None,
            light: None,
        };
        let operators = Operators::for_optics(&optics.check().unwrap()).unwrap();
        let image = Array2::from_shape_fn((12, 19), |(y, x)| ((37 * y + 11 * x) % 17) as f32 - 8.0);
        for window in [1, 3, 7] {
            let correlations = Correlations::new(&operators, window);
            let spread = lagged_sums(&image, &correlations, window, Backend::best());
            let r = window as isize / 2;
            for (y, x) in [(0, 0), (5, 9), (11, 18), (6, 1)] {
                let at = |dy: isize, dx: isize| {
                    let pixel = (reflect(y as isize + dy, 12), reflect(x as isize + dx, 19));
                    f64::from(image[pixel])
                };
                let window = || (-r..=r).flat_map(|dy| (-r..=r).map(move |dx| [dy, dx]));
                let mut expected = 0.0;
                for [ay, ax] in window() {
                    for [by, bx] in window() {
                        // The list has one of each lag and its opposite.
                        let lag = [by - ay, bx - ax];
                        let found =
                            correlations.lags.iter().find(|(l, _)| *l == lag || *l == lag.map(|d| -d));
                        expected += at(ay, ax) * at(by, bx) * found.unwrap().1[2];
                    }
                }
                let found = f64::from(spread.0[2][(y, x)]);
                assert!((found - expected).abs() < 1e-3 * expected.abs().max(1e-3), "{found} {expected}");
            }
        }
    }

    #[test]
    fn noise_of_a_camera_in_its_codes() {
        let Noise::Camera { constant, per_unit } = Noise::camera(20_000.0, 12.0, 255.0) else {
            unreachable!("made as a camera")
        };
        // At 9,000 electrons: sqrt(9,000 + 144) electrons = 1.219 codes, and 1/12 for rounding.
        assert!((constant + per_unit * 114.75 - (1.2192_f64.powi(2) + 1.0 / 12.0)).abs() < 1e-3);
    }
}
