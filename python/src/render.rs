//! Rendering of scenes.

use farnear_scene::{
    Camera, EllipticalDistortion, Lens, Noise, OpticsFile, Psf, RenderError, Renderer, Scene, truth,
};
use ndarray::Array2;
use numpy::{IntoPyArray, PyArray2};
use pyo3::prelude::*;

use crate::{errors::wrong, optics::Optics, work};

/// Far image, near image, true depth.
type Rendered<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyArray2<f32>>);

/// Render what a camera exposes of a known scene.
///
/// Parameters
/// ----------
/// optics : Optics
///     The lens, its focus pair and the pixels.
/// scene : str
///     "plane:MM", "staircase", "slant", "cone" or "sphere", with options such as "cone,texture=fractal,contrast=0.3".
/// width, height : int
///     Size of the images, px.
/// noise : {"none", "8bit", "12bit"}
///     Noise and quantisation of the camera.
/// seed : int
///     Seed of texture and noise; the same seed gives the same images.
/// elliptical_distortion : bool
///     Whether the lens has field curvature.
///
/// Returns
/// -------
/// far, near : array uint8 or uint16 (height, width)
///     The images; with more than 8 bits `uint16` over its full range.
/// truth : array float32 (height, width)
///     True depth of each pixel, mm.
///
/// Examples
/// --------
/// >>> optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703)
/// >>> far, near, truth = farnear.render(optics, "plane:900", width=64, height=48)
/// >>> far.shape, far.dtype.name, float(truth[0, 0])
/// ((48, 64), 'uint8', 900.0)
#[pyfunction]
#[pyo3(signature = (optics, scene="staircase", *, width=640, height=480, noise="8bit", seed=1, elliptical_distortion=false))]
#[allow(clippy::too_many_arguments)] // keywords in Python
pub fn render<'py>(
    py: Python<'py>,
    optics: &Optics,
    scene: &str,
    width: usize,
    height: usize,
    noise: &str,
    seed: u64,
    elliptical_distortion: bool,
) -> PyResult<Rendered<'py>> {
    let scene: Scene = scene.parse().map_err(wrong)?;
    let noise: Noise = noise.parse().map_err(wrong)?;
    let spread: Psf = optics.0.psf().to_string().parse().map_err(wrong)?;
    let file = OpticsFile::parse(&toml::to_string(&optics.0).map_err(wrong)?).map_err(wrong)?;
    let mut lens = Lens::from_optics(&file).map_err(wrong)?;
    if elliptical_distortion {
        lens = lens.with_distortion(EllipticalDistortion::default());
    }
    let camera = Camera::new(width, height, noise);
    let bits = noise.bits();
    let expose = move || -> Result<_, RenderError> {
        let renderer = Renderer::new(&scene, &lens, &spread, &camera, seed)?;
        let [far, near] =
            [(lens.sensor_far_mm, 0), (lens.sensor_near_mm, 1)].map(|(at_mm, n)| renderer.expose(at_mm, n));
        Ok((far?, near?, truth(&scene, &lens, &camera)))
    };
    let (far, near, truth) = work::watched(py, expose)?.map_err(wrong)?;
    Ok((of_codes(py, far, bits), of_codes(py, near, bits), truth.into_pyarray(py)))
}

/// Scales camera codes of this bit depth to the full range of their type.
fn of_codes(py: Python<'_>, codes: Array2<u16>, bits: u8) -> Bound<'_, PyAny> {
    if bits <= 8 {
        return codes.mapv(|code| code as u8).into_pyarray(py).into_any();
    }
    let full = f64::from((1u32 << bits) - 1);
    codes
        .mapv(|code| (f64::from(code) * f64::from(u16::MAX) / full).round() as u16)
        .into_pyarray(py)
        .into_any()
}
