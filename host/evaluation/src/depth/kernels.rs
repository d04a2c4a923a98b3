//! Gain of larger operators, the open question of Li 2014.

use anyhow::Result;
use farnear_depth::{
    kernel::{LARGEST_SIZE, SIZES},
    operators::{Request, design},
};

use crate::{
    page::Page,
    rig::{self, PSFS},
    sweep,
};

const PLANES: usize = 12;
const SEED: u64 = 300;

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Size of the operators");
    page.paragraph(&format!(
        "RMSE over {PLANES} planes with operators of {least}x{least} to {LARGEST_SIZE}x{LARGEST_SIZE} pixels, clean / 8-bit.",
        least = SIZES[0]
    ));
    let mut rows = Vec::new();
    for (name, psf) in PSFS {
        let optics = rig::optics(psf)?;
        let designed = SIZES
            .iter()
            .map(|&kernel_size| {
                Ok((design(&Request { kernel_size, ..Request::for_optics(&optics) })?, optics))
            })
            .collect::<Result<Vec<_>>>()?;
        let cells = sweep::planes(psf, PLANES, SEED, &designed)?.into_iter().map(sweep::cell);
        rows.push(std::iter::once(name.to_owned()).chain(cells).collect());
    }
    let head: Vec<String> = std::iter::once("PSF = operators".to_owned())
        .chain(SIZES.iter().map(|size| format!("{size}x{size}")))
        .collect();
    page.table(1, &head, &rows);
    Ok(())
}
