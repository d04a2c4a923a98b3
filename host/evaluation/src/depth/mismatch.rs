//! Operators designed for another point spread function than the lens has, like Li 2014, table 5.1.

use anyhow::Result;
use farnear_depth::operators::Operators;
use rayon::prelude::*;

use crate::{
    page::{Page, mm},
    rig::{self, Exposure, PSFS},
};

const PLANES: usize = 8;
const SEED: u64 = 200;
/// A Gaussian that is a tenth too wide besides the three.
const WIDE: (&str, &str) = ("Gaussian, k 0.5036 (10 % too wide)", "gaussian:k=0.5036");

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("The wrong point spread function");
    page.paragraph(&format!(
        "RMSE over {PLANES} planes when the operators are designed for another PSF than the lens has: clean / 8-bit. \
         A wrong PSF costs more than noise; calibrate it."
    ));
    let depths = rig::depths(PLANES, 0.0)?;
    let lens = rig::lens(false)?;
    let designs: Vec<(&str, &str)> = PSFS.into_iter().chain([WIDE]).collect();
    let designed = designs
        .iter()
        .map(|(_, psf)| {
            let optics = rig::optics(psf)?;
            Ok((Operators::for_optics(&optics)?, optics))
        })
        .collect::<Result<Vec<_>>>()?;
    let mut rows = Vec::new();
    for (name, psf) in PSFS {
        let mut cells = vec![Vec::new(); designs.len()];
        for exposure in [Exposure::Clean, Exposure::EightBit] {
            let of_planes = depths
                .par_iter()
                .enumerate()
                .map(|(i, depth_mm)| {
                    let pair = rig::render(&rig::plane(*depth_mm)?, &lens, psf, exposure, SEED + i as u64)?;
                    designed
                        .iter()
                        .map(|(operators, optics)| {
                            rig::error(&rig::depth(&pair, operators, optics)?, &pair.truth, false)
                        })
                        .collect::<Result<Vec<_>>>()
                })
                .collect::<Result<Vec<_>>>()?;
            for (design, cell) in cells.iter_mut().enumerate() {
                cell.push(mm(rig::pooled_mm(of_planes.iter().map(|errors| &errors[design]))));
            }
        }
        rows.push(std::iter::once(name.to_owned()).chain(cells.iter().map(|c| c.join(" / "))).collect());
    }
    let head: Vec<String> = std::iter::once("lens \\ operators".to_owned())
        .chain(designs.iter().map(|(name, _)| (*name).to_owned()))
        .collect();
    page.table(1, &head, &rows);
    Ok(())
}
