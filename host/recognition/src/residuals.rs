//! Residuals of soft assignments: vectors of locally aggregated descriptors (Jégou et al., CVPR 2010). Mean
//! difference of a clip's frames from typical frames, weighted by the assignment, with signed square roots
//! and unit length (Jégou et al., PAMI 34, 2012). Independent of the order. O(frames x centres x F).

use ndarray::{Array1, Array2, ArrayView2, Axis};

/// M x F numbers of unit length from `centres` (M x F), frame vectors (frames x F) and soft assignments.
pub fn residuals(
    centres: ArrayView2<f32>,
    frames: ArrayView2<f32>,
    assignments: ArrayView2<f32>,
) -> Array1<f32> {
    if centres.nrows() == 0 || frames.nrows() == 0 {
        return Array1::zeros(centres.len());
    }
    let mut sums: Array2<f32> = assignments.t().dot(&frames);
    for ((mut sum, centre), assigned) in
        sums.rows_mut().into_iter().zip(centres.rows()).zip(assignments.sum_axis(Axis(0)))
    {
        sum.scaled_add(-assigned, &centre);
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
    use super::super::codebook::Codebook;
    use super::*;
    use ndarray::array;

    fn of(frames: ArrayView2<f32>, sharpness: f32) -> Array1<f32> {
        let centres = array![[0.0_f32, 0.0], [10.0, 0.0]];
        let book = Codebook { centres, spread: 1.0, residual: None };
        residuals(book.centres.view(), frames, book.soft_assignments(frames, sharpness).view())
    }

    #[test]
    fn residuals_distinguish_sides_that_assignments_do_not() {
        let (left, right) = (array![[-1.0_f32, 0.0], [10.0, 1.0]], array![[1.0_f32, 0.0], [10.0, 1.0]]);
        let (a, b) = (of(left.view(), 1.0), of(right.view(), 1.0));
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
        let (a, b) = (of(frames.view(), 2.0), of(turned.view(), 2.0));
        assert!((&a - &b).iter().all(|d| d.abs() < 1e-5));
        assert!((a.dot(&a) - 1.0).abs() < 1e-5);
        assert_eq!(of(frames.slice(ndarray::s![..0, ..]), 2.0).to_vec(), vec![0.0; 4]);
    }
}
