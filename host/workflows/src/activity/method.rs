//! Classification options shared by training and evaluation.

use std::{str::FromStr, sync::Arc};

use farnear_recognition::classifier::Family;
use farnear_recognition::experiment::Experiment;
use farnear_recognition::frames::Mode;
use farnear_recognition::space::SpaceSettings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use super::shipped::{self, Shipped};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
};

/// Options of the classifier.
#[serde_as]
#[derive(Clone, Default, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[serde(default)]
pub struct MethodOptions {
    /// Whether the order of frames counts: order-free (the thesis' promise) or ordered (sitting down is not standing up) [default:
    /// order-free].
    #[cfg_attr(feature = "clap", arg(long))]
    #[schemars(with = "Option<String>")]
    pub mode: Option<Mode>,
    /// Embedded pattern learning (EPL) as in the thesis: 0/1 grids over a 3-D Isomap embedding with k nearest neighbours, order-free.
    #[cfg_attr(feature = "clap", arg(long, value_name = "thesis"))]
    pub epl: Option<Epl>,
    /// svc (linear support vectors), softmax (logistic regression) or knn (nearest neighbours) [default: svc].
    #[cfg_attr(feature = "clap", arg(long))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub classifier: Option<Family>,
    /// Tell activities apart by what the network of a model that comes with the program makes of clips: where samples are few, or come from
    /// another camera. The model decides whether the order of frames counts.
    #[cfg_attr(feature = "clap", arg(long, value_name = "MODEL"))]
    pub features: Option<String>,
    /// Take the default settings instead of choosing them by cross-validation over the training subjects (quicker).
    #[cfg_attr(feature = "clap", arg(long))]
    pub no_search: bool,
}

/// Variants of embedded pattern learning.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Epl {
    Thesis,
}

impl FromStr for Epl {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "thesis" => Ok(Self::Thesis),
            other => Err(format!("unknown variant `{other}`: expected thesis")),
        }
    }
}

impl MethodOptions {
    /// Fails for options that exclude each other, and for an unknown model.
    pub fn method(&self) -> Result<Method> {
        let Self { mode, epl, classifier, features, no_search } = self;
        let pattern = match (epl, features) {
            (Some(_), _) => {
                let others = [
                    ("--mode", mode.is_some()),
                    ("--classifier", classifier.is_some()),
                    ("--features", features.is_some()),
                ];
                none_of("epl", "thesis", others)?;
                Pattern::Thesis
            }
            (None, Some(name)) => {
                none_of("features", name, [("--mode", mode.is_some())])?;
                let model = Shipped::named(name).ok_or_else(|| {
                    WorkflowError::parameter("features", name, format!("expected {}", shipped::names()))
                })?;
                Pattern::Features { model, classifier: classifier.unwrap_or(Family::Svc) }
            }
            (None, None) => Pattern::Codebook {
                mode: mode.unwrap_or_default(),
                classifier: classifier.unwrap_or(Family::Svc),
            },
        };
        Ok(Method { pattern, search: !no_search })
    }

    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// Fails for the first option that is given although `name` excludes it.
pub(super) fn none_of<const N: usize>(
    name: &'static str,
    value: impl ToString,
    others: [(&str, bool); N],
) -> Result<()> {
    match others.into_iter().find(|(_, given)| *given) {
        None => Ok(()),
        Some((other, _)) => {
            Err(WorkflowError::parameter(name, value, format!("cannot be used with {other}")))
        }
    }
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Method {
    pub pattern: Pattern,
    /// By cross-validation over the training subjects, instead of using the defaults (faster).
    pub search: bool,
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Pattern {
    Codebook {
        /// Whether the order of frames counts.
        mode: Mode,
        classifier: Family,
    },
    /// Features from the network of a shipped model.
    Features { model: &'static Shipped, classifier: Family },
    /// Embedded pattern learning (EPL) as in the thesis: 0/1 grids over a 3-D Isomap embedding, order-free kNN.
    Thesis,
}

impl Method {
    /// Reports that a search takes long.
    pub(super) fn announce(&self, context: &Context<'_>) {
        if self.search {
            context.info(
                "settings are chosen by cross-validation over the subjects (--no-search takes the defaults)",
            );
        }
    }

    /// Candidates of the search, for full frames or cropped silhouettes.
    pub fn experiment(&self, full_frames: bool) -> Result<Experiment> {
        let experiment = match (self.pattern, self.search) {
            (Pattern::Features { model, classifier }, _) => {
                let [full, cut_out] = model.recognisers()?;
                Experiment::on_features(if full_frames { full } else { cut_out }.space, classifier)
            }
            (Pattern::Thesis, _) => Experiment::thesis(),
            (Pattern::Codebook { mode, classifier }, true) => {
                Experiment::searched(mode).with_classifier(classifier)
            }
            (Pattern::Codebook { mode, classifier }, false) => {
                Experiment::codebook(SpaceSettings { mode, ..SpaceSettings::default() })
                    .with_classifier(classifier)
            }
        };
        // The thesis has no unknown class.
        let second = match self.pattern {
            Pattern::Thesis => None,
            _ => Some(Arc::new(shipped::auxiliary_model(full_frames)?)),
        };
        let experiment = Experiment { second, ..experiment };
        Ok(if self.search { experiment } else { experiment.fixed() })
    }

    pub fn name(&self) -> &'static str {
        match self.pattern {
            Pattern::Thesis => "thesis",
            Pattern::Features { model, .. } => model.name,
            Pattern::Codebook { mode: Mode::OrderFree, .. } => "order-free",
            Pattern::Codebook { mode: Mode::Ordered, .. } => "ordered",
        }
    }
}
