//! How activities are told apart: the flags that training and evaluation share.

use std::io::IsTerminal;

use clap::{Args, ValueEnum};
use farnear_activity::recognition::{
    classifier::Family, experiment::Experiment, frames::Mode, space::SpaceSettings,
};

/// The method.
#[derive(Args)]
pub struct Method {
    /// Whether the order of frames counts: order-free (the thesis' promise) or ordered (sitting down is not standing up).
    #[arg(long, default_value = "order-free")]
    mode: Mode,
    /// Embedded pattern learning (EPL) as in the thesis: 0/1 grids over a 3-D Isomap embedding with k nearest neighbours, order-free.
    #[arg(long, value_name = "PATTERN", conflicts_with_all = ["mode", "classifier"])]
    epl: Option<Epl>,
    /// svc (linear support vectors) or knn (nearest neighbours).
    #[arg(long, default_value = "svc")]
    classifier: Family,
    /// Take the default settings instead of choosing them by cross-validation over the training subjects (quicker).
    #[arg(long)]
    no_search: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Epl {
    Thesis,
}

impl Method {
    /// What is tried and chosen from.
    pub fn experiment(&self) -> Experiment {
        let experiment = match (self.epl, self.no_search) {
            (Some(Epl::Thesis), _) => Experiment::thesis(),
            (None, false) => Experiment::searched(self.mode),
            (None, true) => {
                Experiment::codebook(SpaceSettings { mode: self.mode, ..SpaceSettings::default() })
            }
        };
        // The thesis' pattern keeps the thesis' classifier.
        let experiment = match self.epl {
            None => experiment.with_classifier(self.classifier),
            Some(Epl::Thesis) => experiment,
        };
        if self.no_search { experiment.fixed() } else { experiment }
    }

    /// Says on a terminal what takes so long.
    pub fn announce(&self) {
        if !self.no_search && std::io::stderr().is_terminal() {
            eprintln!(
                "choosing settings by cross-validation over the subjects (--no-search takes the defaults) ..."
            );
        }
    }

    /// Its name among figures.
    pub fn name(&self) -> &'static str {
        match (self.epl, self.mode) {
            (Some(Epl::Thesis), _) => "thesis",
            (None, Mode::OrderFree) => "order-free",
            (None, Mode::Ordered) => "ordered",
        }
    }
}
