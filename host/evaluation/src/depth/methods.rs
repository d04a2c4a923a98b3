//! This project's method compared with published ones on the same pairs.

use anyhow::Result;
use farnear_depth::{
    baselines::{self, Favaro, FavaroSettings, Method},
    metrics::Comparison,
    operators::Operators,
    optics::Optics,
    pipeline::{Settings, depth_from_pair},
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

    fn depth(&self, method: Option<Method>, pair: &Pair, settings: &Settings) -> Result<Array2<f32>> {
        let (far, near) = (pair.far.view(), pair.near.view());
        Ok(match method {
            None => depth_from_pair(far, near, &self.operators, &self.optics, settings)?,
            Some(Method::Favaro) => self.favaro.depth_from_pair(far, near, &self.optics, settings)?,
            Some(method) => baselines::depth_from_pair(method, far, near, &self.optics, settings)?,
        }
        .depth_mm)
    }
}

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Methods");
    page.paragraph(&format!(
        "RMSE by rational operators (`ro`) and by the baselines, each with the lens's true PSF and the same windows: `subbarao` is the S-transform \
         (Subbarao & Surya 1994), `subbarao-fourier` the ratio of local spectra (Subbarao 1988), `favaro` null-space projectors (Favaro & Soatto \
         2005). Clean / 8-bit, over {PLANES} planes, on the staircase (8 px around steps left out) and on the cone. *No value*: share of the planes' pixels (8-bit) without a depth; they are not counted."
    ));
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
        let errors = errors(psf, &scenes, &methods)?;
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
    noise_against_support(page)
}

/// Errors `[exposure][scene][method]`, optionally without 8 px around steps.
fn errors(
    psf: &str,
    scenes: &[(Scene, u64, bool)],
    methods: &[Option<Method>],
) -> Result<[Vec<Vec<Comparison>>; 2]> {
    let (prepared, lens) = (Prepared::new(psf)?, rig::lens(false)?);
    let of_scene = |exposure: Exposure, (scene, seed, away): &(Scene, u64, bool)| {
        let pair = rig::render(scene, &lens, psf, exposure, *seed)?;
        methods
            .iter()
            .map(|&method| {
                let map = prepared.depth(method, &pair, &Settings::default())?;
                rig::error(&map, &pair.truth, *away)
            })
            .collect::<Result<Vec<_>>>()
    };
    let of_exposure =
        |exposure| scenes.par_iter().map(|scene| of_scene(exposure, scene)).collect::<Result<Vec<_>>>();
    let [clean, noisy] = EXPOSURES.map(of_exposure);
    Ok([clean?, noisy?])
}

/// With equal windows, to separate noise from support.
fn noise_against_support(page: &mut Page) -> Result<()> {
    const PSF: &str = "gaussian:k=0.4578";
    const WINDOWS_PX: [usize; 4] = [7, 11, 15, 21];
    page.paragraph(
        "Favaro's method is the better one under noise with a window of 7 px: each of its 7x7 patches is projected as a whole, and it was taught textures like \
         these. What a wider window (`--window`) buys, Gaussian PSF, 6 planes and the cone, clean / 8-bit (`ro` needs 5 to 10 ms for a pair, `favaro` about a second):",
    );
    let lens = rig::lens(false)?;
    let prepared = Prepared::new(PSF)?;
    let mut scenes: Vec<(Scene, u64)> = Vec::new();
    for (index, depth_mm) in rig::depths(6, 0.0)?.into_iter().enumerate() {
        scenes.push((rig::plane(depth_mm)?, SEED + index as u64));
    }
    scenes.push(("cone".parse()?, SEED));
    let jobs: Vec<_> =
        EXPOSURES.into_iter().flat_map(|e| scenes.iter().map(move |scene| (e, scene))).collect();
    let errors = jobs
        .par_iter()
        .map(|(exposure, (scene, seed))| {
            let pair = rig::render(scene, &lens, PSF, *exposure, *seed)?;
            let mut errors = Vec::new();
            for smoothing_px in WINDOWS_PX {
                let settings = Settings { smoothing_px, ..Settings::default() };
                for method in [None, Some(Method::Favaro)] {
                    errors.push(rig::error(&prepared.depth(method, &pair, &settings)?, &pair.truth, false)?);
                }
            }
            Ok(errors)
        })
        .collect::<Result<Vec<_>>>()?;
    let rows: Vec<Vec<String>> = WINDOWS_PX
        .iter()
        .enumerate()
        .map(|(window, size)| {
            let cell = |method: usize, scenes_of: std::ops::Range<usize>| {
                let of = |exposure: &[Vec<_>]| {
                    mm(rig::pooled_mm(exposure[scenes_of.clone()].iter().map(|e| &e[2 * window + method])))
                };
                errors.chunks(scenes.len()).map(of).collect::<Vec<_>>().join(" / ")
            };
            let last = scenes.len() - 1;
            vec![
                size.to_string(),
                cell(0, 0..last),
                cell(1, 0..last),
                cell(0, last..last + 1),
                cell(1, last..last + 1),
            ]
        })
        .collect();
    page.table(0, &["window, px", "planes, ro", "planes, favaro", "cone, ro", "cone, favaro"], &rows);
    Ok(())
}
