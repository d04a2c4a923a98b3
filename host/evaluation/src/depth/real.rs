//! Real scenes: Watanabe & Nayar's pair, and two slices of focal stacks with unknown optics.

use std::path::Path;

use anyhow::{Context, Result};
use farnear_depth::{
    operators::Operators,
    optics::{Optics, OpticsFile},
    pipeline::{Settings, depth_from_pair},
};
use farnear_files::image_file::read_grey;
use ndarray::{Array2, ArrayView2, s};

use crate::{
    page::Page,
    panels::{self, Panel, Scale},
    people::data::Data,
};

pub const INTRODUCTION: &str = "# Accuracy on real scenes

Written by `cargo xtask evaluate` where the data are available; they are not part of this repository. Accuracy with known truth is in
[accuracy.md](accuracy.md).";

pub fn measure(page: &mut Page, data: &Data) -> Result<()> {
    let data = &data.0;
    let breakfast = data.join("breakfast");
    if breakfast.is_dir() {
        measure_breakfast(page, &breakfast)?;
    }
    super::lens_stacks::measure(page, data)?;
    super::stacks::measure(page, data)?;
    Ok(())
}

/// Surfaces of the breakfast table: name, rows, columns, and the median depth of an independent implementation, mm.
const SURFACES: [(&str, [usize; 2], [usize; 2], f64); 4] = [
    ("wall", [20, 130], [30, 600], 741.0),
    ("toast", [230, 400], [70, 200], 635.0),
    ("cup", [220, 340], [330, 450], 638.0),
    ("front of the table", [440, 470], [300, 600], 623.0),
];

fn measure_breakfast(page: &mut Page, folder: &Path) -> Result<()> {
    page.heading("Breakfast table");
    page.paragraph(
        "The pair of Watanabe & Nayar (Rational Filters for Passive Depth from Defocus, IJCV 27, 1998; Columbia University): 25 mm lens at f/8.3, focused at 869 \
         and 529 mm; pill-box, smoothing 7, median 5. The reference is an independent implementation with the same settings.",
    );
    let text = std::fs::read_to_string(folder.join("optics.toml")).context("optics.toml of the pair")?;
    let optics: Optics = toml::from_str::<OpticsFile>(&text)?.check()?;
    let operators = Operators::for_optics(&optics)?;
    let far = read_grey(&folder.join("breakfast_far.png"))?.pixels;
    let near = read_grey(&folder.join("breakfast_near.png"))?.pixels;
    let settings = Settings { median_px: 5, ..Settings::default() };
    let map = depth_from_pair(far.view(), near.view(), &operators, &optics, &settings)?;
    let rows: Vec<Vec<String>> = SURFACES
        .iter()
        .map(|(name, rows, columns, reference)| {
            let region = map.depth_mm.slice(s![rows[0]..rows[1], columns[0]..columns[1]]);
            let (median, deviation, missing) = spread(region);
            let texts = [median, *reference, deviation].map(|v| format!("{v:.1}"));
            std::iter::once((*name).to_owned())
                .chain(texts)
                .chain([format!("{:.2}", 100.0 * missing)])
                .collect()
        })
        .collect();
    page.table(1, &["surface", "median", "reference", "SD", "no value, %"], &rows);
    let png = panels::row(&[
        grey_panel("far-focused image", &far),
        Panel {
            title: "depth, 560 to 800 mm".into(),
            map: map.depth_mm.view(),
            scale: Scale::Depth([560.0, 800.0]),
        },
        Panel { title: "confidence, 0 to 1".into(), map: map.confidence.view(), scale: Scale::Grey(1.0) },
    ])?;
    page.picture("accuracy-breakfast.png", &png, "Breakfast table: image, depth, confidence")
}

fn grey_panel<'a>(title: &str, image: &'a Array2<f32>) -> Panel<'a> {
    let high = image.iter().copied().fold(0.0, f32::max);
    Panel { title: title.into(), map: image.view(), scale: Scale::Grey(high) }
}

/// Median, standard deviation and share without a value.
fn spread(region: ArrayView2<f32>) -> (f64, f64, f64) {
    let mut values: Vec<f64> = region.iter().filter(|v| v.is_finite()).map(|v| f64::from(*v)).collect();
    if values.is_empty() {
        return (f64::NAN, f64::NAN, 1.0);
    }
    values.sort_by(f64::total_cmp);
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    (values[values.len() / 2], variance.sqrt(), 1.0 - n / region.len() as f64)
}
