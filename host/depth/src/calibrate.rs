//! Calibration on captured images.
//!
//! ## PSF (Li 2014, sections 5.2.1 and 5.2.2)
//! A flat, textured target is at the far focus: the far-focused image is sharp and the near-focused one blurred by the
//! largest radius R; at the near focus it is the reverse. Trial PSFs blur the sharp image until it equals the other: a
//! search of `k`, or of `k` for each `p`. Two improvements over the printed method: radially binned spectra are
//! compared, so that a trial costs a hundred OTF values instead of a convolution; and the squared difference is divided
//! by `H1^2 + H2^2` (total least squares), because trial blur also blurs the sharp image's noise, which favours
//! stronger blur. With blur radii R1 and R2 the cost is `sum |H1 I2 - H2 I1|^2 / (H1^2 + H2^2)`: neither image need be
//! sharp, and a target at any known depth except the middle suffices. Units: R in pixels, frequencies in rad/px. Cost:
//! two FFTs a pair, then 10 ms (Gaussian) to 0.5 s (generalised).

mod free;
mod ready;
mod search;
mod spectra;
mod spread;
pub mod stack;

use std::fmt;
use std::str::FromStr;

use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};

use crate::optics::Optics;
use crate::psf::Psf;

pub use free::OtfPoint;
pub use ready::made_ready;
pub(crate) use spectra::SpectrumError;

/// Nearer to the middle of the range both images are blurred alike and carry no information on the PSF.
const LEAST_ALPHA: f64 = 0.2;

/// Least energy ratio of the sharper image to the other for a target at its focus.
const SHARPER: f64 = 1.1;

/// Residual relative to the noise above which a PSF does not explain the pairs.
const EXCESS: f64 = 1.3;

/// Residual allowed besides, as part of the images' energy: aliases leave it without noise.
const NEGLIGIBLE: f64 = 5e-4;

/// Relative standard error of the width from which it counts as undetermined: 1 % costs 0.3 mm on the thesis' rig.
pub const LOOSE: f64 = 0.01;

/// Which PSF is calibrated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Model {
    /// `k` of the Gaussian.
    Gaussian,
    /// `p` and `k` of the generalised Gaussian.
    Generalised,
    /// Any round PSF, as a profile.
    Free,
}

impl Model {
    /// The name as the command line writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gaussian => "gaussian",
            Self::Generalised => "generalised",
            Self::Free => "free",
        }
    }
}

impl fmt::Display for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Model {
    type Err = CalibrationError;

    fn from_str(text: &str) -> Result<Self, CalibrationError> {
        let known = [Self::Gaussian, Self::Generalised, Self::Free]
            .into_iter()
            .find(|model| model.name() == text.trim());
        known.ok_or_else(|| CalibrationError::UnknownModel(text.to_owned()))
    }
}

/// Why a calibration failed. An `index` is of the given pairs from 0; messages count from 1.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum CalibrationError {
    #[error("`{0}` cannot be calibrated: use gaussian, generalised or free")]
    UnknownModel(String),
    #[error("no pair to calibrate on")]
    NoPair,
    #[error(
        "calibrate stack has already found the point spread function of this lens and a response for it: measure with this file, or give \
         an optics file without [stage] to find another"
    )]
    LearnedLens,
    #[error(
        "pair {}: the far image is {far_width}x{far_height}, the near image {near_width}x{near_height}", .index + 1
    )]
    SizeMismatch { index: usize, far_width: usize, far_height: usize, near_width: usize, near_height: usize },
    #[error("pair {}, {which} image: {reason}", .index + 1)]
    Image { index: usize, which: &'static str, reason: SpectrumError },
    #[error(
        "pair {}: at alpha = {alpha:.2} both images are blurred alike; put the target at the far or the near focus", .index + 1
    )]
    MiddleOfRange { index: usize, alpha: f64 },
    #[error(
        "pair {}: the far image has {ratio:.2} times the detail of the near one, so neither is in focus; \
         put the target at the far or the near focus, or say at which depth it stands", .index + 1
    )]
    NeitherSharp { index: usize, ratio: f64 },
    #[error(
        "the best {parameter} is {value}, the end of the search: the images do not show the blur that the optics promise; \
         check max_blur_px, the order of the images and where the target stands"
    )]
    AtSearchEnd { parameter: &'static str, value: f64 },
    #[error("no round point spread function makes one image of the other: {0}")]
    Profile(String),
}

/// A pair of images of a flat target.
#[derive(Debug, Clone, Copy)]
pub struct CapturedPair<'a> {
    /// Far-focused image, (height, width), any scale.
    pub far: ArrayView2<'a, f32>,
    /// Near-focused image.
    pub near: ArrayView2<'a, f32>,
    /// Normalised depth of the target ([`Optics::alpha`]); `None` assumes the focus of the sharper image.
    pub alpha: Option<f64>,
}

/// A calibrated PSF.
#[derive(Debug, Clone, PartialEq)]
pub struct PsfFit {
    /// The PSF.
    pub psf: Psf,
    /// Residual of the images' energy in the compared frequencies, 0 to 1: noise and model error.
    pub residual: f64,
    /// Residual due to noise alone, as estimated from the pairs.
    pub noise: f64,
    /// Standard error of `p`, where the PSF has one and the pairs determine it.
    pub standard_error_p: Option<f64>,
    /// Standard error of `k`; of a free PSF, that of the root of half its second moment.
    pub standard_error_k: Option<f64>,
    /// The OTF of a free PSF within the pairs' reach; else empty.
    pub otf: Vec<OtfPoint>,
    /// Depth of each pair's target, given or found.
    pub alphas: Vec<f64>,
}

/// Quality of a calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The PSF explains the pairs and is well determined.
    Good,
    /// It explains them, but the width is undetermined by more than [`LOOSE`].
    Loose,
    /// It leaves more than noise.
    Unexplained,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Good => "good",
            Self::Loose => "loose",
            Self::Unexplained => "unexplained",
        })
    }
}

impl PsfFit {
    /// The width as the `k` that [`Self::standard_error_k`] is of: the parameter of a Gaussian or generalised Gaussian, of any
    /// other PSF that of a Gaussian of the same second moment.
    pub fn width(&self) -> f64 {
        match self.psf {
            Psf::Gaussian { k } | Psf::Generalised { k, .. } => k,
            Psf::PillBox | Psf::Ring { .. } | Psf::Radial(_) => (0.5 * self.psf.second_moment()).sqrt(),
        }
    }

    /// Quality of the calibration.
    pub fn verdict(&self) -> Verdict {
        if self.residual > EXCESS * self.noise + NEGLIGIBLE {
            Verdict::Unexplained
        } else if self.standard_error_k.is_none_or(|error| error > LOOSE * self.width()) {
            Verdict::Loose
        } else {
            Verdict::Good
        }
    }
}

/// The PSF of `model` that turns the images of each pair into each other, jointly for all pairs. Returns
/// [`CalibrationError`] for pairs without texture, of different size, or only in the middle of the range, and for optics
/// with a learned response, which holds for their own PSF only.
pub fn fit_psf(
    pairs: &[CapturedPair<'_>],
    optics: &Optics,
    model: Model,
) -> Result<PsfFit, CalibrationError> {
    if pairs.is_empty() {
        return Err(CalibrationError::NoPair);
    }
    if optics.stage().is_some() {
        return Err(CalibrationError::LearnedLens);
    }
    let mut observations = Vec::with_capacity(pairs.len());
    let mut alphas = Vec::with_capacity(pairs.len());
    let mut silent = None;
    for (index, pair) in pairs.iter().enumerate() {
        let ((far_height, far_width), (near_height, near_width)) = (pair.far.dim(), pair.near.dim());
        if (far_height, far_width) != (near_height, near_width) {
            return Err(CalibrationError::SizeMismatch {
                index,
                far_width,
                far_height,
                near_width,
                near_height,
            });
        }
        let image = |which| move |reason| CalibrationError::Image { index, which, reason };
        let far = spectra::windowed(pair.far).map_err(image("far"))?;
        let near = spectra::windowed(pair.near).map_err(image("near"))?;
        let bins = spectra::Bins::new(&far, &near);
        let alpha = match pair.alpha {
            Some(alpha) if alpha.abs() < LEAST_ALPHA => {
                // Pairs in the middle are blurred alike and carry no information: the rest of the series decides.
                silent.get_or_insert(CalibrationError::MiddleOfRange { index, alpha });
                alphas.push(alpha);
                continue;
            }
            Some(alpha) => alpha,
            None => {
                let ratio = bins.energy_ratio();
                if ratio > SHARPER {
                    -1.0
                } else if ratio < 1.0 / SHARPER {
                    1.0
                } else {
                    return Err(CalibrationError::NeitherSharp { index, ratio });
                }
            }
        };
        alphas.push(alpha);
        observations.push((bins, optics.blur_px(alpha)));
    }
    if observations.is_empty()
        && let Some(error) = silent
    {
        return Err(error);
    }
    let (psf, cost, otf, of_width) = match model {
        Model::Gaussian => {
            search::gaussian(&observations).map(|(k, cost)| (Psf::Gaussian { k }, cost, Vec::new(), None))
        }
        Model::Generalised => {
            search::generalised(&observations).map(|(psf, cost)| (psf, cost, Vec::new(), None))
        }
        Model::Free => free::profile(&observations)
            .map(|found| (Psf::Radial(found.psf), found.cost, found.otf, found.of_k)),
    }?;
    let of_parameters = spread::of_parameters(&observations, psf);
    let energy: f64 = observations.iter().map(|(bins, _)| bins.energy()).sum();
    let coefficients: f64 = observations.iter().map(|(bins, _)| bins.coefficients()).sum();
    Ok(PsfFit {
        psf,
        residual: cost / energy,
        // Bands of few coefficients may overestimate it.
        noise: (spread::noise(&observations) * coefficients).min(cost) / energy,
        standard_error_p: of_parameters.as_ref().filter(|errors| errors.len() == 2).map(|errors| errors[0]),
        standard_error_k: of_width.or(of_parameters.and_then(|errors| errors.last().copied())),
        otf,
        alphas,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_count_pairs_from_one() {
        let blurred = CalibrationError::NeitherSharp { index: 0, ratio: 1.0 };
        assert!(blurred.to_string().starts_with("pair 1: "), "{blurred}");
        let middle = CalibrationError::MiddleOfRange { index: 1, alpha: 0.1 };
        assert!(middle.to_string().starts_with("pair 2: at alpha = 0.10"), "{middle}");
        let sizes = CalibrationError::SizeMismatch {
            index: 1,
            far_width: 4,
            far_height: 3,
            near_width: 5,
            near_height: 3,
        };
        assert!(sizes.to_string().starts_with("pair 2: the far image is 4x3"), "{sizes}");
    }

    /// At p = 1 the Gaussian of the same second moment has 1.73 k: half of 6 k^2.
    #[test]
    fn the_width_of_a_generalised_gaussian_is_the_parameter_whose_error_is_stated() {
        let fit = |psf, error| PsfFit {
            psf,
            residual: 0.0,
            noise: 0.0,
            standard_error_p: None,
            standard_error_k: Some(error),
            otf: Vec::new(),
            alphas: Vec::new(),
        };
        let found = |error| fit(Psf::Generalised { p: 1.0, k: 0.4 }, error);
        assert_eq!(found(0.0055).width(), 0.4);
        assert_eq!(found(0.0055).verdict(), Verdict::Loose, "1.4 % of k");
        assert_eq!(found(0.0039).verdict(), Verdict::Good);
        assert_eq!(fit(Psf::PillBox, 0.0).width(), 0.5);
    }
}
