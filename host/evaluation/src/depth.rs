//! Parts of the accuracy pages, in their order.

mod calibration;
mod coded;
mod corrections;
mod designs;
mod fill;
mod focus;
mod kernels;
mod lens_stacks;
mod methods;
mod mismatch;
mod planes;
pub mod real;
mod shapes;
mod stacks;
mod surfaces;
mod uncertainty;

use anyhow::Result;

use crate::page::Page;

type Part = (&'static str, fn(&mut Page) -> Result<()>);

pub const RENDERED: [Part; 13] = [
    ("planes", planes::measure),
    ("shapes", shapes::measure),
    ("mismatch", mismatch::measure),
    ("methods", methods::measure),
    ("designs", designs::measure),
    ("kernels", kernels::measure),
    ("fill", fill::measure),
    ("uncertainty", uncertainty::measure),
    ("surfaces", surfaces::measure),
    ("calibration", calibration::measure),
    ("coded", coded::measure),
    ("corrections", corrections::measure),
    ("focus", focus::measure),
];

pub const INTRODUCTION: &str = "# Accuracy

Written by `cargo xtask evaluate`; two runs on one kind of processor write the same bytes. All depths and errors are in mm.

Scenes are rendered by [`hil-sim/scene`](../hil-sim/scene/src/lib.rs), which works with point spread functions in space and knows nothing of the
transfer functions from which the operators are designed. The lens has 50 mm focal length and 12.8 mm aperture, pixels are 7.4 um; the pair is focused
at 933 and 886.81 mm, so that blur reaches 2.703 px (the rig of Li, PhD thesis, University of Warwick, 2014). Images have 640 x 480 pixels;
surfaces are painted with sand of contrast 0.2. *Clean* images are the light itself; *8-bit* and *12-bit* ones have the shot noise of a mean of 9,000
electrons, 12 electrons of read noise, a full well of 20,000 electrons and that many bits. Unless a table says otherwise: operators of 7x7 by the
`linear` design for the scene's own point spread function, coefficients smoothed over 7x7, median 3x3, a rim of 16 px not counted. Errors are
root mean squares over all pixels.";
