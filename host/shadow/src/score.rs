//! Quality of shadow removal in pixels, compared with ground truth: figures of Li 2014 (tables 8.1 and 8.2)
//! and of Sanin, Sanderson and Lovell, Pattern Recognition 45 (2012).
//! | figure | definition |
//! |---|---|
//! | shadow removed, % | removed shadow pixels of all shadow pixels (table 8.1; the survey's detection rate) |
//! | wrongly removed, % | removed subject pixels of all subject pixels (table 8.2; 100 minus the survey's discrimination rate) |
//! | intersection over union, % | of the result and the true subject |

use ndarray::{ArrayView2, Zip};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Truth {
    Background,
    Shadow,
    Subject,
    /// Excluded: outside the region of interest, or too blurred.
    Ignored,
}

impl Truth {
    /// ChangeDetection.net: 0 static, 50 shadow, 85 outside the region of interest, 170 unknown, 255 moving;
    /// also 127, the shadow of many background models. `None` for others.
    #[must_use]
    pub fn from_grey(value: u8) -> Option<Self> {
        match value {
            0 => Some(Self::Background),
            50 | 127 => Some(Self::Shadow),
            85 | 170 => Some(Self::Ignored),
            255 => Some(Self::Subject),
            _ => None,
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the {what} is {}x{} pixels but the ground truth is {}x{}; they must be the same frame", .found.1, .found.0, .expected.1, .expected.0)]
pub struct ShapeError {
    pub what: &'static str,
    pub found: (usize, usize),
    pub expected: (usize, usize),
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShadowScore {
    /// True shadow pixels (in the mask before removal, if given).
    pub shadow_pixels: u64,
    pub shadow_removed: u64,
    /// True subject pixels (in the mask before removal, if given).
    pub subject_pixels: u64,
    pub subject_removed: u64,
    pub intersection: u64,
    pub union: u64,
}

impl ShadowScore {
    /// Adds a frame with the masks before and after removal. Without `before` all true pixels count as
    /// present, so pixels missed by the background model count as removed.
    pub fn add(
        &mut self,
        before: Option<ArrayView2<'_, bool>>,
        after: ArrayView2<'_, bool>,
        truth: ArrayView2<'_, Truth>,
    ) -> Result<(), ShapeError> {
        let expected = truth.dim();
        if after.dim() != expected {
            return Err(ShapeError { what: "mask after the removal", found: after.dim(), expected });
        }
        match before {
            Some(before) if before.dim() != expected => {
                return Err(ShapeError { what: "mask before the removal", found: before.dim(), expected });
            }
            Some(before) => Zip::from(before)
                .and(after)
                .and(truth)
                .for_each(|&before, &after, &truth| self.count(before, after, truth)),
            None => Zip::from(after).and(truth).for_each(|&after, &truth| self.count(true, after, truth)),
        }
        Ok(())
    }

    fn count(&mut self, before: bool, after: bool, truth: Truth) {
        match truth {
            Truth::Ignored => return,
            Truth::Shadow if before => {
                self.shadow_pixels += 1;
                self.shadow_removed += u64::from(!after);
            }
            Truth::Subject if before => {
                self.subject_pixels += 1;
                self.subject_removed += u64::from(!after);
            }
            _ => {}
        }
        self.intersection += u64::from(after && truth == Truth::Subject);
        self.union += u64::from(after || truth == Truth::Subject);
    }

    #[must_use]
    pub fn removed_percent(&self) -> Option<f64> {
        percent(self.shadow_removed, self.shadow_pixels)
    }

    #[must_use]
    pub fn wrongly_removed_percent(&self) -> Option<f64> {
        percent(self.subject_removed, self.subject_pixels)
    }

    #[must_use]
    pub fn iou_percent(&self) -> Option<f64> {
        percent(self.intersection, self.union)
    }
}

fn percent(part: u64, whole: u64) -> Option<f64> {
    (whole > 0).then(|| 100.0 * part as f64 / whole as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, arr2};

    const B: Truth = Truth::Background;
    const S: Truth = Truth::Shadow;
    const P: Truth = Truth::Subject;
    const X: Truth = Truth::Ignored;

    #[test]
    fn counts_by_hand() {
        let truth = arr2(&[[P, P, P, P], [S, S, S, B], [X, X, B, S]]);
        let before = arr2(&[[true, true, true, false], [true, true, true, true], [true, true, false, false]]);
        let after =
            arr2(&[[true, true, false, false], [false, true, false, true], [true, false, false, false]]);
        let mut score = ShadowScore::default();
        score.add(Some(before.view()), after.view(), truth.view()).unwrap();
        // Two of three shadow pixels in the mask were removed, and one of three subject pixels.
        assert_eq!((score.shadow_removed, score.shadow_pixels), (2, 3));
        assert_eq!((score.subject_removed, score.subject_pixels), (1, 3));
        // Result: 2 subject, 1 shadow, 1 background; the true subject has 4.
        assert_eq!((score.intersection, score.union), (2, 6));
        assert!((score.iou_percent().unwrap() - 100.0 / 3.0).abs() < 1e-12);

        let mut whole = ShadowScore::default();
        whole.add(None, after.view(), truth.view()).unwrap();
        assert_eq!((whole.shadow_removed, whole.shadow_pixels), (3, 4));
        assert_eq!((whole.subject_removed, whole.subject_pixels), (2, 4));
    }

    #[test]
    fn empty_counts_give_no_percentage() {
        let mut score = ShadowScore::default();
        score
            .add(None, Array2::from_elem((2, 2), false).view(), Array2::from_elem((2, 2), B).view())
            .unwrap();
        assert_eq!(score.removed_percent(), None);
        assert_eq!(score.wrongly_removed_percent(), None);
        assert_eq!(score.iou_percent(), None);
    }
}
