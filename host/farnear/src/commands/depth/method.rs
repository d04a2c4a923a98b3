//! How depth is computed: rational operators or a method to compare with.

use std::path::Path;

use anyhow::{Result, bail};
use farnear_depth::{
    baselines,
    operators::Operators,
    optics::Optics,
    pipeline::{DepthMap, Settings, depth_from_pair},
};
use ndarray::Array2;

use crate::files;

/// How depth is computed.
#[derive(Clone, Copy)]
pub enum Method {
    /// `ro`.
    RationalOperators,
    /// Somebody else's.
    Baseline(baselines::Method),
}

/// A method by its name.
pub fn method(text: &str) -> Result<Method, String> {
    if text == "ro" {
        return Ok(Method::RationalOperators);
    }
    let baseline = text.parse().map(Method::Baseline);
    baseline.map_err(|_| "expected ro, subbarao, subbarao-fourier or favaro".to_owned())
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
    pub fn new(method: Method, operators: Option<&Path>, optics: &Optics) -> Result<Self> {
        match (method, operators) {
            (Method::RationalOperators, asked) => {
                Ok(Self::RationalOperators(Box::new(files::operators::find(asked, optics)?)))
            }
            (Method::Baseline(method), Some(_)) => bail!("--method {method} uses no --operators"),
            (Method::Baseline(method), None) => Ok(Self::Baseline(method)),
        }
    }

    /// Its name as the command line writes it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::RationalOperators(_) => "ro",
            Self::Baseline(method) => method.name(),
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
    pub fn depth(
        &self,
        far: &Array2<f32>,
        near: &Array2<f32>,
        optics: &Optics,
        settings: &Settings,
    ) -> Result<DepthMap> {
        let (far, near) = (far.view(), near.view());
        Ok(match self {
            Self::RationalOperators(operators) => depth_from_pair(far, near, operators, optics, settings)?,
            Self::Baseline(method) => baselines::depth_from_pair(*method, far, near, optics, settings)?,
        })
    }
}
