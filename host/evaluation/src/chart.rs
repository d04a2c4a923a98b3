//! Line charts as PNG.

use anyhow::{Result, anyhow};
use plotters::{prelude::*, style::register_font as register};

use crate::panels;

const SIZE: (u32, u32) = (860, 380);
/// The legend stands to the right of the axes.
const LEGEND_PX: i32 = 270;

/// Eight colours that also the colour-blind tell apart (Okabe & Ito 2008), black last.
const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(120, 120, 120),
    RGBColor(0, 0, 0),
];

/// Makes the font of all text known to plotters.
pub fn register_font() -> Result<()> {
    register("sans-serif", FontStyle::Normal, dejavu::sans::regular())
        .map_err(|_| anyhow!("the built-in font is damaged"))
}

/// One curve.
pub struct Curve {
    /// Its name in the legend.
    pub name: String,
    /// Its points.
    pub points: Vec<(f64, f64)>,
}

/// A chart of `curves`; the vertical axis starts at 0. The bytes of a PNG.
pub fn lines(title: &str, x_label: &str, y_label: &str, curves: &[Curve]) -> Result<Vec<u8>> {
    let points = || curves.iter().flat_map(|curve| &curve.points).filter(|(_, y)| y.is_finite());
    let [left, right] =
        [f64::min as fn(f64, f64) -> f64, f64::max].map(|f| points().map(|p| p.0).reduce(f).unwrap_or(0.0));
    let top = 1.08 * points().map(|p| p.1).fold(0.0, f64::max).max(1e-9);
    let mut buffer = vec![255_u8; 3 * (SIZE.0 * SIZE.1) as usize];
    draw(&mut buffer, title, [x_label, y_label], [left, right, top], curves)
        .map_err(|error| anyhow!("cannot draw {title:?}: {error}"))?;
    panels::encode(&buffer, SIZE)
}

fn draw(
    buffer: &mut [u8],
    title: &str,
    [x_label, y_label]: [&str; 2],
    [left, right, top]: [f64; 3],
    curves: &[Curve],
) -> Result<(), Box<dyn std::error::Error>> {
    let area = BitMapBackend::with_buffer(buffer, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let (axes, legend) = area.split_horizontally(SIZE.0 as i32 - LEGEND_PX);
    let mut chart = ChartBuilder::on(&axes)
        .caption(title, ("sans-serif", 17))
        .margin(12)
        .x_label_area_size(42)
        .y_label_area_size(58)
        .build_cartesian_2d(left..right, 0.0..top)?;
    chart
        .configure_mesh()
        .x_desc(x_label)
        .y_desc(y_label)
        .label_style(("sans-serif", 13))
        .axis_desc_style(("sans-serif", 14))
        .light_line_style(RGBColor(245, 245, 245))
        .bold_line_style(RGBColor(220, 220, 220))
        .draw()?;
    for (index, (curve, colour)) in curves.iter().zip(COLOURS.iter().cycle()).enumerate() {
        let finite = curve.points.iter().copied().filter(|(_, y)| y.is_finite());
        let style = colour.stroke_width(2);
        chart.draw_series(LineSeries::new(finite, style))?;
        let y = 48 + 22 * index as i32;
        legend.draw(&PathElement::new([(4, y), (24, y)], style))?;
        legend.draw(&Text::new(curve.name.clone(), (30, y - 7), ("sans-serif", 12).into_font()))?;
    }
    area.present()?;
    Ok(())
}
