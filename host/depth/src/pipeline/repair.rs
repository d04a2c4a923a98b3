//! Removes the effect of invalid pixels from a finished map.

use ndarray::{Array2, Zip};

use super::fast::{Job, Maps};
use super::{DepthMap, Settings};
use crate::border::reflect;
use crate::metrics::dilate_square;

impl Job<'_> {
    /// Removes the pixels that depend on an invalid one, and recomputes the medians next to them from the rest.
    pub fn repair(&self, map: &mut DepthMap, invalid: &Array2<bool>) {
        let size = map.depth_mm.dim();
        let settings = Settings { median_px: 1, ..*self.settings };
        let plain = Job { settings: &settings, ..*self };
        let [mut raw, mut texture, mut misfit] = [(); 3].map(|()| Array2::zeros(size));
        plain.run(
            &mut Vec::new(),
            Maps { depth_mm: raw.view_mut(), texture: texture.view_mut(), misfit: misfit.view_mut() },
        );
        Zip::from(&mut raw).and(invalid).for_each(|raw, invalid| {
            if *invalid {
                *raw = f32::NAN;
            }
        });
        let beside = dilate_square(invalid, self.settings.median_px / 2);
        for (at, _) in beside.indexed_iter().filter(|(_, beside)| **beside) {
            if invalid[at] {
                map.depth_mm[at] = f32::NAN;
                map.confidence[at] = 0.0;
            } else if map.confidence[at] > 0.0 {
                // Depth falls with alpha, so the median of depths is the depth of the median.
                map.depth_mm[at] = median_at(&raw, self.settings.median_px, at);
            }
        }
    }
}

/// Median of the values around (y, x) without NaN, with reflected borders; NaN without any.
pub(crate) fn median_at(image: &Array2<f32>, size: usize, (y, x): (usize, usize)) -> f32 {
    let (height, width) = image.dim();
    let r = (size / 2) as isize;
    let mut window = Vec::with_capacity(size * size);
    for dy in -r..=r {
        let row = reflect(y as isize + dy, height);
        window
            .extend((-r..=r).map(|dx| image[(row, reflect(x as isize + dx, width))]).filter(|v| !v.is_nan()));
    }
    if window.is_empty() {
        return f32::NAN;
    }
    let middle = window.len() / 2;
    *window.select_nth_unstable_by(middle, f32::total_cmp).1
}
