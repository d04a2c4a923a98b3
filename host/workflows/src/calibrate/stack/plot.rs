//! Plots a lens calibration: blur over distance, the response, errors and predicted deviations.

use plotters::{coord::Shift, prelude::*};

use super::StackFigures;
use crate::{
    error::Result,
    plot::{self, COLOURS, Curve, Drawing, Drawn, Format, chart},
};

const SIZE: (u32, u32) = (1300, 430);

pub fn plot(figures: &StackFigures, format: Format) -> Result<Vec<u8>> {
    plot::encode(figures, SIZE, format)
}

impl Drawing for StackFigures {
    fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Drawn<B> {
        area.fill(&WHITE)?;
        let area = area.titled(&format!("Lens: {}, {} pairs", self.psf, self.pairs), ("sans-serif", 18))?;
        let parts = area.split_evenly((1, 3));
        let [before, behind] = self.blur_per_slice_px;
        let measured: Vec<(f64, f64)> = self.blur.iter().map(|[slices, px]| (*slices, *px)).collect();
        let [first, last] = [measured.first(), measured.last()].map(|end| end.map_or(0.0, |(at, _)| *at));
        let side = |name: &str, colour: RGBColor, end: f64, slope: f64| -> Curve {
            (format!("{name}: {slope:.2} px a slice"), colour, vec![(0.0, 0.0), (end, slope * end.abs())])
        };
        let sides = [side("in front", COLOURS[0], first, before), side("behind", COLOURS[1], last, behind)];
        let dots = [(String::new(), COLOURS[2], measured)];
        let x = first.min(-1.0)..last.max(1.0);
        chart(&parts[0], "Blur radius, px (dots: measured)", "slices from the focus", x, &sides, &dots)?;

        let depths = -1.2..1.2;
        let response = self.response.iter().map(|[measured, depth]| (*measured, *depth)).collect();
        let lines = [
            ("measured = true".to_owned(), RGBColor(180, 180, 180), vec![(-1.2, -1.2), (1.2, 1.2)]),
            ("response".to_owned(), COLOURS[0], response),
        ];
        let title = "True normalised depth (-1: far plane)";
        chart(&parts[1], title, "measured normalised depth", depths.clone(), &lines, &[])?;

        // Thousandths of the range: the chart's labels have one decimal.
        let of_range = 1e3 / self.range_mm;
        let over_depth = |value: &dyn Fn(&super::AtDepth) -> f64| {
            self.by_depth.iter().map(|at| (at.depth, of_range * value(at))).collect::<Vec<(f64, f64)>>()
        };
        let errors = [
            ("mean error".to_owned(), COLOURS[1], over_depth(&|at| at.bias_mm)),
            ("RMS error".to_owned(), COLOURS[0], over_depth(&|at| at.rms_mm)),
            ("predicted SD".to_owned(), COLOURS[2], over_depth(&|at| at.predicted_mm)),
        ];
        let title = format!("Held-out errors, 1/1000 of {} mm", self.range_mm);
        chart(&parts[2], &title, "true normalised depth", depths, &errors, &[])?;
        area.present()
    }
}
