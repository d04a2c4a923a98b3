//! Chromaticity: in shadow the value drops while hue and saturation stay (Cucchiara, Grana, Piccardi and
//! Prati, IEEE PAMI 25, 2003, equation 5); differences are averaged over a window as in Sanin et al. 2012.

use ndarray::Array2;

use super::images::{Images, hsv, hue_difference, rgb, window_means};
use farnear_silhouettes::mask::Mask;

/// Value relative to the background.
const DARKEST: f32 = 0.3;
const LIGHTEST: f32 = 1.0;
const WINDOW_RADIUS_PX: usize = 2;

pub(super) struct Limits {
    /// Largest excess saturation over the background, 0 to 1.
    pub saturation: f32,
    pub hue_deg: f32,
    /// Below this saturation (0 to 1) hue is noise and ignored.
    pub least_saturation: f32,
}

pub(super) const LIMITS: Limits = Limits { saturation: 0.16, hue_deg: 48.0, least_saturation: 0.15 };

pub(super) fn detect(images: &Images<'_>, limits: &Limits) -> Mask {
    let mut ratio = Array2::zeros(images.size());
    let mut differences = Array2::from_elem(images.size(), [0.0; 2]);
    for (at, _) in images.foreground.indexed_iter().filter(|&(_, &set)| set) {
        let [hue, saturation, value] = hsv(rgb(images.frame, at));
        let [background_hue, background_saturation, background_value] = hsv(rgb(images.background, at));
        // Nothing is darker than a black background.
        ratio[at] = if background_value > 0.0 { value / background_value } else { f32::INFINITY };
        let coloured = saturation.min(background_saturation) >= limits.least_saturation;
        let hue = if coloured { hue_difference(hue, background_hue) } else { 0.0 };
        differences[at] = [saturation - background_saturation, hue];
    }
    let means = window_means(&differences, images.foreground, WINDOW_RADIUS_PX);
    images.foreground_where(|at| {
        let [saturation, hue] = means[at];
        (DARKEST..=LIGHTEST).contains(&ratio[at]) && saturation <= limits.saturation && hue <= limits.hue_deg
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    fn plain(colour: [u8; 3]) -> Array3<u8> {
        Array3::from_shape_fn((6, 6, 3), |(_, _, channel)| colour[channel])
    }

    fn passes(frame: [u8; 3], background: [u8; 3]) -> bool {
        let (frame, background) = (plain(frame), plain(background));
        let mask = Array2::from_elem((6, 6), true);
        let images = Images::new(frame.view(), background.view(), mask.view()).unwrap();
        let found = detect(&images, &LIMITS);
        assert!(found.iter().all(|&set| set == found[[0, 0]]));
        found[[0, 0]]
    }

    #[test]
    fn only_a_darker_copy_passes() {
        let ground = [160, 120, 80];
        assert!(passes([96, 72, 48], ground), "60 % of the light");
        assert!(!passes([32, 24, 16], ground), "20 % of the light");
        assert!(!passes([176, 132, 88], ground), "brighter");
        assert!(!passes([48, 72, 96], ground), "another hue");
        assert!(!passes([100, 50, 10], ground), "more saturated");
        assert!(!passes([0, 0, 0], [0, 0, 0]), "black on black");
        assert!(passes([70, 72, 78], [160, 152, 145]), "grey in the sky's light");
    }
}
