//! Operators designed for another point spread function than the lens', as in Li 2014, table 5.1.

use anyhow::Result;
use farnear_depth::operators::Operators;

use crate::{
    page::Page,
    rig::{self, PSFS},
    sweep,
};

const PLANES: usize = 8;
const SEED: u64 = 200;
const WIDE: (&str, &str) = ("Gaussian, k 0.5036 (10 % too wide)", "gaussian:k=0.5036");

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("The wrong point spread function");
    page.paragraph(&format!(
        "RMSE over {PLANES} planes when the operators are designed for another PSF than the lens has: clean / 8-bit. \
         A wrong PSF costs more than noise; calibrate it."
    ));
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
        let cells = sweep::planes(psf, PLANES, SEED, &designed)?.into_iter().map(sweep::cell);
        rows.push(std::iter::once(name.to_owned()).chain(cells).collect());
    }
    let head: Vec<String> = std::iter::once("lens \\ operators".to_owned())
        .chain(designs.iter().map(|(name, _)| (*name).to_owned()))
        .collect();
    page.table(1, &head, &rows);
    Ok(())
}
