//! Predicted against measured standard deviation of the depth.

use anyhow::Result;
use farnear_depth::{
    operators::Operators,
    pipeline::{Settings, depth_from_pair},
    uncertainty::{Noise, standard_deviation_mm},
};
use farnear_scene::{Camera, Noise as CameraNoise, Renderer};
use ndarray::{Array2, s};
use rayon::prelude::*;

use crate::{
    page::{Page, mm},
    rig::{self, PSFS},
};

const PAIRS: u32 = 16;
const SIZE: (usize, usize) = (240, 200);
const RIM: usize = 20;
const SEED: u64 = 800;
/// Positions in the working range: 0 is far focus, 1 near focus.
const PLACES: [f64; 3] = [0.15, 0.5, 0.85];

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Predicted uncertainty");
    page.paragraph(&format!(
        "The standard deviation that is predicted for each pixel from one pair and the camera's noise, against the one measured over {PAIRS} pairs of the same \
         textured plane that differ in nothing but noise; root mean squares over the pixels."
    ));
    let cameras = [("8-bit", CameraNoise::EightBit), ("12-bit", CameraNoise::TwelveBit)];
    let jobs: Vec<_> = PSFS
        .into_iter()
        .flat_map(|psf| cameras.into_iter().flat_map(move |camera| PLACES.map(|place| (psf, camera, place))))
        .collect();
    let rows = jobs
        .par_iter()
        .map(|&((name, psf), (bits, noise), place)| {
            let (depth_mm, predicted, measured) = one(psf, noise, place)?;
            Ok(vec![
                name.into(),
                bits.into(),
                format!("{depth_mm:.1}"),
                mm(predicted),
                mm(measured),
                format!("{:.3}", predicted / measured),
            ])
        })
        .collect::<Result<Vec<Vec<String>>>>()?;
    page.table(2, &["PSF = operators", "camera", "depth", "predicted SD", "measured SD", "ratio"], &rows);
    Ok(())
}

fn one(psf: &str, noise: CameraNoise, place: f64) -> Result<(f64, f64, f64)> {
    let optics = rig::optics(psf)?;
    let operators = Operators::for_optics(&optics)?;
    let settings = Settings::default();
    let lens = rig::lens(false)?;
    let depth_mm = lens.far_mm + place * (lens.near_mm - lens.far_mm);
    let camera = Camera::new(SIZE.0, SIZE.1, noise);
    let of_camera = Noise::camera(camera.full_well_e, camera.read_noise_e, f64::from(noise.max_code()));
    let renderer = Renderer::new(&rig::plane(depth_mm)?, &lens, &psf.parse()?, &camera, SEED)?;
    let [mut sum, mut squares] = [(); 2].map(|()| Array2::<f64>::zeros((SIZE.1, SIZE.0)));
    let mut predicted = f64::NAN;
    let inner = s![RIM..SIZE.1 - RIM, RIM..SIZE.0 - RIM];
    for number in 0..PAIRS {
        let far = renderer.expose(lens.sensor_far_mm, 2 * number)?.mapv(f32::from);
        let near = renderer.expose(lens.sensor_near_mm, 2 * number + 1)?.mapv(f32::from);
        let map = depth_from_pair(far.view(), near.view(), &operators, &optics, &settings)?;
        let depth = map.depth_mm.mapv(f64::from);
        sum += &depth;
        squares += &(&depth * &depth);
        if number == 0 {
            let deviation =
                standard_deviation_mm(far.view(), near.view(), &operators, &optics, &settings, of_camera)?;
            let inner = deviation.slice(inner).mapv(|d| f64::from(d).powi(2));
            predicted = (inner.sum() / inner.len() as f64).sqrt();
        }
    }
    let n = f64::from(PAIRS);
    let variance = (&squares - &(&sum * &sum / n)) / (n - 1.0);
    let inner = variance.slice(inner);
    Ok((depth_mm, predicted, (inner.sum() / inner.len() as f64).sqrt()))
}
