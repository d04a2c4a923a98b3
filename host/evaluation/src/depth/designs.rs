//! Families of rational operators and their design procedures on the same planes.

use anyhow::Result;
use farnear_depth::operators::{Design, Family, Operators, Request, design};
use farnear_depth::optics::Optics;
use rayon::prelude::*;

use crate::{
    page::{Page, mm},
    rig::{self, Exposure, PSFS},
};

const PLANES: usize = 12;
const SEED: u64 = 500;

/// Index into [`PSFS`], family, design.
const COMPARED: [(usize, Family, Design); 8] = [
    (0, Family::Watanabe, Design::Linear),
    (0, Family::Raj, Design::Linear),
    (0, Family::Ro, Design::Thesis),
    (0, Family::Ro, Design::Linear),
    (1, Family::Gro, Design::Thesis),
    (1, Family::Gro, Design::Linear),
    (2, Family::Ggro, Design::Thesis),
    (2, Family::Ggro, Design::Linear),
];

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Families and designs");
    page.paragraph(&format!(
        "RMSE over {PLANES} planes, operators of 7x7 for the lens's own PSF. `watanabe` and `raj` are the published procedures of Watanabe & Nayar (1998) \
         and Raj & Staunton (2012); `thesis` is the Levenberg-Marquardt design of Li (2014), `linear` one linear least squares. *NIR residual* \
         is what the rational model leaves of the normalised image ratio, RMS."
    ));
    let depths = rig::depths(PLANES, 0.0)?;
    let lens = rig::lens(false)?;
    let designed = COMPARED
        .iter()
        .map(|&(psf, family, procedure)| {
            let optics = rig::optics(PSFS[psf].1)?;
            let request = Request { family, design: procedure, ..Request::for_optics(&optics) };
            Ok((psf, design(&request)?, optics))
        })
        .collect::<Result<Vec<(usize, Operators, Optics)>>>()?;
    let mut cells = vec![Vec::new(); COMPARED.len()];
    for exposure in [Exposure::Clean, Exposure::EightBit] {
        for (psf, (_, text)) in PSFS.iter().enumerate() {
            let of_planes = depths
                .par_iter()
                .enumerate()
                .map(|(i, depth_mm)| {
                    let pair = rig::render(&rig::plane(*depth_mm)?, &lens, text, exposure, SEED + i as u64)?;
                    designed
                        .iter()
                        .filter(|(of, ..)| *of == psf)
                        .map(|(_, operators, optics)| {
                            rig::error(&rig::depth(&pair, operators, optics)?, &pair.truth, false)
                        })
                        .collect::<Result<Vec<_>>>()
                })
                .collect::<Result<Vec<_>>>()?;
            let of_psf = cells.iter_mut().zip(&designed).filter(|(_, (of, ..))| *of == psf);
            for (index, (cell, _)) in of_psf.enumerate() {
                cell.push(mm(rig::pooled_mm(of_planes.iter().map(|errors| &errors[index]))));
            }
        }
    }
    let rows: Vec<Vec<String>> = COMPARED
        .iter()
        .zip(&designed)
        .zip(cells)
        .map(|(((psf, family, procedure), (_, operators, _)), cells)| {
            let procedure = match family {
                Family::Watanabe | Family::Raj => "published".to_owned(),
                _ => procedure.to_string(),
            };
            let names = [PSFS[*psf].0.to_owned(), family.to_string(), procedure];
            let residual = format!("{:.4}", operators.nir_rms());
            names.into_iter().chain([residual]).chain(cells).collect()
        })
        .collect();
    page.table(3, &["PSF", "family", "design", "NIR residual", "clean", "8-bit"], &rows);
    Ok(())
}
