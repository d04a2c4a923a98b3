//! A folder of frames with the streaming answer drawn on them.

use std::{io::Cursor, path::Path};

use farnear_files::{EncodeError, staging::Staging, text::Writer, video::Pixels};
use farnear_recognition::model::Answer;
use farnear_silhouettes::mask::{Mask, bits::BitMask};
use image::{ImageFormat, Rgb, RgbImage, imageops};

use crate::error::Result;

const INK: Rgb<u8> = Rgb([255, 255, 255]);
const DARK: Rgb<u8> = Rgb([24, 24, 24]);
const OUTLINE: Rgb<u8> = Rgb([255, 160, 0]);
const KNOWN: Rgb<u8> = Rgb([60, 160, 90]);
const UNKNOWN: Rgb<u8> = Rgb([150, 60, 60]);
const TEXT_PX: f32 = 20.0;
const GAP_PX: u32 = 6;
/// Smaller frames are enlarged by whole numbers to at least this height.
const LEAST_HEIGHT_PX: u32 = 240;
const SHOWN: usize = 3;

/// Removed when dropped before [`Self::finish`].
pub(super) struct AnnotatedVideo {
    out: Staging,
    writer: Writer,
    frames: usize,
}

pub(super) struct Shown {
    /// First row, first column, one past the last row and column.
    pub spans: [usize; 4],
    pub text: String,
    pub known: bool,
}

impl AnnotatedVideo {
    pub fn begin(folder: &Path) -> Result<Self> {
        Ok(Self { out: Staging::new_folder(folder)?, writer: Writer::new(TEXT_PX)?, frames: 0 })
    }

    pub fn draw(&mut self, picture: Option<&Pixels>, mask: &Mask, answer: &Answer) -> Result<()> {
        let seen = with_outline(picture, mask);
        let line = self.writer.height();
        let strip = SHOWN as u32 * (line + GAP_PX) + GAP_PX;
        let (width, height) = (seen.width().max(320), seen.height());
        let mut page = RgbImage::from_pixel(width, height + strip, DARK);
        imageops::overlay(&mut page, &seen, i64::from((width - seen.width()) / 2), 0);
        let mut ranked: Vec<&(String, f32)> = answer.probabilities.iter().collect();
        ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
        for (row, (name, probability)) in (0_u32..).zip(ranked.into_iter().take(SHOWN)) {
            let top = height + GAP_PX + row * (line + GAP_PX);
            let bar = ((width - 2 * GAP_PX) as f32 * probability.clamp(0.0, 1.0)) as u32;
            let colour = if answer.activity.is_some() { KNOWN } else { UNKNOWN };
            for (x, y) in (0..bar).flat_map(|x| (0..line).map(move |y| (x, y))) {
                page.put_pixel(GAP_PX + x, top + y, colour);
            }
            let unknown = if row == 0 && answer.activity.is_none() { " (unknown)" } else { "" };
            let text = format!("{name} {:.0} %{unknown}", 100.0 * probability);
            self.writer.write(&mut page, 2 * GAP_PX, top, &text, INK);
        }
        self.write(&page)
    }

    pub fn draw_people(&mut self, picture: Option<&Pixels>, mask: &Mask, people: &[Shown]) -> Result<()> {
        let mut page = with_outline(picture, mask);
        let times = page.height() / mask.nrows().max(1) as u32;
        for person in people {
            let colour = if person.known { KNOWN } else { UNKNOWN };
            let [top, left, bottom, right] = person.spans.map(|at| at as u32 * times);
            let (right, bottom) = (right.min(page.width()), bottom.min(page.height()));
            let sides = (left..right).flat_map(|x| [(x, top), (x, bottom.saturating_sub(1))]);
            let ends = (top..bottom).flat_map(|y| [(left, y), (right.saturating_sub(1), y)]);
            let (wide, high) = page.dimensions();
            for (x, y) in sides.chain(ends).filter(|(x, y)| *x < wide && *y < high) {
                page.put_pixel(x, y, colour);
            }
            let (width, height) = (self.writer.width(&person.text), self.writer.height());
            let (x, y) = (left.min(page.width().saturating_sub(width)), top.saturating_sub(height));
            for at in (x..(x + width).min(page.width())).flat_map(|x| (y..y + height).map(move |y| (x, y))) {
                if at.1 < page.height() {
                    page.put_pixel(at.0, at.1, colour);
                }
            }
            self.writer.write(&mut page, x, y, &person.text, INK);
        }
        self.write(&page)
    }

    fn write(&mut self, page: &RgbImage) -> Result<()> {
        self.frames += 1;
        let mut png = Cursor::new(Vec::new());
        page.write_to(&mut png, ImageFormat::Png).map_err(EncodeError::of("a frame with its answer"))?;
        Ok(self.out.write(&format!("frame_{:06}.png", self.frames), &png.into_inner())?)
    }

    pub fn finish(self) -> Result<()> {
        Ok(self.out.finish()?)
    }
}

fn with_outline(picture: Option<&Pixels>, mask: &Mask) -> RgbImage {
    let (height, width) = mask.dim();
    let level = |y: usize, x: usize| match picture {
        Some(Pixels::Grey(grey)) => grey.get((y, x)).map_or([0; 3], |v| [*v; 3]),
        Some(Pixels::Rgb(rgb)) => [0, 1, 2].map(|k| rgb.get((y, x, k)).copied().unwrap_or_default()),
        None => [if mask[[y, x]] { 200 } else { 0 }; 3],
    };
    let inner = BitMask::pack(mask.view()).eroded(1).unpack();
    let seen = RgbImage::from_fn(width as u32, height as u32, |x, y| {
        let (y, x) = (y as usize, x as usize);
        if mask[[y, x]] && !inner[[y, x]] { OUTLINE } else { Rgb(level(y, x)) }
    });
    let times = LEAST_HEIGHT_PX.div_ceil(seen.height().max(1)).clamp(1, 8);
    if times == 1 || seen.height() >= LEAST_HEIGHT_PX {
        return seen;
    }
    imageops::resize(&seen, seen.width() * times, seen.height() * times, imageops::FilterType::Nearest)
}
