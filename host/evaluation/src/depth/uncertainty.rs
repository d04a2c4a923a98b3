//! Predicted standard deviation against the error of the depth.

use anyhow::Result;
use farnear_depth::{
    measure::{DepthMethod, MeasureSettings, measure_pair_of_views},
    operators::Operators,
};
use farnear_scene::{Camera, Noise, Renderer};
use ndarray::s;
use rayon::prelude::*;

use crate::{
    page::{Page, mm},
    rig::{self, PSFS},
};

const PAIRS: u32 = 4;
const SIZE: (usize, usize) = (240, 200);
const RIM: usize = 20;
const SEED: u64 = 800;
/// Positions in the working range: 0 is far focus, 1 near focus.
const PLACES: [f64; 3] = [0.15, 0.5, 0.85];

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Predicted uncertainty");
    page.paragraph(&format!(
        "The standard deviation that is predicted for each pixel from one pair alone (the noise is estimated), against the error over {PAIRS} pairs of a \
         textured plane; root mean squares over the pixels. `ro` has windows of 7 px, `whitened` adaptive ones."
    ));
    let cameras = [("8-bit", Noise::EightBit), ("12-bit", Noise::TwelveBit)];
    let jobs: Vec<_> = PSFS
        .into_iter()
        .flat_map(|psf| cameras.into_iter().flat_map(move |camera| PLACES.map(|place| (psf, camera, place))))
        .collect();
    let rows = jobs
        .par_iter()
        .map(|&((name, psf), (bits, noise), place)| {
            let lens = rig::lens(false)?;
            let depth_mm = lens.far_mm + place * (lens.near_mm - lens.far_mm);
            let mut row = vec![name.into(), bits.into(), format!("{depth_mm:.1}")];
            let optics = rig::optics(psf)?;
            let operators = Operators::for_optics(&optics)?;
            for method in [DepthMethod::Rational(&operators), DepthMethod::Whitened] {
                let [predicted, error] = predicted_and_error(psf, noise, depth_mm, method)?;
                row.extend([mm(predicted), mm(error), format!("{:.2}", predicted / error)]);
            }
            Ok(row)
        })
        .collect::<Result<Vec<Vec<String>>>>()?;
    let of_methods = ["ro: predicted", "error", "ratio", "whitened: predicted", "error", "ratio"];
    page.table(2, &[&["PSF = operators", "camera", "depth"][..], &of_methods].concat(), &rows);
    Ok(())
}

fn predicted_and_error(psf: &str, noise: Noise, depth_mm: f64, method: DepthMethod<'_>) -> Result<[f64; 2]> {
    let optics = rig::optics(psf)?;
    let settings = MeasureSettings { window: method.usual_window(), ..MeasureSettings::default() };
    let lens = rig::lens(false)?;
    let camera = Camera::new(SIZE.0, SIZE.1, noise);
    let renderer = Renderer::new(&rig::plane(depth_mm)?, &lens, &psf.parse()?, &camera, SEED)?;
    let [mut predicted, mut errors, mut pixels] = [0.0; 3];
    let inner = s![RIM..SIZE.1 - RIM, RIM..SIZE.0 - RIM];
    for number in 0..PAIRS {
        let far = renderer.expose(lens.sensor_far_mm, 2 * number)?.mapv(f32::from);
        let near = renderer.expose(lens.sensor_near_mm, 2 * number + 1)?.mapv(f32::from);
        let found = measure_pair_of_views(far.view(), near.view(), &optics, method, None, &settings)?;
        let depths = found.map.depth_mm.slice(inner);
        for (depth, deviation) in depths.iter().zip(found.validity.deviation_mm.slice(inner)) {
            if depth.is_finite() {
                predicted += f64::from(*deviation).powi(2);
                errors += (f64::from(*depth) - depth_mm).powi(2);
                pixels += 1.0;
            }
        }
    }
    Ok([predicted, errors].map(|sum| (sum / pixels).sqrt()))
}
