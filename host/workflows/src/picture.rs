//! Figures of an image: brightness, saturation, texture, focus.

use farnear_capture::camera::Image;
use farnear_depth::focus_measure::FocusMeasure;
use ndarray::s;
use serde::Serialize;

use crate::{figures::rounded, measure::Rectangle};

const BINS: usize = 256;
/// Share of saturated pixels that affects depth: their true values, and so the blur, are unknown.
const SATURATED: f64 = 0.005;
/// Mean relative to full scale below which read noise dominates.
const DARK: f64 = 0.04;
/// Contrast (standard deviation / mean) with too little texture for defocus.
const TEXTURELESS: f64 = 0.02;

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PictureFigures {
    pub width: usize,
    pub height: usize,
    pub bits: u8,
    /// Relative to full scale.
    pub mean: f64,
    /// Standard deviation / mean.
    pub contrast: f64,
    /// Share of pixels at the largest code.
    pub saturated_fraction: f64,
    /// Pixels per bin of the full scale, darkest first.
    pub histogram: Vec<u32>,
    /// Larger is sharper; `None` for a dark or tiny image.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focus: Option<f64>,
    /// Reasons against use for depth, with remedies.
    pub warnings: Vec<String>,
}

/// Figures of the part of `region` inside the image, or of all of it. The warnings are always those of the whole image.
pub fn figures_of(image: &Image, region: Option<Rectangle>, measure: FocusMeasure) -> PictureFigures {
    let whole = figures(image, measure);
    match region.and_then(|region| part(image, region)) {
        Some(part) => PictureFigures { warnings: whole.warnings, ..figures(&part, measure) },
        None => whole,
    }
}

/// The part of `region` inside the image; `None` if it is empty.
fn part(image: &Image, region: Rectangle) -> Option<Image> {
    let (height, width) = image.pixels.dim();
    let right = region.x.saturating_add(region.width).min(width);
    let bottom = region.y.saturating_add(region.height).min(height);
    if region.x >= right || region.y >= bottom {
        return None;
    }
    let pixels = image.pixels.slice(s![region.y..bottom, region.x..right]).to_owned();
    Some(Image { pixels, ..*image })
}

pub fn figures(image: &Image, measure: FocusMeasure) -> PictureFigures {
    let (height, width) = image.pixels.dim();
    let counts = image.counts();
    let (bits, largest) = (image.bits.clamp(1, 16), counts.len() - 1);
    let mut histogram = vec![0u32; BINS];
    let (mut sum, mut squares) = (0.0f64, 0.0f64);
    for (code, pixels) in counts.iter().enumerate().filter(|(_, pixels)| **pixels > 0) {
        histogram[if bits >= 8 { code >> (bits - 8) } else { code << (8 - bits) }] += pixels;
        sum += code as f64 * f64::from(*pixels);
        squares += (code * code) as f64 * f64::from(*pixels);
    }
    let (count, full) = (image.pixels.len().max(1) as f64, largest as f64);
    let mean = sum / count;
    let deviation = (squares / count - mean * mean).max(0.0).sqrt();
    let contrast = if mean > 0.0 { deviation / mean } else { 0.0 };
    let saturated_fraction = f64::from(counts[largest]) / count;
    let focus = measure.of(image.codes().view()).ok();
    PictureFigures {
        width,
        height,
        bits: image.bits,
        mean: rounded(mean / full, 4),
        contrast: rounded(contrast, 4),
        saturated_fraction: rounded(saturated_fraction, 6),
        histogram,
        focus,
        warnings: warnings(saturated_fraction, mean / full, contrast),
    }
}

fn warnings(saturated: f64, mean: f64, contrast: f64) -> Vec<String> {
    let mut warnings = Vec::new();
    if saturated > SATURATED {
        let percent = 100.0 * saturated;
        warnings
            .push(format!("{percent:.1} % of the pixels are saturated: expose shorter or close the light"));
    }
    if mean < DARK {
        warnings.push(format!("dark: {:.1} % of the full scale in the mean; expose longer", 100.0 * mean));
    }
    if contrast < TEXTURELESS {
        warnings.push("hardly any texture: depth from defocus needs some; project or paint a pattern".into());
    }
    warnings
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    fn seen(bits: u8, code: impl Fn(usize, usize) -> u16) -> PictureFigures {
        let pixels = Array2::from_shape_fn((32, 48), |(y, x)| code(y, x));
        figures(&Image::new(pixels, bits), FocusMeasure::Tenengrad)
    }

    #[test]
    fn a_textured_picture_draws_no_warning() {
        let found = seen(12, |y, x| if (x / 2 + y / 2) % 2 == 0 { 1000 } else { 3000 });
        assert_eq!(found.warnings, Vec::<String>::new());
        assert_eq!((found.width, found.height, found.bits), (48, 32, 12));
        assert_eq!(found.histogram.iter().sum::<u32>(), 48 * 32);
        // 1000 of 4096 is in bin 62, 3000 in bin 187.
        assert_eq!((found.histogram[62], found.histogram[187]), (768, 768));
        assert!((found.mean - 2000.0 / 4095.0).abs() < 1e-4);
        assert!((found.contrast - 0.5).abs() < 1e-4);
    }

    #[test]
    fn a_part_ends_at_the_border_and_none_lies_outside() {
        let image = Image::new(Array2::from_shape_fn((4, 6), |(y, x)| (10 * y + x) as u16), 8);
        let at = |region: [usize; 4]| part(&image, region.into()).map(|part| part.pixels);
        assert_eq!(at([1, 2, 2, 1]), Some(ndarray::array![[21, 22]]));
        assert_eq!(at([4, 3, 9, usize::MAX]), Some(ndarray::array![[34, 35]]));
        assert_eq!((at([6, 0, 1, 1]), at([0, 0, 0, 3])), (None, None));
    }

    #[test]
    fn a_region_hides_no_warning_of_the_whole_image() {
        let image = Image::new(Array2::from_shape_fn((32, 48), |(_, x)| if x < 4 { 255 } else { 100 }), 8);
        let found = figures_of(&image, Some([10, 0, 20, 32].into()), FocusMeasure::Tenengrad);
        assert_eq!((found.width, found.saturated_fraction), (20, 0.0));
        assert!(found.warnings[0].starts_with("8.3 % of the pixels"), "{:?}", found.warnings);
        assert_eq!(figures_of(&image, None, FocusMeasure::Tenengrad).width, 48);
    }

    #[test]
    fn sharper_is_larger() {
        let sharp = seen(8, |_, x| if x % 8 < 4 { 50 } else { 200 }).focus.unwrap();
        let soft = seen(8, |_, x| (125.0 + 75.0 * (x as f64 * 0.785).sin()) as u16).focus.unwrap();
        assert!(sharp > soft, "{sharp} {soft}");
    }

    #[test]
    fn unfit_pictures_give_warnings() {
        assert!(seen(8, |_, x| if x < 4 { 255 } else { 100 }).warnings[0].starts_with("8.3 % of the pixels"));
        let dark = seen(8, |_, x| (x % 2) as u16);
        assert!(dark.warnings[0].starts_with("dark"), "{:?}", dark.warnings);
        assert!(seen(8, |_, _| 100).warnings[0].starts_with("hardly any texture"));
        assert_eq!(seen(8, |_, _| 0).focus, None);
    }
}
