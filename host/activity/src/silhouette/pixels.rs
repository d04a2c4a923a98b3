//! Small operations on masks that several stages share.

use crate::mask::{BoundingBox, Mask};
use ndarray::{Array2, ArrayView2, s};

/// First and last set pixel of a row, `None` if the row is empty. Long empty stretches are skipped 32 pixels at a time.
pub fn row_extent(row: &[bool]) -> Option<(usize, usize)> {
    const BLOCK: usize = 32;
    let any = |part: &[bool]| part.iter().fold(false, |found, &set| found | set);
    let first_block = row.chunks(BLOCK).position(any)? * BLOCK;
    let first = first_block + row[first_block..].iter().position(|&set| set)?;
    let last_block = row.chunks(BLOCK).rposition(any)? * BLOCK;
    let last =
        last_block + row[last_block..row.len().min(last_block + BLOCK)].iter().rposition(|&set| set)?;
    Some((first, last))
}

/// Intersection over union of two masks of one shape; 1 when both are empty. Pixels beyond the smaller mask do not count.
pub fn intersection_over_union(a: ArrayView2<bool>, b: ArrayView2<bool>) -> f64 {
    let (mut both, mut either) = (0_usize, 0_usize);
    for (&p, &q) in a.iter().zip(b.iter()) {
        both += usize::from(p & q);
        either += usize::from(p | q);
    }
    if either == 0 { 1.0 } else { both as f64 / either as f64 }
}

/// The mask mirrored left to right.
pub fn mirrored(mask: ArrayView2<bool>) -> Mask {
    mask.slice(s![.., ..;-1]).to_owned()
}

/// Nearest-neighbour crop of a box scaled to `height` x `width`, aspect ratio NOT kept.
pub fn crop_scaled(mask: ArrayView2<bool>, bounds: BoundingBox, height: usize, width: usize) -> Mask {
    Array2::from_shape_fn((height, width), |(y, x)| {
        mask[[
            bounds.top + (2 * y + 1) * bounds.height() / (2 * height),
            bounds.left + (2 * x + 1) * bounds.width() / (2 * width),
        ]]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn row_extents_reach_over_blocks() {
        let mut row = [false; 130];
        assert_eq!(row_extent(&row), None);
        row[101] = true;
        assert_eq!(row_extent(&row), Some((101, 101)));
        row[3] = true;
        row[129] = true;
        assert_eq!(row_extent(&row), Some((3, 129)));
    }

    #[test]
    fn scaling_a_crop_keeps_its_corners() {
        let mask = Mask::from_shape_fn((20, 30), |(y, x)| {
            (5..15).contains(&y) && (10..20).contains(&x) && x >= y + 5
        });
        let bounds = BoundingBox::of(mask.view()).expect("not empty");
        let big = crop_scaled(mask.view(), bounds, 100, 100);
        assert!(big[[0, 0]] && big[[0, 99]] && big[[99, 99]] && !big[[99, 0]]);
    }
}
