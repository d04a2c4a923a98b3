//! The rendered rig, its pairs, and the comparisons.

use anyhow::{Context, Result};
use farnear_depth::{
    metrics::{CompareSettings, Comparison, compare},
    operators::Operators,
    optics::{Optics, OpticsFile},
    pipeline::{Settings, depth_from_pair},
    psf::Psf,
};
use farnear_scene::{Camera, EllipticalDistortion, Lens, Noise, Renderer, Scene, truth};
use ndarray::Array2;

pub const FOCAL_LENGTH_MM: f64 = 50.0;
/// Li 2014, section 4.3: far focus 933 mm, near focus 886.81 mm, at most 2.703 px of blur.
const OPTICS: &str = "[lens]\nfocal_length_mm = 50.0\naperture_mm = 12.8\n[sensor]\npixel_um = 7.4\n\
                      [focus]\nfar_mm = 933.0\nmax_blur_px = 2.703\n";
const SIZE: (usize, usize) = (640, 480);
/// Excluded border, where windows and operators see reflections.
pub const BORDER_PX: usize = 16;
const AWAY_FROM_EDGES_PX: usize = 8;

pub const PSFS: [(&str, &str); 3] = [
    ("pill-box", "pillbox"),
    ("Gaussian, k 0.4578", "gaussian:k=0.4578"),
    ("generalised Gaussian, p 1.8, k 0.4802", "generalised:p=1.8,k=0.4802"),
];

#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Exposure {
    /// Noiseless floating point.
    Clean,
    EightBit,
    TwelveBit,
}

impl Exposure {
    pub const ALL: [Self; 3] = [Self::Clean, Self::EightBit, Self::TwelveBit];

    pub fn name(self) -> &'static str {
        match self {
            Self::Clean => "clean",
            Self::EightBit => "8-bit",
            Self::TwelveBit => "12-bit",
        }
    }

    fn noise(self) -> Noise {
        match self {
            Self::Clean => Noise::None,
            Self::EightBit => Noise::EightBit,
            Self::TwelveBit => Noise::TwelveBit,
        }
    }
}

pub struct Pair {
    pub far: Array2<f32>,
    pub near: Array2<f32>,
    pub truth: Array2<f32>,
}

pub fn optics(psf: &str) -> Result<Optics> {
    let file: OpticsFile = toml::from_str(OPTICS).context("the evaluation's optics")?;
    Ok(file.check()?.with_psf(psf.parse::<Psf>()?))
}

/// Perfect or with the elliptical distortion.
pub fn lens(distorted: bool) -> Result<Lens> {
    let lens = Lens::from_optics(&farnear_scene::OpticsFile::parse(OPTICS)?)?;
    Ok(if distorted { lens.with_distortion(EllipticalDistortion::default()) } else { lens })
}

/// `seed` sets texture and noise.
pub fn render(scene: &Scene, lens: &Lens, psf: &str, exposure: Exposure, seed: u64) -> Result<Pair> {
    let camera = Camera::new(SIZE.0, SIZE.1, exposure.noise());
    let renderer = Renderer::new(scene, lens, &psf.parse()?, &camera, seed)?;
    let expose = |sensor_mm: f64, number: u32| -> Result<Array2<f32>> {
        Ok(match exposure {
            Exposure::Clean => renderer.radiance(sensor_mm)?,
            _ => renderer.expose(sensor_mm, number)?.mapv(f32::from),
        })
    };
    Ok(Pair {
        far: expose(lens.sensor_far_mm, 0)?,
        near: expose(lens.sensor_near_mm, 1)?,
        truth: truth(scene, lens, &camera),
    })
}

/// 8 bit, values 0 to 1, with its truth.
pub fn stack(
    scene: &Scene,
    lens: &Lens,
    psf: &str,
    sensors_mm: &[f64],
    seed: u64,
) -> Result<(Vec<Array2<f32>>, Array2<f32>)> {
    let noise = Exposure::EightBit.noise();
    let camera = Camera::new(SIZE.0, SIZE.1, noise);
    let renderer = Renderer::new(scene, lens, &psf.parse()?, &camera, seed)?;
    let white = f32::from(noise.max_code());
    let expose = |(number, sensor_mm): (usize, &f64)| -> Result<Array2<f32>> {
        Ok(renderer.expose(*sensor_mm, number as u32)?.mapv(|code| f32::from(code) / white))
    };
    let images = sensors_mm.iter().enumerate().map(expose).collect::<Result<_>>()?;
    Ok((images, truth(scene, lens, &camera)))
}

/// `count` depths from far to near focus, `margin` of a step inside the range.
pub fn depths(count: usize, margin: f64) -> Result<Vec<f64>> {
    let range = optics("pillbox")?.working_range();
    let steps = (count - 1) as f64 + 2.0 * margin;
    Ok((0..count)
        .map(|i| range.far_mm + (i as f64 + margin) / steps * (range.near_mm - range.far_mm))
        .collect())
}

/// Sand, perpendicular to the axis.
pub fn plane(depth_mm: f64) -> Result<Scene> {
    Ok(format!("plane:{depth_mm}").parse()?)
}

/// Rational operators with the settings of all tables: smoothing 7, median 3.
pub fn depth(pair: &Pair, operators: &Operators, optics: &Optics) -> Result<Array2<f32>> {
    Ok(depth_from_pair(pair.far.view(), pair.near.view(), operators, optics, &Settings::default())?.depth_mm)
}

pub fn error(map: &Array2<f32>, truth: &Array2<f32>, away_from_edges: bool) -> Result<Comparison> {
    let away_from_edges_px = away_from_edges.then_some(AWAY_FROM_EDGES_PX);
    let settings = CompareSettings { border_px: BORDER_PX, away_from_edges_px };
    Ok(compare(map.view(), truth.view(), None, &settings)?)
}

/// RMS over several maps, weighted by pixels.
pub fn pooled_mm<'a>(comparisons: impl IntoIterator<Item = &'a Comparison>) -> f64 {
    let (mut squares, mut pixels) = (0.0, 0.0);
    for comparison in comparisons {
        squares += comparison.rmse_mm.powi(2) * comparison.pixels as f64;
        pixels += comparison.pixels as f64;
    }
    (squares / pixels).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_span_the_range() {
        let all = depths(24, 0.0).unwrap();
        assert!((all[0] - 933.0).abs() < 1e-9 && (all[23] - 886.81).abs() < 5e-3, "{all:?}");
        let inside = depths(9, 0.5).unwrap();
        assert!((inside[0] - (933.0 - 46.19 / 18.0)).abs() < 1e-2, "{inside:?}");
    }
}
