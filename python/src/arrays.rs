//! Images, maps and masks from Python: native `float32` is not copied, everything else is converted.

use ndarray::{Array2, ArrayView2};
use numpy::{PyArrayDescrMethods, PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::{
    exceptions::PyTypeError,
    prelude::*,
    types::{PyBool, PyBytes, PyList, PyString, PyTuple},
};

use crate::{errors::FarnearError, optics::Optics};

/// Extracts an argument and puts its name into a `TypeError`; exception notes need Python 3.11.
pub fn named<'py, T>(name: &str, object: &Bound<'py, PyAny>) -> PyResult<T>
where
    T: for<'a> FromPyObject<'a, 'py, Error = PyErr>,
{
    object.extract::<T>().map_err(|error| {
        if error.is_instance_of::<PyTypeError>(object.py()) {
            return PyTypeError::new_err(format!("{name}: {}", error.value(object.py())));
        }
        error
    })
}

pub fn optics_named<'py>(name: &str, object: &Bound<'py, PyAny>) -> PyResult<PyRef<'py, Optics>> {
    object.extract::<PyRef<'py, Optics>>().map_err(|_| {
        PyTypeError::new_err(format!("{name}: expected farnear.Optics, not {}", type_name(object)))
    })
}

enum Values<'py> {
    Lent(PyReadonlyArray2<'py, f32>),
    Own(Array2<f32>),
}

impl Values<'_> {
    fn view(&self) -> ArrayView2<'_, f32> {
        match self {
            Self::Lent(array) => array.as_array(),
            Self::Own(array) => array.view(),
        }
    }
}

pub struct Image<'py> {
    values: Values<'py>,
    full_scale: Option<f32>,
}

impl Image<'_> {
    /// `uint8` and `uint16` scaled to 0..1, others unchanged; NaN where a masked array is masked.
    pub fn view(&self) -> ArrayView2<'_, f32> {
        self.values.view()
    }

    /// Largest code of `uint8` and `uint16`, whose values are scaled by it.
    pub fn full_scale(&self) -> Option<f32> {
        self.full_scale
    }
}

/// Fails for images whose scales differ. Each is a name and [`Image::full_scale`].
pub fn check_alike(first: (&str, Option<f32>), second: (&str, Option<f32>)) -> PyResult<()> {
    if first.1 == second.1 {
        return Ok(());
    }
    let kind = |full_scale: Option<f32>| match full_scale {
        Some(full) if full > f32::from(u8::MAX) => "uint16",
        Some(_) => "uint8",
        None => "other numbers",
    };
    Err(FarnearError::new_err(format!(
        "{} holds {} and {} {}: give all alike, or their scales differ",
        first.0,
        kind(first.1),
        second.0,
        kind(second.1)
    )))
}

/// Copies of `images`, which must be alike, and their full scale.
pub fn stack_of<'py>(images: &[Bound<'py, PyAny>]) -> PyResult<(Vec<Array2<f32>>, Option<f32>)> {
    let mut owned = Vec::with_capacity(images.len());
    let mut first = None;
    for (index, image) in images.iter().enumerate() {
        let name = format!("images[{index}]");
        let image = named::<Image<'py>>(&name, image)?;
        let first = *first.get_or_insert(image.full_scale());
        check_alike(("images[0]", first), (name.as_str(), image.full_scale()))?;
        owned.push(image.view().to_owned());
    }
    Ok((owned, first.flatten()))
}

impl<'py> FromPyObject<'_, 'py> for Image<'py> {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let what = "a grey image, a numpy array (height, width) of integers or floating point numbers";
        let array = Untyped::of(object, what)?;
        let full = match (array.kind, array.size) {
            ('u', 1) => Some(f32::from(u8::MAX)),
            ('u', 2) => Some(f32::from(u16::MAX)),
            _ => None,
        };
        let mut values = array.values()?;
        if let Some(full) = full {
            values = Values::Own(values.view().mapv(|code| code / full));
        }
        Ok(Self { values, full_scale: full })
    }
}

/// A map of any numeric type, e.g. depth.
pub struct Map<'py>(Values<'py>);

impl Map<'_> {
    /// NaN where a masked array is masked.
    pub fn view(&self) -> ArrayView2<'_, f32> {
        self.0.view()
    }
}

impl<'py> FromPyObject<'_, 'py> for Map<'py> {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let what = "a map, a numpy array (height, width) of integers or floating point numbers";
        Untyped::of(object, what)?.values().map(Self)
    }
}

/// A mask: bool, or integers that are not 0. Masked elements are not set.
pub struct Mask(pub Array2<bool>);

impl<'py> FromPyObject<'_, 'py> for Mask {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let what = "a mask, a numpy array (height, width) of bool or uint8 (0 = not set)";
        let array = Untyped::numeric(object, what, &['b', 'u', 'i'])?;
        let set = array.data.call_method1("astype", ("bool",))?.extract::<PyReadonlyArray2<'py, bool>>()?;
        let mut set = set.as_array().to_owned();
        if let Some(masked) = &array.masked {
            set.zip_mut_with(&masked.as_array(), |set, masked| *set &= !masked);
        }
        Ok(Self(set))
    }
}

/// Samples (n, features) of `float32`.
pub struct Samples<'py>(PyReadonlyArray2<'py, f32>);

impl Samples<'_> {
    pub fn view(&self) -> ArrayView2<'_, f32> {
        self.0.as_array()
    }
}

impl<'py> FromPyObject<'_, 'py> for Samples<'py> {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        in_place(object.extract()?).map(Self)
    }
}

/// The array, or a copy if its elements are unaligned or not a whole number of elements apart, as in packed structures.
fn in_place(array: PyReadonlyArray2<'_, f32>) -> PyResult<PyReadonlyArray2<'_, f32>> {
    let aligned: bool = array.getattr("flags")?.getattr("aligned")?.extract()?;
    let whole = |stride: &isize| stride.unsigned_abs().is_multiple_of(size_of::<f32>());
    if aligned && array.strides().iter().all(whole) {
        return Ok(array);
    }
    array.call_method1("astype", ("=f4",))?.extract()
}

struct Untyped<'py> {
    data: Bound<'py, PyAny>,
    masked: Option<PyReadonlyArray2<'py, bool>>,
    kind: char,
    size: usize,
}

impl<'py> Untyped<'py> {
    fn of(object: Borrowed<'_, 'py, PyAny>, what: &str) -> PyResult<Self> {
        Self::numeric(object, what, &['u', 'i', 'f'])
    }

    fn numeric(object: Borrowed<'_, 'py, PyAny>, what: &str, kinds: &[char]) -> PyResult<Self> {
        let py = object.py();
        let numpy = py.import("numpy")?;
        let mut given = object.to_owned();
        if given.cast::<PyUntypedArray>().is_err() && is_array_like(&given) {
            given = numpy.call_method1("asarray", (given,))?; // xarray, torch on the CPU, ...
        }
        let array = given.cast::<PyUntypedArray>().map_err(|_| {
            PyTypeError::new_err(format!("expected {what}, not {}", type_name(&object.to_owned())))
        })?;
        let (dtype, dimensions) = (array.dtype(), array.ndim());
        let (kind, size) = (dtype.kind() as char, dtype.itemsize());
        if dimensions != 2 || !kinds.contains(&kind) {
            return Err(PyTypeError::new_err(format!(
                "expected {what}, not an array of {dtype} with {dimensions} dimensions"
            )));
        }
        let ma = numpy.getattr("ma")?;
        let mut masked = None;
        if given.is_instance(&ma.getattr("MaskedArray")?)? {
            masked = Some(ma.call_method1("getmaskarray", (&given,))?.extract()?);
            given = ma.call_method1("getdata", (&given,))?;
        }
        Ok(Self { data: given, masked, kind, size })
    }

    fn values(&self) -> PyResult<Values<'py>> {
        let lent = match self.data.extract::<PyReadonlyArray2<'py, f32>>() {
            Ok(native) => in_place(native)?,
            Err(_) => self.data.call_method1("astype", ("=f4",))?.extract()?,
        };
        let Some(masked) = &self.masked else { return Ok(Values::Lent(lent)) };
        let mut own = lent.as_array().to_owned();
        own.zip_mut_with(&masked.as_array(), |value, masked| {
            if *masked {
                *value = f32::NAN;
            }
        });
        Ok(Values::Own(own))
    }
}

/// Whether numpy can convert it with a definite type: not a list, whose type would be a guess.
fn is_array_like(object: &Bound<'_, PyAny>) -> bool {
    let plain = object.is_instance_of::<PyList>()
        || object.is_instance_of::<PyTuple>()
        || object.is_instance_of::<PyString>()
        || object.is_instance_of::<PyBytes>()
        || object.is_instance_of::<PyBool>();
    !plain && object.hasattr("__array__").unwrap_or(false)
}

fn type_name(object: &Bound<'_, PyAny>) -> String {
    object.get_type().to_string()
}
