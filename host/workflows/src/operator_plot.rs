//! Plots the fit and response of operators as SVG or PNG. Upper left: normalised image ratio (NIR) over normalised
//! depth at five frequencies; dots are the optics', lines the cubic fit `a1 alpha + a3 alpha^3`. Upper right: a1 and a3
//! over frequency. Below: kernel responses along a row and along the diagonal, each divided by its largest magnitude.

use std::f64::consts::PI;

use farnear_depth::{normalised_ratio, operators::Operators, psf::Otf};
use plotters::{coord::Shift, prelude::*};

use crate::{
    error::Result,
    plot::{self, COLOURS, Curve, Drawing, Drawn, Format, chart},
};

const SIZE: (u32, u32) = (1100, 820);
/// NIR curves by radial frequency, rad/px.
const FREQUENCIES: usize = 5;
pub fn plot(operators: &Operators, format: Format) -> Result<Vec<u8>> {
    plot::encode(operators, SIZE, format)
}

impl Drawing for Operators {
    fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Drawn<B> {
        draw(area, self)
    }
}

fn draw<B: DrawingBackend>(area: &DrawingArea<B, Shift>, operators: &Operators) -> Drawn<B> {
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
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
