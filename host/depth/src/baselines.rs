//! Published methods for the same pair, for comparison.
//!
//! | method | what | reference |
//! |---|---|---|
//! | [`Method::Subbarao`] | S-transform: difference of the images over the Laplacian of their mean | Subbarao & Surya 1994 |
//! | [`Method::SubbaraoFourier`] | ratio of local spectra | Subbarao 1988; Li 2014, appendix C |
//! | [`Method::Favaro`] | projectors on the null space of each depth, learned from rendered patches | Favaro & Soatto 2005 |
//!
//! (Watanabe & Nayar and Raj & Staunton differ by their operators only: see [`crate::operators::Family`].) Each gives a
//! [`DepthMap`] with the conventions of [`crate::pipeline::depth_from_pair`]; evidence is summed over
//! [`Settings::smoothing_px`]. The first two use only the PSF's second moment, `sigma^2 = 2 k^2 R^2` for a Gaussian. In
//! a telecentric pair `sigma1^2 - sigma2^2 = c Rmax^2 alpha`.

mod common;
mod favaro;
mod fourier;
mod s_transform;

use std::fmt;
use std::str::FromStr;

use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};

use crate::optics::Optics;
use crate::pipeline::{DepthMap, RunError, Settings};

pub use favaro::{Favaro, FavaroSettings};

/// Name of the baseline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// S-transform.
    Subbarao,
    /// Ratio of local spectra.
    SubbaraoFourier,
    /// Null-space projectors.
    Favaro,
}

/// Why a baseline gives no depth.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum BaselineError {
    #[error("`{0}` is not a baseline: use subbarao, subbarao-fourier or favaro")]
    Unknown(String),
    #[error(transparent)]
    Pair(#[from] RunError),
    #[error("{name} = {value}: must lie between {least} and {most}")]
    Setting { name: &'static str, value: usize, least: usize, most: usize },
    #[error("the projectors were learned for {learned}, the optics have {optics}: learn them again")]
    OtherOptics { learned: String, optics: String },
    #[error("the patches of alpha = {alpha:.2} have no principal directions")]
    NoDirections { alpha: f64 },
}

impl Method {
    /// All baselines.
    pub const ALL: [Self; 3] = [Self::Subbarao, Self::SubbaraoFourier, Self::Favaro];

    /// The name as the command line writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Subbarao => "subbarao",
            Self::SubbaraoFourier => "subbarao-fourier",
            Self::Favaro => "favaro",
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Method {
    type Err = BaselineError;

    fn from_str(text: &str) -> Result<Self, BaselineError> {
        let known = Self::ALL.into_iter().find(|method| method.name() == text.trim());
        known.ok_or_else(|| BaselineError::Unknown(text.to_owned()))
    }
}

/// Depth of a pair by a baseline: `far` and `near` are (height, width) in any common scale. A [`Favaro`] saves learning
/// for many pairs. Returns [`BaselineError::Pair`] for images that differ in size, are too small, constant or invalid.
pub fn depth_from_pair(
    method: Method,
    far: ArrayView2<f32>,
    near: ArrayView2<f32>,
    optics: &Optics,
    settings: &Settings,
) -> Result<DepthMap, BaselineError> {
    let pair = common::Pair::new(far, near, settings)?;
    let evidence = match method {
        Method::Subbarao => s_transform::evidence(&pair, optics, settings),
        Method::SubbaraoFourier => fourier::evidence(&pair, optics, settings),
        Method::Favaro => Favaro::learn(optics, &FavaroSettings::default())?.evidence(&pair, settings),
    };
    Ok(pair.finish(evidence, optics, settings))
}
