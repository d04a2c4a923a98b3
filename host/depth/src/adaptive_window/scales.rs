//! The units of filtering: a pair's mean brightness, and its noise relative to it.

use ndarray::{ArrayView1, ArrayView2};
use rayon::prelude::*;

use crate::prepare::noise::PairNoise;

/// Least variance of a pixel, in squared means: above the rounding errors of running sums.
const LEAST_NOISE: f64 = 1e-8;

pub(super) struct Scales {
    pub mean: f32,
    pub gain: f32,
    /// Variance of a pixel of brightness b (in means): `constant + per_unit b`.
    pub noise: [f32; 2],
    pub least_noise: f32,
    /// Part of the variance that is noise of single pixels.
    pub white: f32,
    pub whole: bool,
}

impl Scales {
    pub(super) fn new(far: ArrayView2<f32>, near: ArrayView2<f32>, noise: PairNoise) -> Self {
        let of_rows: Vec<[f64; 3]> = (0..far.nrows())
            .into_par_iter()
            .map(|y| [far.row(y), near.row(y)].map(moments))
            .map(|[a, b]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]])
            .collect();
        let [sum, squares, count] =
            of_rows.into_iter().fold([0.0; 3], |a, b| [a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
        let whole = count as usize == 2 * far.len();
        let mean = sum / count;
        let spread = (squares / count - mean * mean).max(0.0).sqrt();
        // An image may be centred on 0; then its spread is the scale.
        let scale = if mean.abs() > spread { mean.abs() } else { spread }.max(f64::MIN_POSITIVE);
        let square = scale * scale;
        Self {
            mean: mean as f32,
            gain: scale.recip() as f32,
            noise: [
                ((noise.constant + noise.per_unit * mean) / square) as f32,
                (noise.per_unit * scale / square) as f32,
            ],
            least_noise: (noise.variance(mean) / square * 0.1).max(LEAST_NOISE) as f32,
            white: white_part(&noise) as f32,
            whole,
        }
    }
}

/// Part of the variance that is noise of single pixels. Strong compression removes that noise and adds coarser errors. The
/// factor was chosen on JPEG of the qualities 92, 85 and 75, where the coding makes 0.4, 0.6 and 0.8 of the noise.
fn white_part(noise: &PairNoise) -> f64 {
    let [coding, added] =
        [noise.coding, noise.added].map(|part| part / noise.mean_variance.max(f64::MIN_POSITIVE));
    1.0 - added * (1.6 * coding * coding).min(1.0)
}

fn moments(row: ArrayView1<f32>) -> [f64; 3] {
    // Independent sums, so that the compiler vectorises them.
    const SIDE_BY_SIDE: usize = 8;
    let (mut sums, mut squares) = ([0.0_f64; SIDE_BY_SIDE], [0.0_f64; SIDE_BY_SIDE]);
    let values = row.as_slice().unwrap_or_default();
    let (parts, rest) = values.as_chunks::<SIDE_BY_SIDE>();
    for part in parts {
        for i in 0..SIDE_BY_SIDE {
            let v = f64::from(part[i]);
            sums[i] += v;
            squares[i] += v * v;
        }
    }
    for (i, v) in rest.iter().enumerate() {
        sums[i] += f64::from(*v);
        squares[i] += f64::from(*v).powi(2);
    }
    let [sum, square] = [sums, squares].map(|part| part.into_iter().sum::<f64>());
    if !values.is_empty() && sum.is_finite() && square.is_finite() {
        return [sum, square, values.len() as f64];
    }
    row.iter().filter(|v| v.is_finite()).fold([0.0; 3], |[sum, squares, count], v| {
        let v = f64::from(*v);
        [sum + v, squares + v * v, count + 1.0]
    })
}
