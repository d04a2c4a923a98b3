//! Families of rational operators and their design procedures on the same planes.

use anyhow::Result;
use farnear_depth::operators::{Design, Family, Request, design};

use crate::{
    page::{Page, mm},
    rig::{self, PSFS},
    sweep,
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
    let mut rows: Vec<Vec<String>> = Vec::new();
    for (index, (name, psf)) in PSFS.into_iter().enumerate() {
        let optics = rig::optics(psf)?;
        let of_psf: Vec<_> = COMPARED.into_iter().filter(|(of, ..)| *of == index).collect();
        let designed = of_psf
            .iter()
            .map(|&(_, family, procedure)| {
                let request = Request { family, design: procedure, ..Request::for_optics(&optics) };
                Ok((design(&request)?, optics))
            })
            .collect::<Result<Vec<_>>>()?;
        let errors = sweep::planes(psf, PLANES, SEED, &designed)?;
        for ((&(_, family, procedure), (operators, _)), [clean, noisy]) in
            of_psf.iter().zip(&designed).zip(errors)
        {
            let procedure = match family {
                Family::Watanabe | Family::Raj => "published".to_owned(),
                _ => procedure.to_string(),
            };
            let residual = format!("{:.4}", operators.nir_rms());
            rows.push(vec![name.to_owned(), family.to_string(), procedure, residual, mm(clean), mm(noisy)]);
        }
    }
    page.table(3, &["PSF", "family", "design", "NIR residual", "clean", "8-bit"], &rows);
    Ok(())
}
