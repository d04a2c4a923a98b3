//! `view.png`: depth map as a colour picture: near is warm, far is cold, grey has no value; scale bar in mm.

use image::{Rgb, RgbImage};
use ndarray::ArrayView2;
use rayon::prelude::*;

use crate::{EncodeError, image_file::encode_to, quantiles::Quantiles, text::Writer};

/// Small maps are enlarged by an integer factor to at least this height, if [`MAX_WIDTH_PX`] allows it.
const MIN_HEIGHT_PX: usize = 320;
/// Maps are not enlarged beyond this width.
const MAX_WIDTH_PX: usize = 4096;
/// Part of outliers on either side that do not affect the colours.
const OUTLIERS: f64 = 0.005;
const MARGIN_PX: u32 = 24;
const BAR_PX: u32 = 22;
const BACKGROUND: Rgb<u8> = Rgb([250, 250, 248]);
const INK: Rgb<u8> = Rgb([40, 40, 44]);
const NO_VALUE: Rgb<u8> = Rgb([150, 150, 152]);

/// Floats have no more digits.
const DECIMALS_MAX: f64 = 9.0;

/// Confidence with full colour.
const CONFIDENT: f32 = 0.5;
/// Part of colour at confidence 0.
const FAINTEST: f32 = 0.15;

/// PNG of a depth map in mm. `confidence` (0 to 1, same shape) reduces the colour.
pub fn view_png(depth_mm: ArrayView2<f32>, confidence: ArrayView2<f32>) -> Result<Vec<u8>, EncodeError> {
    view_png_in("mm", depth_mm, confidence)
}

/// [`view_png`] with another unit for the scale.
pub fn view_png_in(
    unit: &str,
    depth: ArrayView2<f32>,
    confidence: ArrayView2<f32>,
) -> Result<Vec<u8>, EncodeError> {
    let mut png = Vec::new();
    let picture = draw(unit, depth, confidence)?;
    let size = (picture.height() as usize, picture.width() as usize);
    encode_to(picture.as_raw(), size, image::ExtendedColorType::Rgb8, &mut png)?;
    Ok(png)
}

fn draw(unit: &str, depth_mm: ArrayView2<f32>, confidence: ArrayView2<f32>) -> Result<RgbImage, EncodeError> {
    let (rows, columns) = depth_mm.dim();
    let widest = MAX_WIDTH_PX / columns.max(1);
    let zoom = MIN_HEIGHT_PX.div_ceil(rows.max(1)).min(widest).max(1) as u32;
    let (width, height) = (columns as u32 * zoom, rows as u32 * zoom);
    let range = Range::of(depth_mm);
    // Text height is 3.5 % of the picture within limits.
    let mut writer = Writer::new((height as f32 * 0.035).clamp(13.0, 60.0))?;
    let (step, decimals) = range.0.map_or((1.0, 0), |(near, far)| ticks(f64::from(far - near)));
    let label = |tick: f64| labelled(&format!("{tick:.decimals$}"), unit);
    let mut label_width = writer.width(&labelled("0000.0", unit));
    if let (Some((near, far)), 3..) = (range.0, decimals) {
        let ends = [near, far].map(|end| writer.width(&label(f64::from(end))));
        label_width = label_width.max(ends[0]).max(ends[1]);
    }
    let bar_left = MARGIN_PX * 2 + width;
    let canvas_width = bar_left + BAR_PX + 14 + label_width + MARGIN_PX;
    let mut canvas = RgbImage::from_pixel(canvas_width, height + 2 * MARGIN_PX, BACKGROUND);

    let colours = Colours::new(&range);
    let zoom = zoom as usize;
    let lines = canvas.par_chunks_exact_mut(3 * canvas_width as usize);
    lines.skip(MARGIN_PX as usize).take(height as usize).enumerate().for_each(|(y, line)| {
        let (pixels, _) = line[3 * MARGIN_PX as usize..].as_chunks_mut();
        let values = depth_mm.row(y / zoom).into_iter().zip(confidence.row(y / zoom));
        for (places, (depth, confidence)) in pixels.chunks_mut(zoom).zip(values) {
            places.fill(faded(colours.of(*depth), *confidence).0);
        }
    });
    let Some((near, far)) = range.0 else {
        writer.write(&mut canvas, bar_left, MARGIN_PX, "no depth", INK);
        return Ok(canvas);
    };
    // Scale bar: far at the top.
    for y in 0..height {
        let depth = far + (near - far) * (y as f32 + 0.5) / height as f32;
        for x in 0..BAR_PX {
            canvas.put_pixel(bar_left + x, MARGIN_PX + y, range.colour(depth));
        }
    }
    let mut tick = (f64::from(near) / step).ceil() * step;
    let mut last_label = u32::MAX;
    while tick <= f64::from(far) + 1e-6 * step {
        let from_top = (f64::from(far) - tick) / f64::from(far - near) * f64::from(height - 1);
        let y = MARGIN_PX + from_top.round() as u32;
        for x in 0..6 {
            canvas.put_pixel(bar_left + BAR_PX + x, y, INK);
        }
        let top = y.saturating_sub(writer.height() / 2);
        // In a low picture labels would overlap.
        if last_label - y >= writer.height() {
            writer.write(&mut canvas, bar_left + BAR_PX + 12, top, &label(tick), INK);
            last_label = y;
        }
        tick += step;
    }
    Ok(canvas)
}

/// A number in its unit: 12 mm, but image 12.
fn labelled(number: &str, unit: &str) -> String {
    if unit == "image" { format!("{unit} {number}") } else { format!("{number} {unit}") }
}

/// Colour table of a range: the scale takes longer than the rest of a large picture.
struct Colours {
    /// Nearest depth, and colours per mm.
    line: Option<[f32; 2]>,
    colours: Vec<Rgb<u8>>,
}

impl Colours {
    /// Far finer than visible steps.
    const NUMBER: usize = 4096;

    fn new(range: &Range) -> Self {
        let Some((near, far)) = range.0 else { return Self { line: None, colours: Vec::new() } };
        let last = (Self::NUMBER - 1) as f32;
        let depth = |i: usize| near + (far - near) * i as f32 / last;
        let colours = (0..Self::NUMBER).map(|i| range.colour(depth(i))).collect();
        Self { line: Some([near, last / (far - near)]), colours }
    }

    fn of(&self, depth_mm: f32) -> Rgb<u8> {
        let Some([near, per_mm]) = self.line.filter(|_| depth_mm.is_finite()) else { return NO_VALUE };
        // Negative floats become 0.
        let index = ((depth_mm - near) * per_mm + 0.5) as usize;
        self.colours[index.min(Self::NUMBER - 1)]
    }
}

/// `None` without values.
struct Range(Option<(f32, f32)>);

impl Range {
    fn of(depth_mm: ArrayView2<f32>) -> Self {
        let quantiles = Quantiles::new(depth_mm);
        let last = quantiles.finite().saturating_sub(1);
        let quantile = |part: f64| quantiles.at((part * last as f64) as usize);
        let (Some(near), Some(far)) = (quantile(OUTLIERS), quantile(1.0 - OUTLIERS)) else {
            return Self(None);
        };
        let middle = 0.5 * (near + far);
        // A plane has only noise: at least a thousandth of the distance spans the colours.
        let half = (0.5 * (far - near)).max(5e-4 * middle.abs());
        Self(Some((middle - half, middle + half)))
    }

    fn colour(&self, depth_mm: f32) -> Rgb<u8> {
        let Some((near, far)) = self.0.filter(|_| depth_mm.is_finite()) else { return NO_VALUE };
        let part = ((far - depth_mm) / (far - near)).clamp(0.0, 1.0);
        // Turbo's ends are almost black and are left out.
        let colour = colorous::TURBO.eval_continuous(0.06 + 0.88 * f64::from(part));
        Rgb([colour.r, colour.g, colour.b])
    }
}

/// Mixes towards grey by confidence, but keeps a tint.
fn faded(colour: Rgb<u8>, confidence: f32) -> Rgb<u8> {
    if confidence >= CONFIDENT {
        return colour;
    }
    let kept = FAINTEST + (1.0 - FAINTEST) * (confidence / CONFIDENT).clamp(0.0, 1.0);
    // Positive: adding a half and truncating rounds to nearest.
    let mix =
        |value: u8, grey: u8| (f32::from(grey) + (f32::from(value) - f32::from(grey)) * kept + 0.5) as u8;
    Rgb(std::array::from_fn(|channel| mix(colour[channel], NO_VALUE[channel])))
}

/// Distance of the ticks, and decimals with which their labels differ.
fn ticks(span: f64) -> (f64, usize) {
    let step = tick_step(span);
    // The addend covers rounding of powers of ten; a span of zero has no tick.
    let decimals = if step > 0.0 { -(step.log10() + 1e-9).floor() } else { 0.0 };
    (step, decimals.clamp(0.0, DECIMALS_MAX) as usize)
}

/// Tick distance: 1, 2 or 5 times a power of ten, for five to eleven ticks.
fn tick_step(span: f64) -> f64 {
    let rough = span / 8.0;
    let power = 10f64.powf(rough.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|factor| factor * power)
        .find(|step| *step >= rough)
        .unwrap_or(rough)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, array};

    #[test]
    fn near_is_warm_far_is_cold_and_nothing_is_grey() {
        let map = array![[900.0f32, 950.0, f32::NAN]];
        let range = Range::of(map.view());
        let [near, far] = [range.colour(900.0), range.colour(950.0)];
        assert!(near[0] > near[2] && far[2] > far[0], "{near:?} {far:?}");
        assert_eq!(range.colour(f32::NAN), NO_VALUE);
    }

    #[test]
    fn any_map_gives_a_picture() {
        for map in [
            Array2::from_elem((16, 16), f32::NAN),
            Array2::from_elem((16, 200), 900.0),
            Array2::from_shape_fn((400, 300), |(y, x)| 600.0 + (x + y) as f32),
        ] {
            let png = view_png(map.view(), Array2::ones(map.dim()).view()).unwrap();
            let picture = image::load_from_memory(&png).unwrap();
            assert!(picture.height() >= MIN_HEIGHT_PX as u32 && picture.width() > map.dim().1 as u32);
        }
    }

    #[test]
    fn a_row_is_not_enlarged_to_a_huge_picture() {
        for columns in [300, 4000, 6000] {
            let map = Array2::from_shape_fn((1, columns), |(_, x)| 600.0 + x as f32);
            let picture = draw("mm", map.view(), Array2::ones(map.dim()).view()).unwrap();
            let width = picture.width() as usize;
            assert!(width > columns && width < MAX_WIDTH_PX.max(columns) + 300, "{columns}: {width}");
        }
    }

    #[test]
    fn images_are_numbered() {
        assert_eq!(["mm", "image"].map(|unit| labelled("12", unit)), ["12 mm", "image 12"]);
    }

    #[test]
    fn ticks_are_round_and_few() {
        for span in [0.9, 4.6, 46.2, 250.0, 3000.0] {
            let step = tick_step(span);
            assert!((4.0..=11.0).contains(&(span / step)), "{span} {step}");
        }
    }

    #[test]
    fn labels_of_neighbouring_ticks_differ() {
        assert_eq!(ticks(0.0).1, 0);
        for (span, expected) in [(3000.0, 0), (8.0, 0), (0.8, 1), (0.09, 2), (0.008, 3), (2e-5, 6)] {
            let (step, decimals) = ticks(span);
            assert_eq!(decimals, expected, "{span}");
            assert_ne!(format!("{:.decimals$}", 20.0), format!("{:.decimals$}", 20.0 + step), "{span}");
        }
    }
}
