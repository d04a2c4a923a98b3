//! What larger operators buy, the question with which Li 2014 ends.

use anyhow::Result;
use farnear_depth::{
    kernel::SIZES,
    operators::{Request, design},
};
use rayon::prelude::*;

use crate::{
    page::{Page, mm},
    rig::{self, Exposure, PSFS},
};

const PLANES: usize = 12;
const SEED: u64 = 300;

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Size of the operators");
    page.paragraph(&format!(
        "RMSE over {PLANES} planes with operators of 5x5 to 11x11 pixels, clean / 8-bit."
    ));
    let depths = rig::depths(PLANES, 0.0)?;
    let lens = rig::lens(false)?;
    let mut rows = Vec::new();
    for (name, psf) in PSFS {
        let optics = rig::optics(psf)?;
        let designed = SIZES
            .iter()
            .map(|&kernel_size| Ok(design(&Request { kernel_size, ..Request::for_optics(&optics) })?))
            .collect::<Result<Vec<_>>>()?;
        let mut cells = vec![Vec::new(); SIZES.len()];
        for exposure in [Exposure::Clean, Exposure::EightBit] {
            let of_planes = depths
                .par_iter()
                .enumerate()
                .map(|(i, depth_mm)| {
                    let pair = rig::render(&rig::plane(*depth_mm)?, &lens, psf, exposure, SEED + i as u64)?;
                    designed
                        .iter()
                        .map(|operators| {
                            rig::error(&rig::depth(&pair, operators, &optics)?, &pair.truth, false)
                        })
                        .collect::<Result<Vec<_>>>()
                })
                .collect::<Result<Vec<_>>>()?;
            for (size, cell) in cells.iter_mut().enumerate() {
                cell.push(mm(rig::pooled_mm(of_planes.iter().map(|errors| &errors[size]))));
            }
        }
        rows.push(std::iter::once(name.to_owned()).chain(cells.iter().map(|c| c.join(" / "))).collect());
    }
    let head: Vec<String> = std::iter::once("PSF = operators".to_owned())
        .chain(SIZES.iter().map(|size| format!("{size}x{size}")))
        .collect();
    page.table(1, &head, &rows);
    Ok(())
}
