//! Maps as images (viridis), and a histogram as SVG.

use std::{fmt::Write as _, io::Cursor};

use farnear_files::EncodeError;
use image::{ImageFormat, Rgb, RgbImage};
use ndarray::ArrayView2;

use crate::{error::Result, quantile};

const BINS: usize = 96;
/// Floats have no more digits.
const DECIMALS_MAX: f64 = 9.0;
const NONE: Rgb<u8> = Rgb([150, 150, 152]);

/// Decimals for values of a range of this width, at least `least`: steps of a tenth of the range differ.
pub fn decimals(range: f64, least: usize) -> usize {
    let needed = if range > 0.0 { (1.0 - range.log10()).ceil() } else { 0.0 };
    least.max(needed.clamp(0.0, DECIMALS_MAX) as usize)
}

/// A map as PNG, from dark at `low` to bright at `high`.
pub fn colours(map: ArrayView2<f32>, [low, high]: [f64; 2]) -> Result<Vec<u8>> {
    let (height, width) = map.dim();
    let span = (high - low).max(f64::MIN_POSITIVE);
    let picture = RgbImage::from_fn(width as u32, height as u32, |x, y| {
        let value = map[[y as usize, x as usize]];
        if !value.is_finite() {
            return NONE;
        }
        let colour = colorous::VIRIDIS.eval_continuous(((f64::from(value) - low) / span).clamp(0.0, 1.0));
        Rgb([colour.r, colour.g, colour.b])
    });
    let mut png = Cursor::new(Vec::new());
    picture.write_to(&mut png, ImageFormat::Png).map_err(EncodeError::of("a map's picture"))?;
    Ok(png.into_inner())
}

/// Histogram without the outer half percents, as SVG.
pub fn histogram(depth: ArrayView2<f32>, unit: &str) -> String {
    let [Some(low), Some(high)] = [0.005, 0.995].map(|part| quantile::of_map(depth, part)) else {
        return "<p>no depth</p>".into();
    };
    let span = if high > low { high - low } else { 1e-3 };
    let decimals = decimals(span, 1);
    let mut counts = [0u32; BINS];
    for value in depth.iter().map(|value| f64::from(*value)).filter(|value| (low..=high).contains(value)) {
        let bin = ((value - low) / span * BINS as f64) as usize;
        counts[bin.min(BINS - 1)] += 1;
    }
    let most = f64::from(counts.iter().copied().max().unwrap_or(1).max(1));
    let mut svg =
        String::from("<svg viewBox=\"0 0 960 180\" role=\"img\" aria-label=\"histogram of depth\">");
    for (bin, count) in counts.iter().enumerate() {
        let height = 150.0 * f64::from(*count) / most;
        let (x, y) = (bin * 10, 150.0 - height);
        let _ = write!(svg, "<rect x={x} y={y:.1} width=9 height={height:.1} fill=\"#31688e\"/>");
    }
    for (x, anchor, value) in [(0, "start", low), (480, "middle", low + 0.5 * span), (960, "end", high)] {
        let _ = write!(
            svg,
            "<text x={x} y=170 font-size=14 text-anchor={anchor}>{value:.decimals$} {unit}</text>"
        );
    }
    svg.push_str("</svg>");
    svg
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    #[test]
    fn the_histogram_of_a_small_map_shows_every_value() {
        let map = Array2::from_shape_fn((2, 5), |(y, x)| (5 * y + x) as f32);
        let plot = histogram(map.view(), "mm");
        assert!(plot.contains(">0.0 mm<") && plot.contains(">9.0 mm<"), "{plot}");
        assert_eq!(plot.matches("height=150.0").count(), 10, "{plot}");
    }

    #[test]
    fn labels_of_a_small_range_differ() {
        for (range, expected) in [(46.0, 2), (0.5, 2), (0.08, 3), (2e-4, 5), (0.0, 2), (f64::NAN, 2)] {
            assert_eq!(decimals(range, 2), expected, "{range}");
        }
        let of_microscope = Array2::from_shape_fn((10, 10), |(_, x)| 2.0 + 1e-4 * x as f32);
        let plot = histogram(of_microscope.view(), "mm");
        for label in [">2.00000 mm<", ">2.00045 mm<", ">2.00090 mm<"] {
            assert!(plot.contains(label), "{plot}");
        }
    }
}
