//! A textureless disc on a textured surface, filled from what surrounds it.

use anyhow::Result;
use farnear_depth::{
    metrics::{CompareSettings, compare},
    operators::Operators,
    pipeline::{Settings, depth_from_pair},
};
use farnear_scene::{Camera, Noise, Picture, Renderer, Scene, Texture};
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    page::{Page, mm},
    rig::{self, Exposure, PSFS},
};

const SEED: u64 = 900;
/// Two texture samples per pixel of the 640x480 images.
const TEXTURE: (usize, usize) = (1280, 960);
/// Centre (row, column) and radius of the disc in px.
const CENTRE: (f64, f64) = (190.0, 420.0);
const RADIUS_PX: f64 = 40.0;
const SCENES: [&str; 4] = ["plane:905", "slant", "cone", "sphere"];
/// Textures and noises.
const REPEATS: u64 = 3;

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Filling where there is no texture");
    page.paragraph(&format!(
        "A disc of {RADIUS_PX:.0} px radius without any texture, 110 px beside the image's middle; `--fill` fits a surface to a margin around it. RMSE inside the \
         disc as measured and filled, over {REPEATS} textures with their noise."
    ));
    let sands = (0..REPEATS).map(sand_with_disc).collect::<Result<Vec<_>>>()?;
    let jobs: Vec<_> = PSFS
        .into_iter()
        .flat_map(|psf| SCENES.into_iter().map(move |scene| (psf, scene)))
        .flat_map(|(psf, scene)| [Exposure::Clean, Exposure::EightBit].map(|exposure| (psf, scene, exposure)))
        .collect();
    let rows = jobs
        .par_iter()
        .map(|&((name, psf), scene, exposure)| {
            let mut squares = [0.0; 2];
            for (seed, sand) in (SEED..).zip(&sands) {
                let errors = one(psf, scene, exposure, sand, seed)?;
                squares.iter_mut().zip(errors).for_each(|(sum, error)| *sum += error * error);
            }
            let [measured, filled] = squares.map(|sum| (sum / REPEATS as f64).sqrt());
            Ok(vec![name.into(), scene.into(), exposure.name().into(), mm(measured), mm(filled)])
        })
        .collect::<Result<Vec<Vec<String>>>>()?;
    page.table(3, &["PSF = operators", "scene", "images", "not filled", "filled"], &rows);
    Ok(())
}

/// Sand at two samples per pixel, flat inside the disc.
fn sand_with_disc(repeat: u64) -> Result<Picture> {
    let lens = rig::lens(false)?;
    let camera = Camera::new(TEXTURE.0, TEXTURE.1, Noise::None);
    // At its focus the surface is seen as it is painted.
    let scene = rig::plane(lens.far_mm)?;
    let renderer = Renderer::new(&scene, &lens, &"pillbox".parse()?, &camera, SEED + repeat)?;
    let mut sand = renderer.radiance(lens.sensor_far_mm)?;
    for ((row, column), radiance) in sand.indexed_iter_mut() {
        if distance_px(0.5 * (row as f64 + 0.5), 0.5 * (column as f64 + 0.5)) < RADIUS_PX {
            *radiance = 1.0;
        }
    }
    Ok(Picture::new(sand)?)
}

fn distance_px(row: f64, column: f64) -> f64 {
    (row - CENTRE.0).hypot(column - CENTRE.1)
}

/// RMSE inside the disc without and with filling, mm.
fn one(psf: &str, scene: &str, exposure: Exposure, sand: &Picture, seed: u64) -> Result<[f64; 2]> {
    let optics = rig::optics(psf)?;
    let operators = Operators::for_optics(&optics)?;
    let scene = Scene { texture: Texture::Picture(sand.clone()), ..scene.parse()? };
    let pair = rig::render(&scene, &rig::lens(false)?, psf, exposure, seed)?;
    let disc = Array2::from_shape_fn(pair.truth.dim(), |(row, column)| {
        distance_px(row as f64 + 0.5, column as f64 + 0.5) < RADIUS_PX
    });
    let rmse = |fill: bool| -> Result<f64> {
        let settings = Settings { fill, ..Settings::default() };
        let map = depth_from_pair(pair.far.view(), pair.near.view(), &operators, &optics, &settings)?;
        let settings = CompareSettings::default();
        let error = compare(map.depth_mm.view(), pair.truth.view(), Some(disc.view()), &settings);
        // Nothing inside has a depth: there is no error to state.
        Ok(error.map_or(f64::NAN, |error| error.rmse_mm))
    };
    Ok([rmse(false)?, rmse(true)?])
}
