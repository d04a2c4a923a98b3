//! The subject centred in a small square picture, as in Li 2014, section 9.3.1.

use ndarray::{Array2, ArrayView2};

use super::{BoundingBox, Mask};

/// Side of the thesis' silhouettes.
pub const SIDE_PX: usize = 100;

/// The mask's bounding box scaled with its aspect to fill a square of `side_px`, and centred. A pixel is set
/// if at least half of it is covered. `None` for an empty mask. Linear in the box's pixels.
#[must_use]
pub fn centred(mask: ArrayView2<'_, bool>, side_px: usize) -> Option<Mask> {
    let bounds = BoundingBox::of(mask)?;
    let longest = bounds.height().max(bounds.width()) as f64;
    let scale = longest / side_px as f64;
    // Corner of the square that centres the box.
    let top = bounds.top as f64 - 0.5 * (longest - bounds.height() as f64);
    let left = bounds.left as f64 - 0.5 * (longest - bounds.width() as f64);
    let rows: Vec<_> = (0..side_px).map(|at| weights(top + at as f64 * scale, scale, mask.nrows())).collect();
    let columns: Vec<_> =
        (0..side_px).map(|at| weights(left + at as f64 * scale, scale, mask.ncols())).collect();
    let half = 0.5 * scale * scale;
    Some(Array2::from_shape_fn((side_px, side_px), |(row, column)| {
        let covered: f64 = rows[row]
            .iter()
            .map(|&(r, height)| {
                let width: f64 =
                    columns[column].iter().filter(|&&(c, _)| mask[[r, c]]).map(|&(_, width)| width).sum();
                height * width
            })
            .sum();
        // Tolerance, so that rounding does not decide half-covered pixels.
        covered >= half * (1.0 - 1e-9)
    }))
}

/// Pixels covered by the interval [start, start + extent), with their coverage.
fn weights(start: f64, extent: f64, length: usize) -> Vec<(usize, f64)> {
    let first = start.max(0.0).floor() as usize;
    let last = (start + extent).ceil().max(0.0) as usize;
    (first..last.min(length))
        .map(|pixel| (pixel, (start + extent).min(pixel as f64 + 1.0) - start.max(pixel as f64)))
        .filter(|&(_, covered)| covered > 0.0)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mask::area;
    use ndarray::s;

    #[test]
    fn a_tall_box_fills_the_height_and_is_centred() {
        let mut mask = Mask::from_elem((400, 300), false);
        mask.slice_mut(s![50..250, 200..280]).fill(true); // 200 x 80: scaled by 1/2 to 100 x 40
        let small = centred(mask.view(), SIDE_PX).unwrap();
        assert_eq!(
            BoundingBox::of(small.view()),
            Some(BoundingBox { top: 0, left: 30, bottom: 100, right: 70 })
        );
        assert_eq!(area(small.view()), 4000);
    }

    #[test]
    fn it_does_not_depend_on_where_the_subject_stood() {
        let shape = |top: usize, left: usize| {
            let mut mask = Mask::from_elem((150, 150), false);
            for row in 0..61 {
                mask.slice_mut(s![top + row, left..left + 5 + row / 3]).fill(true);
            }
            centred(mask.view(), SIDE_PX).unwrap()
        };
        assert_eq!(shape(0, 0), shape(80, 110));
        assert_eq!(shape(0, 0), shape(33, 7));
    }

    #[test]
    fn a_disc_keeps_its_shape_at_any_size() {
        for radius in [20, 75, 260] {
            let side = 2 * radius + 40;
            let centre = 0.5 * side as f64;
            let mask = Mask::from_shape_fn((side, side), |(row, column)| {
                (row as f64 + 0.5 - centre).hypot(column as f64 + 0.5 - centre) <= radius as f64
            });
            let small = centred(mask.view(), SIDE_PX).unwrap();
            // pi 50^2 = 7854; a source pixel is up to 2.5 target pixels wide.
            let found = area(small.view()) as f64;
            assert!((found - 7854.0).abs() < 160.0, "radius {radius}: {found}");
        }
    }

    #[test]
    fn an_empty_mask_is_not_centred() {
        assert_eq!(centred(Mask::from_elem((10, 10), false).view(), SIDE_PX), None);
        assert_eq!(centred(Mask::from_elem((0, 0), false).view(), SIDE_PX), None);
    }
}
