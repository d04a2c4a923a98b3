//! Confusion matrices as PNG: rows are true activities, columns answers, in per cent of the row.

use anyhow::Result;
use farnear_recognition::evaluation::confusion::Confusion;
use plotters::{
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};

use crate::chart::{Area, Drawn, draw_to_png};

const CELL_PX: i32 = 46;
const NAMES_PX: i32 = 118;
const TITLE_PX: i32 = 30;
const MARGIN_PX: i32 = 14;

pub fn pictures(matrices: &[(&str, &Confusion)]) -> Result<Vec<u8>> {
    let side = |confusion: &Confusion| NAMES_PX + CELL_PX * confusion.classes.len() as i32;
    let widths: Vec<i32> = matrices.iter().map(|(_, confusion)| side(confusion) + MARGIN_PX).collect();
    let height =
        matrices.iter().map(|(_, confusion)| side(confusion)).max().unwrap_or(0) + TITLE_PX + MARGIN_PX;
    let size = (widths.iter().sum::<i32>() as u32, height as u32);
    draw_to_png(size, "confusion matrices", |area| {
        let mut left = 0;
        for ((title, confusion), width) in matrices.iter().zip(&widths) {
            draw(area, left, title, confusion)?;
            left += width;
        }
        Ok(())
    })
}

fn draw(area: &Area<'_>, left: i32, title: &str, confusion: &Confusion) -> Drawn {
    let text = |size: i32, colour: RGBColor, horizontal: HPos| {
        ("sans-serif", size).into_font().color(&colour).pos(Pos::new(horizontal, VPos::Center))
    };
    let (cells, top) = (left + NAMES_PX, TITLE_PX + NAMES_PX);
    let middle = cells + CELL_PX * confusion.classes.len() as i32 / 2;
    area.draw(&Text::new(title.to_owned(), (middle, TITLE_PX / 2), text(16, BLACK, HPos::Center)))?;
    for (k, name) in confusion.classes.iter().enumerate() {
        let at = CELL_PX * k as i32 + CELL_PX / 2;
        area.draw(&Text::new(name.clone(), (cells - 8, top + at), text(14, BLACK, HPos::Right)))?;
        let upright = text(14, BLACK, HPos::Left).transform(FontTransform::Rotate270);
        area.draw(&Text::new(name.clone(), (cells + at, top - 8), upright))?;
    }
    for (i, row) in confusion.counts.iter().enumerate() {
        let total = row.iter().sum::<u32>().max(1);
        for (j, &count) in row.iter().enumerate() {
            let share = f64::from(count) / f64::from(total);
            let colour = shade(share, i == j);
            let (x, y) = (cells + CELL_PX * j as i32, top + CELL_PX * i as i32);
            let corners = [(x, y), (x + CELL_PX - 1, y + CELL_PX - 1)];
            area.draw(&Rectangle::new(corners, colour.filled()))?;
            if count > 0 {
                let ink = if share > 0.55 { WHITE } else { BLACK };
                let place = (x + CELL_PX / 2, y + CELL_PX / 2);
                area.draw(&Text::new(format!("{:.0}", 100.0 * share), place, text(14, ink, HPos::Center)))?;
            }
        }
    }
    Ok(())
}

/// Blue for right, orange for wrong answers, in eight steps to keep the picture small.
fn shade(share: f64, right: bool) -> RGBColor {
    let full = if right { [0.0, 114.0, 178.0] } else { [213.0, 94.0, 0.0] };
    let level = if share > 0.0 { (8.0 * share).ceil() / 8.0 } else { 0.0 };
    let mix = |k: usize| (244.0 + (full[k] - 244.0) * level).round() as u8;
    RGBColor(mix(0), mix(1), mix(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_holds_all_matrices_side_by_side() {
        crate::chart::register_font().unwrap();
        let mut confusion = Confusion::new(vec!["walk".into(), "dig".into()]);
        confusion.count(0, 0);
        confusion.count(1, 0);
        let bytes = pictures(&[("a", &confusion), ("b", &confusion)]).unwrap();
        let reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let side = (NAMES_PX + 2 * CELL_PX + MARGIN_PX) as u32;
        assert_eq!(reader.info().size(), (2 * side, side + TITLE_PX as u32));
    }

    #[test]
    fn right_and_wrong_have_their_own_colours_and_nothing_has_none() {
        assert_eq!(shade(0.0, true), shade(0.0, false));
        assert_ne!(shade(0.5, true), shade(0.5, false));
    }
}
