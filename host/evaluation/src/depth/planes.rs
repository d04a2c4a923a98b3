//! Planes through the working range, as in Li 2014, fig. 5.4.

use anyhow::Result;
use farnear_depth::{metrics::Comparison, operators::Operators};
use rayon::prelude::*;

use crate::{
    chart::{self, Curve},
    page::{Page, mm},
    rig::{self, Exposure, PSFS},
};

const PLANES: usize = 24;
/// Seed of the first plane; each has its own texture.
const SEED: u64 = 100;

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Planes");
    page.paragraph(&format!(
        "{PLANES} planes from far to near focus, each with a different texture; RMSE over all planes."
    ));
    let depths = rig::depths(PLANES, 0.0)?;
    let lens = rig::lens(false)?;
    let (mut rows, mut curves) = (Vec::new(), Vec::new());
    for (name, psf) in PSFS {
        let optics = rig::optics(psf)?;
        let operators = Operators::for_optics(&optics)?;
        let mut row = vec![name.to_owned()];
        let mut worst_bias = 0.0_f64;
        for exposure in Exposure::ALL {
            let one = |(index, depth_mm): (usize, &f64)| -> Result<Comparison> {
                let pair = rig::render(&rig::plane(*depth_mm)?, &lens, psf, exposure, SEED + index as u64)?;
                rig::error(&rig::depth(&pair, &operators, &optics)?, &pair.truth, false)
            };
            let errors =
                depths.par_iter().enumerate().map(|(i, d)| one((i, d))).collect::<Result<Vec<_>>>()?;
            row.push(mm(rig::pooled_mm(&errors)));
            if exposure == Exposure::Clean {
                worst_bias = errors.iter().map(|e| e.bias_mm.abs()).fold(0.0, f64::max);
            }
            if exposure != Exposure::TwelveBit {
                let points = depths.iter().zip(&errors).map(|(d, e)| (*d, e.rmse_mm)).collect();
                curves.push(Curve { name: format!("{name}, {}", exposure.name()), points });
            }
        }
        row.push(mm(worst_bias));
        rows.push(row);
    }
    page.table(1, &["PSF = operators", "clean", "8-bit", "12-bit", "largest bias of a clean plane"], &rows);
    let png = chart::lines("RMSE of planes", "depth in mm", "RMSE in mm", &curves)?;
    page.picture(
        "accuracy-planes.png",
        &png,
        "RMSE over depth for three point spread functions, clean and 8-bit",
    )
}
