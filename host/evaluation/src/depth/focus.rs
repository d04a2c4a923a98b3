//! Depth from focus over a rendered stack, compared with the pair.

use anyhow::Result;
use farnear_depth::{
    focus_stack::{StackSettings, depth_from_stack},
    operators::Operators,
};
use ndarray::Array2;

use crate::{
    page::Page,
    rig::{self, Exposure},
};

const SEED: u64 = 1_800;
const PSF: &str = "gaussian:k=0.4578";
const IMAGES: usize = 21;
const STEP_MM: f64 = 0.015;
const WINDOWS_PX: [usize; 4] = [7, 9, 15, 21];

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Depth from focus");
    let lens = rig::lens(false)?;
    let scene = "staircase".parse()?;
    let middle = 0.5 * (lens.sensor_far_mm + lens.sensor_near_mm);
    let places: Vec<f64> =
        (0..IMAGES).map(|i| middle + STEP_MM * (i as f64 - 0.5 * (IMAGES - 1) as f64)).collect();
    let (images, truth) = rig::stack(&scene, &lens, PSF, &places, SEED)?;
    let usual = StackSettings::default();
    page.paragraph(&format!(
        "The staircase, Gaussian PSF, 8-bit: {IMAGES} images {:.0} um of sensor travel apart about the middle of the pair's, by `farnear focus-stack` with its defaults \
         (`{}`, images blurred by {} px, median {}x{}, guided within {} px, up to {} points, reliability {}) unless stated otherwise. For comparison the pair, by `ro` with a window of 7. Away from \
         steps: more than 8 px. *No value*: too little reliability, or sharpest in the first or last image.",
        1e3 * STEP_MM,
        usual.measure,
        usual.smoothing_px,
        usual.median_px,
        usual.median_px,
        usual.guided_px,
        usual.fit_points,
        usual.min_reliability
    ));
    let mut rows = Vec::new();
    let views: Vec<_> = images.iter().map(|image| image.view()).collect();
    let windows = WINDOWS_PX.map(|window_px| StackSettings { window_px, ..usual });
    for settings in windows.into_iter().chain([StackSettings { guided_px: 0.0, ..usual }]) {
        let map = depth_from_stack(&views, &settings)?;
        let depth =
            map.place.mapv(|place| depth_mm(f64::from(place), places[0], rig::FOCAL_LENGTH_MM) as f32);
        let how = match settings {
            settings if settings == usual => " (default)",
            settings if settings.guided_px == 0.0 => ", not guided",
            _ => "",
        };
        rows.push(row(&format!("stack, window {}{how}", settings.window_px), &depth, &truth)?);
    }
    let optics = rig::optics(PSF)?;
    let pair = rig::render(&scene, &lens, PSF, Exposure::EightBit, SEED)?;
    let depth = rig::depth(&pair, &Operators::for_optics(&optics)?, &optics)?;
    rows.push(row("pair", &depth, &pair.truth)?);
    page.table(1, &["", "away from steps", "everywhere", "no value"], &rows);
    Ok(())
}

/// In-focus distance at a place in the stack, by the thin lens.
fn depth_mm(place: f64, first_mm: f64, focal_mm: f64) -> f64 {
    let sensor_mm = first_mm + STEP_MM * place;
    focal_mm * sensor_mm / (sensor_mm - focal_mm)
}

fn row(name: &str, depth: &Array2<f32>, truth: &Array2<f32>) -> Result<Vec<String>> {
    let away = rig::error(depth, truth, true)?;
    let everywhere = rig::error(depth, truth, false)?;
    let border = rig::BORDER_PX;
    let middle = depth.slice(ndarray::s![border..depth.nrows() - border, border..depth.ncols() - border]);
    let empty = middle.iter().filter(|depth| depth.is_nan()).count() as f64 / middle.len() as f64;
    Ok(vec![
        name.into(),
        format!("{:.3}", away.rmse_mm),
        format!("{:.3}", everywhere.rmse_mm),
        format!("{:.2} %", 100.0 * empty),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_distances_by_the_thin_lens() {
        // Li 2014's far focus: 933 mm with the sensor at 52.8313 mm.
        assert!((depth_mm(0.0, 52.831_257, 50.0) - 933.0).abs() < 0.01);
        assert!(depth_mm(10.0, 52.831_257, 50.0) < 890.0);
    }
}
