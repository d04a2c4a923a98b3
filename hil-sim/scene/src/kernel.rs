//! PSFs integrated over texture cells and pixels.
//!
//! A texture sample is the centre of a square cell of half a pixel, bilinear in between. Constant cells would alias and
//! make focused images up to 10 % too crisp, a depth error of 0.5 mm at the ends of the working range.
//!
//! Lengths are in cells. A sample of radiance 1 gives the cell at offset `d` the mean
//! `V(d) = integral psf(x, y) B(x - d_x) B(y - d_y) dx dy` with the quadratic B-spline `B` (the triangle of
//! linear interpolation averaged over the cell). A pixel is the mean of its four cells.
//! * Pill-box: the inner integral over y is a polynomial in the disc's height; the outer one over
//!   `x = R sin t` is split at each kink and integrated by Gauss-Legendre to rounding.
//! * Gaussian: closed form in the error function.
//! * Generalised Gaussian: Gauss-Legendre over the smooth parts; near the centre, with its cusp for `p < 2`,
//!   a mixture of discs, `f(r) = integral of -f'(R) [r < R] dR`.
//!
//! Tails below `exp(-12)` of the peak are cut and the kernel is normalised to 1. Cost: 10 us (pill-box, 2.7
//! px) to 1 ms (generalised) a kernel, growing with the square of the radius.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use crate::psf::{Profile, Psf};
use crate::quadrature::{EIGHT, FOUR, integrate};

/// Texture cells per pixel side.
pub const CELLS_PER_PIXEL: usize = 2;

/// Exponent at which Gaussian tails are cut.
const TAIL_EXPONENT: f64 = 12.0;
/// Half the width of the quadratic B-spline, cells.
const SPLINE_REACH: f64 = 1.5;
const KNOTS: [f64; 4] = [-1.5, -0.5, 0.5, 1.5];
/// Blur radius in cells below which the PSF is a point: the kernels differ by less than 1e-6.
const POINT_RADIUS: f64 = 1e-6;

/// Weights `V(d)` for offsets -radius..=radius in both directions, in cells.
#[derive(Debug, Clone, PartialEq)]
pub struct CellKernel {
    /// Largest offset, cells.
    pub radius: usize,
    /// Row-major square of `2 radius + 1` offsets; sums to 1.
    pub weights: Vec<f64>,
}

impl CellKernel {
    /// Kernel of `psf` at the blur radius `blur_px` (>= 0, px).
    #[must_use]
    pub fn new(psf: &Psf, blur_px: f64) -> Self {
        let blur = blur_px * CELLS_PER_PIXEL as f64;
        let reach = Self::reach(psf, blur_px);
        match *psf {
            _ if blur < POINT_RADIUS => Self::from_octant(reach, |x, y| spline(x as f64) * spline(y as f64)),
            Psf::PillBox => Self::from_octant(reach, |x, y| disc_weight(x as f64, y as f64, blur)),
            Psf::Ring { inner } => {
                let covered = inner * blur;
                Self::from_octant(reach, |x, y| {
                    let [x, y] = [x as f64, y as f64];
                    let hidden = if covered < POINT_RADIUS { 0.0 } else { disc_weight(x, y, covered) };
                    disc_weight(x, y, blur) - hidden
                })
            }
            Psf::Gaussian { k } => {
                let line: Vec<f64> = (0..=reach).map(|d| gaussian_line_weight(d as f64, k * blur)).collect();
                Self::from_octant(reach, |x, y| line[x] * line[y])
            }
            Psf::Generalised { p, k } => {
                let profile = Profile { p, sigma: k * blur };
                Self::from_octant(reach, |x, y| profile_weight(x as f64, y as f64, profile))
            }
        }
    }

    /// Largest offset of the kernel of `psf` at `blur_px`, cells.
    #[must_use]
    pub fn reach(psf: &Psf, blur_px: f64) -> usize {
        let blur = blur_px * CELLS_PER_PIXEL as f64;
        let extent = match *psf {
            _ if blur < POINT_RADIUS => 0.0,
            Psf::PillBox | Psf::Ring { .. } => blur,
            Psf::Gaussian { k } => Profile { p: 2.0, sigma: k * blur }.radius_at(TAIL_EXPONENT),
            Psf::Generalised { p, k } => Profile { p, sigma: k * blur }.radius_at(TAIL_EXPONENT),
        };
        // The spline at offset d overlaps the PSF if d - 1.5 < extent.
        (extent + SPLINE_REACH).ceil() as usize - 1
    }

    /// Mirrors the octant `0 <= y <= x`, as every PSF here is radially symmetric.
    fn from_octant(radius: usize, weight: impl Fn(usize, usize) -> f64) -> Self {
        let side = 2 * radius + 1;
        let mut weights = vec![0.0; side * side];
        for x in 0..=radius {
            for y in 0..=x {
                let value = weight(x, y);
                for (column, row) in [(x, y), (y, x)] {
                    for column in [radius - column, radius + column] {
                        for row in [radius - row, radius + row] {
                            weights[row * side + column] = value;
                        }
                    }
                }
            }
        }
        let total: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= total);
        Self { radius, weights }
    }

    /// Weight at an offset in cells, 0 outside.
    #[must_use]
    pub fn at(&self, row: isize, column: isize) -> f64 {
        let radius = self.radius as isize;
        if row.abs() > radius || column.abs() > radius {
            return 0.0;
        }
        let side = 2 * radius + 1;
        self.weights[((row + radius) * side + column + radius) as usize]
    }

    /// Weight of a cell on a pixel whose first cell is `row`, `column` cells further down and right.
    #[must_use]
    pub fn on_pixel(&self, row: isize, column: isize) -> f64 {
        0.25 * (self.at(row, column)
            + self.at(row + 1, column)
            + self.at(row, column + 1)
            + self.at(row + 1, column + 1))
    }
}

fn spline(t: f64) -> f64 {
    let t = t.abs();
    if t < 0.5 { 0.75 - t * t } else { 0.5 * (SPLINE_REACH - t).max(0.0).powi(2) }
}

fn spline_integral(t: f64) -> f64 {
    let tail = |t: f64| (SPLINE_REACH - t).max(0.0).powi(3) / 6.0;
    if t <= -0.5 {
        tail(-t)
    } else if t < 0.5 {
        0.5 + 0.75 * t - t.powi(3) / 3.0
    } else {
        1.0 - tail(t)
    }
}

fn disc_weight(x: f64, y: f64, radius: f64) -> f64 {
    let nearest = (x.abs() - SPLINE_REACH).max(0.0).hypot((y.abs() - SPLINE_REACH).max(0.0));
    if nearest >= radius {
        return 0.0;
    }
    if (x.abs() + SPLINE_REACH).hypot(y.abs() + SPLINE_REACH) <= radius {
        return 1.0;
    }
    let angle = |position: f64| libm::asin((position / radius).clamp(-1.0, 1.0));
    // Columns of the disc at radius * sin(t), cut where the spline or the disc's border crosses a knot.
    let mut cuts = KNOTS.map(|knot| angle(x + knot)).to_vec();
    let (start, end) = (cuts[0], cuts[3]);
    for edge in KNOTS.map(|knot| y + knot) {
        if edge.abs() < radius {
            let crossing = angle((radius * radius - edge * edge).sqrt());
            cuts.extend([crossing, -crossing].map(|cut| cut.clamp(start, end)));
        }
    }
    cuts.sort_by(f64::total_cmp);
    let column = |t: f64| {
        let height = radius * libm::cos(t);
        let inside = spline_integral(height - y) - spline_integral(-height - y);
        spline(radius * libm::sin(t) - x) * inside * height
    };
    cuts.windows(2)
        .filter(|piece| piece[1] > piece[0])
        .map(|piece| integrate(&EIGHT, piece[0], piece[1], column))
        .sum()
}

fn gaussian_line_weight(d: f64, sigma: f64) -> f64 {
    // The spline is the third difference of a half parabola; its mean under the Gaussian, without the
    // quadratic polynomial that the difference removes.
    let half_parabola = |a: f64| {
        let z = a / sigma;
        let bell = sigma * libm::exp(-0.5 * z * z) / (2.0 * PI).sqrt();
        0.5 * ((a * a + sigma * sigma) * 0.5 * libm::erf(z * FRAC_1_SQRT_2) + a * bell)
    };
    let [a, b, c, e] = KNOTS.map(|knot| half_parabola(d + knot));
    (e - a) - 3.0 * (c - b)
}

fn profile_weight(x: f64, y: f64, profile: Profile) -> f64 {
    // Scale of the profile: the flanks of a large p are steeper than sigma.
    let smooth = profile.sigma / profile.p.max(1.0) > 0.8;
    if !smooth || x.max(y) < 2.0 {
        return mixture_weight(x, y, profile);
    }
    let peak = profile.peak();
    let density = |r2: f64| {
        peak * libm::exp(-libm::pow(r2 / (profile.sigma * profile.sigma), 0.5 * profile.p) / profile.p)
    };
    let pieces = |at: f64| KNOTS[..3].iter().map(move |knot| at + knot);
    pieces(x)
        .map(|left| {
            integrate(&FOUR, left, left + 1.0, |u| {
                let line =
                    |low: f64| integrate(&FOUR, low, low + 1.0, |v| spline(v - y) * density(u * u + v * v));
                spline(u - x) * pieces(y).map(line).sum::<f64>()
            })
        })
        .sum()
}

/// [`profile_weight`] as a mixture of discs; discs that hold the whole support sum to `f` at its far corner.
fn mixture_weight(x: f64, y: f64, profile: Profile) -> f64 {
    let nearest = (x - SPLINE_REACH).max(0.0).hypot((y - SPLINE_REACH).max(0.0));
    let farthest = (x + SPLINE_REACH).hypot(y + SPLINE_REACH);
    let outermost = farthest.min(profile.radius_at(30.0)).max(nearest);
    // Panel borders: where the disc meets the spline's pieces, and where the profile bends.
    let mut radii = vec![nearest, outermost];
    for u in KNOTS.map(|knot| x + knot) {
        for v in KNOTS.map(|knot| y + knot) {
            radii.extend([u.hypot(v), u.abs(), v.abs()]);
        }
    }
    let bends = [1e-5, 1e-3, 0.02, 0.1, 0.3, 0.7, 1.2, 2.0, 3.0, 5.0, 8.0, 12.0, 18.0];
    radii.extend(bends.map(|exponent| profile.radius_at(exponent)));
    radii.retain(|&radius| radius >= nearest && radius <= outermost);
    radii.sort_by(f64::total_cmp);
    let within: f64 = radii
        .windows(2)
        .filter(|panel| panel[1] > panel[0])
        .map(|panel| {
            integrate(&EIGHT, panel[0], panel[1], |radius| {
                let slope = libm::pow(radius / profile.sigma, profile.p - 1.0) / profile.sigma;
                profile.density(radius) * slope * disc_weight(x, y, radius)
            })
        })
        .sum();
    within + profile.density(farthest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const PSFS: [&str; 7] = [
        "pillbox",
        "ring:inner=0.6",
        "gaussian:k=0.4578",
        "generalised:p=1.8,k=0.4802",
        "generalised:p=0.7,k=0.2",
        "generalised:p=8,k=0.7",
        "generalised:p=64,k=0.95",
    ];

    #[test]
    fn weights_sum_to_one_before_normalisation() {
        // Splines at all cells sum to 1, so the weights sum to the PSF's integral.
        for radius in [0.01f64, 0.3, 1.0, 5.4, 23.0] {
            let reach = (radius + 1.5).ceil() as i32;
            let offsets =
                || (-reach..=reach).flat_map(|x| (-reach..=reach).map(move |y| (f64::from(x), f64::from(y))));
            let disc: f64 =
                offsets().map(|(x, y)| disc_weight(x, y, radius)).sum::<f64>() / (PI * radius * radius);
            assert!((disc - 1.0).abs() < 1e-9, "disc of {radius}: {disc}");
        }
        for (p, sigma) in [
            (1.8, 0.05),
            (1.8, 0.7),
            (1.8, 2.6),
            (0.7, 0.5),
            (0.7, 3.0),
            (8.0, 0.4),
            (8.0, 9.0),
            (64.0, 1.0),
            (64.0, 4.0),
        ] {
            let profile = Profile { p, sigma };
            let reach = profile.radius_at(26.0).ceil() as i32 + 2;
            let octant = (0..=reach).flat_map(|x| (0..=x).map(move |y| (x, y)));
            let sum: f64 = octant
                .map(|(x, y)| {
                    let mirrors = [x > 0, y > 0, x != y].into_iter().filter(|mirrored| *mirrored).count();
                    f64::from(1_i32 << mirrors) * profile_weight(f64::from(x), f64::from(y), profile)
                })
                .sum();
            assert!((sum - 1.0).abs() < 1e-6, "p {p} sigma {sigma}: {sum}");
        }
        for sigma in [0.02, 0.5, 2.5] {
            let sum: f64 = (-40..=40).map(|d| gaussian_line_weight(f64::from(d), sigma)).sum();
            assert!((sum - 1.0).abs() < 1e-12, "sigma {sigma}: {sum}");
        }
    }

    #[test]
    fn pixel_weights_agree_with_monte_carlo() {
        // Monte Carlo: the share of points on a pixel is its weight.
        const THROWS: u32 = 2_000_000;
        let mut random = ChaCha8Rng::seed_from_u64(3);
        for (radius_px, cell) in [(2.703, 0.0), (0.8, 0.5), (0.2, 0.0)] {
            let kernel = CellKernel::new(&Psf::PillBox, radius_px);
            let mut hits = std::collections::BTreeMap::new();
            for _ in 0..THROWS {
                // Uniform on the disc by rejection, independent of the kernel's formulas.
                let (x, y) = loop {
                    let (x, y): (f64, f64) = (random.random_range(-1.0..1.0), random.random_range(-1.0..1.0));
                    if x * x + y * y <= 1.0 {
                        break (x * radius_px, y * radius_px);
                    }
                };
                // The triangle of linear interpolation: two uniform steps.
                let mut hat =
                    || 0.25 + random.random_range(-0.25..0.25) + random.random_range(-0.25..0.25f64);
                let pixel = ((x + hat() + cell).floor() as isize, (y + hat() + cell).floor() as isize);
                *hits.entry(pixel).or_insert(0u32) += 1;
            }
            let first_cell = if cell > 0.0 { 1 } else { 0 };
            for row in -4..=4 {
                for column in -4..=4 {
                    let share = f64::from(*hits.get(&(row, column)).unwrap_or(&0)) / f64::from(THROWS);
                    // A pixel is the mean of four cells, so their weights on a pixel sum to 1.
                    let weight = 4.0 * kernel.on_pixel(2 * row - first_cell, 2 * column - first_cell);
                    let deviation = (weight.max(1e-7) / f64::from(THROWS)).sqrt();
                    assert!(
                        (share - weight).abs() < 5.0 * deviation,
                        "{radius_px} {row} {column}: {share} {weight}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_mixture_of_discs_agrees_with_direct_quadrature_and_the_closed_gaussian() {
        let sigma = 2.4;
        let profile = Profile { p: 2.0, sigma };
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (3.0, 1.0), (6.0, 5.0)] {
            let closed = gaussian_line_weight(x, sigma) * gaussian_line_weight(y, sigma);
            assert!((mixture_weight(x, y, profile) - closed).abs() < 1e-9, "{x} {y}");
            assert!((profile_weight(x, y, profile) - closed).abs() < 1e-9, "{x} {y}");
        }
    }

    #[test]
    fn second_moment_is_the_psfs_plus_that_of_the_spline() {
        // The spline adds 1/4 in each direction; sampling at cells adds a ripple that fades with the blur.
        for text in PSFS {
            let psf: Psf = text.parse().unwrap();
            let (blur_px, cells) = (2.703, CELLS_PER_PIXEL as f64);
            let kernel = CellKernel::new(&psf, blur_px);
            let reach = kernel.radius as isize;
            let moment: f64 = (-reach..=reach)
                .flat_map(|row| (-reach..=reach).map(move |column| (row, column)))
                .map(|(row, column)| kernel.at(row, column) * (row * row + column * column) as f64)
                .sum();
            let expected = psf.second_moment(blur_px) * cells * cells + 2.0 / 4.0;
            // The cut tail holds 1e-5 of a Gaussian, but 4e-4 for p = 0.7.
            let tolerance = if text.contains("p=0.7") { 1e-2 } else { 2e-3 };
            assert!((moment / expected - 1.0).abs() < tolerance, "{text}: {moment} {expected}");
        }
    }

    #[test]
    fn no_blur_is_the_spline_and_tiny_blur_is_close_to_it() {
        for text in PSFS {
            let psf: Psf = text.parse().unwrap();
            let point = CellKernel::new(&psf, 0.0);
            // An eighth, three quarters and an eighth of the spline in each direction.
            assert_eq!(
                (point.radius, point.at(0, 0), point.at(1, 0), point.at(-1, 1)),
                (1, 0.5625, 0.09375, 0.015625)
            );
            assert!((CellKernel::new(&psf, 1e-4).at(0, 0) - 0.5625).abs() < 1e-6, "{text}");
        }
    }
}
