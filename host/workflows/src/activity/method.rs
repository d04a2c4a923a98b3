//! How activities are told apart: what training and evaluation share.

use farnear_activity::recognition::{
    classifier::Family, experiment::Experiment, frames::Mode, space::SpaceSettings,
};

/// The method.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Method {
    /// What clips are turned into.
    pub pattern: Pattern,
    /// Choose the settings by cross-validation over the training subjects, instead of taking the defaults (quicker).
    pub search: bool,
}

/// What clips are turned into, and by what they are told apart.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Pattern {
    /// Soft assignments to a codebook.
    Codebook {
        /// Whether the order of frames counts.
        mode: Mode,
        /// What tells patterns apart.
        classifier: Family,
    },
    /// Embedded pattern learning (EPL) as in the thesis: 0/1 grids over a 3-D Isomap embedding with k nearest neighbours, order-free.
    Thesis,
}

impl Method {
    /// What is tried and chosen from.
    pub fn experiment(&self) -> Experiment {
        let experiment = match (self.pattern, self.search) {
            (Pattern::Thesis, _) => Experiment::thesis(),
            (Pattern::Codebook { mode, classifier }, true) => {
                Experiment::searched(mode).with_classifier(classifier)
            }
            (Pattern::Codebook { mode, classifier }, false) => {
                Experiment::codebook(SpaceSettings { mode, ..SpaceSettings::default() })
                    .with_classifier(classifier)
            }
        };
        if self.search { experiment } else { experiment.fixed() }
    }

    /// Its name among figures.
    pub fn name(&self) -> &'static str {
        match self.pattern {
            Pattern::Thesis => "thesis",
            Pattern::Codebook { mode: Mode::OrderFree, .. } => "order-free",
            Pattern::Codebook { mode: Mode::Ordered, .. } => "ordered",
        }
    }
}
