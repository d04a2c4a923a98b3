//! Renders a simulated pair and its true depth into a folder.

use std::fs;

use anyhow::{Context as _, Result};
use farnear_depth::psf::Psf as OpticsPsf;
use farnear_files::{image_file::encode_png, npy};
use farnear_scene::{Camera, EllipticalDistortion, Lens, OpticsFile, Psf, RenderError, Renderer, truth};
use farnear_workflows::{Context, optics, result_folder};
use serde::Serialize;

use crate::commands::render::Arguments;

#[derive(Serialize)]
pub struct RenderFigures {
    width: usize,
    height: usize,
    nearest_mm: f64,
    farthest_mm: f64,
}

/// Renders a far- and a near-focused image. The folder gets all files or none.
pub fn render(arguments: Arguments, context: &Context<'_>) -> Result<RenderFigures> {
    let Arguments {
        scene, elliptical_distortion, psf, optics: file, noise, seed, width, height, out, ..
    } = arguments;
    let camera = Camera::new(width, height, noise);
    let optics = optics::read(&file)?;
    if let Some(name) = &psf {
        optics::check_new_psf(&optics, name)?;
    }
    let psf = psf.map_or(Ok(optics.psf()), |name| name.parse::<OpticsPsf>())?;
    let spread: Psf =
        psf.to_string().parse().context("the renderer does not know this point spread function")?;
    let mut lens = Lens::from_optics(&OpticsFile::parse(&fs::read_to_string(&file)?)?)?;
    if elliptical_distortion {
        lens = lens.with_distortion(EllipticalDistortion::default());
    }
    let scene = scene.read()?;
    let staged = result_folder::rendered(&out)?;
    let bits = camera.noise.bits();
    let expose = move || -> Result<_, RenderError> {
        let renderer = Renderer::new(&scene, &lens, &spread, &camera, seed)?;
        let [far, near] =
            [(lens.sensor_far_mm, 0), (lens.sensor_near_mm, 1)].map(|(at_mm, n)| renderer.expose(at_mm, n));
        Ok((far?, near?, truth(&scene, &lens, &camera)))
    };
    let (far, near, depth) = context.cancel.watch("rendering", expose)??;
    for (name, pixels) in [("far.png", far), ("near.png", near)] {
        staged.write(name, &encode_png(pixels.view(), bits)?)?;
    }
    staged.write("truth.npy", &npy::write(depth.view()))?;
    staged.write("optics.toml", toml::to_string(&optics.with_psf(psf))?.as_bytes())?;
    staged.finish()?;
    context.info(&format!("wrote {}", out.display()));
    let (height, width) = depth.dim();
    Ok(RenderFigures {
        width,
        height,
        nearest_mm: f64::from(depth.iter().copied().fold(f32::INFINITY, f32::min)),
        farthest_mm: f64::from(depth.iter().copied().fold(f32::NEG_INFINITY, f32::max)),
    })
}
