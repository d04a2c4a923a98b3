//! Picture of a confusion matrix: rows are true activities, columns answers, per cent of the row.

use std::io::Cursor;

use farnear_files::{EncodeError, text::Writer};
use farnear_recognition::evaluation::confusion::Confusion;
use image::{ImageFormat, Rgb, RgbImage, imageops};

const PAPER: Rgb<u8> = Rgb([255, 255, 255]);
const INK: Rgb<u8> = Rgb([0, 0, 0]);
const TEXT_PX: f32 = 18.0;
const GAP_PX: u32 = 8;

pub fn png(confusion: &Confusion) -> Result<Vec<u8>, EncodeError> {
    let mut writer = Writer::new(TEXT_PX)?;
    let line = writer.height();
    let widest = confusion.classes.iter().map(|class| writer.width(class)).max().unwrap_or(0);
    let side = writer.width("100").max(line) + 2 * GAP_PX;
    let classes = confusion.classes.len() as u32;
    let edge = widest + 2 * GAP_PX;
    let mut picture =
        RgbImage::from_pixel(edge + classes * side + GAP_PX, edge + classes * side + GAP_PX, PAPER);
    for (row, (name, counts)) in (0_u32..).zip(confusion.classes.iter().zip(&confusion.counts)) {
        let middle = (side.saturating_sub(line)) / 2;
        let left = GAP_PX + widest - writer.width(name);
        writer.write(&mut picture, left, edge + row * side + middle, name, INK);
        // The column's name is vertical.
        let mut label = RgbImage::from_pixel(widest.max(1), line, PAPER);
        writer.write(&mut label, 0, 0, name, INK);
        let upright = imageops::rotate270(&label);
        imageops::overlay(&mut picture, &upright, i64::from(edge + row * side + middle), i64::from(GAP_PX));
        let total = counts.iter().sum::<u32>().max(1);
        for (column, &count) in (0_u32..).zip(counts) {
            let share = f64::from(count) / f64::from(total);
            let colour = colorous::BLUES.eval_continuous(share);
            let (x, y) = (edge + column * side, edge + row * side);
            for (dx, dy) in (0..side - 1).flat_map(|dy| (0..side - 1).map(move |dx| (dx, dy))) {
                picture.put_pixel(x + dx, y + dy, Rgb([colour.r, colour.g, colour.b]));
            }
            if count > 0 {
                let text = format!("{:.0}", 100.0 * share);
                let ink = if share > 0.5 { PAPER } else { INK };
                let left = x + (side.saturating_sub(writer.width(&text))) / 2;
                writer.write(&mut picture, left, y + middle, &text, ink);
            }
        }
    }
    let mut png = Cursor::new(Vec::new());
    picture.write_to(&mut png, ImageFormat::Png).map_err(EncodeError::of("the confusion matrix"))?;
    Ok(png.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn right_answers_are_dark_and_on_the_diagonal() {
        let mut confusion = Confusion::new(vec!["walk".into(), "dig".into()]);
        (0..4).for_each(|_| confusion.count(0, 0));
        confusion.count(1, 1);
        let picture = image::load_from_memory(&png(&confusion).expect("a picture")).expect("PNG").into_rgb8();
        // The lower right corner is in the last class's cell; the cell above it is empty.
        let at = |up: u32| picture[(picture.width() - GAP_PX - 4, picture.height() - GAP_PX - 4 - up)];
        let dark = |pixel: Rgb<u8>| pixel.0.iter().map(|&v| u32::from(v)).sum::<u32>() < 300;
        assert!(dark(at(0)) && !dark(at(50)), "{:?} {:?}", at(0), at(50));
    }
}
