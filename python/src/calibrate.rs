//! The point spread function of a lens, from pairs of flat targets.

use farnear_depth::{
    calibrate::{CapturedPair, Model, fit_psf, made_ready},
    mosaic::{self, is_mosaic},
    prepare::Align,
};
use farnear_workflows::calibrate::psf::doubt;
use pyo3::prelude::*;

use crate::{
    arrays::{Image, check_alike, named, optics_named},
    errors::{FarnearError, parsed, wrong},
    optics::{Optics, psf_text},
    work,
};

/// A calibrated point spread function, as `calibrate_psf` returns it. Can be pickled and copied.
///
/// Attributes
/// ----------
/// optics : Optics
///     The given optics with the point spread function that was found.
/// psf : str
///     The point spread function as `Optics(psf=...)` accepts it.
/// verdict : str
///     "good"; "loose" if `k` is open by more than 1 %; "unexplained" if more is left than noise.
/// findings : list of str
///     What to know before trusting the fit.
/// k : float
///     Width over blur radius; of a free profile that of a Gaussian with the same second moment.
/// standard_error_k, standard_error_p : float or None
///     Standard errors of `k` and of the exponent `p`, where the pairs determine them.
/// residual : float
///     Energy of the images that the model leaves over, 0 to 1.
/// noise_residual : float
///     What noise alone leaves over, 0 to 1.
/// alphas : list of float
///     Normalised depth of the target in each pair: -1 at the far focus, +1 at the near focus.
/// otf : list of (float, float, float)
///     Of a free profile: frequency times blur radius (rad), value, standard error.
#[pyclass(frozen, get_all, module = "farnear")]
pub struct PsfFit {
    optics: Optics,
    psf: String,
    verdict: String,
    findings: Vec<String>,
    k: f64,
    standard_error_k: Option<f64>,
    standard_error_p: Option<f64>,
    residual: f64,
    noise_residual: f64,
    alphas: Vec<f64>,
    otf: Vec<(f64, f64, f64)>,
}

/// Arguments of `PsfFit._assemble`.
type Parts =
    (Optics, String, String, Vec<String>, f64, [Option<f64>; 2], [f64; 2], Vec<f64>, Vec<(f64, f64, f64)>);

#[pymethods]
impl PsfFit {
    /// For pickle and copy.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Parts)> {
        let parts = (
            self.optics.clone(),
            self.psf.clone(),
            self.verdict.clone(),
            self.findings.clone(),
            self.k,
            [self.standard_error_k, self.standard_error_p],
            [self.residual, self.noise_residual],
            self.alphas.clone(),
            self.otf.clone(),
        );
        Ok((py.get_type::<Self>().getattr("_assemble")?, parts))
    }

    /// A fit from its parts, for pickle.
    #[staticmethod]
    #[allow(clippy::too_many_arguments)] // the attributes
    fn _assemble(
        optics: Optics,
        psf: String,
        verdict: String,
        findings: Vec<String>,
        k: f64,
        standard_errors: [Option<f64>; 2],
        residuals: [f64; 2],
        alphas: Vec<f64>,
        otf: Vec<(f64, f64, f64)>,
    ) -> Self {
        let [standard_error_k, standard_error_p] = standard_errors;
        let [residual, noise_residual] = residuals;
        Self {
            optics,
            psf,
            verdict,
            findings,
            k,
            standard_error_k,
            standard_error_p,
            residual,
            noise_residual,
            alphas,
            otf,
        }
    }

    fn __repr__(&self) -> String {
        let error = self.standard_error_k.map_or(String::new(), |error| format!(" +- {error:.5}"));
        format!(
            "PsfFit({}, k = {:.5}{error}, {})",
            self.psf.lines().next().unwrap_or_default(),
            self.k,
            self.verdict
        )
    }
}

/// Fit the point spread function of a lens to pairs of flat, textured targets, all pairs together.
///
/// Parameters
/// ----------
/// pairs : sequence of (far, near, distance_mm)
///     Far- and near-focused image of one kind, each (height, width), and the distance of the target in mm, or None if the
///     target is at the focus of the sharper image.
/// optics : Optics
///     The optics; their own point spread function is ignored.
/// model : {"gaussian", "generalised", "free"}
///     `k` of a Gaussian, `p` and `k` of a generalised Gaussian, or any round profile.
/// align : {"auto", "none", "optics", "shift", "similarity", "affine"}
///     How each near image is aligned with its far image first.
///
/// Returns
/// -------
/// PsfFit
///     With `optics`, `psf`, `verdict` and standard errors.
///
/// Examples
/// --------
/// >>> optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703, psf="gaussian:k=0.4578")
/// >>> pairs = [(*farnear.render(optics, f"plane:{mm}")[:2], mm) for mm in (933.0, 887.0)]
/// >>> farnear.calibrate_psf(pairs, optics).verdict
/// 'good'
#[pyfunction]
#[pyo3(signature = (pairs, optics, *, model="gaussian", align="auto"))]
pub fn calibrate_psf<'py>(
    py: Python<'py>,
    pairs: Vec<(Bound<'py, PyAny>, Bound<'py, PyAny>, Option<f64>)>,
    optics: &Bound<'py, PyAny>,
    model: &str,
    align: &str,
) -> PyResult<PsfFit> {
    let model: Model = model.parse().map_err(wrong)?;
    let align: Align = parsed("align", align)?;
    let optics = &*optics_named("optics", optics)?;
    let mut owned = Vec::with_capacity(pairs.len());
    for (index, (far, near, true_mm)) in pairs.iter().enumerate() {
        let names = [0, 1].map(|image| format!("pairs[{index}][{image}]"));
        let far: Image<'py> = named(&names[0], far)?;
        let near: Image<'py> = named(&names[1], near)?;
        check_alike((names[0].as_str(), far.full_scale()), (names[1].as_str(), near.full_scale()))?;
        let focal_length_mm = optics.0.focal_length_mm();
        if let Some(mm) = true_mm.filter(|mm| !(mm.is_finite() && *mm > focal_length_mm)) {
            return Err(FarnearError::new_err(format!(
                "pairs[{index}][2] is {mm} mm; expected a distance above the focal length of {focal_length_mm} mm, or None"
            )));
        }
        owned.push(([far.view().to_owned(), near.view().to_owned()], true_mm.map(|mm| optics.0.alpha(mm))));
    }
    let lens = optics.0;
    let is_raw = owned.iter().any(|([far, _], _)| is_mosaic(far.view()));
    let fit = work::watched(py, move || {
        let mut ready = Vec::with_capacity(owned.len());
        for (images, alpha) in owned {
            ready.push((made_ready(images, &lens, align).map_err(wrong)?.0, alpha));
        }
        let captured: Vec<CapturedPair<'_>> = ready
            .iter()
            .map(|([far, near], alpha)| CapturedPair { far: far.view(), near: near.view(), alpha: *alpha })
            .collect();
        fit_psf(&captured, &lens, model).map_err(wrong)
    })??;
    let findings = is_raw.then(|| mosaic::WORDS.to_owned()).into_iter().chain(doubt(&fit, model)).collect();
    Ok(PsfFit {
        optics: lens.with_psf(fit.psf).into(),
        psf: psf_text(fit.psf)?,
        verdict: fit.verdict().to_string(),
        findings,
        k: fit.width(),
        standard_error_k: fit.standard_error_k,
        standard_error_p: fit.standard_error_p,
        residual: fit.residual,
        noise_residual: fit.noise,
        otf: fit.otf.iter().map(|point| (point.z, point.value, point.standard_error)).collect(),
        alphas: fit.alphas,
    })
}
