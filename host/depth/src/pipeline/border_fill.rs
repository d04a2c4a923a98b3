//! The border of a map, where the kernels reach beyond the images. Reflection assumes that the scene continues as its
//! mirror image. But blur mixed in the real scene beyond, differently in each image: depth within one kernel size of
//! the border is off by millimetres even without noise. So border pixels take the depth of the nearest pixel whose
//! operators (pre-filter and kernel, half a kernel size each) see only the image, at [`BORDER_CONFIDENCE`] of its
//! confidence. Pixels without a depth stay without. Cost: the border's pixels once.

use ndarray::Array2;

use crate::depth_map::DepthMap;

/// Confidence factor of a neighbour's value.
const BORDER_CONFIDENCE: f32 = 0.5;

/// Fills the border of `width_px` pixels; at most to the middle of a small map.
pub(crate) fn fill(map: &mut DepthMap, width_px: usize) {
    let (height, width) = map.depth_mm.dim();
    let border = |n: usize| width_px.min((n - 1) / 2);
    let (Some(depths), Some(confidences)) = (map.depth_mm.as_slice_mut(), map.confidence.as_slice_mut())
    else {
        unreachable!("maps are made in standard layout");
    };
    // Top and bottom first: the rows they copy from are still unmodified.
    let (first, last) = (border(height), height - 1 - border(height));
    let (left, right) = (border(width), width - 1 - border(width));
    let inner = left..right + 1;
    let source_row = [first, last].map(|y| {
        let row = y * width..(y + 1) * width;
        (depths[row.clone()].to_vec(), confidences[row].to_vec())
    });
    for y in (0..first).chain(last + 1..height) {
        let (from_depths, from_confidences) = &source_row[usize::from(y > last)];
        let row = y * width..(y + 1) * width;
        let (depths, confidences) = (&mut depths[row.clone()], &mut confidences[row]);
        for x in (0..left).chain(right + 1..width) {
            let from = x.clamp(left, right);
            take(&mut depths[x], &mut confidences[x], from_depths[from], from_confidences[from]);
        }
        // Slices of equal length, so that the compiler vectorises the loop.
        let to = depths[inner.clone()].iter_mut().zip(&mut confidences[inner.clone()]);
        let from = from_depths[inner.clone()].iter().zip(&from_confidences[inner.clone()]);
        for ((depth, confidence), (from_depth, from_confidence)) in to.zip(from) {
            take(depth, confidence, *from_depth, *from_confidence);
        }
    }
    for y in first..=last {
        let row = y * width..(y + 1) * width;
        let (depths, confidences) = (&mut depths[row.clone()], &mut confidences[row]);
        for (outside, from) in [(0..left, left), (right + 1..width, right)] {
            let (from_depth, from_confidence) = (depths[from], confidences[from]);
            for x in outside {
                take(&mut depths[x], &mut confidences[x], from_depth, from_confidence);
            }
        }
    }
}

/// Values of the nearest inner pixels in the border of `width_px` pixels, where it has values.
pub(crate) fn extend(map: &mut Array2<f32>, width_px: usize) {
    let (height, width) = map.dim();
    let inner = |i: usize, n: usize| i.clamp(width_px.min((n - 1) / 2), n - 1 - width_px.min((n - 1) / 2));
    for y in 0..height {
        let row = inner(y, height);
        let beside = if row == y { inner(0, width) } else { width };
        for x in (0..beside).chain((width - beside).max(beside)..width) {
            if !map[(y, x)].is_nan() {
                map[(y, x)] = map[(row, inner(x, width))];
            }
        }
    }
}

fn take(depth: &mut f32, confidence: &mut f32, from_depth: f32, from_confidence: f32) {
    let has = !depth.is_nan();
    *confidence = if has { BORDER_CONFIDENCE * from_confidence } else { *confidence };
    *depth = if has { from_depth } else { *depth };
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(height: usize, width: usize) -> DepthMap {
        DepthMap {
            depth_mm: Array2::from_shape_fn((height, width), |(y, x)| (100 * y + x) as f32),
            confidence: Array2::from_elem((height, width), 0.8),
            filled: None,
            low_texture_fraction: 0.0,
            warnings: Vec::new(),
        }
    }

    #[test]
    fn border_pixels_take_the_nearest_whole_pixel() {
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
