//! farnear for Python: thin functions and classes over the libraries. What they do is said in `farnear/_farnear.pyi` and
//! `docs/python.md`; arrays go in without a copy where they are `float32` and come out without one.

mod arrays;
mod calibrate;
mod corrections;
mod depth;
mod embedding;
mod errors;
#[cfg(feature = "measure")]
mod measure;
mod optics;
mod people;
mod points;
mod recogniser;
mod render;
mod rig;
mod synthetic;

/// The module behind the package `farnear`.
#[pyo3::pymodule]
mod _farnear {
    #[pymodule_export]
    use super::calibrate::calibrate_psf;
    #[pymodule_export]
    use super::corrections::Correction;
    #[pymodule_export]
    use super::depth::{DepthMap, Processor, depth};
    #[pymodule_export]
    use super::embedding::{Rbf, isomap};
    #[pymodule_export]
    use super::errors::{FarnearError, RigError};
    #[cfg(feature = "measure")]
    #[pymodule_export]
    use super::measure::{seconds_of_depth, seconds_of_processor};
    #[pymodule_export]
    use super::optics::{Operators, Optics};
    #[pymodule_export]
    use super::people::{centroid_distance, remove_shadow, sun_position};
    #[pymodule_export]
    use super::points::points_mm;
    #[pymodule_export]
    use super::recogniser::Recogniser;
    #[pymodule_export]
    use super::render::render;
    #[pymodule_export]
    use super::rig::RigClient;
    #[pymodule_export]
    use super::synthetic::synthetic_masks;
}
