//! Corrections of the elliptical distortion, measured on unseen depths (Li 2014, fig. 6.4, table 5.2).

use anyhow::{Context, Result};
use farnear_depth::{
    corrections::{CdcSettings, Correction, Method, Pattern, fit},
    metrics::Comparison,
    operators::Operators,
    optics::Optics,
};
use farnear_scene::EllipticalDistortion;
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    chart::{self, Curve},
    page::{Page, mm},
    panels::{self, Scale},
    rig::{self, Exposure},
};

const PATTERNS: usize = 24;
const HELD_OUT: usize = 9;
const SEED: u64 = 400;
const PSF: &str = "gaussian:k=0.4578";
/// Borders of the 3x3 methods' regions.
const SEAMS: [usize; 2] = [213, 426];

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
         *None* (no correction) shows the noise of this figure. *Formula undone* inverts the formula above, which is impossible on a rig. It leaves only the noise of the pairs: the lower bound for a correction."
    ));
    let learn = planes(&rig::depths(PATTERNS, 0.0)?, SEED)?;
    let judge = planes(&rig::depths(HELD_OUT, 0.5)?, SEED + PATTERNS as u64)?;
    let corrections = learned(&learn)?;
    let optics = rig::optics(PSF)?;
    let mut rows = Vec::new();
    let mut curves = Vec::new();
    let mut judged = |name: &str, correct: &(dyn Fn(&Array2<f32>) -> Result<Array2<f32>> + Sync)| {
        let corrected = judge
            .par_iter()
            .map(|plane| Ok(Plane { true_mm: plane.true_mm, depth_mm: correct(&plane.depth_mm)? }))
            .collect::<Result<Vec<_>>>()?;
        let errors = errors(&corrected)?;
        rows.push(row(name, &errors, steps(&corrected)));
        let points = judge.iter().zip(&errors).map(|(plane, error)| (plane.true_mm, error.rmse_mm)).collect();
        curves.push(Curve { name: name.into(), points });
        anyhow::Ok(())
    };
    judged("none", &|map| Ok(map.clone()))?;
    for (name, correction) in &corrections {
        judged(name, &|map| Ok(correction.apply(map.view())?))?;
    }
    judged("formula undone", &|map| Ok(undone(map, &optics)))?;
    page.table(
        1,
        &["correction", "RMSE", "largest of a plane", "largest bias", "step at seams, RMS", "largest step"],
        &rows,
    );
    let png =
        chart::lines("Held-out planes before and after correction", "depth in mm", "RMSE in mm", &curves)?;
    page.picture("accuracy-corrections.png", &png, "RMSE over depth of held-out planes for each correction")?;
    errors_of_the_middle_plane(page, &judge[HELD_OUT / 2], &corrections)
}

fn learned(planes: &[Plane]) -> Result<Vec<(String, Correction)>> {
    let patterns: Vec<Pattern<'_>> =
        planes.iter().map(|p| Pattern { depth_mm: p.depth_mm.view(), true_mm: p.true_mm }).collect();
    let smoothed = CdcSettings::default();
    let raw_patterns = CdcSettings { smoothing_px: 0.0, ..smoothed };
    let mut wanted: Vec<_> =
        Method::ALL.into_iter().map(|method| (method.name().to_owned(), method, smoothed)).collect();
    wanted.push(("cdc, raw patterns".to_owned(), Method::Cdc, raw_patterns));
    wanted
        .into_par_iter()
        .map(|(name, method, settings)| Ok((name, fit(method, &patterns, &settings)?)))
        .collect()
}

fn errors_of_the_middle_plane(
    page: &mut Page,
    plane: &Plane,
    corrections: &[(String, Correction)],
) -> Result<()> {
    let panel = |title: &str, map: &Array2<f32>| (title.to_owned(), map.mapv(|d| d - plane.true_mm as f32));
    let mut maps = vec![panel("no correction, -4 to +4 mm", &plane.depth_mm)];
    for (method, title) in [(Method::Clsf, "clsf (3x3 regions)"), (Method::ClsfFull, "clsf-full")] {
        let (_, correction) =
            corrections.iter().find(|(name, _)| name == method.name()).context("every method was learned")?;
        maps.push(panel(title, &correction.apply(plane.depth_mm.view())?));
    }
    let caption = format!("Error of the held-out plane at {:.2} mm: raw, clsf, clsf-full", plane.true_mm);
    page.picture("accuracy-distortion.png", &panels::titled(maps.len(), &maps, Scale::Error(4.0))?, &caption)
}

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

/// The map without the rendered distortion.
fn undone(map: &Array2<f32>, optics: &Optics) -> Array2<f32> {
    let lens = EllipticalDistortion::default();
    let (height, width) = map.dim();
    Array2::from_shape_fn((height, width), |(row, column)| {
        let (x, y) = ((column as f64 + 0.5) / width as f64, (row as f64 + 0.5) / height as f64);
        let seen = optics.alpha(f64::from(map[(row, column)]));
        // The distortion is linear in alpha.
        let at_zero = lens.apply(0.0, x, y);
        optics.depth_mm((seen - at_zero) / (lens.apply(1.0, x, y) - at_zero)) as f32
    })
}

fn errors(planes: &[Plane]) -> Result<Vec<Comparison>> {
    let one = |plane: &Plane| {
        let truth = Array2::from_elem(plane.depth_mm.dim(), plane.true_mm as f32);
        rig::error(&plane.depth_mm, &truth, false)
    };
    planes.iter().map(one).collect()
}

/// RMS and largest mean jump across the vertical borders of the regions, mm.
fn steps(planes: &[Plane]) -> [f64; 2] {
    let mut steps = Vec::new();
    for Plane { depth_mm: map, .. } in planes {
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
    [(squares / steps.len() as f64).sqrt(), steps.into_iter().fold(0.0, f64::max)]
}

fn row(name: &str, errors: &[Comparison], [rms_step, largest_step]: [f64; 2]) -> Vec<String> {
    let rmse = (errors.iter().map(|e| e.rmse_mm * e.rmse_mm).sum::<f64>() / errors.len() as f64).sqrt();
    let largest = errors.iter().map(|e| e.rmse_mm).fold(0.0, f64::max);
    let bias = errors.iter().map(|e| e.bias_mm.abs()).fold(0.0, f64::max);
    vec![name.into(), mm(rmse), mm(largest), mm(bias), mm(rms_step), mm(largest_step)]
}
