//! Plots the fit and response of operators as SVG or PNG. Upper left: normalised image ratio (NIR) over normalised
//! depth at five frequencies; dots are the optics', lines the cubic fit `a1 alpha + a3 alpha^3`. Upper right: a1 and a3
//! over frequency. Below: kernel responses along a row and along the diagonal, each divided by its largest magnitude.

use std::{f64::consts::PI, path::Path};

use farnear_depth::{normalised_ratio, operators::Operators, psf::Otf};
use farnear_files::EncodeError;
use plotters::{coord::Shift, prelude::*, style::register_font};

use crate::error::{Result, WorkflowError};

const SIZE: (u32, u32) = (1100, 820);
/// NIR curves by radial frequency, rad/px.
const FREQUENCIES: usize = 5;
/// Okabe & Ito 2008: distinguishable by the colour-blind.
const COLOURS: [RGBColor; 5] = [
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

pub fn plot(operators: &Operators, format: Format) -> Result<Vec<u8>> {
    register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular())
        .map_err(|_| EncodeError::of("a plot")("the built-in font is damaged"))?;
    let failed = |error: &dyn std::fmt::Display| EncodeError::of("a plot")(error);
    match format {
        Format::Svg => {
            let mut text = String::new();
            draw(&SVGBackend::with_string(&mut text, SIZE).into_drawing_area(), operators)
                .map_err(|error| failed(&error))?;
            Ok(text.into_bytes())
        }
        Format::Png => {
            let mut pixels = vec![255; 3 * (SIZE.0 * SIZE.1) as usize];
            draw(&BitMapBackend::with_buffer(&mut pixels, SIZE).into_drawing_area(), operators)
                .map_err(|error| failed(&error))?;
            let Some(picture) = image::RgbImage::from_raw(SIZE.0, SIZE.1, pixels) else {
                return Err(EncodeError::of("a plot")("another size than its canvas").into());
            };
            let mut png = std::io::Cursor::new(Vec::new());
            picture.write_to(&mut png, image::ImageFormat::Png).map_err(EncodeError::of("a plot"))?;
            Ok(png.into_inner())
        }
    }
}

type Curve = (String, RGBColor, Vec<(f64, f64)>);

fn draw<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    operators: &Operators,
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
    area.fill(&WHITE)?;
    let area = area.titled(operators.name(), ("sans-serif", 18))?;
    let quarters = area.split_evenly((2, 2));
    let request = operators.request();
    let otf = request.psf.otf(request.max_blur_px);
    let (fitted, dots) = ratio_curves(operators, &otf);
    chart(&quarters[0], "NIR: optics (dots) and cubic fit", "alpha", -1.0..1.0, &fitted, &dots)?;

    let fit = operators.normalised_ratio();
    let over = |values: &[f64]| fit.frequency_rad_px.iter().copied().zip(values.iter().copied()).collect();
    let coefficients = [
        ("a1".to_owned(), COLOURS[0], over(&fit.linear)),
        ("a3".to_owned(), COLOURS[1], over(&fit.cubic)),
        ("RMS misfit".to_owned(), COLOURS[2], over(&fit.rms)),
    ];
    let end = fit.frequency_rad_px.last().copied().unwrap_or(PI);
    chart(&quarters[1], "Coefficients of the fit", "frequency in rad/px", 0.0..end, &coefficients, &[])?;

    for (quarter, title, diagonal) in
        [(&quarters[2], "Responses along a row", false), (&quarters[3], "Responses along the diagonal", true)]
    {
        let kernels = [
            ("pre-filter", operators.prefilter()),
            ("Gm1", operators.gm1()),
            ("Gp1", operators.gp1()),
            ("Gp2", operators.gp2()),
        ];
        let curves: Vec<Curve> = kernels
            .iter()
            .zip(COLOURS)
            .map(|((name, kernel), colour)| {
                let response = |u: f64| kernel.response(u, if diagonal { u } else { 0.0 });
                let points: Vec<(f64, f64)> = frequencies().map(|u| (u, response(u))).collect();
                let largest = points.iter().map(|(_, r)| r.abs()).fold(f64::MIN_POSITIVE, f64::max);
                ((*name).to_owned(), colour, points.into_iter().map(|(u, r)| (u, r / largest)).collect())
            })
            .collect();
        chart(quarter, title, "frequency along each axis in rad/px", 0.0..PI, &curves, &[])?;
    }
    area.present()
}

/// Fit and optics at some frequencies of the fit's table.
fn ratio_curves(operators: &Operators, otf: &Otf) -> (Vec<Curve>, Vec<Curve>) {
    let fit = operators.normalised_ratio();
    let max_blur_px = operators.max_blur_px();
    let last = fit.frequency_rad_px.len().saturating_sub(1);
    let mut chosen: Vec<usize> = (1..=FREQUENCIES).map(|i| i * last / FREQUENCIES).collect();
    chosen.dedup();
    let curves = |index: &usize, points: &dyn Fn(f64, f64) -> f64, colour: RGBColor| -> Curve {
        let w = fit.frequency_rad_px[*index];
        let alphas = normalised_ratio::alphas();
        (format!("{w:.2} rad/px"), colour, alphas.iter().map(|alpha| (*alpha, points(w, *alpha))).collect())
    };
    let of_fit = chosen.iter().zip(COLOURS).map(|(index, colour)| {
        let [a1, a3] = [fit.linear[*index], fit.cubic[*index]];
        curves(index, &|_, alpha| a1 * alpha + a3 * alpha.powi(3), colour)
    });
    let of_optics = chosen.iter().zip(COLOURS).map(|(index, colour)| {
        curves(index, &|w, alpha| normalised_ratio::normalised_ratio(otf, max_blur_px, w, alpha), colour)
    });
    (of_fit.collect(), of_optics.collect())
}

fn frequencies() -> impl Iterator<Item = f64> {
    const STEPS: usize = 128;
    (0..=STEPS).map(|i| PI * i as f64 / STEPS as f64)
}

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

fn chart<B: DrawingBackend>(
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
    use farnear_depth::operators::{Design, Family, Request, design};

    #[test]
    fn plots_are_svg_or_png() {
        let psf = "gaussian:k=0.4578".parse().unwrap();
        let request = Request {
            family: Family::of(psf),
            design: Design::Linear,
            psf,
            max_blur_px: 2.703,
            kernel_size: 7,
        };
        let operators = design(&request).unwrap();
        let svg = String::from_utf8(plot(&operators, Format::Svg).unwrap()).unwrap();
        for text in ["NIR: optics (dots) and cubic fit", "Gp2", "frequency in rad/px"] {
            assert!(svg.contains(text), "{text}");
        }
        let png =
            image::load_from_memory(&plot(&operators, Format::of(Path::new("a.PNG")).unwrap()).unwrap())
                .unwrap();
        assert_eq!((png.width(), png.height()), SIZE);
        let error = Format::of(Path::new("a.pdf")).unwrap_err().to_string();
        assert!(error.contains(".svg or .png"), "{error}");
    }
}
