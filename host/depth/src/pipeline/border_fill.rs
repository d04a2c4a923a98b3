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

/// Calls `each` with every border pixel and the nearest inner one.
fn each_of_border(
    (height, width): (usize, usize),
    width_px: usize,
    mut each: impl FnMut((usize, usize), (usize, usize)),
) {
    let inner = |i: usize, n: usize| i.clamp(width_px.min((n - 1) / 2), n - 1 - width_px.min((n - 1) / 2));
    for y in 0..height {
        let row = inner(y, height);
        let beside = if row == y { inner(0, width) } else { width };
        for x in (0..beside).chain((width - beside).max(beside)..width) {
            each((y, x), (row, inner(x, width)));
        }
    }
}

/// Values of the nearest inner pixels in the border of `width_px` pixels, where it has values.
pub(crate) fn extend(map: &mut Array2<f32>, width_px: usize) {
    each_of_border(map.dim(), width_px, |at, from| {
        if !map[at].is_nan() {
            map[at] = map[from];
        }
    });
}

/// Widens the deviations of border pixels by what the surface may do between them and the nearest inner pixel: as
/// much as over the same distance on its other side.
pub(crate) fn widen(deviation_mm: &mut Array2<f32>, depth_mm: &Array2<f32>, width_px: usize) {
    let size = deviation_mm.dim();
    // As far on the other side; at most to the opposite border of a small map.
    let mirrored = |at: usize, from: usize, n: usize| (2 * from).saturating_sub(at).min(n - 1);
    each_of_border(size, width_px, |at, from| {
        let mirror = (mirrored(at.0, from.0, size.0), mirrored(at.1, from.1, size.1));
        let apart = depth_mm[from] - depth_mm[mirror];
        if apart.is_finite() {
            deviation_mm[at] = deviation_mm[at].hypot(apart);
        }
    });
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
    fn deviations_of_the_border_grow_with_the_slope() {
        let mut depth_mm = map(20, 30).depth_mm;
        depth_mm[(12, 8)] = f32::NAN;
        let mut deviation_mm = Array2::from_elem((20, 30), 0.5);
        deviation_mm[(0, 29)] = f32::NAN;
        widen(&mut deviation_mm, &depth_mm, 4);
        // Depth rises by 1 a column and by 100 a row.
        assert_eq!(deviation_mm[(10, 0)], 0.5_f32.hypot(4.0));
        assert_eq!(deviation_mm[(10, 28)], 0.5_f32.hypot(3.0));
        assert!((deviation_mm[(1, 10)] - 300.0).abs() < 0.1);
        assert_eq!([deviation_mm[(10, 15)], deviation_mm[(12, 0)]], [0.5; 2]);
        assert!(deviation_mm[(0, 29)].is_nan());
    }

    #[test]
    fn a_small_map_is_filled_from_its_middle() {
        let mut map = map(16, 16);
        fill(&mut map, 11);
        assert_eq!(map.depth_mm[(0, 0)], 707.0);
        assert_eq!(map.depth_mm[(15, 15)], 808.0);
    }
}
