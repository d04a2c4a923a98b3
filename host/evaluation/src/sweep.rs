//! The same planes by several operators.

use anyhow::Result;
use farnear_depth::{operators::Operators, optics::Optics};
use rayon::prelude::*;

use crate::{
    page::mm,
    rig::{self, Exposure},
};

/// RMSE, mm, `[clean, 8-bit]` per operator over planes from far to near focus, each with its own texture and noise.
pub fn planes(psf: &str, count: usize, seed: u64, by: &[(Operators, Optics)]) -> Result<Vec<[f64; 2]>> {
    let (depths, lens) = (rig::depths(count, 0.0)?, rig::lens(false)?);
    let mut found = vec![[f64::NAN; 2]; by.len()];
    for (column, exposure) in [Exposure::Clean, Exposure::EightBit].into_iter().enumerate() {
        let one = |(seed, depth_mm): (u64, &f64)| {
            let pair = rig::render(&rig::plane(*depth_mm)?, &lens, psf, exposure, seed)?;
            by.iter()
                .map(|(operators, optics)| {
                    rig::error(&rig::depth(&pair, operators, optics)?, &pair.truth, false)
                })
                .collect::<Result<Vec<_>>>()
        };
        let jobs: Vec<(u64, &f64)> = (seed..).zip(&depths).collect();
        let of_planes = jobs.into_par_iter().map(one).collect::<Result<Vec<_>>>()?;
        for (index, found) in found.iter_mut().enumerate() {
            found[column] = rig::pooled_mm(of_planes.iter().map(|errors| &errors[index]));
        }
    }
    Ok(found)
}

pub fn cell([clean, noisy]: [f64; 2]) -> String {
    format!("{} / {}", mm(clean), mm(noisy))
}
