//! Images and maps from Python: `float32` is looked at where it lies, integers are scaled to 0 to 1.

use ndarray::{Array2, ArrayView2};
use numpy::{PyArrayMethods, PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::{exceptions::PyTypeError, prelude::*};

/// A grey image.
pub enum Image<'py> {
    /// `float32`, without a copy: any scale.
    Float(PyReadonlyArray2<'py, f32>),
    /// Integers over their largest value, 0 to 1: full scale is where the camera clips.
    Scaled(Array2<f32>),
}

impl<'py> FromPyObject<'_, 'py> for Image<'py> {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(float) = object.extract::<PyReadonlyArray2<'py, f32>>() {
            return Ok(Self::Float(float));
        }
        if let Ok(bytes) = object.extract::<PyReadonlyArray2<'py, u8>>() {
            return Ok(Self::Scaled(bytes.as_array().mapv(|code| f32::from(code) / f32::from(u8::MAX))));
        }
        if let Ok(words) = object.extract::<PyReadonlyArray2<'py, u16>>() {
            return Ok(Self::Scaled(words.as_array().mapv(|code| f32::from(code) / f32::from(u16::MAX))));
        }
        if let Ok(double) = object.extract::<PyReadonlyArray2<'py, f64>>() {
            let float = double.as_array().mapv(|value| value as f32);
            return Ok(Self::Float(numpy::PyArray2::from_owned_array(object.py(), float).readonly()));
        }
        let found = match object.cast::<PyUntypedArray>() {
            Ok(array) => format!("an array of {} with {} dimensions", array.dtype(), array.ndim()),
            Err(_) => object.get_type().to_string(),
        };
        Err(PyTypeError::new_err(format!(
            "expected a grey image, a numpy array (height, width) of uint8, uint16, float32 or float64, not {found}"
        )))
    }
}

impl Image<'_> {
    /// Its values.
    pub fn view(&self) -> ArrayView2<'_, f32> {
        match self {
            Self::Float(array) => array.as_array(),
            Self::Scaled(array) => array.view(),
        }
    }

    /// Whether its values are a camera's codes.
    pub fn is_scaled(&self) -> bool {
        matches!(self, Self::Scaled(_))
    }
}

/// A mask: bool, or numbers that are set where they are not 0.
pub struct Mask(pub Array2<bool>);

impl<'py> FromPyObject<'_, 'py> for Mask {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(mask) = object.extract::<PyReadonlyArray2<'py, bool>>() {
            return Ok(Self(mask.as_array().to_owned()));
        }
        let levels = object.extract::<PyReadonlyArray2<'py, u8>>();
        let levels = levels.map_err(|_| {
            PyTypeError::new_err(
                "expected a mask, a numpy array (height, width) of bool or uint8 (0 = not set)",
            )
        })?;
        Ok(Self(levels.as_array().mapv(|level| level != 0)))
    }
}
