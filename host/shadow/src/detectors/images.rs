//! Inputs of all detectors, and shared colour and gradient measures.

use ndarray::{Array2, ArrayView2, ArrayView3};

#[derive(Clone, Copy, Debug)]
pub struct Images<'a> {
    /// RGB, shape (height, width, 3).
    pub frame: ArrayView3<'a, u8>,
    /// The scene without the subject, same shape.
    pub background: ArrayView3<'a, u8>,
    /// Subject or shadow, shape (height, width).
    pub foreground: ArrayView2<'a, bool>,
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "shadow detectors need a frame and a background of shape (height, width, 3) and a mask of shape (height, width); \
     got {frame:?}, {background:?} and {foreground:?}"
)]
pub struct ImagesError {
    pub frame: (usize, usize, usize),
    pub background: (usize, usize, usize),
    pub foreground: (usize, usize),
}

impl<'a> Images<'a> {
    pub fn new(
        frame: ArrayView3<'a, u8>,
        background: ArrayView3<'a, u8>,
        foreground: ArrayView2<'a, bool>,
    ) -> Result<Self, ImagesError> {
        let (height, width) = foreground.dim();
        if frame.dim() != (height, width, 3) || background.dim() != frame.dim() {
            return Err(ImagesError {
                frame: frame.dim(),
                background: background.dim(),
                foreground: foreground.dim(),
            });
        }
        Ok(Self { frame, background, foreground })
    }

    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        self.foreground.dim()
    }

    pub(super) fn foreground_where(&self, mut test: impl FnMut((usize, usize)) -> bool) -> Array2<bool> {
        let mut mask = Array2::from_elem(self.size(), false);
        for (at, &set) in self.foreground.indexed_iter() {
            if set {
                mask[at] = test(at);
            }
        }
        mask
    }
}

pub(super) fn rgb(image: ArrayView3<'_, u8>, (row, column): (usize, usize)) -> [f32; 3] {
    [0, 1, 2].map(|channel| f32::from(image[[row, column, channel]]))
}

/// Mean of red, green and blue, shape (height, width).
pub(super) fn intensity(image: ArrayView3<'_, u8>) -> Array2<f32> {
    let (height, width, _) = image.dim();
    Array2::from_shape_fn((height, width), |at| rgb(image, at).iter().sum::<f32>() / 3.0)
}

/// Hue in [0, 360) degrees (0 for grey), saturation and value in 0..1, of RGB in 0..255.
pub(super) fn hsv([r, g, b]: [f32; 3]) -> [f32; 3] {
    let (high, low) = (r.max(g).max(b), r.min(g).min(b));
    let span = high - low;
    let hue = if span == 0.0 {
        0.0
    } else if high == r {
        60.0 * ((g - b) / span).rem_euclid(6.0)
    } else if high == g {
        60.0 * ((b - r) / span + 2.0)
    } else {
        60.0 * ((r - g) / span + 4.0)
    };
    [hue, if high == 0.0 { 0.0 } else { span / high }, high / 255.0]
}

pub(super) fn hue_difference(a: f32, b: f32) -> f32 {
    let difference = (a - b).abs();
    difference.min(360.0 - difference)
}

/// Horizontal and vertical central differences, grey levels per pixel; 0 at the border.
pub(super) fn gradient(image: &Array2<f32>) -> Array2<[f32; 2]> {
    let (height, width) = image.dim();
    Array2::from_shape_fn((height, width), |(row, column)| {
        if row == 0 || column == 0 || row + 1 == height || column + 1 == width {
            return [0.0, 0.0];
        }
        let across = image[[row, column + 1]] - image[[row, column - 1]];
        let down = image[[row + 1, column]] - image[[row - 1, column]];
        [0.5 * across, 0.5 * down]
    })
}

/// Means over the set pixels of a square window around each set pixel. Cost: O(N window^2).
pub(super) fn window_means<const N: usize>(
    values: &Array2<[f32; N]>,
    among: ArrayView2<'_, bool>,
    radius_px: usize,
) -> Array2<[f32; N]> {
    let (height, width) = among.dim();
    let mut means = Array2::from_elem(among.dim(), [0.0; N]);
    for ((row, column), mean) in means.indexed_iter_mut() {
        if !among[[row, column]] {
            continue;
        }
        let mut count = 0.0;
        for r in row.saturating_sub(radius_px)..(row + radius_px + 1).min(height) {
            for c in column.saturating_sub(radius_px)..(column + radius_px + 1).min(width) {
                if among[[r, c]] {
                    count += 1.0;
                    for (sum, value) in mean.iter_mut().zip(values[[r, c]]) {
                        *sum += value;
                    }
                }
            }
        }
        mean.iter_mut().for_each(|sum| *sum /= count);
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array3, arr2};

    #[test]
    fn hsv_of_known_colours() {
        // Smith 1978, the hexcone model: pure colours at multiples of 60 degrees.
        for (rgb, expected) in [
            ([255.0, 0.0, 0.0], [0.0, 1.0, 1.0]),
            ([255.0, 255.0, 0.0], [60.0, 1.0, 1.0]),
            ([0.0, 255.0, 0.0], [120.0, 1.0, 1.0]),
            ([0.0, 0.0, 255.0], [240.0, 1.0, 1.0]),
            ([255.0, 0.0, 255.0], [300.0, 1.0, 1.0]),
            ([51.0, 51.0, 51.0], [0.0, 0.0, 0.2]),
            ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
        ] {
            for (found, expected) in hsv(rgb).iter().zip(expected) {
                assert!((found - expected).abs() < 1e-4, "{rgb:?}");
            }
        }
        assert_eq!(hue_difference(350.0, 20.0), 30.0);
    }

    #[test]
    fn a_plane_has_its_slope_as_gradient() {
        let image = Array2::from_shape_fn((5, 6), |(row, column)| 3.0 * column as f32 - 2.0 * row as f32);
        let slopes = gradient(&image);
        assert_eq!(slopes[[2, 3]], [3.0, -2.0]);
        assert_eq!(slopes[[0, 3]], [0.0, 0.0]);
    }

    #[test]
    fn window_means_ignore_unset_pixels() {
        let values = arr2(&[[[1.0], [5.0], [100.0]], [[3.0], [7.0], [100.0]]]);
        let among = arr2(&[[true, true, false], [true, true, false]]);
        assert_eq!(window_means(&values, among.view(), 1)[[0, 1]], [4.0]);
    }

    #[test]
    fn window_means_reach_equally_far_to_all_sides() {
        let values = Array2::from_shape_fn((5, 7), |(row, column)| [(1 << column) as f32, (1 << row) as f32]);
        let all = Array2::from_elem((5, 7), true);
        assert_eq!(window_means(&values, all.view(), 1)[[2, 3]], [28.0 / 3.0, 14.0 / 3.0]);
        assert_eq!(window_means(&values, all.view(), 2)[[2, 3]], [62.0 / 5.0, 31.0 / 5.0]);
    }

    #[test]
    fn rejects_pictures_of_different_sizes() {
        let (frame, narrow) = (Array3::zeros((4, 5, 3)), Array3::zeros((4, 4, 3)));
        let mask = Array2::from_elem((4, 5), true);
        assert!(Images::new(frame.view(), frame.view(), mask.view()).is_ok());
        let error = Images::new(frame.view(), narrow.view(), mask.view()).unwrap_err();
        assert!(error.to_string().contains("(4, 4, 3)"), "{error}");
    }
}
