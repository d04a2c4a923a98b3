//! This project's method beside other people's, on the same pairs.

use anyhow::Result;
use farnear_depth::{
    baselines::{self, Favaro, FavaroSettings, Method},
    operators::Operators,
    optics::Optics,
    run::Settings,
};
use farnear_scene::Scene;
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    page::{Page, mm},
    rig::{self, Exposure, PSFS, Pair},
};

const PLANES: usize = 12;
const SEED: u64 = 600;
const SCENES: [&str; 2] = ["staircase", "cone"];
const EXPOSURES: [Exposure; 2] = [Exposure::Clean, Exposure::EightBit];

/// What one lens needs: rational operators and projectors, made once.
struct Prepared {
    optics: Optics,
    operators: Operators,
    favaro: Favaro,
}

impl Prepared {
    fn new(psf: &str) -> Result<Self> {
        let optics = rig::optics(psf)?;
        Ok(Self {
            optics,
            operators: Operators::for_optics(&optics)?,
            favaro: Favaro::learn(&optics, &FavaroSettings::default())?,
        })
    }

    /// Depth by rational operators (`None`) or by a baseline.
    fn depth(&self, method: Option<Method>, pair: &Pair) -> Result<Array2<f32>> {
        let (far, near, settings) = (pair.far.view(), pair.near.view(), Settings::default());
        Ok(match method {
            None => return rig::depth(pair, &self.operators, &self.optics),
            Some(Method::Favaro) => self.favaro.depth_from_pair(far, near, &self.optics, &settings)?,
            Some(method) => baselines::depth_from_pair(method, far, near, &self.optics, &settings)?,
        }
        .depth_mm)
    }
}

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Methods");
    page.paragraph(&format!(
        "RMSE by rational operators (`ro`) and by the baselines, each told the lens's own PSF and given the same windows: `subbarao` is the S-transform \
         (Subbarao & Surya 1994), `subbarao-fourier` the ratio of local spectra (Subbarao 1988), `favaro` null-space projectors (Favaro & Soatto \
         2005). Clean / 8-bit, over {PLANES} planes, on the staircase (8 px around steps left out) and on the cone. *No value* is the part of the planes' \
         pixels, 8-bit, for which a method gives no depth; they are not counted."
    ));
    let lens = rig::lens(false)?;
    let mut scenes: Vec<(Scene, u64, bool)> = Vec::new();
    for (index, depth_mm) in rig::depths(PLANES, 0.0)?.into_iter().enumerate() {
        scenes.push((rig::plane(depth_mm)?, SEED + index as u64, false));
    }
    for name in SCENES {
        scenes.push((name.parse()?, SEED, name == "staircase"));
    }
    let methods: Vec<Option<Method>> = std::iter::once(None).chain(Method::ALL.map(Some)).collect();
    let mut rows = Vec::new();
    for (name, psf) in PSFS {
        let prepared = Prepared::new(psf)?;
        // [exposure][scene][method]
        let errors = EXPOSURES
            .iter()
            .map(|&exposure| {
                scenes
                    .par_iter()
                    .map(|(scene, seed, away)| {
                        let pair = rig::render(scene, &lens, psf, exposure, *seed)?;
                        methods
                            .iter()
                            .map(|&method| rig::error(&prepared.depth(method, &pair)?, &pair.truth, *away))
                            .collect::<Result<Vec<_>>>()
                    })
                    .collect::<Result<Vec<_>>>()
            })
            .collect::<Result<Vec<_>>>()?;
        for (index, method) in methods.iter().enumerate() {
            let both = |places: std::ops::Range<usize>| {
                let of = |errors: &Vec<Vec<_>>| {
                    mm(rig::pooled_mm(errors[places.clone()].iter().map(|errors| &errors[index])))
                };
                errors.iter().map(of).collect::<Vec<_>>().join(" / ")
            };
            let planes = &errors[1][..PLANES];
            let missing = planes.iter().map(|e| e[index].missing_fraction).sum::<f64>() / PLANES as f64;
            rows.push(vec![
                name.to_owned(),
                method.map_or("ro", Method::name).to_owned(),
                both(0..PLANES),
                both(PLANES..PLANES + 1),
                both(PLANES + 1..PLANES + 2),
                format!("{:.2} %", 100.0 * missing),
            ]);
        }
    }
    page.table(2, &["PSF", "method", "planes", "staircase", "cone", "no value"], &rows);
    Ok(())
}
