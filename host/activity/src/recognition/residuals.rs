//! What a codebook's shares leave out: on which side of each typical frame a clip's frames lie, and how far off.
//!
//! Vectors of locally aggregated descriptors (Jégou et al., CVPR 2010): the mean over the clip of every frame's difference from
//! some dozen typical frames, each weighted by the frame's share in it. Signed square roots take the weight off few
//! large differences, and the whole has unit length (Jégou et al., PAMI 34, 2012). A mean does not know the order of frames,
//! so what shuffling leaves unchanged stays unchanged. O(frames x centres x F) a clip.

use super::codebook::Codebook;
use ndarray::{Array1, Array2, ArrayView2, Axis};

/// The clip's mean differences from the centres of `book` from its frame vectors (frames x F): centres x F numbers in one row of
/// unit length, zeros for an empty clip.
pub fn residuals(book: &Codebook, frames: ArrayView2<f32>, sharpness: f32) -> Array1<f32> {
    if book.centres.nrows() == 0 || frames.nrows() == 0 {
        return Array1::zeros(book.centres.len());
    }
    let shares = book.shares(frames, sharpness);
    let mut sums: Array2<f32> = shares.t().dot(&frames);
    for ((mut sum, centre), share) in
        sums.rows_mut().into_iter().zip(book.centres.rows()).zip(shares.sum_axis(Axis(0)))
    {
        sum.scaled_add(-share, &centre);
    }
    sums /= frames.nrows() as f32;
    sums.mapv_inplace(|v| v.signum() * v.abs().sqrt());
    let length = sums.iter().map(|v| v * v).sum::<f32>().sqrt();
    if length > 1e-9 {
        sums /= length;
    }
    sums.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    fn book() -> Codebook {
        Codebook { centres: array![[0.0_f32, 0.0], [10.0, 0.0]], spread: 1.0, residual: None }
    }

    #[test]
    fn sides_are_told_that_shares_do_not_tell() {
        let (left, right) = (array![[-1.0_f32, 0.0], [10.0, 1.0]], array![[1.0_f32, 0.0], [10.0, 1.0]]);
        let (a, b) = (residuals(&book(), left.view(), 1.0), residuals(&book(), right.view(), 1.0));
        let half = 0.5_f32.sqrt();
        for (found, expected) in a.iter().zip([-half, 0.0, 0.0, half]) {
            assert!((found - expected).abs() < 1e-4, "{a}");
        }
        assert!((a[0] + b[0]).abs() < 1e-4 && (a[3] - b[3]).abs() < 1e-4);
    }

    #[test]
    fn order_and_repetition_of_frames_change_nothing() {
        let frames = array![[0.3_f32, 0.1], [9.0, 2.0], [4.0, -1.0]];
        let turned = frames.select(Axis(0), &[2, 0, 1, 2, 0, 1]);
        let (a, b) = (residuals(&book(), frames.view(), 2.0), residuals(&book(), turned.view(), 2.0));
        assert!((&a - &b).iter().all(|d| d.abs() < 1e-5));
        assert!((a.dot(&a) - 1.0).abs() < 1e-5);
        let none = residuals(&book(), frames.slice(ndarray::s![..0, ..]), 2.0);
        assert_eq!(none.to_vec(), vec![0.0; 4]);
    }
}
