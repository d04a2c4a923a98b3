//! Classification options shared by training and evaluation.

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
    /// Statistics that are aligned with the training clips'.
    pub align: Alignment,
    /// Rounds of learning from the most confident own answers.
    pub self_training: usize,
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
