mod exact;
mod exposures;
mod ray_caster;

use farnear_scene::{Lens, OpticsFile, standard::OPTICS};

/// The rig of Li 2014, ch. 4.
fn thesis_lens() -> Lens {
    Lens::from_optics(&OpticsFile::parse(OPTICS).expect("valid optics")).expect("a lens")
}
