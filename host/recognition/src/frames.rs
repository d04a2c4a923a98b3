//! Features of one frame of a clip.
//! - Point: embedded coordinates in standard deviations of the first dimension.
//! - Relative point: minus the clip's mean, which removes the person's build.
//! - Box: height and width over the clip's largest height; centroid relative to the clip's mean in the same unit.
//! - Motion (ordered mode): central difference over two frames, over the clip's RMS, so independent of speed.

use super::clip::BOX_NUMBERS;
use ndarray::{Array2, ArrayView2, Axis, s};
use serde::{Deserialize, Serialize};

/// Whether the order of frames counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Independent of the order (as promised by the thesis).
    #[default]
    OrderFree,
    /// Motion counts: sitting down differs from standing up.
    Ordered,
}

farnear_silhouettes::named!(Mode, "mode", "order-free" => OrderFree, "ordered" => Ordered);

/// Weights of a frame vector's parts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weights {
    /// Embedded point relative to the clip's mean, in addition to the point itself.
    pub relative_weight: f32,
    /// Box, compared with the point.
    pub box_weight: f32,
    /// Motion, compared with position.
    pub motion_weight: f32,
}

impl Default for Weights {
    fn default() -> Self {
        Self { relative_weight: 1.0, box_weight: 6.0, motion_weight: 0.7 }
    }
}

const REACH: usize = 2;

/// Frame vectors (frames x F) from embedded points (frames x D, over the gallery's spread) and boxes.
pub fn vectors(
    points: ArrayView2<f32>,
    boxes: Option<ArrayView2<f32>>,
    mode: Mode,
    weights: Weights,
) -> Array2<f32> {
    let (frames, dimensions) = points.dim();
    let boxed = boxes.map_or(0, |_| BOX_NUMBERS);
    let still = dimensions + boxed;
    let motion_width = if mode == Mode::Ordered { still } else { 0 };
    let mut out = Array2::zeros((frames, still + motion_width + dimensions));
    out.slice_mut(s![.., ..dimensions]).assign(&points);
    let relative = still + motion_width;
    let mean = points.sum_axis(Axis(0)) / frames.max(1) as f32;
    out.slice_mut(s![.., relative..]).assign(&((&points - &mean) * weights.relative_weight));
    if let Some(boxes) = boxes {
        let largest = boxes.column(0).iter().fold(1.0_f32, |m, h| m.max(*h));
        let mean = |k: usize| boxes.column(k).sum() / frames.max(1) as f32;
        let centre = [0.0, 0.0, mean(2), mean(3)];
        for (k, centre) in centre.into_iter().enumerate() {
            let mut column = out.slice_mut(s![.., dimensions + k]);
            for (out, value) in column.iter_mut().zip(boxes.column(k)) {
                *out = weights.box_weight * (value - centre) / largest;
            }
        }
    }
    if mode == Mode::Ordered {
        for part in [0..dimensions, dimensions..still] {
            let motion = differences(out.slice(s![.., part.clone()]));
            let mut to = out.slice_mut(s![.., still + part.start..still + part.end]);
            to.assign(&(motion * weights.motion_weight));
        }
    }
    out
}

/// Central differences over their RMS length in the clip.
fn differences(rows: ArrayView2<f32>) -> Array2<f32> {
    let n = rows.nrows();
    let mut out = Array2::zeros(rows.dim());
    for i in 0..n {
        let (from, to) = (i.saturating_sub(REACH), (i + REACH).min(n - 1));
        let span = (to - from).max(1) as f32;
        let mut row = out.row_mut(i);
        row.assign(&((&rows.row(to) - &rows.row(from)) / span));
    }
    let rms = (out.iter().map(|v| v * v).sum::<f32>() / n.max(1) as f32).sqrt();
    if rms > 1e-6 {
        out /= rms;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::Track;
    use crate::embedding::descriptor::{ANGLES, CELLS};

    fn boxes(track: &Track) -> Option<ArrayView2<'_, f32>> {
        track.boxes.as_ref().map(|boxes| boxes.view())
    }

    #[test]
    fn shuffled_frames_give_the_same_vectors_in_order_free_mode() {
        let n = 12;
        let track = Track {
            descriptors: Array2::zeros((n, ANGLES)),
            cells: Array2::zeros((n, CELLS)),
            boxes: Some(Array2::from_shape_fn((n, 4), |(f, k)| (50 + f * (k + 1)) as f32)),
            empty_frames: 0,
        };
        let points = Array2::from_shape_fn((n, 3), |(f, k)| (f * (k + 2)) as f32 * 0.1);
        let order: Vec<usize> = (0..n).map(|i| (i * 5) % n).collect();
        let a = vectors(points.view(), boxes(&track), Mode::OrderFree, Weights::default());
        let shuffled = points.select(ndarray::Axis(0), &order);
        let b = vectors(shuffled.view(), boxes(&track.select(&order)), Mode::OrderFree, Weights::default());
        for (i, &from) in order.iter().enumerate() {
            assert!(b.row(i).iter().zip(a.row(from)).all(|(p, q)| (p - q).abs() < 1e-5));
        }
        assert_eq!(vectors(points.view(), boxes(&track), Mode::Ordered, Weights::default()).ncols(), 17);
    }
}
