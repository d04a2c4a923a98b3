//! What the baselines share: checking and normalising a pair, separable filters, and turning their evidence into a map.

use ndarray::{Array2, ArrayView2, Zip};

use crate::metrics::dilate_square;
use crate::optics::Optics;
use crate::psf::Psf;
use crate::run::{
    DepthMap, MAX_ALPHA, MAX_SMOOTHING_PX, MIN_SIDE_PX, RunError, Settings, Warning, confidence,
};

/// A checked pair, each image divided by its mean; pixels without a value hold the mean.
pub(super) struct Pair {
    pub far: Array2<f32>,
    pub near: Array2<f32>,
    holes: Option<Array2<bool>>,
}

/// What a method found out, each (height, width).
pub(super) struct Evidence {
    /// Normalised depth; NaN where there is none.
    pub alpha: Array2<f32>,
    /// Energy of the texture that it rests on.
    pub texture: Array2<f32>,
    /// Part of the evidence that contradicts it, 0 = none.
    pub misfit: Array2<f32>,
    /// Pixels that a result depends on in each direction.
    pub reach_px: usize,
}

impl Pair {
    pub(super) fn new(
        far: ArrayView2<f32>,
        near: ArrayView2<f32>,
        settings: &Settings,
    ) -> Result<Self, RunError> {
        let (height, width) = far.dim();
        let (near_height, near_width) = near.dim();
        if (near_height, near_width) != (height, width) {
            return Err(RunError::SizeMismatch {
                far_width: width,
                far_height: height,
                near_width,
                near_height,
            });
        }
        if height < MIN_SIDE_PX || width < MIN_SIDE_PX {
            return Err(RunError::TooSmall { width, height });
        }
        for (what, size, largest) in
            [("smoothing", settings.smoothing_px, MAX_SMOOTHING_PX), ("median", settings.median_px, 7)]
        {
            if size % 2 == 0 || size > largest {
                return Err(RunError::Window { what, size, largest });
            }
        }
        let mut holes = Array2::from_elem((height, width), false);
        Zip::from(&mut holes).and(far).and(near).for_each(|hole, far, near| {
            *hole = !(far.is_finite() && near.is_finite());
        });
        let missing = holes.iter().filter(|hole| **hole).count();
        if missing == height * width {
            return Err(RunError::NothingFinite);
        }
        let normalise = |which, image: ArrayView2<f32>| {
            let valid = || image.iter().zip(&holes).filter(|(_, hole)| !**hole).map(|(value, _)| *value);
            let first = valid().next().unwrap_or(0.0);
            if valid().all(|value| value == first) {
                return Err(RunError::Constant { which, value: first });
            }
            let count = (height * width - missing) as f64;
            let mean = valid().map(f64::from).sum::<f64>() / count;
            // An image may be centred on 0; then its spread is the scale.
            let spread = (valid().map(|v| (f64::from(v) - mean).powi(2)).sum::<f64>() / count).sqrt();
            let scale = if mean.abs() > spread { mean } else { spread };
            let mut normalised = image.mapv(|value| ((f64::from(value) - mean) / scale) as f32);
            Zip::from(&mut normalised).and(&holes).for_each(|value, hole| {
                if *hole {
                    *value = 0.0;
                }
            });
            Ok(normalised)
        };
        let (far, near) = (normalise("far", far)?, normalise("near", near)?);
        Ok(Self { far, near, holes: (missing > 0).then_some(holes) })
    }

    /// The depth map of the evidence.
    pub(super) fn finish(&self, evidence: Evidence, optics: &Optics, settings: &Settings) -> DepthMap {
        let Evidence { alpha, mut texture, misfit, reach_px } = evidence;
        let mut alpha = alpha;
        let mut warnings = Vec::new();
        if let Some(holes) = &self.holes {
            let pixels = holes.iter().filter(|hole| **hole).count();
            warnings.push(Warning::NotFinite { pixels });
            Zip::from(&mut alpha).and(&mut texture).and(&dilate_square(holes, reach_px)).for_each(
                |alpha, texture, near_hole| {
                    if *near_hole {
                        (*alpha, *texture) = (f32::NAN, 0.0);
                    }
                },
            );
        }
        let scale = confidence::texture_scale(texture.view());
        let low = texture.iter().filter(|t| **t < confidence::LOW_TEXTURE * scale).count();
        let low_texture_fraction = low as f64 / texture.len() as f64;
        let mut depth_mm = median(&alpha, settings.median_px);
        let mut values = texture;
        Zip::from(&mut depth_mm).and(&mut values).and(&misfit).for_each(|depth, value, misfit| {
            *value =
                if depth.is_nan() { 0.0 } else { confidence::confidence(*value, misfit.max(0.0), scale) };
            let alpha = depth.clamp(-MAX_ALPHA, MAX_ALPHA);
            *depth = if *value > 0.0 { optics.depth_mm(f64::from(alpha)) as f32 } else { f32::NAN };
        });
        DepthMap { depth_mm, confidence: values, low_texture_fraction, warnings }
    }
}

/// Median over a window of `side` pixels, of the values that are there; a hole stays a hole.
fn median(map: &Array2<f32>, side: usize) -> Array2<f32> {
    let (height, width) = map.dim();
    let reach = side / 2;
    let mut window = Vec::with_capacity(side * side);
    Array2::from_shape_fn((height, width), |(row, column)| {
        if side == 1 || map[(row, column)].is_nan() {
            return map[(row, column)];
        }
        window.clear();
        for y in row.saturating_sub(reach)..(row + reach + 1).min(height) {
            for x in column.saturating_sub(reach)..(column + reach + 1).min(width) {
                window.push(map[(y, x)]);
            }
        }
        window.retain(|value| !value.is_nan());
        let middle = window.len() / 2;
        *window.select_nth_unstable_by(middle, f32::total_cmp).1
    })
}

/// Second moment of the PSF over the square of the blur radius: `sigma^2 = moment R^2`.
pub(super) fn moment(psf: Psf) -> f64 {
    match psf {
        Psf::PillBox => 0.5,
        Psf::Gaussian { k } => 2.0 * k * k,
        Psf::Generalised { p, k } => k * k * p.powf(2.0 / p) * libm::tgamma(4.0 / p) / libm::tgamma(2.0 / p),
    }
}

/// Which way a filter runs.
#[derive(Clone, Copy)]
pub(super) enum Along {
    Rows,
    Columns,
}

/// `image` filtered along one direction by an odd number of taps (`taps[i]` weighs the pixel at `i - half`); borders are
/// reflected without repeating the edge pixel.
pub(super) fn filter(image: &Array2<f32>, taps: &[f32], along: Along) -> Array2<f32> {
    let half = taps.len() / 2;
    let (height, width) = image.dim();
    let mut out = Array2::zeros((height, width));
    match along {
        Along::Rows => {
            let mut padded = vec![0.0; width + 2 * half];
            for (row, mut out) in image.outer_iter().zip(out.outer_iter_mut()) {
                for (i, value) in padded.iter_mut().enumerate() {
                    *value = row[reflect(i as isize - half as isize, width)];
                }
                for (i, tap) in taps.iter().enumerate() {
                    for (out, value) in out.iter_mut().zip(&padded[i..i + width]) {
                        *out += tap * value;
                    }
                }
            }
        }
        Along::Columns => {
            for (y, mut out) in out.outer_iter_mut().enumerate() {
                for (i, tap) in taps.iter().enumerate() {
                    let row = image.row(reflect((y + i) as isize - half as isize, height));
                    for (out, value) in out.iter_mut().zip(row) {
                        *out += tap * value;
                    }
                }
            }
        }
    }
    out
}

fn reflect(index: isize, length: usize) -> usize {
    let last = length as isize - 1;
    let mut index = index;
    while !(0..=last).contains(&index) {
        index = if index < 0 { -index } else { 2 * last - index };
    }
    index as usize
}

/// Along both directions.
pub(super) fn filter_both(image: &Array2<f32>, along_rows: &[f32], along_columns: &[f32]) -> Array2<f32> {
    filter(&filter(image, along_rows, Along::Rows), along_columns, Along::Columns)
}

/// Sums over a square window of `side` pixels.
pub(super) fn window_sum(image: &Array2<f32>, side: usize) -> Array2<f32> {
    let taps = vec![1.0; side];
    filter_both(image, &taps, &taps)
}
