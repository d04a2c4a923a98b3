//! Cleaning of a raw foreground mask: removes specks, closes gaps, fills small holes.

use ndarray::ArrayView2;

use super::{
    Mask,
    bits::BitMask,
    regions::{Connectivity, regions},
};

/// For people: opens by 1 px, closes by height / 240, at least 1 px (radii of squares of side 2 r + 1), and fills holes up to
/// 1/3000 of the image; larger ones, as between arm and trunk, belong to the shape.
#[must_use]
pub fn cleaned(mask: ArrayView2<'_, bool>) -> Mask {
    let (height, width) = mask.dim();
    let mut clean = BitMask::pack(mask).opened(1).closed((height / 240).max(1)).unpack();
    fill_holes(&mut clean, height * width / 3000);
    clean
}

/// Fills 4-connected unset regions up to `largest_px` that do not touch the image's edge.
fn fill_holes(mask: &mut Mask, largest_px: usize) {
    let size = mask.dim();
    for hole in regions(mask.view(), false, Connectivity::Four) {
        if hole.area <= largest_px && !hole.bounds.touches_edge(size) {
            hole.paint(mask, true);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mask::area;
    use ndarray::s;

    #[test]
    fn specks_go_cracks_close_and_the_body_keeps_its_outline() {
        let mut body = Mask::from_elem((250, 250), false);
        body.slice_mut(s![10..50, 20..40]).fill(true);
        let mut dirty = body.clone();
        for (row, column) in [(3, 3), (30, 50), (55, 10), (5, 40)] {
            dirty[[row, column]] = true;
        }
        dirty.slice_mut(s![28, 20..40]).fill(false);
        dirty.slice_mut(s![40..43, 28..31]).fill(false);
        assert_eq!(cleaned(dirty.view()), body);
    }

    #[test]
    fn only_small_enclosed_holes_are_filled() {
        let mut mask = Mask::from_elem((20, 20), false);
        mask.slice_mut(s![2..18, 0..16]).fill(true);
        mask.slice_mut(s![4..6, 4..6]).fill(false); // 4 pixels, enclosed
        mask.slice_mut(s![8..14, 6..12]).fill(false); // 36 pixels, enclosed
        mask.slice_mut(s![10..12, 0..2]).fill(false); // 4 pixels, open to the edge
        let before = area(mask.view());
        fill_holes(&mut mask, 10);
        assert_eq!(area(mask.view()), before + 4);
        fill_holes(&mut mask, 0);
        assert_eq!(area(mask.view()), before + 4);
    }
}
