//! Errors of operator design and stored operators.

use super::{FORMAT, Family};
use crate::kernel::KernelError;
use crate::psf::{Psf, PsfError};

/// Why operators could not be designed or read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DesignError {
    /// The blur radius is outside the range of the kernels.
    #[error("largest blur radius {0} px: operators can be designed for 0.3 to 12 px")]
    MaxBlur(f64),
    /// The family does not go with the PSF.
    #[error("family {family} is made for the {expected} PSF, not for {psf}")]
    FamilyNeedsOtherPsf {
        /// The family.
        family: Family,
        /// The model it is made for.
        expected: &'static str,
        /// The given PSF; boxed, for a measured one is long.
        psf: Box<Psf>,
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
    /// The name is unknown.
    #[error("unknown {what} `{name}`: use {known}")]
    UnknownName {
        /// The kind of name.
        what: &'static str,
        /// The text.
        name: String,
        /// The accepted values.
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
