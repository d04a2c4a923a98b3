//! Point-spread functions (PSFs) of a defocused lens and their optical transfer functions (OTFs).
//!
//! With `R` the radius of the blur circle in pixels and `w` the radial frequency in rad/px:
//! - pill-box: `2 J1(z) / z`, `z = R w` (Li 2014, eq. 1.4);
//! - Gaussian: `exp(-(k R w)^2 / 2)`, `sigma = k R` (eqs. 5.9 to 5.11; the printed 5.12 lacks a factor 1/2 in sigma);
//! - generalised Gaussian: the radial PSF `exp(-(r / sigma)^p / p)` (eq. 5.16 made radial), whose OTF comes from a
//!   tabulated Hankel transform ([`crate::hankel`]). `p = 2` is the Gaussian, `p -> infinity` the pill-box of radius
//!   `sigma`; otherwise `sigma` is a scale, not the standard deviation;
//! - ring: an aperture with a covered centre, the difference of two pill-boxes;
//! - radial: any measured or drawn profile ([`RadialPsf`]).
//!
//! Cost: O(1), except building the [`Otf`] of a generalised Gaussian (a few ms).

mod radial;

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::hankel::HankelTable;

pub use radial::{Drawn, RINGS, RadialPsf, RadialTable};

/// Exponents of the generalised Gaussian: below, the tails are hundreds of pixels wide; above, it is nearly a pill-box.
const P_RANGE: [f64; 2] = [0.5, 64.0];

/// Blur constants; usual are 0.3 to 1.
const K_RANGE: [f64; 2] = [0.01, 10.0];

/// Inner radii of a ring; above, no light is left.
const INNER_RANGE: [f64; 2] = [0.0, 0.99];

/// An error of a point-spread function's text or parameters.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
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
    #[error("the PSF's profile or image has {0}")]
    Profile(String),
}

/// A model of the point-spread function.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(try_from = "Parts", into = "Parts")]
pub enum Psf {
    /// Uniform disc of the geometric blur radius.
    #[default]
    PillBox,
    /// Gaussian with `sigma = k R`.
    Gaussian {
        /// Blur constant k.
        k: f64,
    },
    /// Radial generalised Gaussian with the scale `k R`.
    Generalised {
        /// Exponent p.
        p: f64,
        /// Blur constant k.
        k: f64,
    },
    /// Uniform ring: an aperture with a covered centre.
    Ring {
        /// Inner radius in blur radii.
        inner: f64,
    },
    /// Any round PSF, measured or drawn.
    Radial(RadialPsf),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parts {
    model: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    p: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    k: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    inner: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    extent: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rings: Option<Vec<f32>>,
}

impl TryFrom<Parts> for Psf {
    type Error = PsfError;

    fn try_from(Parts { model, p, k, inner, extent, rings }: Parts) -> Result<Self, PsfError> {
        if model != "radial" {
            if rings.is_some() || extent.is_some() {
                let name = if rings.is_some() { "rings" } else { "extent" };
                return Err(PsfError::Unexpected { model, name: name.into() });
            }
            return Self::from_parts(&model, p, k, inner);
        }
        if let Some(name) = [("p", p), ("k", k), ("inner", inner)].iter().find(|(_, value)| value.is_some()) {
            return Err(PsfError::Unexpected { model, name: name.0.into() });
        }
        let example = "farnear depth --psf FILE, whose depth.toml holds one";
        let missing = |name| PsfError::Missing { model: "radial", name, example };
        let rings = rings.ok_or_else(|| missing("rings"))?;
        Ok(Self::Radial(RadialPsf::new(extent.ok_or_else(|| missing("extent"))?, &rings)?))
    }
}

impl From<Psf> for Parts {
    fn from(psf: Psf) -> Self {
        let named = |model: &str| Self {
            model: model.to_owned(),
            p: None,
            k: None,
            inner: None,
            extent: None,
            rings: None,
        };
        match psf {
            Psf::PillBox => named("pillbox"),
            Psf::Gaussian { k } => Self { k: Some(k), ..named("gaussian") },
            Psf::Generalised { p, k } => Self { p: Some(p), k: Some(k), ..named("generalised") },
            Psf::Ring { inner } => Self { inner: Some(inner), ..named("ring") },
            Psf::Radial(psf) => {
                Self { extent: Some(psf.extent()), rings: Some(psf.light().to_vec()), ..named("radial") }
            }
        }
    }
}

impl Psf {
    /// A PSF from its model's name and parameters. Returns [`PsfError`] for an unknown model or wrong parameters.
    pub fn from_parts(
        model: &str,
        p: Option<f64>,
        k: Option<f64>,
        inner: Option<f64>,
    ) -> Result<Self, PsfError> {
        let surplus = |name: &str| PsfError::Unexpected { model: model.to_owned(), name: name.to_owned() };
        if model == "ring" {
            return match (p, k, inner) {
                (None, None, Some(inner)) => Self::Ring { inner }.checked(),
                (Some(_), ..) => Err(surplus("p")),
                (None, Some(_), _) => Err(surplus("k")),
                (None, None, None) => {
                    Err(PsfError::Missing { model: "ring", name: "inner", example: "ring:inner=0.5" })
                }
            };
        }
        let known = ["pillbox", "gaussian", "generalised"].contains(&model);
        if inner.is_some() && known {
            return Err(surplus("inner"));
        }
        match (model, p, k) {
            ("pillbox", None, None) => Ok(Self::PillBox),
            ("pillbox", Some(_), _) => Err(surplus("p")),
            ("pillbox", None, Some(_)) => Err(surplus("k")),
            ("gaussian", None, Some(k)) => Self::Gaussian { k }.checked(),
            ("gaussian", Some(_), _) => Err(surplus("p")),
            ("gaussian", None, None) => {
                Err(PsfError::Missing { model: "gaussian", name: "k", example: "gaussian:k=0.4578" })
            }
            ("generalised", Some(p), Some(k)) => Self::Generalised { p, k }.checked(),
            ("generalised", p, _) => Err(PsfError::Missing {
                model: "generalised",
                name: if p.is_none() { "p" } else { "k" },
                example: "generalised:p=1.8,k=0.4802",
            }),
            _ => Err(PsfError::Unknown(model.to_owned())),
        }
    }

    /// The PSF itself, or [`PsfError::Range`] if its parameters are unusable.
    pub fn checked(self) -> Result<Self, PsfError> {
        match self {
            Self::PillBox => {}
            Self::Gaussian { k } => check_range("k", k, K_RANGE)?,
            Self::Generalised { p, k } => {
                check_range("p", p, P_RANGE)?;
                check_range("k", k, K_RANGE)?;
            }
            Self::Ring { inner } => check_range("inner", inner, INNER_RANGE)?,
            // Checked at construction.
            Self::Radial(_) => {}
        }
        Ok(self)
    }

    /// Mean square distance from the centre, in squared blur radii; half of that along one axis.
    pub fn second_moment(self) -> f64 {
        match self {
            Self::PillBox => 0.5,
            Self::Gaussian { k } => 2.0 * k * k,
            Self::Generalised { p, k } => {
                k * k * p.powf(2.0 / p) * libm::tgamma(4.0 / p) / libm::tgamma(2.0 / p)
            }
            Self::Ring { inner } => 0.5 * (1.0 + inner * inner),
            Self::Radial(psf) => psf.second_moment(),
        }
    }

    /// The OTF for blur radii up to `max_radius_px` and all frequencies of a pixel grid (up to `sqrt(2) pi`).
    pub fn otf(self, max_radius_px: f64) -> Otf {
        self.otf_up_to(max_radius_px * std::f64::consts::SQRT_2 * std::f64::consts::PI)
    }

    /// The OTF for blur radius times frequency up to `max_phase_rad`; beyond, the generalised Gaussian is slower.
    pub fn otf_up_to(self, max_phase_rad: f64) -> Otf {
        match self {
            Self::PillBox => Otf::PillBox,
            Self::Gaussian { k } => Otf::Gaussian { k },
            Self::Generalised { p, k } => {
                Otf::Generalised { k, table: HankelTable::new(p, k * max_phase_rad) }
            }
            Self::Ring { inner } => Otf::Ring { inner },
            Self::Radial(psf) => Otf::Radial(RadialTable::new(psf, max_phase_rad)),
        }
    }
}

fn check_range(name: &'static str, value: f64, [low, high]: [f64; 2]) -> Result<(), PsfError> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(PsfError::Range { name, value: value.to_string(), low, high })
    }
}

impl fmt::Display for Psf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PillBox => write!(f, "pillbox"),
            Self::Gaussian { k } => write!(f, "gaussian:k={k}"),
            Self::Generalised { p, k } => write!(f, "generalised:p={p},k={k}"),
            Self::Ring { inner } => write!(f, "ring:inner={inner}"),
            Self::Radial(psf) => {
                write!(f, "a measured profile (SD {:.4} blur radii)", (0.5 * psf.second_moment()).sqrt())
            }
        }
    }
}

impl FromStr for Psf {
    type Err = PsfError;

    /// `pillbox`, `gaussian:k=0.4578`, `generalised:p=1.8,k=0.4802` or `ring:inner=0.5`.
    fn from_str(text: &str) -> Result<Self, PsfError> {
        let (model, parameters) = text.trim().split_once(':').unwrap_or((text.trim(), ""));
        let model = model.trim();
        let [mut p, mut k, mut inner] = [None; 3];
        for parameter in parameters.split(',').filter(|parameter| !parameter.trim().is_empty()) {
            let (name, value) = parameter.split_once('=').unwrap_or((parameter, ""));
            let (name, value) = (name.trim(), value.trim());
            let (slot, name, [low, high]) = match name {
                "p" => (&mut p, "p", P_RANGE),
                "k" => (&mut k, "k", K_RANGE),
                "inner" => (&mut inner, "inner", INNER_RANGE),
                _ => return Err(PsfError::Unexpected { model: model.to_owned(), name: name.to_owned() }),
            };
            let number = value.parse::<f64>().map_err(|_| PsfError::Range {
                name,
                value: value.to_owned(),
                low,
                high,
            })?;
            if slot.replace(number).is_some() {
                return Err(PsfError::Unexpected { model: model.to_owned(), name: name.to_owned() });
            }
        }
        Self::from_parts(model, p, k, inner)
    }
}

/// An optical transfer function.
#[derive(Debug, Clone)]
pub enum Otf {
    /// `2 J1(z) / z`.
    PillBox,
    /// `exp(-(k z)^2 / 2)`.
    Gaussian {
        /// Blur constant k.
        k: f64,
    },
    /// Tabulated Hankel transform at `k z`.
    Generalised {
        /// Blur constant k.
        k: f64,
        /// Transform of the PSF of unit scale.
        table: HankelTable,
    },
    /// Difference of two pill-boxes.
    Ring {
        /// Inner radius in blur radii.
        inner: f64,
    },
    /// Tabulated transform of a profile.
    Radial(RadialTable),
}

fn disc(z: f64) -> f64 {
    if z < 1e-4 { 1.0 - z * z / 8.0 } else { 2.0 * libm::j1(z) / z }
}

impl Otf {
    /// Response at the blur radius `radius_px` (magnitude) and the radial frequency `w` in rad/px.
    pub fn at(&self, radius_px: f64, w: f64) -> f64 {
        let z = (radius_px * w).abs();
        match self {
            Self::PillBox => disc(z),
            Self::Gaussian { k } => (-0.5 * (k * z) * (k * z)).exp(),
            Self::Generalised { k, table } => table.at(k * z),
            Self::Ring { inner } => {
                let covered = inner * inner;
                (disc(z) - covered * disc(inner * z)) / (1.0 - covered)
            }
            Self::Radial(table) => table.at(z),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_and_models_map_onto_each_other() {
        for text in ["pillbox", "gaussian:k=0.4578", "generalised:p=1.8,k=0.4802", "ring:inner=0.5"] {
            assert_eq!(text.parse::<Psf>().unwrap().to_string(), text);
        }
        assert_eq!("generalised:k=0.5,p=4".parse::<Psf>().unwrap(), Psf::Generalised { p: 4.0, k: 0.5 });
        for (bad, expected) in [
            ("", "unknown PSF \"\""),
            ("airy", "unknown PSF \"airy\""),
            ("pillbox:k=1", "takes no \"k\""),
            ("pillbox:inner=0.5", "takes no \"inner\""),
            ("ring", "needs inner=NUMBER"),
            ("ring:inner=1", "inner = 1"),
            ("ring:inner=0.5,k=1", "takes no \"k\""),
            ("gaussian", "needs k=NUMBER"),
            ("gaussian:k", "k = , expected a number"),
            ("gaussian:k=a", "k = a"),
            ("gaussian:k=1,k=2", "takes no \"k\""),
            ("gaussian:k=-1", "k = -1, expected a number from 0.01"),
            ("generalised:p=2", "needs k=NUMBER"),
            ("generalised:p=0.1,k=1", "p = 0.1"),
        ] {
            let error = bad.parse::<Psf>().unwrap_err().to_string();
            assert!(error.contains(expected), "{error:?} should contain {expected:?}");
        }
        assert_eq!(toml::from_str::<Psf>("model = \"gaussian\"\nk = 0.5").unwrap(), Psf::Gaussian { k: 0.5 });
        let surplus = toml::from_str::<Psf>("model = \"pillbox\"\nk = 0.5").unwrap_err().to_string();
        assert!(surplus.contains("PSF pillbox takes no \"k\""), "{surplus}");
    }

    #[test]
    fn every_otf_is_one_without_blur_and_falls() {
        for psf in [Psf::PillBox, Psf::Gaussian { k: 0.4578 }, Psf::Generalised { p: 1.8, k: 0.4802 }] {
            let otf = psf.otf(3.0);
            assert!((otf.at(0.0, 2.0) - 1.0).abs() < 1e-9 && (otf.at(2.0, 0.0) - 1.0).abs() < 1e-9);
            assert!(otf.at(1.0, 1.0) > otf.at(1.5, 1.0) && otf.at(1.0, 1.0) > otf.at(1.0, 1.5));
        }
    }

    #[test]
    fn the_pill_box_has_the_first_zero_of_j1() {
        assert!(Otf::PillBox.at(1.0, 3.831_705_970_207_512).abs() < 1e-12);
    }

    #[test]
    fn limits_of_the_generalised_gaussian() {
        let gaussian = Psf::Gaussian { k: 0.5 }.otf(3.0);
        let two = Psf::Generalised { p: 2.0, k: 0.5 }.otf(3.0);
        let p: f64 = 64.0;
        let steep = Psf::Generalised { p, k: 1.0 }.otf(3.0);
        let disc = (2.0 * p.powf(2.0 / p) * libm::tgamma(4.0 / p) / libm::tgamma(2.0 / p)).sqrt();
        for i in 0..40 {
            let w = 0.1 * f64::from(i);
            assert!((gaussian.at(2.7, w) - two.at(2.7, w)).abs() < 1e-8);
            // A steep one is a disc of the same second moment (at p = 64 5 % larger than its scale).
            assert!((Otf::PillBox.at(2.0 * disc, w) - steep.at(2.0, w)).abs() < 0.005, "{w}");
        }
    }
}
