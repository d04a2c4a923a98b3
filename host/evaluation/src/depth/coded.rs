//! Coded aperture: operators from an image of it.

use anyhow::Result;
use farnear_depth::{
    operators::Operators,
    psf::{Psf, RadialPsf},
};
use ndarray::Array2;

use crate::{
    page::Page,
    rig,
    sweep::{self, cell},
};

const SEED: u64 = 1_700;
const PLANES: usize = 8;
const IMAGE_PX: usize = 128;

/// Round aperture covered up to `inner` of its radius; 255 is open.
fn aperture(inner: f64) -> Array2<f32> {
    let middle = 0.5 * (IMAGE_PX as f64 - 1.0);
    Array2::from_shape_fn((IMAGE_PX, IMAGE_PX), |(y, x)| {
        let rho = (y as f64 - middle).hypot(x as f64 - middle) / (0.5 * IMAGE_PX as f64);
        if (inner..1.0).contains(&rho) { 255.0 } else { 0.0 }
    })
}

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("A coded aperture, and any other point spread function");
    page.paragraph(&format!(
        "Operators for a point spread function that no formula gave: an image of the aperture ({IMAGE_PX} x {IMAGE_PX} px, as `farnear depth --psf aperture.png` takes \
         it) becomes a profile of 48 rings, and the operators are designed for its transform. Here the middle of the aperture is covered, the simplest code; \
         the lens is rendered with the ring itself. RMSE over {PLANES} planes, clean / 8-bit; the camera gets as much light in each line (a real covered \
         aperture loses its square). *Pill-box*: the result when the code is ignored."
    ));
    let mut rows = Vec::new();
    for inner in [0.0, 0.3, 0.6, 0.8] {
        let lens = if inner > 0.0 { format!("ring:inner={inner}") } else { "pillbox".into() };
        let drawn = RadialPsf::from_image(aperture(inner).view(), None)?;
        let of = |psf: Psf| -> Result<_> {
            let optics = rig::optics("pillbox")?.with_psf(psf);
            Ok((Operators::for_optics(&optics)?, optics))
        };
        let by = [of(Psf::Radial(drawn.psf))?, of(lens.parse()?)?, of(Psf::PillBox)?];
        let found = sweep::planes(&lens, PLANES, SEED, &by)?;
        let share = format!("{:.1} %", 100.0 * drawn.not_round);
        let name = if inner > 0.0 { format!("ring from {inner} R") } else { "open".into() };
        rows.push([vec![name, share], found.into_iter().map(cell).collect()].concat());
    }
    page.table(
        1,
        &[
            "aperture",
            "not round in the image",
            "operators from the image",
            "from the formula",
            "for a pill-box",
        ],
        &rows,
    );
    page.paragraph(
        "Only the pixel steps of the edges break the rotational symmetry of these images. Codes without rotational symmetry are averaged over the circle, with a warning: the kernels have \
         eight-fold symmetry, and a lens turns its point spread function by half a turn at the focus.",
    );
    Ok(())
}
