//! An affine map from the pixels of one image to another, and resampling by it. Coordinates are (x, y) in pixels, the
//! centre of the first pixel at (0, 0).

use std::ops::Range;

use ndarray::{Array2, ArrayView2, Axis};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::simd::{self, Backend};

/// Taps of the interpolation along each axis: Lanczos' kernel of three lobes.
const TAPS: usize = 6;

/// Tabulated places between two pixels; the nearest differs by at most 1/1024 px.
const PHASES: usize = 512;

/// `p' = matrix p + shift`: the position in the other image of the object at `p`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Warp {
    /// Row by row, for (x, y).
    pub matrix: [[f64; 2]; 2],
    /// Of (x, y), px.
    pub shift: [f64; 2],
}

impl Warp {
    /// Moves nothing.
    pub const IDENTITY: Self = Self { matrix: [[1.0, 0.0], [0.0, 1.0]], shift: [0.0; 2] };

    /// Magnification, rotation (degrees, x towards y) and shift (px) about the middle of an image of (height, width).
    pub fn about_middle(
        size: (usize, usize),
        magnification: f64,
        rotation_deg: f64,
        shift_px: [f64; 2],
    ) -> Self {
        let (sin, cos) = rotation_deg.to_radians().sin_cos();
        let [c, s] = [magnification * cos, magnification * sin];
        Self::linear_about(middle(size), [[c, -s], [s, c]], shift_px)
    }

    /// `matrix` about `centre`, then the shift.
    pub(crate) fn linear_about([cx, cy]: [f64; 2], matrix: [[f64; 2]; 2], [sx, sy]: [f64; 2]) -> Self {
        let [[a, b], [c, d]] = matrix;
        Self { matrix, shift: [cx - a * cx - b * cy + sx, cy - c * cx - d * cy + sy] }
    }

    /// Position of `[x, y]` in the other image.
    pub fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [[a, b], [c, d]] = self.matrix;
        [a * x + b * y + self.shift[0], c * x + d * y + self.shift[1]]
    }

    /// `first`, then this map.
    pub fn after(&self, first: &Self) -> Self {
        let [[a, b], [c, d]] = self.matrix;
        let [[e, f], [g, h]] = first.matrix;
        Self {
            matrix: [[a * e + b * g, a * f + b * h], [c * e + d * g, c * f + d * h]],
            shift: self.at(first.shift),
        }
    }

    /// The inverse; `None` for a singular map.
    pub fn inverse(&self) -> Option<Self> {
        let [[a, b], [c, d]] = self.matrix;
        let determinant = a * d - b * c;
        if !(determinant.is_finite() && determinant.abs() > 1e-6) {
            return None;
        }
        let matrix = [[d / determinant, -b / determinant], [-c / determinant, a / determinant]];
        let linear = Self { matrix, shift: [0.0; 2] };
        let [x, y] = linear.at(self.shift);
        Some(Self { matrix, shift: [-x, -y] })
    }

    /// The same map between images of half the size, whose pixels are 2x2 of these.
    pub(crate) fn halved(&self) -> Self {
        let [x, y] = self.at([0.5, 0.5]);
        Self { matrix: self.matrix, shift: [0.5 * (x - 0.5), 0.5 * (y - 0.5)] }
    }

    /// The same map between images of twice the size.
    pub(crate) fn doubled(&self) -> Self {
        let linear = Self { matrix: self.matrix, shift: [0.0; 2] };
        let [x, y] = linear.at([0.5, 0.5]);
        Self { matrix: self.matrix, shift: [2.0 * self.shift[0] + 0.5 - x, 2.0 * self.shift[1] + 0.5 - y] }
    }

    /// Shift of the middle of an image of (height, width), px.
    pub fn shift_of_middle_px(&self, size: (usize, usize)) -> [f64; 2] {
        let from = middle(size);
        let to = self.at(from);
        [to[0] - from[0], to[1] - from[1]]
    }

    /// Square root of the magnification of areas.
    pub fn magnification(&self) -> f64 {
        let [[a, b], [c, d]] = self.matrix;
        (a * d - b * c).abs().sqrt()
    }

    /// Rotation in degrees, x towards y.
    pub fn rotation_deg(&self) -> f64 {
        let [[a, b], [c, d]] = self.matrix;
        (c - b).atan2(a + d).to_degrees()
    }

    /// RMS displacement over an image of (height, width), px.
    pub fn rms_px(&self, size: (usize, usize)) -> f64 {
        let [[a, b], [c, d]] = self.matrix;
        let [sx, sy] = self.shift_of_middle_px(size);
        // The mean square of x about its middle is width^2 / 12.
        let [x2, y2] = [size.1, size.0].map(|n| (n as f64).powi(2) / 12.0);
        (sx * sx + sy * sy + ((a - 1.0).powi(2) + c * c) * x2 + (b * b + (d - 1.0).powi(2)) * y2).sqrt()
    }
}

/// The middle of an image of (height, width) as (x, y).
pub(crate) fn middle((height, width): (usize, usize)) -> [f64; 2] {
    [0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0)]
}

/// Weights of the interpolation at each phase; each sums to 1.
struct Lanczos(Vec<[f32; TAPS]>);

impl Lanczos {
    fn new() -> Self {
        let sinc = |x: f64| {
            if x.abs() < 1e-9 { 1.0 } else { (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x) }
        };
        let weights = |phase: usize| {
            let t = phase as f64 / PHASES as f64;
            let raw: [f64; TAPS] = std::array::from_fn(|i| {
                let x = i as f64 - 2.0 - t;
                if x.abs() < 3.0 { sinc(x) * sinc(x / 3.0) } else { 0.0 }
            });
            let sum: f64 = raw.iter().sum();
            raw.map(|w| (w / sum) as f32)
        };
        Self((0..=PHASES).map(weights).collect())
    }
}

/// The image resampled by `warp`: pixel `p` of the result is `image` at `warp(p)`, interpolated by Lanczos' kernel of
/// three lobes, which keeps the operators' frequencies (up to 0.6 of Nyquist) to 2 %. NaN outside and where a NaN pixel
/// has a weight. Cost: 12 multiply-adds per pixel where neighbours lie between the same rows, up to 42 elsewhere; on all
/// threads of the pool.
pub fn resample(image: ArrayView2<f32>, warp: &Warp) -> Array2<f32> {
    resample_by(image, |place| warp.at(place))
}

/// The same through any map of pixels.
pub(crate) fn resample_by(image: ArrayView2<f32>, map: impl Fn([f64; 2]) -> [f64; 2] + Sync) -> Array2<f32> {
    let (height, width) = image.dim();
    let standard = image.as_standard_layout();
    let Some(pixels) = standard.as_slice() else { unreachable!("made in standard layout") };
    let lanczos = Lanczos::new();
    let backend = Backend::best();
    let mut result = Array2::zeros((height, width));
    result.axis_iter_mut(Axis(0)).into_par_iter().enumerate().for_each_init(
        || (Places::new(width), vec![0.0_f32; width]),
        |(places, columns), (y, mut row)| {
            let row = row.as_slice_mut().unwrap_or_default();
            places.of_row(backend, (0..width).map(|x| map([x as f64, y as f64])), (height, width));
            let mut start = 0;
            while start < width {
                let rows = places.rows[start];
                let length = places.rows[start..].iter().take_while(|other| **other == rows).count();
                let part = start..start + length;
                let to = &mut row[part.clone()];
                if rows == Places::AT_BORDER {
                    for (x, to) in part.zip(to) {
                        *to = places.at_border(x, pixels, (height, width), &lanczos);
                    }
                } else {
                    places.along_rows(backend, part, pixels, &lanczos, columns, to);
                }
                start += length;
            }
        },
    );
    result
}

/// Sources of the pixels of a row.
struct Places {
    /// Places in the image, x and y.
    at: [Vec<f64>; 2],
    /// First tap along each axis.
    first: [Vec<i32>; 2],
    phase: [Vec<i32>; 2],
    /// Equal for pixels between the same rows at the same phase, if all taps lie in the image.
    rows: Vec<i32>,
}

impl Places {
    const AT_BORDER: i32 = -1;

    fn new(width: usize) -> Self {
        let integers = || [vec![0; width], vec![0; width]];
        let at = [vec![0.0; width], vec![0.0; width]];
        Self { at, first: integers(), phase: integers(), rows: vec![0; width] }
    }

    fn of_row(
        &mut self,
        backend: Backend,
        places: impl Iterator<Item = [f64; 2]>,
        (height, width): (usize, usize),
    ) {
        let [xs, ys] = &mut self.at;
        for ((place, x), y) in places.zip(xs).zip(ys) {
            [*x, *y] = place;
        }
        for axis in 0..2 {
            let (first, phase) = (&mut self.first[axis], &mut self.phase[axis]);
            simd::find_taps(backend, &self.at[axis], PHASES as f64, first, phase);
        }
        let last = [width, height].map(|n| n as i32 - TAPS as i32);
        let [left, top] = [&self.first[0], &self.first[1]];
        for (((rows, left), top), phase) in self.rows.iter_mut().zip(left).zip(top).zip(&self.phase[1]) {
            let inside = (*left >= 0) & (*top >= 0) & (*left <= last[0]) & (*top <= last[1]);
            *rows = if inside { (*top << 10) | *phase } else { Self::AT_BORDER };
        }
    }

    /// Value near the border: taps beyond it take the nearest pixel. NaN outside.
    fn at_border(&self, x: usize, pixels: &[f32], (height, width): (usize, usize), lanczos: &Lanczos) -> f32 {
        let is_within = |axis: usize, n: usize| (-0.5..=n as f64 - 0.5).contains(&self.at[axis][x]);
        if !(is_within(0, width) && is_within(1, height)) {
            return f32::NAN;
        }
        let [across, down] = [0, 1].map(|axis| &lanczos.0[self.phase[axis][x] as usize]);
        let [left, top] = [0, 1].map(|axis| self.first[axis][x] as isize);
        let inside = |i: isize, n: usize| i.clamp(0, n as isize - 1) as usize;
        let column = |column: isize| -> f32 {
            let at = inside(left + column, width);
            let rows = down.iter().enumerate();
            rows.map(|(row, weight)| weight * pixels[inside(top + row as isize, height) * width + at]).sum()
        };
        across.iter().enumerate().map(|(i, weight)| column(i as isize) * weight).sum()
    }

    /// Values of pixels between the same rows, which are interpolated vertically once for all columns.
    fn along_rows(
        &self,
        backend: Backend,
        part: Range<usize>,
        pixels: &[f32],
        lanczos: &Lanczos,
        columns: &mut [f32],
        to: &mut [f32],
    ) {
        let width = columns.len();
        let (top, phase) = (self.first[1][part.start] as usize, self.phase[1][part.start] as usize);
        let lefts = &self.first[0][part.clone()];
        let (Some(from), Some(last)) = (lefts.iter().min(), lefts.iter().max()) else { return };
        let (from, last) = (*from as usize, *last as usize);
        let columns = &mut columns[..last + TAPS - from];
        let rows: [&[f32]; TAPS] =
            std::array::from_fn(|row| &pixels[(top + row) * width + from..][..columns.len()]);
        simd::weigh_rows(backend, rows, lanczos.0[phase], columns);
        for ((to, left), phase) in to.iter_mut().zip(lefts).zip(&self.phase[0][part]) {
            let at = *left as usize - from;
            let weights = &lanczos.0[*phase as usize];
            *to = columns[at..at + TAPS].iter().zip(weights).map(|(value, weight)| value * weight).sum();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: &Warp, b: &Warp) -> bool {
        let pairs = a.matrix.iter().flatten().chain(&a.shift).zip(b.matrix.iter().flatten().chain(&b.shift));
        pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-9)
    }

    #[test]
    fn a_warp_after_its_inverse_is_the_identity() {
        let warp = Warp::about_middle((480, 640), 1.02, 0.7, [3.0, -5.0]);
        assert!(close(&warp.after(&warp.inverse().unwrap()), &Warp::IDENTITY));
        assert!((warp.magnification() - 1.02).abs() < 1e-12 && (warp.rotation_deg() - 0.7).abs() < 1e-9);
        let [x, y] = warp.shift_of_middle_px((480, 640));
        assert!((x - 3.0).abs() < 1e-9 && (y + 5.0).abs() < 1e-9);
        assert!(close(&warp.halved().doubled(), &warp));
    }

    #[test]
    fn the_root_mean_square_is_that_of_the_pixels() {
        let warp = Warp::about_middle((48, 64), 1.02, 0.7, [0.3, -0.5]);
        let mut sum = 0.0;
        for y in 0..48 {
            for x in 0..64 {
                let to = warp.at([f64::from(x), f64::from(y)]);
                sum += (to[0] - f64::from(x)).powi(2) + (to[1] - f64::from(y)).powi(2);
            }
        }
        // The continuous formula includes half a pixel beyond the outermost centres.
        assert!((warp.rms_px((48, 64)) - (sum / 3072.0).sqrt()).abs() < 1e-3);
    }

    #[test]
    fn a_wave_is_interpolated_between_its_pixels() {
        let wave = |x: f64, y: f64| (1.3 * x + 0.4 * y).sin() + 0.5 * (0.9 * y).cos();
        let image = Array2::from_shape_fn((40, 50), |(y, x)| wave(x as f64, y as f64) as f32);
        let warp = Warp::about_middle((40, 50), 1.01, 0.5, [0.4, 1.3]);
        let seen = resample(image.view(), &warp);
        for ((y, x), value) in seen.indexed_iter() {
            let [px, py] = warp.at([x as f64, y as f64]);
            if (4.0..45.0).contains(&px) && (4.0..35.0).contains(&py) {
                assert!((f64::from(*value) - wave(px, py)).abs() < 0.05, "({x}, {y})");
            }
            if py > 39.5 {
                assert!(value.is_nan());
            }
        }
    }

    #[test]
    fn places_that_are_not_numbers_are_outside() {
        let image = Array2::from_elem((20, 30), 1.0_f32);
        for shift in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for shift in [[shift, 0.0], [0.0, shift]] {
                let seen = resample(image.view(), &Warp { shift, ..Warp::IDENTITY });
                assert!(seen.iter().all(|value| value.is_nan()), "{shift:?}");
            }
        }
    }

    #[test]
    fn a_missing_pixel_affects_only_the_taps_around_it() {
        let mut image = Array2::from_elem((30, 30), 1.0_f32);
        image[(15, 15)] = f32::NAN;
        let seen = resample(image.view(), &Warp { matrix: [[1.0, 0.0], [0.0, 1.0]], shift: [0.5, 0.0] });
        for ((y, x), value) in seen.indexed_iter() {
            assert_eq!(value.is_nan(), (12..=17).contains(&x) && (12..=17).contains(&y), "({x}, {y})");
        }
    }
}
