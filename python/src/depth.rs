//! Depth of pairs of images.

use farnear_depth::{
    adaptive_window::Window,
    fill::{FillBy, LowTexture},
    measure::{DepthMethod, Finding, MeasureError, MeasureSettings, binned, measure_pair_of_views},
    mosaic::is_mosaic,
    operators,
    pipeline::{self, Settings},
    prepare::PrepareSettings,
};
use farnear_workflows::{
    depth::{DepthRequest, part::Part, tone},
    optics::{OpticsDoubt, another_size, usable_bin},
};
use std::sync::{Mutex, PoisonError};

use ndarray::{CowArray, Ix2};
use numpy::{IntoPyArray, PyArray2};
use pyo3::{exceptions::PyTypeError, prelude::*};

use crate::{
    arrays::{Image, check_alike, named, optics_named},
    depth_map::DepthMap,
    errors::{FarnearError, parsed, wrong},
    optics::Operators,
    work,
};

/// Fill method for low texture: none, the default of `farnear depth`, or by name.
pub struct Fill(Option<FillBy>);

impl<'py> FromPyObject<'_, 'py> for Fill {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(wanted) = object.extract::<bool>() {
            return Ok(Self(wanted.then(FillBy::default)));
        }
        let name = object.extract::<String>().map_err(|_| {
            PyTypeError::new_err(format!(
                "fill must be True, False, \"surface\" or \"thesis\", not {}",
                object.get_type()
            ))
        })?;
        name.parse().map(|by| Self(Some(by))).map_err(wrong)
    }
}

/// Side of the squares of pixels that are averaged into one, or `None` for "auto".
pub struct Bin(Option<usize>);

impl<'py> FromPyObject<'_, 'py> for Bin {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        match object.extract::<usize>() {
            Ok(side @ 1..=16) => Ok(Self(Some(side))),
            Err(_) if object.extract::<String>().is_ok_and(|name| name == "auto") => Ok(Self(None)),
            _ => {
                Err(FarnearError::new_err(format!("bin is {}; expected 1 to 16 or \"auto\"", object.repr()?)))
            }
        }
    }
}

fn filling(fill: &Fill, low_texture: &str) -> PyResult<Settings> {
    let criterion: LowTexture = low_texture.parse().map_err(wrong)?;
    if fill.0.is_none() && criterion != LowTexture::default() {
        return Err(FarnearError::new_err(format!(
            "low_texture={low_texture:?} says what is filled: give fill=True or fill=\"thesis\" too"
        )));
    }
    let usual = Settings::default();
    Ok(Settings {
        fill: fill.0.is_some(),
        fill_by: fill.0.unwrap_or_default(),
        low_texture: criterion,
        ..usual
    })
}

/// Depth map of a far- and a near-focused image, as `farnear depth --bin 1` computes it.
///
/// Parameters
/// ----------
/// far, near : array (height, width)
///     Grey images of one size and one kind, at least 16x16 px. In `uint8` and `uint16` values from `white_level` on are saturated;
///     other integers and floating point numbers have any common scale. `float32` is not copied. Masked pixels have no depth.
/// optics : Optics
///     The optics of the pair.
/// operators : Operators, optional
///     Operators for method "ro"; by default they are designed for the optics.
/// method : {"whitened", "ro", "subbarao", "subbarao-fourier", "favaro"}, optional
///     Whitened (least noise), rational operators, or a baseline; by default rational operators if `operators` are given, else
///     whitened.
/// window : int or "adaptive", optional
///     Side in px (odd, up to 63) of the window over which evidence is summed; "adaptive" is for "whitened", whose default it
///     is. Else the default is 7.
/// median_px : int
///     Side of the median filter, px, odd; 1 = none.
/// fill : bool or {"surface", "thesis"}
///     Fill regions of low texture by a surface, or in the order of the thesis.
/// low_texture : str
///     Criterion of low texture: "energy", or "variance:T" as in the thesis.
/// align : {"auto", "none", "optics", "shift", "similarity", "affine"}
///     Alignment of the near image with the far one.
/// balance : {"auto", "none", "gain", "local"}
///     Equalisation of brightness.
/// min_confidence : float
///     Least confidence of a depth, 0 to 1.
/// white_level : int, optional
///     Code of a saturated pixel in `uint8` and `uint16`, e.g. 4095 for 12 bits; by default the largest of the type.
/// bin : int or "auto"
///     Side in px, up to 16, of the squares of pixels that are averaged into one; "auto" chooses it as `farnear depth` does.
/// threads : int
///     Threads; 0 = one per core.
///
/// Returns
/// -------
/// DepthMap
///     Depth in mm, confidence, standard deviation and reasons, each (height, width) of the averaged image; its `optics` are those
///     of the averaged pixels.
///
/// Raises
/// ------
/// FarnearError
///     Images of two sizes, kinds or scenes, a constant image, operators for other optics, values out of range.
///
/// Notes
/// -----
/// By default pixels are not averaged, except by optics of `calibrate_stack`. For a largest blur of more than 4.5 px `findings`
/// states how many pixels to average.
///
/// 640x480 take 0.2 s. Other Python threads run meanwhile; Ctrl-C takes effect when the map is done.
///
/// Examples
/// --------
/// >>> optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703, psf="gaussian:k=0.4578")
/// >>> far, near, truth = farnear.render(optics, "slant", width=160, height=120)
/// >>> farnear.depth(far, near, optics).depth_mm.shape
/// (120, 160)
#[pyfunction]
#[pyo3(signature = (far, near, optics, *, operators=None, method=None, window=None, median_px=3, fill=Fill(None), low_texture="energy", align="auto",
                    balance="auto", min_confidence=0.0, white_level=None, bin=Bin(Some(1)), threads=1))]
#[allow(clippy::too_many_arguments)] // keywords in Python
pub fn depth(
    py: Python<'_>,
    far: &Bound<'_, PyAny>,
    near: &Bound<'_, PyAny>,
    optics: &Bound<'_, PyAny>,
    operators: Option<&Operators>,
    method: Option<&str>,
    window: Option<&Bound<'_, PyAny>>,
    median_px: usize,
    fill: Fill,
    low_texture: &str,
    align: &str,
    balance: &str,
    min_confidence: f32,
    white_level: Option<u32>,
    bin: Bin,
    threads: usize,
) -> PyResult<DepthMap> {
    let (far, near): (Image<'_>, Image<'_>) = (named("far", far)?, named("near", near)?);
    let optics = &*optics_named("optics", optics)?;
    if !(0.0..=1.0).contains(&min_confidence) {
        return Err(FarnearError::new_err(format!("min_confidence is {min_confidence}; expected 0 to 1")));
    }
    check_alike(("far", far.full_scale()), ("near", near.full_scale()))?;
    let mut doubts = optics.doubts();
    doubts.extend(another_size(&optics.0, far.view().dim()));
    let side = bin.side(&optics.0, &far, operators.is_some(), &mut doubts)?;
    let bins = side * optics.0.stage().map_or(1, |stage| stage.bin);
    let part = Part::of_bins(far.view().dim(), bins);
    let averaged = (side > 1).then(|| optics.binned(side));
    let optics = averaged.as_ref().unwrap_or(optics);
    let designed;
    let usual = if operators.is_some() { "ro" } else { "whitened" };
    let method = match (method.unwrap_or(usual), operators) {
        ("ro", Some(operators)) => DepthMethod::Rational(&operators.0),
        ("ro", None) => {
            designed = work::run(py, || operators::Operators::for_optics(&optics.0))?.map_err(wrong)?;
            DepthMethod::Rational(&designed)
        }
        ("whitened", None) => DepthMethod::Whitened,
        (other, Some(_)) => {
            return Err(FarnearError::new_err(format!("method {other:?} uses no operators")));
        }
        (other, None) => DepthMethod::Baseline(other.parse().map_err(|_| {
            let known = "whitened, ro, subbarao, subbarao-fourier or favaro";
            FarnearError::new_err(format!("there is no method {other:?}; expected {known}"))
        })?),
    };
    let window: Window = match window {
        Some(window) => parsed("window", &window.to_string())?,
        None => method.usual_window(),
    };
    let smoothing_px = if let Window::Fixed(side) = window { side } else { 7 };
    let settings = MeasureSettings {
        prepare: PrepareSettings {
            align: parsed("align", align)?,
            balance: parsed("balance", balance)?,
            limits: limits(&far, white_level)?,
            ..PrepareSettings::default()
        },
        window,
        run: Settings { smoothing_px, median_px, threads, ..filling(&fill, low_texture)? },
        least_confidence: min_confidence,
    };
    let white = settings.prepare.limits.filter(|_| white_level.is_some()).map(|[_, white]| white);
    let (far, near) = (up_to(&far, white, side), up_to(&near, white, side));
    let (far, near) = (far.view(), near.view());
    let (mut found, curved) = work::run(py, || {
        let found = measure_pair_of_views(far, near, &optics.0, method, None, &settings)?;
        let curved = tone::doubt(&found.prepared.far, &found.prepared.near);
        Ok::<_, MeasureError>((found, curved))
    })?
    .map_err(wrong)?;
    found.findings.extend(curved.map(Finding::Run));
    found.findings.extend(doubts.into_iter().map(|doubt| Finding::Run(doubt.to_string())));
    Ok(DepthMap::of(py, found, optics, part))
}

impl Bin {
    /// The number of pixels, with doubts about it.
    fn side(
        &self,
        optics: &farnear_depth::optics::Optics,
        far: &Image<'_>,
        has_operators: bool,
        doubts: &mut Vec<OpticsDoubt>,
    ) -> PyResult<usize> {
        // Operators are for pixels of one size.
        let bin = if has_operators { self.0.or(Some(1)) } else { self.0 };
        match bin {
            Some(1) => {
                let (blur_px, bin) = (optics.max_blur_px(), usable_bin(optics));
                doubts.extend((bin > 1).then_some(OpticsDoubt::TooMuchBlur { blur_px, bin, binned: false }));
            }
            Some(side) if has_operators || optics.stage().is_some() => {
                return Err(FarnearError::new_err(format!(
                    "bin is {side}; operators and optics of calibrate_stack are for pixels of one size: give no bin"
                )));
            }
            _ => {}
        }
        let request = DepthRequest { bin, ..DepthRequest::default() };
        Ok(request.bin_for(optics, bin != Some(1) && is_mosaic(far.view()), doubts))
    }
}

/// An image without values above a stated white level, which are saturated, with `bin` x `bin` pixels averaged into one.
fn up_to<'a>(image: &'a Image<'_>, white: Option<f32>, bin: usize) -> CowArray<'a, f32, Ix2> {
    let clipped: CowArray<'a, f32, Ix2> = match white {
        Some(white) => image.view().mapv(|value| if value > white { white } else { value }).into(),
        None => image.view().into(),
    };
    if bin > 1 { binned(clipped.into_owned(), bin).into() } else { clipped }
}

/// Black and white of camera codes, scaled as the image is.
fn limits(image: &Image<'_>, white_level: Option<u32>) -> PyResult<Option<[f32; 2]>> {
    match (image.full_scale(), white_level) {
        (Some(full), Some(white)) if white == 0 || white as f32 > full => {
            Err(FarnearError::new_err(format!("white_level is {white}; expected 1 to {full}")))
        }
        (Some(full), Some(white)) => Ok(Some([0.0, white as f32 / full])),
        (Some(_), None) => Ok(Some([0.0, 1.0])),
        (None, Some(_)) => Err(FarnearError::new_err("white_level needs images of uint8 or uint16")),
        (None, None) => Ok(None),
    }
}

/// Depth of pair after pair with fixed settings: no alignment, no validation; some ms for 640x480.
///
/// Parameters
/// ----------
/// optics : Optics
///     The optics of the pairs; those of `calibrate_stack`, or with a `[distortion]`, are for `depth`.
/// operators : Operators, optional
///     By default they are designed for the optics.
/// smoothing_px : int
///     Side of the window over which evidence is summed, px, odd.
/// median_px : int
///     Side of the median filter, px, odd; 1 = none.
/// fill : bool or {"surface", "thesis"}
///     Fill regions of low texture.
/// low_texture : str
///     Criterion of low texture: "energy" or "variance:T".
/// threads : int
///     Threads; 0 = one per core.
///
/// Notes
/// -----
/// Several threads may share a processor; their pairs are computed one after the other.
///
/// Examples
/// --------
/// >>> optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703)
/// >>> far, near, truth = farnear.render(optics, "slant", width=160, height=120)
/// >>> depth_mm, confidence = farnear.Processor(optics).run(far, near)
#[pyclass(frozen, module = "farnear")]
pub struct Processor(Mutex<pipeline::Processor>);

#[pymethods]
impl Processor {
    #[new]
    #[pyo3(signature = (optics, *, operators=None, smoothing_px=7, median_px=3, fill=Fill(None), low_texture="energy", threads=1))]
    #[allow(clippy::too_many_arguments)] // keywords in Python
    fn new(
        py: Python<'_>,
        optics: &Bound<'_, PyAny>,
        operators: Option<&Operators>,
        smoothing_px: usize,
        median_px: usize,
        fill: Fill,
        low_texture: &str,
        threads: usize,
    ) -> PyResult<Self> {
        let optics = &*optics_named("optics", optics)?;
        if optics.0.stage().is_some() {
            return Err(FarnearError::new_err(
                "the optics were learned by calibrate stack for method whitened, which a Processor lacks: use farnear.depth",
            ));
        }
        if optics.0.distortion().is_some() {
            return Err(FarnearError::new_err(
                "the optics have a [distortion], which a Processor does not remove from the images: use farnear.depth",
            ));
        }
        let settings = Settings { smoothing_px, median_px, threads, ..filling(&fill, low_texture)? };
        let make = |operators: &operators::Operators| {
            pipeline::Processor::new(operators, &optics.0, &settings)
                .map(|processor| Self(Mutex::new(processor)))
                .map_err(wrong)
        };
        match operators {
            Some(operators) => make(&operators.0),
            None => make(&work::run(py, || operators::Operators::for_optics(&optics.0))?.map_err(wrong)?),
        }
    }

    /// Depth map and confidence of a pair.
    ///
    /// Parameters
    /// ----------
    /// far, near : array (height, width)
    ///     Images of one size and any common scale, of any numeric type.
    ///
    /// Returns
    /// -------
    /// depth_mm, confidence : array float32 (height, width)
    ///     Depth in mm, and confidence from texture and fit, 0 to 1. Masked pixels and those whose windows contain them have no depth.
    #[allow(clippy::type_complexity)] // two arrays
    fn run<'py>(
        &self,
        py: Python<'py>,
        far: &Bound<'py, PyAny>,
        near: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<f32>>)> {
        let (far, near): (Image<'py>, Image<'py>) = (named("far", far)?, named("near", near)?);
        check_alike(("far", far.full_scale()), ("near", near.full_scale()))?;
        let (far, near) = (far.view(), near.view());
        let (depth_mm, confidence) = work::run(py, || {
            // After a panic in another thread the next run overwrites the buffers.
            let mut processor = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            let map = processor.run(far, near).map_err(wrong)?;
            // The processor reuses its map for the next pair.
            Ok::<_, PyErr>((map.depth_mm.clone(), map.confidence.clone()))
        })??;
        Ok((depth_mm.into_pyarray(py), confidence.into_pyarray(py)))
    }
}
