//! Errors of operator design and stored operators.

use super::{FORMAT, Family};
use crate::kernel::KernelError;
use crate::psf::{Psf, PsfError};

/// Why operators could not be designed or read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum DesignError {
    #[error("largest blur radius {0} px: operators can be designed for 0.3 to 12 px")]
    MaxBlur(f64),
    #[error("family {family} is made for the {expected} PSF, not for {psf}")]
    FamilyNeedsOtherPsf {
        family: Family,
        expected: &'static str,
        /// The given PSF; boxed, for a measured one is long.
        psf: Box<Psf>,
    },
    #[error("with a blur of at most {max_blur_px} px no frequency tells depths apart")]
    NoDepthSignal { max_blur_px: f64 },
    #[error("the least squares of {unknowns} taps has no finite solution")]
    Singular { unknowns: usize },
    #[error("no kernels to start from: {0}")]
    Start(String),
    #[error("the minimisation failed: {0}")]
    Minimisation(String),
    #[error(transparent)]
    Kernel(#[from] KernelError),
    #[error(transparent)]
    Psf(#[from] PsfError),
    #[error("unknown {what} `{name}`: use {known}")]
    UnknownName { what: &'static str, name: String, known: &'static str },
    #[error("operators of format {found}, this program reads format {FORMAT}: design them again")]
    Format { found: u32 },
    #[error("the kernels of one set must share one size, found {0:?}")]
    MixedSizes([usize; 4]),
}
