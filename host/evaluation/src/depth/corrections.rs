//! Corrections of the elliptical distortion, judged on depths that taught them nothing, like Li 2014, fig. 6.4 and table 5.2.

use anyhow::Result;
use farnear_depth::{
    corrections::{CdcSettings, Correction, Method, Pattern, fit},
    operators::Operators,
};
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    chart::{self, Curve},
    page::{Page, mm},
    panels::{self, Panel, Scale},
    rig::{self, Exposure},
};

const PATTERNS: usize = 24;
const HELD_OUT: usize = 9;
const SEED: u64 = 400;
const PSF: &str = "gaussian:k=0.4578";
/// Regions of the 3x3 methods end here; what a row jumps by at these columns is their step.
const SEAMS: [usize; 2] = [213, 426];

/// A measured plane.
struct Plane {
    true_mm: f64,
    depth_mm: Array2<f32>,
}

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Corrections of the elliptical distortion");
    page.paragraph(&format!(
        "A lens whose focus varies over the field in ellipses (`alpha_eff = alpha - 0.08 + 0.5 (0.45 - 0.20 alpha) rho2` around (0.65, 0.6) of the \
         image, semi-axes 0.75 and 0.6), Gaussian PSF, 8-bit. The corrections learn from {PATTERNS} planes from far to near focus and are judged on \
         {HELD_OUT} other planes with other textures and noise. *Step at seams* is the jump between the pixels on either side of the vertical borders of the 3x3 \
         regions, its mean along each border of each plane (160 px), so that noise counts little: root mean square and largest over all {HELD_OUT} planes. \
         What no correction has is the noise of this figure."
    ));
    let learn = planes(&rig::depths(PATTERNS, 0.0)?, SEED)?;
    let judge = planes(&rig::depths(HELD_OUT, 0.5)?, SEED + PATTERNS as u64)?;
    let patterns: Vec<Pattern<'_>> =
        learn.iter().map(|p| Pattern { depth_mm: p.depth_mm.view(), true_mm: p.true_mm }).collect();

    let smoothed = CdcSettings::default();
    let raw_patterns = CdcSettings { smoothing_px: 0.0, ..smoothed };
    let mut rows = vec![Vec::new()];
    let raw = errors(&judge, None)?;
    rows[0] = row("none", &raw, steps(&judge, None)?);
    let mut curves =
        vec![Curve { name: "none".into(), points: raw.iter().map(|(d, e, _)| (*d, *e)).collect() }];
    let named = [
        ("two-step", Method::TwoStep, smoothed),
        ("clsf", Method::Clsf, smoothed),
        ("clsf-blend", Method::ClsfBlend, smoothed),
        ("clsf-full", Method::ClsfFull, smoothed),
        ("cdc, raw patterns", Method::Cdc, raw_patterns),
        ("cdc", Method::Cdc, smoothed),
    ];
    let fitted = named
        .par_iter()
        .map(|(_, method, settings)| Ok(fit(*method, &patterns, settings)?))
        .collect::<Result<Vec<_>>>()?;
    for ((name, ..), correction) in named.iter().zip(&fitted) {
        let errors = errors(&judge, Some(correction))?;
        rows.push(row(name, &errors, steps(&judge, Some(correction))?));
        curves
            .push(Curve { name: (*name).into(), points: errors.iter().map(|(d, e, _)| (*d, *e)).collect() });
    }
    page.table(
        1,
        &["correction", "RMSE", "largest of a plane", "largest bias", "step at seams, RMS", "largest step"],
        &rows,
    );
    let png =
        chart::lines("Held-out planes before and after correction", "depth in mm", "RMSE in mm", &curves)?;
    page.picture("accuracy-corrections.png", &png, "RMSE over depth of held-out planes for each correction")?;

    let middle = &judge[HELD_OUT / 2];
    let panel = |title: &str, map: &Array2<f32>| (title.to_owned(), map.mapv(|d| d - middle.true_mm as f32));
    let mut maps = vec![panel("no correction, -4 to +4 mm", &middle.depth_mm)];
    for (index, title) in [(1, "clsf (3x3 regions)"), (3, "clsf-full")] {
        maps.push(panel(title, &fitted[index].apply(middle.depth_mm.view())?));
    }
    let panels: Vec<Panel<'_>> = maps
        .iter()
        .map(|(title, map)| Panel { title: title.clone(), map: map.view(), scale: Scale::Error(4.0) })
        .collect();
    let caption = format!("Error of the held-out plane at {:.2} mm: raw, clsf, clsf-full", middle.true_mm);
    page.picture("accuracy-distortion.png", &panels::row(&panels)?, &caption)
}

/// Renders and measures planes seen through the distorted lens.
fn planes(depths: &[f64], seed: u64) -> Result<Vec<Plane>> {
    let optics = rig::optics(PSF)?;
    let operators = Operators::for_optics(&optics)?;
    let lens = rig::lens(true)?;
    let one = |(index, true_mm): (usize, &f64)| -> Result<Plane> {
        let pair = rig::render(&rig::plane(*true_mm)?, &lens, PSF, Exposure::EightBit, seed + index as u64)?;
        Ok(Plane { true_mm: *true_mm, depth_mm: rig::depth(&pair, &operators, &optics)? })
    };
    depths.par_iter().enumerate().map(one).collect()
}

fn corrected(plane: &Plane, correction: Option<&Correction>) -> Result<Array2<f32>> {
    Ok(match correction {
        Some(correction) => correction.apply(plane.depth_mm.view())?,
        None => plane.depth_mm.clone(),
    })
}

/// True depth, RMSE and bias of each plane.
fn errors(planes: &[Plane], correction: Option<&Correction>) -> Result<Vec<(f64, f64, f64)>> {
    let one = |plane: &Plane| {
        let map = corrected(plane, correction)?;
        let truth = Array2::from_elem(map.dim(), plane.true_mm as f32);
        let error = rig::error(&map, &truth, false)?;
        Ok((plane.true_mm, error.rmse_mm, error.bias_mm))
    };
    planes.iter().map(one).collect()
}

/// Root mean square and largest of the mean jumps across the vertical borders of the regions, mm.
fn steps(planes: &[Plane], correction: Option<&Correction>) -> Result<[f64; 2]> {
    let mut steps = Vec::new();
    for plane in planes {
        let map = corrected(plane, correction)?;
        // Per third of the height: jumps of opposite sign in different regions must not cancel.
        for rows in 0..3 {
            for column in SEAMS {
                let rows = rows * 160..(rows + 1) * 160;
                let jumps = rows.map(|row| f64::from(map[(row, column)] - map[(row, column - 1)]));
                let (sum, n) =
                    jumps.filter(|j| j.is_finite()).fold((0.0, 0.0), |(sum, n), jump| (sum + jump, n + 1.0));
                steps.push((sum / n).abs());
            }
        }
    }
    let squares: f64 = steps.iter().map(|step| step * step).sum();
    Ok([(squares / steps.len() as f64).sqrt(), steps.into_iter().fold(0.0, f64::max)])
}

fn row(name: &str, errors: &[(f64, f64, f64)], [rms_step, largest_step]: [f64; 2]) -> Vec<String> {
    let rmse = (errors.iter().map(|(_, e, _)| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    let largest = errors.iter().map(|(_, e, _)| *e).fold(0.0, f64::max);
    let bias = errors.iter().map(|(.., b)| b.abs()).fold(0.0, f64::max);
    vec![name.into(), mm(rmse), mm(largest), mm(bias), mm(rms_step), mm(largest_step)]
}
