//! farnear for Python: thin functions and classes over the libraries. Doc comments of Python items are docstrings,
//! which `python/docstrings.py` copies into `_farnear.pyi`. `float32` arrays are not copied.

mod arrays;
mod calibrate;
mod calibrate_stack;
mod corrections;
mod depth;
mod depth_map;
mod embedding;
mod errors;
mod focus_stack;
#[cfg(feature = "measure")]
mod measure;
mod optics;
mod people;
mod points;
mod recogniser;
mod render;
mod rig;
mod synthetic;
mod work;

/// The module behind the package `farnear`.
#[pyo3::pymodule]
mod _farnear {
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::calibrate::{PsfFit, calibrate_psf};
    #[pymodule_export]
    use super::calibrate_stack::{StackFit, calibrate_stack};
    #[pymodule_export]
    use super::corrections::Correction;
    #[pymodule_export]
    use super::depth::{Processor, depth};
    #[pymodule_export]
    use super::depth_map::{DepthMap, Plane};
    #[pymodule_export]
    use super::embedding::{Rbf, isomap};
    #[pymodule_export]
    use super::errors::{DisconnectedError, FarnearError, RigError};
    #[pymodule_export]
    use super::focus_stack::{FocusStack, focus_stack};
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
    #[pymodule_init]
    fn init(_module: &Bound<'_, PyModule>) -> PyResult<()> {
        super::work::remember_process();
        Ok(())
    }

    #[pymodule_export]
    #[allow(non_upper_case_globals)] // a name of Python
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
