//! Operator families and design procedures, by name.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::psf::Psf;

/// Which operators, and for which PSF.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Family {
    /// Watanabe & Nayar 1998, pill-box, by their procedure ([`watanabe`](super::watanabe)) for every [`Design`].
    Watanabe,
    /// Raj & Staunton 2012, pill-box, by their procedure ([`raj`](super::raj)) for every [`Design`].
    Raj,
    /// Rational operators by the procedures of Li 2014, for the pill-box, a ring and any measured PSF.
    Ro,
    /// Gaussian rational operators (Li 2014, section 5.2.1).
    Gro,
    /// Generalised Gaussian rational operators (Li 2014, section 5.2.2).
    Ggro,
}

impl Family {
    /// All families.
    pub const ALL: [Self; 5] = [Self::Watanabe, Self::Raj, Self::Ro, Self::Gro, Self::Ggro];

    /// The default family of a PSF.
    pub fn of(psf: Psf) -> Self {
        match psf {
            Psf::PillBox | Psf::Ring { .. } | Psf::Radial(_) => Self::Ro,
            Psf::Gaussian { .. } => Self::Gro,
            Psf::Generalised { .. } => Self::Ggro,
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Watanabe => "watanabe",
            Self::Raj => "raj",
            Self::Ro => "ro",
            Self::Gro => "gro",
            Self::Ggro => "ggro",
        }
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Design of the families `ro`, `gro` and `ggro`: fit of the kernels to the NIR.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Design {
    /// One linear least squares ([`linear`](super::linear)): the most accurate; milliseconds.
    #[default]
    Linear,
    /// Levenberg-Marquardt on the corrected eq. 5.18 of Li 2014 ([`thesis`](super::thesis)).
    Thesis,
}

impl fmt::Display for Design {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Linear => "linear",
            Self::Thesis => "thesis",
        })
    }
}
