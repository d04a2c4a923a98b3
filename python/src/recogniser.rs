//! Activity recognition.

use std::path::{Path, PathBuf};

use farnear_recognition::clip::Track;
use farnear_silhouettes::mask::centre::SIDE_PX;
use farnear_workflows::activity::recognition::Model;
use pyo3::{
    prelude::*,
    types::{PyDict, PyTuple},
};

use crate::{
    arrays::Mask,
    errors::{FarnearError, wrong},
    work,
};

/// Recogniser of activities of people, from the masks of a clip.
///
/// Parameters
/// ----------
/// model : path
///     A recogniser of the package ("everyday", "everyday-order-free"), or a file.
///
/// Examples
/// --------
/// >>> answer = farnear.Recogniser("everyday").recognise(farnear.synthetic_masks("walk"))
/// >>> sorted(answer["probabilities"])[0] in farnear.Recogniser("everyday").activities
/// True
#[pyclass(frozen, module = "farnear")]
pub struct Recogniser {
    model: Model,
    path: PathBuf,
}

#[pymethods]
impl Recogniser {
    #[new]
    #[pyo3(signature = (model=PathBuf::from("everyday")))]
    fn new(py: Python<'_>, model: PathBuf) -> PyResult<Self> {
        let read = py.detach(|| Model::read(&model)).map_err(wrong)?;
        // An unpickled copy may be made in another folder.
        let file = Model::file(&model).map(std::path::absolute).transpose()?;
        Ok(Self { model: read, path: file.unwrap_or(model) })
    }

    /// Activities that it can answer.
    #[getter]
    fn activities(&self) -> Vec<String> {
        self.model.activities().to_vec()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (&Path,))> {
        Ok((py.get_type::<Self>().into_any(), (&self.path,)))
    }

    /// Activity in the masks of a clip.
    ///
    /// Parameters
    /// ----------
    /// *views : sequence of array bool (height, width), or array (frames, height, width)
    ///     Masks of the clip, from one view or several; masks of 100x100 px are taken as cropped.
    /// among : sequence of str, optional
    ///     Restrict the answer to these activities.
    ///
    /// Returns
    /// -------
    /// dict
    ///     `activity` (None = unknown), `confidence` (its probability, 0 to 1), `outlier_score` (above 1 = unknown),
    ///     and `probabilities` by name.
    #[pyo3(signature = (*views, among=None))]
    fn recognise<'py>(
        &self,
        py: Python<'py>,
        views: &Bound<'py, PyTuple>,
        among: Option<Vec<String>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let read = |view: Bound<'py, PyAny>| -> PyResult<Vec<_>> {
            view.try_iter()?.map(|mask| Ok(mask?.extract::<Mask>()?.0)).collect()
        };
        let views = views.iter().map(read).collect::<PyResult<Vec<_>>>()?;
        if let Some(unknown) = among.iter().flatten().find(|name| !self.model.activities().contains(name)) {
            let known = self.model.activities().join(", ");
            return Err(FarnearError::new_err(format!(
                "there is no activity {unknown:?}; the model knows {known}"
            )));
        }
        if among.as_ref().is_some_and(Vec::is_empty) {
            return Err(FarnearError::new_err("among names no activity"));
        }
        let full =
            views.first().and_then(|view| view.first()).is_none_or(|mask| mask.dim() != (SIDE_PX, SIDE_PX));
        let recogniser = self.model.recogniser(full);
        let answer = work::run(py, || {
            let scaling = recogniser.settings.scaling;
            let tracks: Vec<Track> =
                views.iter().map(|masks| Track::from_masks(masks, scaling, full)).collect();
            recogniser.recognise(&tracks)
        })?;
        let mut answer = answer.map_err(wrong)?;
        if let Some(among) = among {
            answer = answer.among(&among);
        }
        let dict = PyDict::new(py);
        dict.set_item("activity", answer.activity)?;
        dict.set_item("confidence", answer.confidence)?;
        dict.set_item("outlier_score", answer.outlier_score)?;
        let probabilities = PyDict::new(py);
        for (name, share) in answer.probabilities {
            probabilities.set_item(name, share)?;
        }
        dict.set_item("probabilities", probabilities)?;
        Ok(dict)
    }
}
