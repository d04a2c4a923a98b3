//! The rim of a map, where the kernels reach beyond the images.
//!
//! Reflecting an image at its border supposes that the scene goes on as its own mirror image. The blur knows better:
//! it mixed in what really lies beyond, by another amount in each of the two images, and depth within one kernel size of
//! the border is off by millimetres even without noise. So rim pixels take the depth of the nearest pixel whose
//! operators (pre-filter and kernel, half a kernel size each) saw nothing but image, at [`RIM_CONFIDENCE`] of its
//! confidence. Pixels without a depth stay without.
//!
//! Cost: the rim's pixels once.

use super::DepthMap;

/// How far a value is trusted that belongs to a neighbour.
const RIM_CONFIDENCE: f32 = 0.5;

/// Fills the rim of `width_px` pixels; at most to the middle of a small map.
pub(super) fn fill(map: &mut DepthMap, width_px: usize) {
    let (height, width) = map.depth_mm.dim();
    let rim = |n: usize| width_px.min((n - 1) / 2);
    let (Some(depths), Some(confidences)) = (map.depth_mm.as_slice_mut(), map.confidence.as_slice_mut())
    else {
        unreachable!("maps are made in standard layout");
    };
    // Top and bottom first: the rows they copy from are then still untouched.
    let (first, last) = (rim(height), height - 1 - rim(height));
    for y in (0..first).chain(last + 1..height) {
        let source = if y < first { first } else { last };
        for x in 0..width {
            let from = source * width + x.clamp(rim(width), width - 1 - rim(width));
            copy(depths, confidences, from, y * width + x);
        }
    }
    for y in first..=last {
        for x in (0..rim(width)).chain(width - rim(width)..width) {
            let from = y * width + x.clamp(rim(width), width - 1 - rim(width));
            copy(depths, confidences, from, y * width + x);
        }
    }
}

/// Copies a pixel to one that has a depth.
fn copy(depths: &mut [f32], confidences: &mut [f32], from: usize, to: usize) {
    if !depths[to].is_nan() {
        depths[to] = depths[from];
        confidences[to] = RIM_CONFIDENCE * confidences[from];
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    fn map(height: usize, width: usize) -> DepthMap {
        DepthMap {
            depth_mm: Array2::from_shape_fn((height, width), |(y, x)| (100 * y + x) as f32),
            confidence: Array2::from_elem((height, width), 0.8),
            low_texture_fraction: 0.0,
            warnings: Vec::new(),
        }
    }

    #[test]
    fn rim_pixels_take_the_nearest_whole_pixel() {
        let mut map = map(20, 30);
        map.depth_mm[(0, 0)] = f32::NAN;
        fill(&mut map, 7);
        assert!(map.depth_mm[(0, 0)].is_nan());
        assert_eq!(map.depth_mm[(0, 1)], 707.0);
        assert_eq!(map.depth_mm[(19, 29)], 1222.0);
        assert_eq!((map.depth_mm[(10, 3)], map.confidence[(10, 3)]), (1007.0, 0.4));
        assert_eq!((map.depth_mm[(7, 7)], map.confidence[(12, 22)]), (707.0, 0.8));
    }

    #[test]
    fn a_small_map_is_filled_from_its_middle() {
        let mut map = map(16, 16);
        fill(&mut map, 11);
        assert_eq!(map.depth_mm[(0, 0)], 707.0);
        assert_eq!(map.depth_mm[(15, 15)], 808.0);
    }
}
