//! Line charts as PNG pictures.

use anyhow::{Result, anyhow};
use plotters::{prelude::*, style::register_font as register};

use crate::panels;

const SIZE: (u32, u32) = (860, 380);
const LEGEND_PX: i32 = 270;

const SMALL_PX: (u32, u32) = (300, 240);
const LEGEND_BELOW_PX: u32 = 30;

/// Colours for the colour-blind: Okabe & Ito (2008), with grey for their yellow, and two darker ones.
const COLOURS: [RGBColor; 10] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(120, 120, 120),
    RGBColor(0, 0, 0),
    RGBColor(120, 60, 10),
    RGBColor(90, 0, 130),
];

/// Few curves have their own colours, many a shade from dark to light: they are a family.
fn colour(index: usize, count: usize) -> RGBColor {
    if count <= COLOURS.len() {
        return COLOURS[index];
    }
    // The last tenth of the scale is too light on white.
    let colorous::Color { r, g, b } = colorous::VIRIDIS.eval_rational(9 * index, 10 * count);
    RGBColor(r, g, b)
}

pub fn register_font() -> Result<()> {
    register("sans-serif", FontStyle::Normal, dejavu::sans::regular())
        .map_err(|_| anyhow!("the built-in font is damaged"))
}

#[derive(Clone)]
pub struct Curve {
    pub name: String,
    pub points: Vec<(f64, f64)>,
}

pub struct Plot {
    pub title: String,
    pub labels: [&'static str; 2],
    /// More than ten are shaded from dark to light.
    pub curves: Vec<Curve>,
    /// Range of the vertical axis; by default 0 to the largest value.
    pub vertical: Option<[f64; 2]>,
}

impl Plot {
    fn ends(&self) -> [f64; 4] {
        let points = || self.curves.iter().flat_map(|curve| &curve.points).filter(|(_, y)| y.is_finite());
        let [left, right] = [f64::min as fn(f64, f64) -> f64, f64::max]
            .map(|f| points().map(|p| p.0).reduce(f).unwrap_or(0.0));
        let top = 1.08 * points().map(|p| p.1).fold(0.0, f64::max).max(1e-9);
        let [bottom, top] = self.vertical.unwrap_or([0.0, top]);
        [left, right, bottom, top]
    }
}

/// The vertical axis starts at 0; returns a PNG.
pub fn lines(title: &str, x_label: &'static str, y_label: &'static str, curves: &[Curve]) -> Result<Vec<u8>> {
    let plot =
        Plot { title: title.into(), labels: [x_label, y_label], curves: curves.to_vec(), vertical: None };
    draw_to_png(SIZE, title, |area| {
        let (axes, legend) = area.split_horizontally(SIZE.0 as i32 - LEGEND_PX);
        draw(&axes, &plot, (17, 12))?;
        for (index, curve) in plot.curves.iter().enumerate() {
            let style = colour(index, plot.curves.len()).stroke_width(2);
            let y = 48 + 22 * index as i32;
            legend.draw(&PathElement::new([(4, y), (24, y)], style))?;
            legend.draw(&Text::new(curve.name.clone(), (30, y - 7), ("sans-serif", 12).into_font()))?;
        }
        Ok(())
    })
}

/// Charts in rows of `columns`, with the legend of the first below; returns a PNG.
pub fn grid(columns: usize, plots: &[Plot]) -> Result<Vec<u8>> {
    let rows = plots.len().div_ceil(columns);
    let named: Vec<&Curve> =
        plots.first().iter().flat_map(|plot| &plot.curves).filter(|curve| !curve.name.is_empty()).collect();
    let below = if named.is_empty() { 0 } else { LEGEND_BELOW_PX };
    let charts = (SMALL_PX.0 * columns as u32, SMALL_PX.1 * rows as u32);
    draw_to_png((charts.0, charts.1 + below), "several charts", |area| {
        let (above, legend) = area.split_vertically(charts.1 as i32);
        for (cell, plot) in above.split_evenly((rows, columns)).iter().zip(plots) {
            draw(cell, plot, (14, 8))?;
        }
        let room = charts.0 as i32 / named.len().max(1) as i32;
        for (index, curve) in named.iter().enumerate() {
            let x = 16 + room * index as i32;
            let style = colour(index, named.len()).stroke_width(2);
            legend.draw(&PathElement::new([(x, 12), (x + 20, 12)], style))?;
            legend.draw(&Text::new(curve.name.clone(), (x + 26, 5), ("sans-serif", 12).into_font()))?;
        }
        Ok(())
    })
}

pub type Area<'a> = DrawingArea<BitMapBackend<'a>, plotters::coord::Shift>;
pub type Drawn = Result<(), Box<dyn std::error::Error>>;

/// A white picture with what `draw` adds, as a PNG.
pub fn draw_to_png(size: (u32, u32), title: &str, draw: impl FnOnce(&Area<'_>) -> Drawn) -> Result<Vec<u8>> {
    let mut buffer = vec![255_u8; 3 * (size.0 * size.1) as usize];
    let area = BitMapBackend::with_buffer(&mut buffer, size).into_drawing_area();
    let drawn = area.fill(&WHITE).map_err(Into::into).and_then(|()| draw(&area));
    drawn.map_err(|error| anyhow!("cannot draw {title:?}: {error}"))?;
    area.present().map_err(|error| anyhow!("cannot draw {title:?}: {error}"))?;
    drop(area);
    panels::encode(&buffer, size)
}

fn draw(area: &Area<'_>, plot: &Plot, (title, label): (i32, i32)) -> Drawn {
    let [left, right, bottom, top] = plot.ends();
    let mut chart = ChartBuilder::on(area)
        .caption(&plot.title, ("sans-serif", title))
        .margin(label)
        .x_label_area_size(3 * label + 6)
        .y_label_area_size(4 * label + 10)
        .build_cartesian_2d(left..right, bottom..top)?;
    chart
        .configure_mesh()
        .x_desc(plot.labels[0])
        .y_desc(plot.labels[1])
        .x_labels(if label < 10 { 5 } else { 10 })
        .y_labels(if label < 10 { 6 } else { 10 })
        .label_style(("sans-serif", label.max(11) + 1))
        .axis_desc_style(("sans-serif", label.max(11) + 2))
        .light_line_style(RGBColor(245, 245, 245))
        .bold_line_style(RGBColor(220, 220, 220))
        .draw()?;
    for (index, curve) in plot.curves.iter().enumerate() {
        let finite = curve.points.iter().copied().filter(|(_, y)| y.is_finite());
        chart.draw_series(LineSeries::new(finite, colour(index, plot.curves.len()).stroke_width(2)))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn no_two_curves_of_a_chart_share_a_colour() {
        for count in [1, 9, 10, 11, 40] {
            let colours: BTreeSet<_> =
                (0..count).map(|index| colour(index, count)).map(|c| (c.0, c.1, c.2)).collect();
            assert_eq!(colours.len(), count);
        }
    }
}
