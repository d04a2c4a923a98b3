//! Rational operators: the four kernels that turn a defocused pair into depth, and their design.
//!
//! At run time `M = Q * (I2 - I1)`, `P = Q * (I2 + I1)` and `Gm1 * M = (Gp1 * P) alpha + (Gp2 * P) alpha^3` (W&N 1998;
//! Li 2014, eqs. 1.6 to 1.9). Gm1 is a low-pass, Gp1 the band-pass of the Laplacian of a Gaussian. The kernels depend
//! only on the PSF and the largest blur radius in pixels, so one set serves every lens that shares them. Frequencies
//! are in rad/px. Cost of [`design`]: some ms for [`Design::Linear`], below a second otherwise.

mod error;
mod family;
pub mod least_squares;
pub mod linear;
pub mod linearise;
mod minimise;
pub mod prefilter;
pub mod raj;
mod request;
mod samples;
pub mod start;
mod stored;
pub mod thesis;
pub mod watanabe;

use serde::{Deserialize, Serialize};

use self::linearise::Polynomial;
use self::stored::RawOperators;
use crate::kernel::Kernel;
use crate::normalised_ratio::{RatioFit, first_non_monotonic, octant};
use crate::optics::Optics;

pub use error::DesignError;
pub use family::{Design, Family};
pub use request::Request;

/// Version of the stored form; other versions are rejected.
pub const FORMAT: u32 = 1;

/// A designed set of operators.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "RawOperators", into = "RawOperators")]
pub struct Operators {
    name: String,
    request: Request,
    nir_rms: f64,
    prefilter: Kernel,
    gm1: Kernel,
    gp1: Kernel,
    gp2: Kernel,
    linearisation: Polynomial,
    normalised_ratio: RatioFit,
}

/// Designs operators. Returns [`DesignError`] if the request contradicts itself or has no usable operators.
pub fn design(request: &Request) -> Result<Operators, DesignError> {
    request.check()?;
    let Request { family, design, psf, max_blur_px, kernel_size } = *request;
    let otf = psf.checked()?.otf(max_blur_px);
    let grid = octant();
    let target = match family {
        Family::Watanabe | Family::Raj => raj::prefilter_target(&otf, max_blur_px, &grid),
        Family::Ro | Family::Gro | Family::Ggro => prefilter::target(&otf, max_blur_px, &grid)?,
    };
    let q = prefilter::fit(&target, &grid, kernel_size)?;
    let normalised_ratio = RatioFit::new(&otf, max_blur_px, first_non_monotonic(&otf, max_blur_px));
    let [gm1, gp1, gp2] = match (family, design) {
        (Family::Watanabe, _) => watanabe::design(&otf, max_blur_px, &q, &grid, kernel_size)?,
        (Family::Raj, _) => raj::design(&otf, max_blur_px, &q, &grid, kernel_size)?,
        (_, Design::Linear) => linear::design(&otf, max_blur_px, &q, &grid, kernel_size)?,
        (_, Design::Thesis) => thesis::design(&otf, max_blur_px, &q, &normalised_ratio, &grid, kernel_size)?,
    };
    let linearisation = match (family, design) {
        (Family::Ro | Family::Gro | Family::Ggro, Design::Linear) => {
            linearise::design(&otf, max_blur_px, &q, [&gm1, &gp1, &gp2], &grid)?
        }
        _ => linearise::IDENTITY,
    };
    let procedure = match family {
        Family::Watanabe | Family::Raj => family.to_string(),
        _ => format!("{family}-{design}"),
    };
    let name = format!("{procedure} {psf} rmax={max_blur_px} {kernel_size}x{kernel_size}");
    Ok(Operators {
        name,
        request: *request,
        nir_rms: normalised_ratio.total_rms(),
        prefilter: q,
        gm1,
        gp1,
        gp2,
        linearisation,
        normalised_ratio,
    })
}

impl Operators {
    /// The default operators for given optics; errors as [`design`].
    pub fn for_optics(optics: &Optics) -> Result<Self, DesignError> {
        design(&Request::for_optics(optics))
    }

    /// A descriptive name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The request: family, design, PSF, blur, size.
    pub fn request(&self) -> &Request {
        &self.request
    }

    /// Largest blur radius Rmax in pixels of the design.
    pub fn max_blur_px(&self) -> f64 {
        self.request.max_blur_px
    }

    /// Width and height of the kernels.
    pub fn kernel_size(&self) -> usize {
        self.request.kernel_size
    }

    /// Pre-filter Q.
    pub fn prefilter(&self) -> &Kernel {
        &self.prefilter
    }

    /// Operator Gm1, applied to the filtered difference.
    pub fn gm1(&self) -> &Kernel {
        &self.gm1
    }

    /// Operator Gp1, applied to the filtered sum; coefficient of alpha.
    pub fn gp1(&self) -> &Kernel {
        &self.gp1
    }

    /// Operator Gp2, applied to the filtered sum; coefficient of alpha^3.
    pub fn gp2(&self) -> &Kernel {
        &self.gp2
    }

    /// Odd polynomial (alpha, alpha^3, alpha^5, alpha^7) from the estimated to the true alpha.
    pub fn linearisation(&self) -> &Polynomial {
        &self.linearisation
    }

    /// Cubic fit of the NIR.
    pub fn normalised_ratio(&self) -> &RatioFit {
        &self.normalised_ratio
    }

    /// RMS misfit of the cubic to the NIR below the first non-monotonic frequency.
    pub fn nir_rms(&self) -> f64 {
        self.nir_rms
    }
}
