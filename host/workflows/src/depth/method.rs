//! Depth methods: rational operators, or baselines for comparison.

use std::{fmt, path::Path, str::FromStr, sync::Arc};

use farnear_depth::{baselines, measure::DepthMethod, operators::Operators, optics::Optics};

use crate::{
    cache::Cache,
    error::{Result, WorkflowError},
};

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Method {
    RationalOperators,
    /// `whitened`: operators with a white residual.
    Whitened,
    Baseline(baselines::Method),
}

#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("expected ro, whitened, subbarao, subbarao-fourier or favaro")]
pub struct UnknownMethod {
    pub name: String,
}

impl FromStr for Method {
    type Err = UnknownMethod;

    fn from_str(text: &str) -> Result<Self, UnknownMethod> {
        if text == "ro" {
            return Ok(Self::RationalOperators);
        }
        if text == "whitened" {
            return Ok(Self::Whitened);
        }
        text.parse().map(Self::Baseline).map_err(|_| UnknownMethod { name: text.into() })
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::RationalOperators => "ro",
            Self::Whitened => "whitened",
            Self::Baseline(method) => method.name(),
        })
    }
}

pub enum Prepared {
    RationalOperators(Arc<Operators>),
    /// Its kernels are designed for the optics.
    Whitened,
    Baseline(baselines::Method),
}

impl Prepared {
    /// Finds the operators; rejects operators that `method` does not use.
    pub fn new(method: Method, asked: Option<&Path>, optics: &Optics, cache: &Cache) -> Result<Self> {
        match (method, asked) {
            (Method::RationalOperators, asked) => {
                Ok(Self::RationalOperators(cache.operators(asked, optics)?))
            }
            (Method::Whitened | Method::Baseline(_), Some(asked)) => Err(WorkflowError::parameter(
                "operators",
                asked.display(),
                format!("method {method} uses none"),
            )),
            (Method::Whitened, None) => Ok(Self::Whitened),
            (Method::Baseline(method), None) => Ok(Self::Baseline(method)),
        }
    }

    pub fn method(&self) -> Method {
        match self {
            Self::RationalOperators(_) => Method::RationalOperators,
            Self::Whitened => Method::Whitened,
            Self::Baseline(method) => Method::Baseline(*method),
        }
    }

    pub fn operators(&self) -> Option<&Operators> {
        match self {
            Self::RationalOperators(operators) => Some(operators),
            Self::Whitened | Self::Baseline(_) => None,
        }
    }

    pub fn as_real(&self) -> DepthMethod<'_> {
        match self {
            Self::RationalOperators(operators) => DepthMethod::Rational(operators),
            Self::Whitened => DepthMethod::Whitened,
            Self::Baseline(method) => DepthMethod::Baseline(*method),
        }
    }
}
