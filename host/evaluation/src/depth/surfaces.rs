//! Standard deviations on random surfaces, by several lenses.

use std::f64::consts::TAU;

use anyhow::{Context, Result};
use farnear_depth::{
    measure::{DepthMethod, MeasureSettings, measure_pair_of_views},
    optics::{Optics, OpticsFile},
};
use farnear_scene::{Camera, HeightMap, Lens, Noise, Renderer, Scene, Shape, truth};
use ndarray::{Array2, s};
use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::{page::Page, rig::BORDER_PX};

const LENSES: [(&str, &str); 4] = [
    (
        "50 mm, 887 to 933 mm",
        "[lens]\nfocal_length_mm = 50.0\naperture_mm = 12.8\n[sensor]\npixel_um = 7.4\n\
         [focus]\nfar_mm = 933.0\nmax_blur_px = 2.703\n[psf]\nmodel = \"gaussian\"\nk = 0.4578\n",
    ),
    (
        "35 mm at 300 mm",
        "[lens]\nfocal_length_mm = 35.0\nf_number = 4.0\n[sensor]\npixel_um = 5.5\n\
         [focus]\nfar_mm = 300.0\nmax_blur_px = 2.6\n[psf]\nmodel = \"pillbox\"\n",
    ),
    (
        "8 mm, 500 to 2000 mm",
        "[lens]\nfocal_length_mm = 8.0\nf_number = 5.6\n[sensor]\npixel_um = 4.8\n\
         [focus]\nfar_mm = 2000.0\nnear_mm = 500.0\n[psf]\nmodel = \"gaussian\"\nk = 0.46\n",
    ),
    (
        "16 mm, not telecentric",
        "[lens]\nfocal_length_mm = 16.0\nf_number = 2.8\ntelecentric = false\n[sensor]\npixel_um = 3.45\n\
         [focus]\nfar_mm = 500.0\nmax_blur_px = 2.8\n[psf]\nmodel = \"pillbox\"\n",
    ),
];
/// Shortest wavelengths, px.
const WAVELENGTHS: [f64; 4] = [400.0, 200.0, 100.0, 60.0];
const WAVES: usize = 24;
const SIZE: (usize, usize) = (480, 640);
/// Part of the working range, in normalised depth, that a surface spans.
const SPAN: f64 = 0.6;
const SEED: u64 = 900;

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Random surfaces");
    page.paragraph(&format!(
        "Sums of {WAVES} waves in random directions, from the shortest wavelength to twice that, which span {:.0} % of the working range; 8-bit, \
         the default method. The part of the errors within three predicted standard deviations, and the RMS of error over standard deviation. \
         No setting was chosen on these surfaces.",
        100.0 * SPAN
    ));
    let jobs: Vec<_> =
        LENSES.into_iter().flat_map(|lens| WAVELENGTHS.map(|wavelength| (lens, wavelength))).collect();
    let rows = jobs
        .par_iter()
        .enumerate()
        .map(|(index, &((name, optics), wavelength_px))| {
            let [within, ratio, filled] = judged(optics, wavelength_px, SEED + index as u64)?;
            let part = |part: f64| format!("{:.1} %", 100.0 * part);
            Ok(vec![
                name.into(),
                format!("{wavelength_px:.0}"),
                part(within),
                format!("{ratio:.2}"),
                part(filled),
            ])
        })
        .collect::<Result<Vec<Vec<String>>>>()?;
    page.table(1, &["lens", "wavelength, px", "within 3 SD", "error / SD", "with depth"], &rows);
    Ok(())
}

/// Part of the errors within three standard deviations, RMS of error over standard deviation, and part of the pixels with a depth.
fn judged(optics: &str, wavelength_px: f64, seed: u64) -> Result<[f64; 3]> {
    let rendered = farnear_scene::OpticsFile::parse(optics)?;
    let (lens, psf) = (Lens::from_optics(&rendered)?, rendered.psf.context("a PSF")?);

    let file: OpticsFile = toml::from_str(optics).context("the evaluation's optics")?;
    let optics = file.check()?;
    let scene = Scene::new(Shape::HeightMap(HeightMap::new(surface(&optics, wavelength_px, seed))?));
    let camera = Camera::new(SIZE.1, SIZE.0, Noise::EightBit);
    let renderer = Renderer::new(&scene, &lens, &psf, &camera, seed)?;
    let far = renderer.expose(lens.sensor_far_mm, 0)?.mapv(f32::from);
    let near = renderer.expose(lens.sensor_near_mm, 1)?.mapv(f32::from);
    let settings =
        MeasureSettings { window: DepthMethod::Whitened.usual_window(), ..MeasureSettings::default() };
    let found =
        measure_pair_of_views(far.view(), near.view(), &optics, DepthMethod::Whitened, None, &settings)?;
    let inner = s![BORDER_PX..SIZE.0 - BORDER_PX, BORDER_PX..SIZE.1 - BORDER_PX];
    let truth = truth(&scene, &lens, &camera);
    let depths = found.map.depth_mm.slice(inner);
    let deviations = found.validity.deviation_mm.slice(inner);
    let ratios: Vec<f64> = depths
        .iter()
        .zip(truth.slice(inner))
        .zip(deviations)
        .map(|((depth, truth), deviation)| f64::from((depth - truth) / deviation))
        .filter(|ratio| ratio.is_finite())
        .collect();
    let count = ratios.len() as f64;
    let within = ratios.iter().filter(|ratio| ratio.abs() <= 3.0).count() as f64;
    let squares: f64 = ratios.iter().map(|ratio| ratio * ratio).sum();
    Ok([within / count, (squares / count).sqrt(), count / depths.len() as f64])
}

/// Depths in mm whose normalised depth is a sum of waves.
fn surface(optics: &Optics, wavelength_px: f64, seed: u64) -> Array2<f32> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let waves: Vec<[f64; 3]> = (0..WAVES)
        .map(|_| {
            let (direction, phase) = (random.random_range(0.0..TAU), random.random_range(0.0..TAU));
            let per_px = TAU / random.random_range(wavelength_px..2.0 * wavelength_px);
            [per_px * direction.cos(), per_px * direction.sin(), phase]
        })
        .collect();
    let sum = Array2::from_shape_fn(SIZE, |(y, x)| {
        waves.iter().map(|[kx, ky, phase]| (kx * x as f64 + ky * y as f64 + phase).sin()).sum::<f64>()
    });
    let (low, high) =
        sum.iter().fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(*value), high.max(*value)));
    sum.mapv(|value| optics.depth_mm(SPAN * (2.0 * (value - low) / (high - low) - 1.0)) as f32)
}
