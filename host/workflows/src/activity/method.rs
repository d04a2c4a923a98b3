//! How activities are classified: options that training and evaluation share.

use std::sync::Arc;

use farnear_recognition::alignment::Alignment;
use farnear_recognition::classifier::Family;
use farnear_recognition::experiment::Experiment;
use farnear_recognition::frames::Mode;
use farnear_recognition::space::SpaceSettings;

use super::shipped::{self, Shipped};
use crate::error::Result;

/// Adaptation to unlabelled clips from another camera, sensor or laboratory.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Adaptation {
    /// What of their frames is brought to the training clips'.
    pub align: Alignment,
    /// Rounds of learning from one's own surest answers for them.
    pub self_training: usize,
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Method {
    /// What clips are turned into.
    pub pattern: Pattern,
    /// Choose the settings by cross-validation over the training subjects, instead of taking the defaults (quicker).
    pub search: bool,
}

/// Features and classifier.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Pattern {
    /// Soft assignments to a codebook.
    Codebook {
        /// Whether the order of frames counts.
        mode: Mode,
        /// What tells patterns apart.
        classifier: Family,
    },
    /// What the network of a model that comes with the program gives.
    Features {
        /// The model's name.
        model: &'static Shipped,
        /// What tells patterns apart.
        classifier: Family,
    },
    /// Embedded pattern learning (EPL) as in the thesis: 0/1 grids over a 3-D Isomap embedding with k nearest neighbours, order-free.
    Thesis,
}

impl Method {
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
        // The thesis knows no unknown.
        let second = match self.pattern {
            Pattern::Thesis => None,
            _ => Some(Arc::new(shipped::auxiliary_model(full_frames)?)),
        };
        let experiment = Experiment { second, ..experiment };
        Ok(if self.search { experiment } else { experiment.fixed() })
    }

    /// Its name among figures.
    pub fn name(&self) -> &'static str {
        match self.pattern {
            Pattern::Thesis => "thesis",
            Pattern::Features { model, .. } => model.name,
            Pattern::Codebook { mode: Mode::OrderFree, .. } => "order-free",
            Pattern::Codebook { mode: Mode::Ordered, .. } => "ordered",
        }
    }
}
