//! Text on a picture, in DejaVu Sans.

use ab_glyph::{Font, FontRef, PxScale, ScaleFont, point};
use image::{Rgb, RgbImage};

use crate::EncodeError;

pub struct Writer {
    font: FontRef<'static>,
    scale: PxScale,
}

impl Writer {
    pub fn new(height_px: f32) -> Result<Self, EncodeError> {
        let font = FontRef::try_from_slice(dejavu::sans::regular()).map_err(EncodeError::of("text"))?;
        Ok(Self { font, scale: PxScale::from(height_px) })
    }

    pub fn height(&self) -> u32 {
        self.font.as_scaled(self.scale).height().ceil() as u32
    }

    pub fn width(&self, text: &str) -> u32 {
        let font = self.font.as_scaled(self.scale);
        text.chars().map(|letter| font.h_advance(font.glyph_id(letter))).sum::<f32>().ceil() as u32
    }

    /// Writes with the upper left corner at (`left`, `top`), clipped.
    pub fn write(&mut self, picture: &mut RgbImage, left: u32, top: u32, text: &str, ink: Rgb<u8>) {
        let font = self.font.as_scaled(self.scale);
        let mut x = left as f32;
        let baseline = top as f32 + font.ascent();
        for letter in text.chars() {
            let id = font.glyph_id(letter);
            let glyph = id.with_scale_and_position(self.scale, point(x, baseline));
            x += font.h_advance(id);
            let Some(outline) = font.outline_glyph(glyph) else { continue };
            let bounds = outline.px_bounds();
            outline.draw(|dx, dy, cover| {
                let (x, y) = (bounds.min.x as i64 + i64::from(dx), bounds.min.y as i64 + i64::from(dy));
                let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else { return };
                let Some(pixel) = picture.get_pixel_mut_checked(x, y) else { return };
                for (value, ink) in pixel.0.iter_mut().zip(ink.0) {
                    let mixed =
                        f32::from(*value) + (f32::from(ink) - f32::from(*value)) * cover.clamp(0.0, 1.0);
                    *value = mixed.round() as u8;
                }
            });
        }
    }
}
