//! Rational operators: the four kernels that turn a defocused pair into depth, and their design.
//!
//! At run time `M = Q * (I2 - I1)`, `P = Q * (I2 + I1)` and `Gm1 * M = (Gp1 * P) alpha + (Gp2 * P) alpha^3` (W&N 1998;
//! Li 2014, eqs. 1.6 to 1.9). Gm1 is a low-pass, Gp1 the band-pass of the Laplacian of a Gaussian. The kernels follow
//! from the point-spread function and the largest blur radius in pixels alone, so one set serves every lens that
//! shares them.
//!
//! Frequencies are in rad/px. Cost of [`design`]: some ms for [`Design::Linear`], below a second otherwise.

pub mod least_squares;
pub mod linear;
pub mod linearise;
pub mod prefilter;
pub mod published;
pub mod start;
pub mod thesis;

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use self::linearise::Polynomial;
use crate::kernel::{Kernel, KernelError};
use crate::nir::{NirFit, first_non_monotonic, octant};
use crate::optics::Optics;
use crate::psf::{Psf, PsfError};

/// Version of the stored form; other versions are refused.
pub const FORMAT: u32 = 1;

/// Blur radii that can be designed for: below a third of a pixel the images do not differ, above 12 the kernels are
/// far too small for the blur.
const MAX_BLUR_PX: [f64; 2] = [0.3, 12.0];

/// Why operators could not be designed or read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DesignError {
    /// The blur radius is outside what the kernels can serve.
    #[error("largest blur radius {0} px: operators can be designed for 0.3 to 12 px")]
    MaxBlur(f64),
    /// The family does not go with the PSF.
    #[error("family {family} is made for the {expected} PSF, not for {psf}")]
    FamilyNeedsOtherPsf {
        /// The family.
        family: Family,
        /// The model it is made for.
        expected: &'static str,
        /// The given PSF.
        psf: Psf,
    },
    /// No frequency of the pixel grid tells depths apart.
    #[error("with a blur of at most {max_blur_px} px no frequency tells depths apart")]
    NoDepthSignal {
        /// The largest blur radius.
        max_blur_px: f64,
    },
    /// The least squares has no usable solution.
    #[error("the least squares of {unknowns} taps has no finite solution")]
    Singular {
        /// Number of unknowns.
        unknowns: usize,
    },
    /// The Parks-McClellan start of a non-linear design failed.
    #[error("no kernels to start from: {0}")]
    Start(String),
    /// A non-linear design did not come to an end.
    #[error("the minimisation failed: {0}")]
    Minimisation(String),
    /// A kernel is malformed.
    #[error(transparent)]
    Kernel(#[from] KernelError),
    /// The PSF is unusable.
    #[error(transparent)]
    Psf(#[from] PsfError),
    /// The name is none of the known ones.
    #[error("unknown {what} `{name}`: use {known}")]
    UnknownName {
        /// What was to be named.
        what: &'static str,
        /// The text.
        name: String,
        /// What can be used.
        known: &'static str,
    },
    /// Stored operators of another version.
    #[error("operators of format {found}, this program reads format {FORMAT}: design them again")]
    Format {
        /// The stored version.
        found: u32,
    },
    /// Kernels of one set have different sizes.
    #[error("the kernels of one set must share one size, found {0:?}")]
    MixedSizes([usize; 4]),
}

/// Which operators, and for which PSF.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Family {
    /// Watanabe & Nayar 1998, pill-box, by their procedure ([`published`]) whatever the [`Design`].
    Watanabe,
    /// Raj & Staunton 2012, pill-box, by their procedure ([`published`]) whatever the [`Design`].
    Raj,
    /// Pill-box rational operators by the procedures of Li 2014.
    Ro,
    /// Gaussian rational operators (Li 2014, section 5.2.1).
    Gro,
    /// Generalised Gaussian rational operators (Li 2014, section 5.2.2).
    Ggro,
}

impl Family {
    /// All families.
    pub const ALL: [Self; 5] = [Self::Watanabe, Self::Raj, Self::Ro, Self::Gro, Self::Ggro];

    /// The family that a PSF gets if none is asked for.
    pub fn of(psf: Psf) -> Self {
        match psf {
            Psf::PillBox => Self::Ro,
            Psf::Gaussian { .. } => Self::Gro,
            Psf::Generalised { .. } => Self::Ggro,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Watanabe => "watanabe",
            Self::Raj => "raj",
            Self::Ro => "ro",
            Self::Gro => "gro",
            Self::Ggro => "ggro",
        }
    }

    fn check(self, psf: Psf) -> Result<(), DesignError> {
        let (expected, fits) = match self {
            Self::Watanabe | Self::Raj | Self::Ro => ("pillbox", matches!(psf, Psf::PillBox)),
            Self::Gro => ("gaussian", matches!(psf, Psf::Gaussian { .. })),
            Self::Ggro => ("generalised", matches!(psf, Psf::Generalised { .. })),
        };
        if fits { Ok(()) } else { Err(DesignError::FamilyNeedsOtherPsf { family: self, expected, psf }) }
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

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

/// How the kernels of the families `ro`, `gro` and `ggro` are fitted to the NIR.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Design {
    /// One linear least squares ([`linear`]): the most accurate, and milliseconds.
    #[default]
    Linear,
    /// Levenberg-Marquardt on eq. 5.18 of Li 2014, put right ([`thesis`]).
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

/// What operators are asked for.
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
    /// Width and height of the kernels: 5, 7, 9 or 11.
    pub kernel_size: usize,
}

impl Request {
    /// The default operators for some optics: the PSF's own family, linear design, 7x7.
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
}

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
    nir: NirFit,
}

/// Operators as stored.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawOperators {
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
    nir: NirFit,
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
            nir: raw.nir,
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
            nir: o.nir,
        }
    }
}

impl Request {
    fn check(&self) -> Result<(), DesignError> {
        if !(MAX_BLUR_PX[0]..=MAX_BLUR_PX[1]).contains(&self.max_blur_px) {
            return Err(DesignError::MaxBlur(self.max_blur_px));
        }
        if !crate::kernel::SIZES.contains(&self.kernel_size) {
            return Err(KernelError::Size(self.kernel_size).into());
        }
        self.family.check(self.psf)
    }
}

/// Designs operators.
///
/// # Errors
/// [`DesignError`] if the request contradicts itself or no usable operators exist for it.
pub fn design(request: &Request) -> Result<Operators, DesignError> {
    request.check()?;
    let Request { family, design, psf, max_blur_px, kernel_size } = *request;
    let otf = psf.checked()?.otf(max_blur_px);
    let grid = octant();
    let target = match family {
        Family::Watanabe | Family::Raj => published::prefilter_target(&otf, max_blur_px, &grid),
        Family::Ro | Family::Gro | Family::Ggro => prefilter::target(&otf, max_blur_px, &grid)?,
    };
    let q = prefilter::fit(&target, &grid, kernel_size)?;
    let nir = NirFit::new(&otf, max_blur_px, first_non_monotonic(&otf, max_blur_px));
    let [gm1, gp1, gp2] = match (family, design) {
        (Family::Watanabe, _) => published::watanabe(&otf, max_blur_px, &q, &grid, kernel_size)?,
        (Family::Raj, _) => published::raj(&otf, max_blur_px, &q, &grid, kernel_size)?,
        (_, Design::Linear) => linear::design(&otf, max_blur_px, &q, &grid, kernel_size)?,
        (_, Design::Thesis) => thesis::design(&otf, max_blur_px, &q, &nir, &grid, kernel_size)?,
    };
    let linearisation = match (family, design) {
        (Family::Ro | Family::Gro | Family::Ggro, Design::Linear) => {
            linearise::design(&otf, max_blur_px, &q, [&gm1, &gp1, &gp2], &grid)?
        }
        // As published.
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
        nir_rms: nir.total_rms(),
        prefilter: q,
        gm1,
        gp1,
        gp2,
        linearisation,
        nir,
    })
}

impl Operators {
    /// The default operators of some optics.
    ///
    /// # Errors
    /// As [`design`].
    pub fn for_optics(optics: &Optics) -> Result<Self, DesignError> {
        design(&Request::for_optics(optics))
    }

    /// A name that says what they are.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What was asked for: family, design, PSF, blur, size.
    pub fn request(&self) -> &Request {
        &self.request
    }

    /// Largest blur radius Rmax in pixels that they were designed for.
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

    /// Coefficients of the odd polynomial (alpha, alpha^3, alpha^5, alpha^7) from the alpha found to the true one.
    pub fn linearisation(&self) -> &Polynomial {
        &self.linearisation
    }

    /// Cubic fit of the NIR.
    pub fn nir(&self) -> &NirFit {
        &self.nir
    }

    /// Root-mean-square misfit of the cubic to the NIR over the frequencies below the first non-monotonic one.
    pub fn nir_rms(&self) -> f64 {
        self.nir_rms
    }
}
