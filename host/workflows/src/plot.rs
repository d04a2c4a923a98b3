//! Plots as SVG or PNG: the canvas, a chart with curves and dots, and a legend where no curve is.

use std::path::Path;

use farnear_files::EncodeError;
use plotters::{coord::Shift, prelude::*, style::register_font};

use crate::error::{Result, WorkflowError};

/// Okabe & Ito 2008: distinguishable by the colour-blind.
pub(crate) const COLOURS: [RGBColor; 5] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
];

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Format {
    Svg,
    Png,
}

impl Format {
    pub fn of(file: &Path) -> Result<Self> {
        match file.extension().unwrap_or_default().to_string_lossy().to_lowercase().as_str() {
            "svg" => Ok(Self::Svg),
            "png" => Ok(Self::Png),
            _ => Err(WorkflowError::parameter("plot", file.display(), "plots are written as .svg or .png")),
        }
    }
}

pub(crate) type Drawn<B> = Result<(), DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;

/// What a plot shows, on any canvas.
pub(crate) trait Drawing {
    fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Drawn<B>;
}

pub(crate) fn encode(drawing: &impl Drawing, size: (u32, u32), format: Format) -> Result<Vec<u8>> {
    register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular())
        .map_err(|_| EncodeError::of("a plot")("the built-in font is damaged"))?;
    let failed = |error: &dyn std::fmt::Display| EncodeError::of("a plot")(error);
    match format {
        Format::Svg => {
            let mut text = String::new();
            drawing
                .draw(&SVGBackend::with_string(&mut text, size).into_drawing_area())
                .map_err(|error| failed(&error))?;
            Ok(text.into_bytes())
        }
        Format::Png => {
            let mut pixels = vec![255; 3 * (size.0 * size.1) as usize];
            drawing
                .draw(&BitMapBackend::with_buffer(&mut pixels, size).into_drawing_area())
                .map_err(|error| failed(&error))?;
            let Some(picture) = image::RgbImage::from_raw(size.0, size.1, pixels) else {
                return Err(EncodeError::of("a plot")("another size than its canvas").into());
            };
            let mut png = std::io::Cursor::new(Vec::new());
            picture.write_to(&mut png, image::ImageFormat::Png).map_err(EncodeError::of("a plot"))?;
            Ok(png.into_inner())
        }
    }
}

/// Name, colour and points of a curve.
pub(crate) type Curve = (String, RGBColor, Vec<(f64, f64)>);

/// Corner in which a legend covers the fewest points (coordinates from 0 to 1); preferably the lower right.
fn free_corner(points: Vec<[f64; 2]>, lines: usize) -> SeriesLabelPosition {
    // Slightly more than the legend's share of a chart.
    let (width, height) = (0.3, 0.06 + 0.055 * lines as f64);
    let corners = [
        (SeriesLabelPosition::LowerRight, [1.0, 0.0]),
        (SeriesLabelPosition::UpperLeft, [0.0, 1.0]),
        (SeriesLabelPosition::LowerLeft, [0.0, 0.0]),
        (SeriesLabelPosition::UpperRight, [1.0, 1.0]),
    ];
    let covered = |[u, v]: [f64; 2]| {
        points.iter().filter(|[x, y]| (x - u).abs() < width && (y - v).abs() < height).count()
    };
    let best = corners.into_iter().min_by_key(|(_, corner)| covered(*corner));
    best.map_or(SeriesLabelPosition::LowerRight, |(position, _)| position)
}

pub(crate) fn chart<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    title: &str,
    x_label: &str,
    x: std::ops::Range<f64>,
    lines: &[Curve],
    dots: &[Curve],
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
    let values = || lines.iter().chain(dots).flat_map(|(.., points)| points.iter().map(|p| p.1));
    let finite = || values().filter(|v| v.is_finite());
    let [low, high] = [finite().fold(0.0, f64::min), finite().fold(0.0, f64::max)];
    let room = 0.06 * (high - low).max(1e-6);
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 15))
        .margin(10)
        .x_label_area_size(38)
        .y_label_area_size(48)
        .build_cartesian_2d(x.clone(), low - room..high + room)?;
    let points = lines.iter().chain(dots).flat_map(|(.., points)| points);
    let relative = points
        .map(|(u, v)| [(u - x.start) / (x.end - x.start), (v - low + room) / (high - low + 2.0 * room)]);
    let place = free_corner(relative.collect(), lines.len());
    chart
        .configure_mesh()
        .x_desc(x_label)
        // Avoid a rounded -0.0.
        .y_label_formatter(&|value| format!("{:.1}", if value.abs() < 1e-6 { 0.0 } else { *value }))
        .label_style(("sans-serif", 12))
        .axis_desc_style(("sans-serif", 13))
        .light_line_style(RGBColor(246, 246, 246))
        .bold_line_style(RGBColor(222, 222, 222))
        .draw()?;
    for (name, colour, points) in lines {
        let style = colour.stroke_width(2);
        chart
            .draw_series(LineSeries::new(points.iter().copied(), style))?
            .label(name.clone())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], style));
    }
    for (_, colour, points) in dots {
        chart.draw_series(points.iter().map(|point| Circle::new(*point, 2, colour.filled())))?;
    }
    chart
        .configure_series_labels()
        .position(place)
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(205, 205, 205))
        .label_font(("sans-serif", 12))
        .draw()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_legend_goes_where_no_curve_is() {
        let falling: Vec<[f64; 2]> = (0..=50).map(|i| f64::from(i) / 50.0).map(|x| [x, 1.0 - x]).collect();
        assert!(matches!(free_corner(falling.clone(), 3), SeriesLabelPosition::LowerLeft));
        let rising: Vec<[f64; 2]> = falling.iter().map(|[x, y]| [*x, 1.0 - y]).collect();
        assert!(matches!(free_corner(rising, 3), SeriesLabelPosition::LowerRight));
        assert!(matches!(free_corner(Vec::new(), 3), SeriesLabelPosition::LowerRight));
    }
}
