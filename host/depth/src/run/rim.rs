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
    let inside = |i: usize, n: usize| {
        let rim = width_px.min((n - 1) / 2);
        i.clamp(rim, n - 1 - rim)
    };
    let mut fill = |y: usize, x: usize| {
        let source = (inside(y, height), inside(x, width));
        if source == (y, x) || map.depth_mm[(y, x)].is_nan() {
            return;
        }
        map.depth_mm[(y, x)] = map.depth_mm[source];
        map.confidence[(y, x)] = RIM_CONFIDENCE * map.confidence[source];
    };
    let rim = width_px.min(width);
    for y in 0..height {
        if inside(y, height) == y {
            (0..rim).chain(width - rim..width).for_each(|x| fill(y, x));
        } else {
            (0..width).for_each(|x| fill(y, x));
        }
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
