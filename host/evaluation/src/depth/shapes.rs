//! Surfaces of varying depth: staircase, slant, cone and sphere.

use anyhow::Result;
use farnear_depth::operators::Operators;
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    page::{Page, mm},
    panels::{self, Panel, Scale},
    rig::{self, Exposure, PSFS, Pair},
};

const SHAPES: [&str; 4] = ["staircase", "slant", "cone", "sphere"];
const SEED: u64 = 1;

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Staircase, slant, cone, sphere");
    page.paragraph(
        "Each spans the working range. The staircase has eight steps; within 8 px of a step, where a window sees two depths, nothing is counted.",
    );
    let jobs: Vec<(usize, usize, Exposure)> = (0..PSFS.len())
        .flat_map(|p| {
            (0..SHAPES.len())
                .flat_map(move |s| Exposure::ALL.into_iter().map(move |exposure| (p, s, exposure)))
        })
        .collect();
    let errors = jobs
        .par_iter()
        .map(|&(p, s, exposure)| {
            let (pair, map) = one(PSFS[p].1, SHAPES[s], exposure)?;
            Ok(rig::error(&map, &pair.truth, SHAPES[s] == "staircase")?.rmse_mm)
        })
        .collect::<Result<Vec<f64>>>()?;
    let rows: Vec<Vec<String>> = errors
        .chunks(Exposure::ALL.len())
        .enumerate()
        .map(|(index, errors)| {
            let (p, s) = (index / SHAPES.len(), index % SHAPES.len());
            let names = [PSFS[p].0, SHAPES[s]].map(str::to_owned);
            names.into_iter().chain(errors.iter().map(|e| mm(*e))).collect()
        })
        .collect();
    page.table(2, &["PSF = operators", "scene", "clean", "8-bit", "12-bit"], &rows);
    page.paragraph(
        "Generalised Gaussian, 8-bit; near is warm. Errors from 2 mm too near (blue) to 2 mm too far (red):",
    );
    for shape in SHAPES {
        let (pair, map) = one(PSFS[2].1, shape, Exposure::EightBit)?;
        let error = &map - &pair.truth;
        let range = Scale::Depth([884.0, 936.0]);
        let png = panels::row(&[
            Panel { title: format!("{shape}, true depth"), map: pair.truth.view(), scale: range },
            Panel { title: "measured".into(), map: map.view(), scale: range },
            Panel { title: "error, -2 to +2 mm".into(), map: error.view(), scale: Scale::Error(2.0) },
        ])?;
        page.picture(
            &format!("accuracy-{shape}.png"),
            &png,
            &format!("{shape}: true depth, measured depth, error"),
        )?;
    }
    Ok(())
}

fn one(psf: &str, shape: &str, exposure: Exposure) -> Result<(Pair, Array2<f32>)> {
    let optics = rig::optics(psf)?;
    let pair = rig::render(&shape.parse()?, &rig::lens(false)?, psf, exposure, SEED)?;
    let map = rig::depth(&pair, &Operators::for_optics(&optics)?, &optics)?;
    Ok((pair, map))
}
