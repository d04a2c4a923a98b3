//! Flags that training and evaluation share.

use std::io::IsTerminal;

use clap::{
    Args, ValueEnum,
    builder::{PossibleValuesParser, TypedValueParser},
};
use farnear_recognition::classifier::Family;
use farnear_recognition::frames::Mode;
use farnear_workflows::activity::{
    method::{Method, Pattern},
    shipped::{MODELS, Shipped},
};

/// The method.
#[derive(Args)]
pub struct MethodArguments {
    /// Whether the order of frames counts: order-free (the thesis' promise) or ordered (sitting down is not standing up).
    #[arg(long, default_value = "order-free")]
    mode: Mode,
    /// Embedded pattern learning (EPL) as in the thesis: 0/1 grids over a 3-D Isomap embedding with k nearest neighbours, order-free.
    #[arg(long, value_name = "PATTERN", conflicts_with_all = ["mode", "classifier"])]
    epl: Option<Epl>,
    /// svc (linear support vectors), softmax (logistic regression) or knn (nearest neighbours).
    #[arg(long, default_value = "svc", value_parser = classifiers())]
    classifier: Family,
    /// Tell activities apart by what the network of a model that comes with the program makes of clips: where samples are few, or come from
    /// another camera. The model decides whether the order of frames counts.
    #[arg(long, value_name = "MODEL", conflicts_with_all = ["mode", "epl"], value_parser = shipped())]
    features: Option<&'static Shipped>,
    /// Take the default settings instead of choosing them by cross-validation over the training subjects (quicker).
    #[arg(long)]
    no_search: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Epl {
    Thesis,
}

impl MethodArguments {
    /// Reports on a terminal what will take long.
    pub fn method(&self) -> Method {
        let search = !self.no_search;
        if search && std::io::stderr().is_terminal() {
            eprintln!(
                "settings are chosen by cross-validation over the subjects (--no-search takes the defaults) ..."
            );
        }
        let pattern = match self.epl {
            Some(Epl::Thesis) => Pattern::Thesis,
            None => match self.features {
                Some(model) => Pattern::Features { model, classifier: self.classifier },
                None => Pattern::Codebook { mode: self.mode, classifier: self.classifier },
            },
        };
        Method { pattern, search }
    }
}

fn shipped() -> impl TypedValueParser<Value = &'static Shipped> {
    PossibleValuesParser::new(MODELS.iter().map(|model| model.name))
        .try_map(|name| Shipped::named(&name).ok_or("no model of that name"))
}

/// All names, so that help and completions list them.
fn classifiers() -> impl TypedValueParser<Value = Family> {
    PossibleValuesParser::new(Family::ALL.iter().map(|family| family.name()))
        .try_map(|name| name.parse::<Family>())
}
