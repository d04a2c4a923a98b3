//! Request for operators: family, design, PSF, blur and size.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::{Design, DesignError, Family};
use crate::kernel::{KernelError, SIZES};
use crate::optics::Optics;
use crate::psf::Psf;

/// Supported blur radii: below a third of a pixel the images do not differ; above 12 px the blur exceeds the kernels.
const MAX_BLUR_PX: [f64; 2] = [0.3, 12.0];

impl FromStr for Family {
    type Err = DesignError;

    fn from_str(name: &str) -> Result<Self, DesignError> {
        Self::ALL.into_iter().find(|family| family.name() == name).ok_or_else(|| DesignError::UnknownName {
            what: "family",
            name: name.to_owned(),
            known: "watanabe, raj, ro, gro or ggro",
        })
    }
}

impl FromStr for Design {
    type Err = DesignError;

    fn from_str(name: &str) -> Result<Self, DesignError> {
        match name {
            "linear" => Ok(Self::Linear),
            "thesis" => Ok(Self::Thesis),
            _ => Err(DesignError::UnknownName {
                what: "design",
                name: name.to_owned(),
                known: "linear or thesis",
            }),
        }
    }
}

/// Request for operators.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Request {
    /// Family; must fit the PSF.
    pub family: Family,
    /// Procedure.
    pub design: Design,
    /// Point-spread function.
    pub psf: Psf,
    /// Largest blur radius Rmax in pixels.
    pub max_blur_px: f64,
    /// Width and height of the kernels: one of [`SIZES`].
    pub kernel_size: usize,
}

impl Request {
    /// The default operators for given optics: the PSF's own family, linear design, 7x7.
    pub fn for_optics(optics: &Optics) -> Self {
        let psf = optics.psf();
        Self {
            family: Family::of(psf),
            design: Design::Linear,
            psf,
            max_blur_px: optics.max_blur_px(),
            kernel_size: 7,
        }
    }

    pub(super) fn check(&self) -> Result<(), DesignError> {
        if !(MAX_BLUR_PX[0]..=MAX_BLUR_PX[1]).contains(&self.max_blur_px) {
            return Err(DesignError::MaxBlur(self.max_blur_px));
        }
        if !SIZES.contains(&self.kernel_size) {
            return Err(KernelError::Size(self.kernel_size).into());
        }
        self.check_family()
    }

    fn check_family(&self) -> Result<(), DesignError> {
        let Self { family, psf, .. } = *self;
        let (expected, fits) = match family {
            Family::Watanabe | Family::Raj => ("pillbox", matches!(psf, Psf::PillBox)),
            Family::Ro => (
                "pillbox, ring or a measured",
                matches!(psf, Psf::PillBox | Psf::Ring { .. } | Psf::Radial(_)),
            ),
            Family::Gro => ("gaussian", matches!(psf, Psf::Gaussian { .. })),
            Family::Ggro => ("generalised", matches!(psf, Psf::Generalised { .. })),
        };
        if fits {
            Ok(())
        } else {
            Err(DesignError::FamilyNeedsOtherPsf { family, expected, psf: psf.into() })
        }
    }
}
