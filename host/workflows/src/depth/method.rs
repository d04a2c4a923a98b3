//! How depth is computed: rational operators or a method to compare with.

use std::{fmt, path::Path, str::FromStr};

use farnear_depth::{
    baselines,
    operators::Operators,
    optics::Optics,
    pipeline::{DepthMap, Settings, depth_from_pair},
};

use super::pair::Pair;
use crate::{
    error::{Result, WorkflowError},
    operators,
};

/// How depth is computed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Method {
    /// `ro`.
    #[default]
    RationalOperators,
    /// Somebody else's.
    Baseline(baselines::Method),
}

/// A name that belongs to no method.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("expected ro, subbarao, subbarao-fourier or favaro")]
pub struct UnknownMethod {
    /// The name.
    pub name: String,
}

impl FromStr for Method {
    type Err = UnknownMethod;

    fn from_str(text: &str) -> Result<Self, UnknownMethod> {
        if text == "ro" {
            return Ok(Self::RationalOperators);
        }
        text.parse().map(Self::Baseline).map_err(|_| UnknownMethod { name: text.into() })
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::RationalOperators => "ro",
            Self::Baseline(method) => method.name(),
        })
    }
}

/// A method with what it needs.
pub enum Prepared {
    /// With its operators.
    RationalOperators(Box<Operators>),
    /// Learns what it needs by itself.
    Baseline(baselines::Method),
}

impl Prepared {
    /// Finds the operators, or refuses those that `method` has no use for.
    ///
    /// # Errors
    /// [`WorkflowError::Parameter`]; why there are no such operators.
    pub fn new(method: Method, asked: Option<&Path>, optics: &Optics) -> Result<Self> {
        match (method, asked) {
            (Method::RationalOperators, asked) => {
                Ok(Self::RationalOperators(Box::new(operators::find(asked, optics)?)))
            }
            (Method::Baseline(method), Some(asked)) => Err(WorkflowError::parameter(
                "operators",
                asked.display(),
                format!("method {method} uses none"),
            )),
            (Method::Baseline(method), None) => Ok(Self::Baseline(method)),
        }
    }

    /// Which method it is.
    pub fn method(&self) -> Method {
        match self {
            Self::RationalOperators(_) => Method::RationalOperators,
            Self::Baseline(method) => Method::Baseline(*method),
        }
    }

    /// Its operators, if it has any.
    pub fn operators(&self) -> Option<&Operators> {
        match self {
            Self::RationalOperators(operators) => Some(operators),
            Self::Baseline(_) => None,
        }
    }

    /// Depth of a pair.
    ///
    /// # Errors
    /// [`WorkflowError::Depth`], [`WorkflowError::Baseline`].
    pub fn depth(&self, pair: &Pair, optics: &Optics, settings: &Settings) -> Result<DepthMap> {
        let (far, near) = (pair.far.view(), pair.near.view());
        Ok(match self {
            Self::RationalOperators(operators) => depth_from_pair(far, near, operators, optics, settings)?,
            Self::Baseline(method) => baselines::depth_from_pair(*method, far, near, optics, settings)?,
        })
    }
}
