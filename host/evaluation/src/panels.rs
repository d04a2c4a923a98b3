//! Maps in a row as a small PNG: depths near (warm) to far (cold), errors too near (blue) to too far (red).

use anyhow::{Result, anyhow, bail};
use colorous::Gradient;
use ndarray::{Array2, ArrayView2, s};
use plotters::prelude::*;

const SHRINK: usize = 3;
const MARGIN: usize = 10;
const TITLE: usize = 26;
/// Few colours keep the picture small.
const LEVELS: usize = 40;
const NO_VALUE: [u8; 3] = [150, 150, 152];

pub struct Panel<'a> {
    pub title: String,
    pub map: ArrayView2<'a, f32>,
    pub scale: Scale,
}

#[derive(Clone, Copy)]
pub enum Scale {
    /// Depths of both ends of the scale, mm.
    Depth([f32; 2]),
    /// Magnitude at the ends of the scale, mm.
    Error(f32),
    Grey(f32),
}

impl Scale {
    fn colour(self, value: f32) -> [u8; 3] {
        if !value.is_finite() {
            return NO_VALUE;
        }
        let (gradient, place): (Gradient, f32) = match self {
            Self::Depth([near, far]) => (colorous::TURBO, 1.0 - (value - near) / (far - near)),
            Self::Error(limit) => (colorous::RED_BLUE, 0.5 - 0.5 * value / limit),
            Self::Grey(white) => (colorous::GREYS, 1.0 - value / white),
        };
        let level = (place.clamp(0.0, 1.0) * (LEVELS - 1) as f32).round() as usize;
        let colour = gradient.eval_rational(level, LEVELS);
        [colour.r, colour.g, colour.b]
    }
}

pub fn row(panels: &[Panel<'_>]) -> Result<Vec<u8>> {
    grid(panels.len(), panels)
}

/// [`grid`] of maps with their titles, in one scale.
pub fn titled(across: usize, maps: &[(String, Array2<f32>)], scale: Scale) -> Result<Vec<u8>> {
    let panels: Vec<Panel<'_>> =
        maps.iter().map(|(title, map)| Panel { title: title.clone(), map: map.view(), scale }).collect();
    grid(across, &panels)
}

/// Panels of one size in rows of `across`; returns a PNG.
pub fn grid(across: usize, panels: &[Panel<'_>]) -> Result<Vec<u8>> {
    let Some(first) = panels.first() else { bail!("a picture without panels") };
    let (rows, columns) = (first.map.nrows() / SHRINK, first.map.ncols() / SHRINK);
    let down = panels.len().div_ceil(across);
    let size = (MARGIN + across * (columns + MARGIN), down * (TITLE + rows + MARGIN));
    let place = |index: usize| {
        (MARGIN + index % across * (columns + MARGIN), index / across * (TITLE + rows + MARGIN))
    };
    let mut buffer = vec![255_u8; 3 * size.0 * size.1];
    for (index, panel) in panels.iter().enumerate() {
        let (left, top) = place(index);
        for ((row, column), value) in shrunk(panel.map).indexed_iter() {
            if row < rows && column < columns {
                let at = 3 * ((top + TITLE + row) * size.0 + left + column);
                buffer[at..at + 3].copy_from_slice(&panel.scale.colour(*value));
            }
        }
    }
    let size = (size.0 as u32, size.1 as u32);
    titles(&mut buffer, size, place, panels).map_err(|error| anyhow!("cannot write titles: {error}"))?;
    encode(&buffer, size)
}

fn titles(
    buffer: &mut [u8],
    size: (u32, u32),
    place: impl Fn(usize) -> (usize, usize),
    panels: &[Panel<'_>],
) -> Result<(), Box<dyn std::error::Error>> {
    let area = BitMapBackend::with_buffer(buffer, size).into_drawing_area();
    for (index, panel) in panels.iter().enumerate() {
        let (left, top) = place(index);
        let at = (left as i32, top as i32 + 8);
        area.draw(&Text::new(panel.title.clone(), at, ("sans-serif", 13).into_font()))?;
    }
    area.present()?;
    Ok(())
}

/// Means over the valid ones of 3x3 pixels.
fn shrunk(map: ArrayView2<f32>) -> Array2<f32> {
    Array2::from_shape_fn((map.nrows() / SHRINK, map.ncols() / SHRINK), |(row, column)| {
        let block = map.slice(s![SHRINK * row..SHRINK * (row + 1), SHRINK * column..SHRINK * (column + 1)]);
        let (sum, count) =
            block.iter().filter(|v| v.is_finite()).fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
        sum / count
    })
}

/// RGB as a PNG, with a palette if 256 colours suffice (greys are rounded to 16).
pub fn encode(rgb: &[u8], (width, height): (u32, u32)) -> Result<Vec<u8>> {
    let mut palette: Vec<[u8; 3]> = Vec::new();
    let mut indices = Vec::with_capacity(rgb.len() / 3);
    for pixel in rgb.chunks_exact(3) {
        let mut colour = [pixel[0], pixel[1], pixel[2]];
        if colour[0] == colour[1] && colour[1] == colour[2] {
            colour = [(f32::from(colour[0]) / 17.0).round() as u8 * 17; 3];
        }
        let index = palette.iter().position(|known| *known == colour).unwrap_or_else(|| {
            palette.push(colour);
            palette.len() - 1
        });
        if index > 255 {
            break;
        }
        indices.push(index as u8);
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    if palette.len() <= 256 {
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_palette(palette.concat());
        encoder.write_header()?.write_image_data(&indices)?;
    } else {
        encoder.set_color(png::ColorType::Rgb);
        encoder.write_header()?.write_image_data(rgb)?;
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_blue_when_too_near_and_red_when_too_far() {
        let scale = Scale::Error(2.0);
        let ([near_red, _, near_blue], [far_red, _, far_blue]) = (scale.colour(-2.0), scale.colour(2.0));
        assert!(near_blue > near_red && far_red > far_blue);
        assert_eq!(scale.colour(f32::NAN), NO_VALUE);
    }

    #[test]
    fn a_row_is_a_png_of_the_panels_size() {
        crate::chart::register_font().unwrap();
        let map = Array2::from_shape_fn((30, 60), |(y, x)| (x + y) as f32);
        let panel = || Panel { title: "a".into(), map: map.view(), scale: Scale::Depth([0.0, 90.0]) };
        let bytes = row(&[panel(), panel()]).unwrap();
        let reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        assert_eq!(reader.info().size(), (10 + 2 * 30, 26 + 10 + 10));
        assert_eq!(reader.info().color_type, png::ColorType::Indexed);
    }
}
