//! Stored operators: reading, checks and writing.

use serde::{Deserialize, Serialize};

use super::linearise::Polynomial;
use super::{Design, DesignError, FORMAT, Family, Operators, Request};
use crate::kernel::Kernel;
use crate::normalised_ratio::RatioFit;
use crate::psf::Psf;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawOperators {
    format: u32,
    name: String,
    family: Family,
    design: Design,
    max_blur_px: f64,
    kernel_size: usize,
    nir_rms: f64,
    linearisation: Polynomial,
    psf: Psf,
    prefilter: Kernel,
    gm1: Kernel,
    gp1: Kernel,
    gp2: Kernel,
    normalised_ratio: RatioFit,
}

impl TryFrom<RawOperators> for Operators {
    type Error = DesignError;

    fn try_from(raw: RawOperators) -> Result<Self, DesignError> {
        if raw.format != FORMAT {
            return Err(DesignError::Format { found: raw.format });
        }
        let sizes = [&raw.prefilter, &raw.gm1, &raw.gp1, &raw.gp2].map(Kernel::size);
        if sizes.iter().any(|s| *s != raw.kernel_size) {
            return Err(DesignError::MixedSizes(sizes));
        }
        let request = Request {
            family: raw.family,
            design: raw.design,
            psf: raw.psf.checked()?,
            max_blur_px: raw.max_blur_px,
            kernel_size: raw.kernel_size,
        };
        request.check()?;
        Ok(Self {
            name: raw.name,
            request,
            nir_rms: raw.nir_rms,
            prefilter: raw.prefilter,
            gm1: raw.gm1,
            gp1: raw.gp1,
            gp2: raw.gp2,
            linearisation: raw.linearisation,
            normalised_ratio: raw.normalised_ratio,
        })
    }
}

impl From<Operators> for RawOperators {
    fn from(o: Operators) -> Self {
        Self {
            format: FORMAT,
            name: o.name,
            family: o.request.family,
            design: o.request.design,
            max_blur_px: o.request.max_blur_px,
            kernel_size: o.request.kernel_size,
            nir_rms: o.nir_rms,
            psf: o.request.psf,
            prefilter: o.prefilter,
            gm1: o.gm1,
            gp1: o.gp1,
            gp2: o.gp2,
            linearisation: o.linearisation,
            normalised_ratio: o.normalised_ratio,
        }
    }
}
