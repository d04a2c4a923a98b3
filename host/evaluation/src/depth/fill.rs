//! A textureless disc on a textured surface, filled from its surroundings.

use anyhow::Result;
use farnear_depth::{
    fill::{FillBy, LowTexture},
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
const COLUMNS: usize = 5;
/// Thresholds of the ratio's variance: between those of disc and texture, and the thesis'.
const SUITED: f32 = 1e-4;
const OF_THESIS: f32 = 0.0144;
const REPEATS: u64 = 3;

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Filling regions without texture");
    page.paragraph(&format!(
        "A disc of {RADIUS_PX:.0} px radius without any texture, 110 px from the image's centre; `--fill` fits a surface to a margin around it. RMSE inside the \
         disc as measured and filled, over {REPEATS} textures with their noise. For comparison, Li 2014's section 6.5 (`--fill=thesis`): regions one after the other, each by seven terms from the \
         rectangle around it with a pixel to spare; and its criterion with a threshold that suits these scenes (`--low-texture variance:{SUITED}`) and its own of {OF_THESIS} \
         (in brackets the part of the map that was filled; its inequality is put right). By its own threshold everything is low texture, and nothing is left to fill from; by any threshold the middle of the \
         range is, where both images are alike, however much texture there is."
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
            let mut squares = [0.0; COLUMNS];
            let mut taken = [0.0; COLUMNS];
            for (seed, sand) in (SEED..).zip(&sands) {
                let found = one(psf, scene, exposure, sand, seed)?;
                for (at, (error, part)) in found.into_iter().enumerate() {
                    squares[at] += error * error / REPEATS as f64;
                    taken[at] += 100.0 * part / REPEATS as f64;
                }
            }
            let [measured, filled, thesis, suited, own] = squares.map(f64::sqrt);
            let [.., of_suited, of_own] = taken;
            Ok(vec![
                name.into(),
                scene.into(),
                exposure.name().into(),
                mm(measured),
                mm(filled),
                mm(thesis),
                format!("{} ({of_suited:.0} %)", mm(suited)),
                format!("{} ({of_own:.0} %)", mm(own)),
            ])
        })
        .collect::<Result<Vec<Vec<String>>>>()?;
    let own = format!("variance:{OF_THESIS}");
    let suited = format!("variance:{SUITED}");
    let columns =
        ["PSF = operators", "scene", "images", "not filled", "filled", "as the thesis", &suited, &own];
    page.table(3, &columns, &rows);
    Ok(())
}

fn sand_with_disc(repeat: u64) -> Result<Picture> {
    let lens = rig::lens(false)?;
    let camera = Camera::new(TEXTURE.0, TEXTURE.1, Noise::None);
    // In focus the surface is sharp.
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

/// RMSE in the disc, mm, and filled share: without filling, filled, by the thesis' criterion with both thresholds.
fn one(
    psf: &str,
    scene: &str,
    exposure: Exposure,
    sand: &Picture,
    seed: u64,
) -> Result<[(f64, f64); COLUMNS]> {
    let optics = rig::optics(psf)?;
    let operators = Operators::for_optics(&optics)?;
    let scene = Scene { texture: Texture::Picture(sand.clone()), ..scene.parse()? };
    let pair = rig::render(&scene, &rig::lens(false)?, psf, exposure, seed)?;
    let disc = Array2::from_shape_fn(pair.truth.dim(), |(row, column)| {
        distance_px(row as f64 + 0.5, column as f64 + 0.5) < RADIUS_PX
    });
    let judged = |fill: bool, low_texture: LowTexture, fill_by: FillBy| -> Result<(f64, f64)> {
        let settings = Settings { fill, low_texture, fill_by, ..Settings::default() };
        let map = depth_from_pair(pair.far.view(), pair.near.view(), &operators, &optics, &settings)?;
        let filled = map.filled.iter().flatten().filter(|filled| **filled).count();
        let settings = CompareSettings::default();
        let error = compare(map.depth_mm.view(), pair.truth.view(), Some(disc.view()), &settings);
        // Without a depth inside there is no error.
        Ok((error.map_or(f64::NAN, |error| error.rmse_mm), filled as f64 / disc.len() as f64))
    };
    let (energy, surface, thesis) = (LowTexture::Energy, FillBy::Surface, FillBy::Thesis);
    Ok([
        judged(false, energy, surface)?,
        judged(true, energy, surface)?,
        judged(true, energy, thesis)?,
        judged(true, LowTexture::Variance { below: SUITED }, thesis)?,
        judged(true, LowTexture::Variance { below: OF_THESIS }, thesis)?,
    ])
}
