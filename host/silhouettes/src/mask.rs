//! Binary masks of moving people: (height, width), row 0 at the top, `true` for the subject. Coordinates are
//! pixels with centres at (row + 0.5, column + 0.5).

pub mod assignment;
pub mod bits;
pub mod centre;
pub mod cleaning;
pub mod extractor;
pub mod feedback;
pub mod people;
pub mod regions;
pub mod subject;
pub mod tracking;

use ndarray::{Array2, ArrayView2};

pub type Mask = Array2<bool>;

/// Smallest upright rectangle, half open, px.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoundingBox {
    pub top: usize,
    pub left: usize,
    pub bottom: usize,
    pub right: usize,
}

impl BoundingBox {
    /// `None` for an empty mask. One pass.
    #[must_use]
    pub fn of(mask: ArrayView2<'_, bool>) -> Option<Self> {
        let mut found: Option<Self> = None;
        for (row, pixels) in mask.outer_iter().enumerate() {
            let Some(first) = pixels.iter().position(|&set| set) else { continue };
            let last = pixels.iter().rposition(|&set| set).unwrap_or(first);
            let line = Self { top: row, left: first, bottom: row + 1, right: last + 1 };
            found = Some(found.map_or(line, |whole| whole.union(line)));
        }
        found
    }

    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            top: self.top.min(other.top),
            left: self.left.min(other.left),
            bottom: self.bottom.max(other.bottom),
            right: self.right.max(other.right),
        }
    }

    #[must_use]
    pub fn height(self) -> usize {
        self.bottom - self.top
    }

    #[must_use]
    pub fn width(self) -> usize {
        self.right - self.left
    }

    /// Gap between two boxes along the larger axis, px; 0 if they touch or overlap.
    #[must_use]
    pub fn gap(self, other: Self) -> usize {
        let between = |a_end: usize, b_start: usize| b_start.saturating_sub(a_end);
        let rows = between(self.bottom, other.top).max(between(other.bottom, self.top));
        let columns = between(self.right, other.left).max(between(other.right, self.left));
        rows.max(columns)
    }

    #[must_use]
    pub fn touches_edge(self, (height, width): (usize, usize)) -> bool {
        self.top == 0 || self.left == 0 || self.bottom == height || self.right == width
    }
}

#[must_use]
pub fn area(mask: ArrayView2<'_, bool>) -> usize {
    mask.iter().filter(|&&set| set).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounding_box_of_two_far_pixels_holds_both_and_nothing_more() {
        let mut mask = Mask::from_elem((5, 7), false);
        mask[[1, 5]] = true;
        mask[[3, 2]] = true;
        let found = BoundingBox::of(mask.view());
        assert_eq!(found, Some(BoundingBox { top: 1, left: 2, bottom: 4, right: 6 }));
        assert_eq!(area(mask.view()), 2);
    }

    #[test]
    fn an_empty_mask_has_no_bounding_box() {
        assert_eq!(BoundingBox::of(Mask::from_elem((3, 3), false).view()), None);
    }

    #[test]
    fn gap_is_the_distance_along_the_worse_axis_and_zero_where_boxes_overlap() {
        let a = BoundingBox { top: 0, left: 0, bottom: 2, right: 2 };
        let b = BoundingBox { top: 1, left: 6, bottom: 3, right: 8 };
        assert_eq!(a.gap(b), 4);
        assert_eq!(b.gap(a), 4);
        assert_eq!(a.gap(a), 0);
        assert!(a.touches_edge((10, 10)) && !b.touches_edge((10, 10)));
    }
}
