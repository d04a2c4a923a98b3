//! Page of the target: cells as a 1-bit image, a 100 mm line, centre marks.

use pdf_writer::{Content, Finish, Name, Pdf, Rect, Ref, Str};

use super::{MARGIN_MM, Paper, Texture};

/// Units of a PDF page per millimetre.
const POINTS: f64 = 72.0 / 25.4;
/// Line to check the printed scale.
const RULER_MM: f64 = 100.0;
/// Marks at the middle of the texture's sides.
const MARK_MM: f64 = 5.0;

pub(super) fn pdf(texture: &Texture, paper: Paper, cell_mm: f64, label: &str) -> Vec<u8> {
    let [catalog, tree, page, image, font, content] = [1, 2, 3, 4, 5, 6].map(Ref::new);
    let (picture, letters) = (Name(b"Cells"), Name(b"Letters"));
    let mut pdf = Pdf::new();
    let mut root = pdf.catalog(catalog);
    root.pages(tree);
    // Request printing at actual size.
    root.viewer_preferences().pair(Name(b"PrintScaling"), Name(b"None"));
    root.finish();
    pdf.pages(tree).kids([page]).count(1);
    let mut sheet = pdf.page(page);
    sheet.media_box(Rect::new(0.0, 0.0, points(paper.width_mm), points(paper.height_mm)));
    sheet.parent(tree).contents(content);
    let mut resources = sheet.resources();
    resources.x_objects().pair(picture, image);
    resources.fonts().pair(letters, font);
    resources.finish();
    sheet.finish();
    let bits = packed(texture);
    let mut cells = pdf.image_xobject(image, &bits);
    cells.width(texture.columns as i32).height(texture.rows as i32).bits_per_component(1).interpolate(false);
    cells.color_space().device_gray();
    cells.finish();
    pdf.type1_font(font).base_font(Name(b"Helvetica"));
    pdf.stream(content, &drawing(texture, paper, cell_mm, label, picture, letters));
    pdf.finish()
}

fn drawing(
    texture: &Texture,
    paper: Paper,
    cell_mm: f64,
    label: &str,
    picture: Name<'_>,
    letters: Name<'_>,
) -> Vec<u8> {
    let (width, height) = (texture.columns as f64 * cell_mm, texture.rows as f64 * cell_mm);
    let (left, top) = (0.5 * (paper.width_mm - width), paper.height_mm - MARGIN_MM);
    let bottom = top - height;
    let mut content = Content::new();
    content.save_state();
    content.transform([points(width), 0.0, 0.0, points(height), points(left), points(bottom)]);
    content.x_object(picture);
    content.restore_state();
    let mut line = |from: [f64; 2], to: [f64; 2]| {
        content.move_to(points(from[0]), points(from[1])).line_to(points(to[0]), points(to[1])).stroke();
    };
    // The cross is on a whole cell, so slightly off the page's centre.
    let middle = left + ((texture.columns / 2) as f64 + 0.5) * cell_mm;
    let level = top - ((texture.rows / 2) as f64 + 0.5) * cell_mm;
    for (x, away) in [(left - 1.0, -MARK_MM), (left + width + 1.0, MARK_MM)] {
        line([x, level], [x + away, level]);
    }
    for (y, away) in [(top + 1.0, MARK_MM), (bottom - 1.0, -MARK_MM)] {
        line([middle, y], [middle, y + away]);
    }
    let ruler = MARGIN_MM + 6.0;
    line([left, ruler], [left + RULER_MM, ruler]);
    for end in [left, left + RULER_MM] {
        line([end, ruler - 1.5], [end, ruler + 1.5]);
    }
    for (x, y, text) in [
        (left + 2.0, ruler + 2.0, "100 mm, if it was printed at its actual size".to_owned()),
        (left, ruler - 5.5, format!("{label}; this edge is the lower one")),
    ] {
        content.begin_text().set_font(letters, 8.0).next_line(points(x), points(y));
        content.show(Str(text.as_bytes())).end_text();
    }
    content.finish().into_vec()
}

/// Packs rows of bits into whole bytes; white is 1.
fn packed(texture: &Texture) -> Vec<u8> {
    let row = |cells: &[bool]| -> Vec<u8> {
        let byte = |eight: &[bool]| {
            eight.iter().enumerate().fold(0, |byte, (place, black)| byte | u8::from(!black) << (7 - place))
        };
        cells.chunks(8).map(byte).collect()
    };
    texture.black.chunks(texture.columns).flat_map(row).collect()
}

fn points(mm: f64) -> f32 {
    (mm * POINTS) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_become_bits_from_the_left_and_rows_begin_a_byte() {
        let black = [true, false, false, true, true, true, true, true, false, true];
        let texture = Texture { columns: 5, rows: 2, black: black.to_vec() };
        assert_eq!(packed(&texture), [0b0110_0000, 0b0001_0000]);
    }
}
