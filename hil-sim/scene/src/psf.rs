//! Point spread functions, normalised to 1, for a blur radius `R` in any unit.
//! * Pill-box: constant over the disc of radius `R`, the image of a round aperture.
//! * Gaussian: standard deviation `sigma = k R` in each direction.
//! * Generalised Gaussian: `f(r) = p^(1 - 2/p) / (2 pi sigma^2 Gamma(2/p)) exp(-(r / sigma)^p / p)`,
//!   `sigma = k R` (Claxton & Staunton 2008, normalised in the plane; Li 2014, eq. 5.16 normalises on the
//!   line). `p = 2` is the Gaussian; for other `p` sigma is a scale, not the standard deviation.
//! * Ring: constant between the radii `inner R` and `R`, the image of a round aperture with a covered centre.

use std::f64::consts::PI;
use std::fmt;
use std::str::FromStr;

use thiserror::Error;

/// Smaller p: tails of hundreds of pixels; larger: a pill-box to three digits.
const P_RANGE: std::ops::RangeInclusive<f64> = 0.5..=64.0;
const K_RANGE: std::ops::RangeInclusive<f64> = 0.01..=10.0;
const INNER_RANGE: std::ops::RangeInclusive<f64> = 0.0..=0.99;

/// Shape of the blur; its size is the blur radius. Text form: [`Psf::from_str`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Psf {
    /// Constant over the disc of the blur.
    PillBox,
    /// Gaussian with sigma = `k` times the blur radius.
    Gaussian {
        /// Ratio of sigma to blur radius.
        k: f64,
    },
    /// Generalised Gaussian with shape `p` and scale `k` times the blur radius.
    Generalised {
        /// Exponent; 2 is the Gaussian, infinity the pill-box.
        p: f64,
        /// Ratio of scale to blur radius.
        k: f64,
    },
    /// Constant outside of `inner` times the blur radius.
    Ring {
        /// Ratio of inner to outer radius.
        inner: f64,
    },
}

/// Why a PSF was rejected.
#[derive(Debug, Clone, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum PsfError {
    #[error(
        "unknown PSF {0:?}, expected pillbox, gaussian:k=0.4578, generalised:p=1.8,k=0.4802 or ring:inner=0.5"
    )]
    Unknown(String),
    #[error("PSF {model} needs {name}=NUMBER, for instance {example}")]
    Missing { model: &'static str, name: &'static str, example: &'static str },
    #[error("PSF {model} takes no {name:?} here")]
    Unexpected { model: String, name: String },
    #[error("PSF parameter {name} = {value}, expected a number from {low} to {high}")]
    Range { name: &'static str, value: String, low: f64, high: f64 },
}

impl Psf {
    /// A PSF from `[psf]` in `optics.toml`; fails for an unknown model or wrong parameters.
    pub fn from_parts(
        model: &str,
        p: Option<f64>,
        k: Option<f64>,
        inner: Option<f64>,
    ) -> Result<Self, PsfError> {
        let surplus = |name: &str| PsfError::Unexpected { model: model.into(), name: name.into() };
        if model == "ring" {
            return match (p, k, inner) {
                (None, None, Some(inner)) => {
                    Ok(Self::Ring { inner: in_range("inner", inner, &INNER_RANGE)? })
                }
                (Some(_), ..) => Err(surplus("p")),
                (None, Some(_), _) => Err(surplus("k")),
                (None, None, None) => {
                    Err(PsfError::Missing { model: "ring", name: "inner", example: "ring:inner=0.5" })
                }
            };
        }
        if inner.is_some() && ["pillbox", "gaussian", "generalised"].contains(&model) {
            return Err(surplus("inner"));
        }
        match (model, p, k) {
            ("pillbox", None, None) => Ok(Self::PillBox),
            ("pillbox", Some(_), _) => Err(surplus("p")),
            ("pillbox", _, Some(_)) => Err(surplus("k")),
            ("gaussian", None, Some(k)) => Ok(Self::Gaussian { k: in_range("k", k, &K_RANGE)? }),
            ("gaussian", Some(_), _) => Err(surplus("p")),
            ("gaussian", None, None) => {
                Err(PsfError::Missing { model: "gaussian", name: "k", example: "gaussian:k=0.4578" })
            }
            ("generalised", Some(p), Some(k)) => {
                Ok(Self::Generalised { p: in_range("p", p, &P_RANGE)?, k: in_range("k", k, &K_RANGE)? })
            }
            ("generalised", p, _) => Err(PsfError::Missing {
                model: "generalised",
                name: if p.is_none() { "p" } else { "k" },
                example: "generalised:p=1.8,k=0.4802",
            }),
            _ => Err(PsfError::Unknown(model.into())),
        }
    }

    /// Density at the distance `r` for the blur radius `radius` (> 0), per unit area.
    #[must_use]
    pub fn density(&self, r: f64, radius: f64) -> f64 {
        match *self {
            Self::PillBox => {
                if r <= radius {
                    1.0 / (PI * radius * radius)
                } else {
                    0.0
                }
            }
            Self::Ring { inner } => {
                if (inner * radius..=radius).contains(&r) {
                    1.0 / (PI * radius * radius * (1.0 - inner * inner))
                } else {
                    0.0
                }
            }
            Self::Gaussian { k } => Profile { p: 2.0, sigma: k * radius }.density(r),
            Self::Generalised { p, k } => Profile { p, sigma: k * radius }.density(r),
        }
    }

    /// Mean squared distance from the centre for the blur radius `radius`.
    #[must_use]
    pub fn second_moment(&self, radius: f64) -> f64 {
        match *self {
            Self::PillBox => 0.5 * radius * radius,
            Self::Ring { inner } => 0.5 * radius * radius * (1.0 + inner * inner),
            Self::Gaussian { k } => 2.0 * (k * radius).powi(2),
            Self::Generalised { p, k } => {
                (k * radius).powi(2) * p.powf(2.0 / p) * libm::tgamma(4.0 / p) / libm::tgamma(2.0 / p)
            }
        }
    }
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Profile {
    pub(crate) p: f64,
    pub(crate) sigma: f64,
}

impl Profile {
    pub(crate) fn peak(&self) -> f64 {
        self.p.powf(1.0 - 2.0 / self.p) / (2.0 * PI * self.sigma * self.sigma * libm::tgamma(2.0 / self.p))
    }

    pub(crate) fn density(&self, r: f64) -> f64 {
        self.peak() * libm::exp(-libm::pow(r / self.sigma, self.p) / self.p)
    }

    /// Distance at which the exponent is `-exponent`.
    pub(crate) fn radius_at(&self, exponent: f64) -> f64 {
        self.sigma * libm::pow(self.p * exponent, 1.0 / self.p)
    }
}

fn in_range(name: &'static str, value: f64, range: &std::ops::RangeInclusive<f64>) -> Result<f64, PsfError> {
    if range.contains(&value) {
        Ok(value)
    } else {
        Err(PsfError::Range { name, value: value.to_string(), low: *range.start(), high: *range.end() })
    }
}

impl FromStr for Psf {
    type Err = PsfError;

    /// `pillbox`, `gaussian:k=0.4578`, `generalised:p=1.8,k=0.4802` or `ring:inner=0.5`.
    fn from_str(text: &str) -> Result<Self, PsfError> {
        let (model, parameters) = text.split_once(':').unwrap_or((text, ""));
        let (mut p, mut k, mut inner) = (None, None, None);
        for part in parameters.split(',').filter(|part| !part.is_empty()) {
            let (name, value) = part.split_once('=').unwrap_or((part, ""));
            let (slot, name, range) = match name {
                "p" => (&mut p, "p", &P_RANGE),
                "k" => (&mut k, "k", &K_RANGE),
                "inner" => (&mut inner, "inner", &INNER_RANGE),
                _ => return Err(PsfError::Unexpected { model: model.into(), name: name.into() }),
            };
            let number = value.parse::<f64>().map_err(|_| PsfError::Range {
                name,
                value: value.into(),
                low: *range.start(),
                high: *range.end(),
            })?;
            if slot.replace(number).is_some() {
                return Err(PsfError::Unexpected { model: model.into(), name: name.into() });
            }
        }
        Self::from_parts(model, p, k, inner)
    }
}

impl fmt::Display for Psf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PillBox => write!(f, "pillbox"),
            Self::Gaussian { k } => write!(f, "gaussian:k={k}"),
            Self::Generalised { p, k } => write!(f, "generalised:p={p},k={k}"),
            Self::Ring { inner } => write!(f, "ring:inner={inner}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Integral of `f(r) r^power 2 pi r dr` by the midpoint rule on a fine grid.
    fn radial_integral(psf: &Psf, radius: f64, power: i32) -> f64 {
        let (limit, steps) = (6.0 * radius, 200_000);
        let dr = limit / f64::from(steps);
        (0..steps)
            .map(|i| {
                let r = (f64::from(i) + 0.5) * dr;
                psf.density(r, radius) * r.powi(power + 1)
            })
            .sum::<f64>()
            * 2.0
            * PI
            * dr
    }

    #[test]
    fn every_psf_integrates_to_one_and_has_its_second_moment() {
        for text in [
            "pillbox",
            "gaussian:k=0.4578",
            "generalised:p=1.8,k=0.4802",
            "generalised:p=1,k=0.3",
            "generalised:p=6,k=0.6",
            "ring:inner=0.6",
        ] {
            let psf: Psf = text.parse().unwrap();
            for radius in [0.4, 2.7] {
                // The midpoint rule is accurate to a grid step at the pill-box's edge, 1e-4.
                assert!((radial_integral(&psf, radius, 0) - 1.0).abs() < 1e-4, "{text}");
                let moment = radial_integral(&psf, radius, 2);
                assert!((moment / psf.second_moment(radius) - 1.0).abs() < 2e-4, "{text} {moment}");
            }
        }
    }

    #[test]
    fn generalised_with_p_2_is_the_gaussian() {
        let (gaussian, generalised) = (Psf::Gaussian { k: 0.5 }, Psf::Generalised { p: 2.0, k: 0.5 });
        for r in [0.0, 0.3, 1.0, 4.0] {
            assert!((gaussian.density(r, 1.7) - generalised.density(r, 1.7)).abs() < 1e-15);
        }
        assert!((gaussian.second_moment(1.7) - generalised.second_moment(1.7)).abs() < 1e-12);
    }

    #[test]
    fn text_round_trips_and_mistakes_are_named() {
        for text in ["pillbox", "gaussian:k=0.4578", "generalised:p=1.8,k=0.4802", "ring:inner=0.6"] {
            assert_eq!(text.parse::<Psf>().unwrap().to_string(), text);
        }
        for (text, expected) in [
            ("airy", "unknown PSF \"airy\""),
            ("gaussian", "needs k=NUMBER"),
            ("gaussian:k=x", "k = x"),
            ("gaussian:k=0", "k = 0"),
            ("gaussian:k=NaN", "k = NaN"),
            ("gaussian:k=0.4,k=0.5", "takes no \"k\""),
            ("pillbox:k=1", "takes no \"k\""),
            ("generalised:k=0.5", "needs p=NUMBER"),
            ("generalised:p=0.1,k=0.5", "p = 0.1"),
        ] {
            let error = text.parse::<Psf>().unwrap_err().to_string();
            assert!(error.contains(expected), "{error:?} should contain {expected:?}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_answered(text in "(pillbox|gaussian|generalised|\\PC*)(:[pk=,.0-9a-zNI-]*)?") {
            if let Ok(psf) = text.parse::<Psf>() {
                prop_assert_eq!(psf.to_string().parse::<Psf>(), Ok(psf));
            }
        }
    }
}
