//! Confidence of each pixel, and which pixels have too little texture.
//!
//! Two things make a depth doubtful: a low texture energy `c1` (window sum of `p1^2`) compared with the rest of the
//! image, and a window that the model does not explain (noise, a depth step, saturation). The misfit is the part of the
//! difference image that its regression on `p1` leaves, `(sum m^2 - (sum p1 m)^2 / c1) / c1`: the mean square of the
//! pixels' own alpha about the window's. Confidence is `c1 / (c1 + T) / (1 + misfit)`, `T = 0.05 median(c1)`: 1/2 for a
//! perfect fit on the threshold. Li 2014's rule (eq. 6.15) compares the variance of the ratio with 0.0144 with an
//! inverted inequality; it does not separate. Cost: O(1) per pixel; the median uses about 10,000 pixels.

use ndarray::{Array2, ArrayView2, Ix2, SliceInfo, SliceInfoElem, Zip, s};

/// Texture energy relative to its median below which a pixel counts as low texture.
pub const LOW_TEXTURE: f32 = 0.05;

/// Texture energy relative to its median below which it is rounding only: no depth.
pub(crate) const NO_TEXTURE: f32 = 1e-7;

const SAMPLE: usize = 10_000;

pub(crate) fn sample((height, width): (usize, usize)) -> SliceInfo<[SliceInfoElem; 2], Ix2, Ix2> {
    let step = (((height * width) as f64 / SAMPLE as f64).sqrt() as usize).max(1);
    // A long image may be narrower than the step.
    let [y, x] = [height, width].map(|side| step.min(side.max(1)));
    s![y / 2..;y, x / 2..;x]
}

/// Median energy of the pixels with texture, the unit of texture energy; 0 without any.
pub fn texture_scale(texture: ArrayView2<f32>) -> f32 {
    // Positive floats are ordered like their bits, which compare faster.
    let mut values: Vec<u32> =
        texture.slice(sample(texture.dim())).iter().filter(|t| **t > 0.0).map(|t| t.to_bits()).collect();
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    f32::from_bits(*values.select_nth_unstable(middle).1)
}

/// Confidence of a pixel with texture energy `texture` and relative misfit `misfit`; 0 without texture.
#[inline(always)]
pub fn confidence(texture: f32, misfit: f32, scale: f32) -> f32 {
    if texture > NO_TEXTURE * scale {
        texture / ((texture + LOW_TEXTURE * scale) * (1.0 + misfit))
    } else {
        0.0
    }
}

pub(crate) fn withhold(texture: &mut Array2<f32>, invalid: &Array2<bool>) {
    Zip::from(texture).and(invalid).for_each(|texture, invalid| {
        if *invalid {
            *texture = f32::NAN;
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_pixels_have_no_texture() {
        let mut texture = ndarray::array![[1.0, 2.0], [3.0, 4.0]];
        withhold(&mut texture, &ndarray::array![[false, true], [false, false]]);
        assert!(texture[(0, 1)].is_nan() && texture.iter().filter(|value| value.is_finite()).count() == 3);
    }

    #[test]
    fn about_ten_thousand_pixels_are_sampled() {
        for (size, side) in [((50, 80), (50, 80)), ((400, 900), (67, 150)), ((1000, 1000), (100, 100))] {
            let map = Array2::<f32>::zeros(size);
            // The step is rounded down.
            assert_eq!(map.slice(sample(size)).dim(), side);
        }
        assert_eq!(Array2::<f32>::zeros((1, 200_000)).slice(sample((1, 200_000))).dim(), (1, 50_000));
    }

    #[test]
    fn the_scale_is_the_median_of_the_pixels_with_texture() {
        assert_eq!(
            texture_scale(ndarray::array![[0.0, 0.0, 0.0], [f32::NAN, 3.0, 0.0], [5.0, 0.0, 4.0]].view()),
            4.0
        );
        assert_eq!(texture_scale(Array2::zeros((4, 4)).view()), 0.0);
    }
}
