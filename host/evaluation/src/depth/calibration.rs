//! Accuracy of point spread functions from noisy pairs, as in Li 2014, sections 5.2.1 and 5.2.2.

use anyhow::Result;
use farnear_depth::{
    calibrate::{CapturedPair, Model, fit_psf},
    psf::Psf,
};
use farnear_scene::Scene;
use rayon::prelude::*;

use crate::{
    page::Page,
    rig::{self, Exposure},
};

const SEED: u64 = 700;
/// Pairs per line, each with its own texture and noise.
const PAIRS: u64 = 8;
const TRUE: [(&str, Model); 6] = [
    ("gaussian:k=0.40", Model::Gaussian),
    ("gaussian:k=0.4578", Model::Gaussian),
    ("gaussian:k=0.52", Model::Gaussian),
    ("generalised:p=1.6,k=0.45", Model::Generalised),
    ("generalised:p=1.8,k=0.4802", Model::Generalised),
    ("generalised:p=2.4,k=0.50", Model::Generalised),
];

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Calibration of the point spread function");
    page.paragraph(&format!(
        "From one 8-bit pair of a plane at far focus whose PSF is not known; largest and mean errors over {PAIRS} pairs."
    ));
    let lens = rig::lens(false)?;
    let far: Scene = rig::plane(lens.far_mm)?;
    let mut rows = Vec::new();
    for (psf, model) in TRUE {
        let truth: Psf = psf.parse()?;
        let optics = rig::optics(psf)?;
        let found = (0..PAIRS)
            .into_par_iter()
            .map(|i| {
                let pair = rig::render(&far, &lens, psf, Exposure::EightBit, SEED + i)?;
                let pair = CapturedPair { far: pair.far.view(), near: pair.near.view(), alpha: None };
                Ok(fit_psf(&[pair], &optics, model)?.psf)
            })
            .collect::<Result<Vec<_>>>()?;
        let errors = |parameter: fn(Psf) -> f64| {
            let errors: Vec<f64> = found.iter().map(|f| parameter(*f) - parameter(truth)).collect();
            let largest = errors.iter().map(|e| e.abs()).fold(0.0, f64::max);
            (errors.iter().sum::<f64>() / errors.len() as f64, largest)
        };
        let (mean_k, largest_k) = errors(k_of);
        let (mean_p, largest_p) = errors(p_of);
        let of_p = |value: f64| if model == Model::Gaussian { "-".into() } else { format!("{value:.3}") };
        rows.push(vec![
            psf.into(),
            format!("{mean_k:.4}"),
            format!("{largest_k:.4}"),
            of_p(mean_p),
            of_p(largest_p),
        ]);
    }
    page.table(1, &["true PSF", "k: mean error", "k: largest", "p: mean error", "p: largest"], &rows);
    Ok(())
}

fn k_of(psf: Psf) -> f64 {
    match psf {
        Psf::Gaussian { k } | Psf::Generalised { k, .. } => k,
        _ => 1.0,
    }
}

fn p_of(psf: Psf) -> f64 {
    match psf {
        Psf::Generalised { p, .. } => p,
        _ => 2.0,
    }
}
