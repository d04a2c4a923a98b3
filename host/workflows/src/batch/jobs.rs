//! Kinds of jobs: a line in the table and a function that builds a workflow's settings from fields.

mod campaign;
mod evaluate;

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{BatchError, fields::Fields};
use crate::{
    activity::recognise::RecogniseRequest,
    context::Context,
    correct::CorrectRequest,
    depth::DepthRequest,
    error::{Result, WorkflowError},
    focus_stack::FocusStackRequest,
    request::{Job, PathKind, Request, Task},
    shadow::removal::ShadowRemoveRequest,
    silhouettes::{markers::MarkersRequest, passages::PassagesRequest, video::SilhouettesVideoRequest},
};

pub(super) struct Kind {
    pub name: &'static str,
    pub makes_file: bool,
    pub work: fn(&mut Fields) -> Result<Box<dyn Job>>,
}

#[rustfmt::skip]
const KINDS: &[Kind] = &[
    Kind::of::<DepthRequest>(),
    Kind::of::<FocusStackRequest>(),
    Kind::of::<CorrectRequest>(),
    Kind::of::<SilhouettesVideoRequest>(),
    Kind::of::<PassagesRequest>(),
    Kind::of::<MarkersRequest>(),
    Kind::of::<ShadowRemoveRequest>(),
    Kind::of::<RecogniseRequest>(),
    Kind { name: "evaluate", makes_file: false, work: evaluate::work },
    Kind { name: "campaign", makes_file: false, work: campaign::work },
];

impl Kind {
    const fn of<R: Request>() -> Self {
        Self {
            name: R::NAME,
            makes_file: matches!(Task::of::<R>().output(), Some((_, PathKind::OutputFile))),
            work: |fields| {
                let base = fields.base().to_path_buf();
                (Task::of::<R>().job)(fields.take_all(), &base)
            },
        }
    }
}

impl Kind {
    /// Accepts hyphens between the words of a command: `silhouettes-video`.
    fn is_named(&self, name: &str) -> bool {
        self.name.replace(' ', "-") == name.replace(' ', "-")
    }
}

pub(super) fn kind(name: &str) -> Result<&'static Kind, BatchError> {
    KINDS
        .iter()
        .find(|kind| kind.is_named(name))
        .ok_or_else(|| BatchError::UnknownKind { name: name.into(), known: names().join(", ") })
}

pub(super) fn is_kind(name: &str) -> bool {
    KINDS.iter().any(|kind| kind.is_named(name))
}

pub(super) fn names() -> Vec<String> {
    KINDS.iter().map(|kind| kind.name.replace(' ', "-")).collect()
}

struct Call<S> {
    settings: S,
    inputs: Vec<PathBuf>,
    run: fn(&S, &Path, &Context<'_>) -> Result<Value>,
}

impl<S: Send> Job for Call<S> {
    fn inputs(&self) -> Vec<PathBuf> {
        self.inputs.clone()
    }

    fn run(&self, out: &Path, context: &Context<'_>) -> Result<Value> {
        (self.run)(&self.settings, out, context)
    }
}

/// Figures as printed. A number that JSON cannot represent becomes null.
pub(super) fn value(figures: impl serde::Serialize) -> Result<Value> {
    serde_json::to_value(figures).map_err(|error| {
        WorkflowError::parameter("figures", error, "figures that JSON can hold") // they are plain structs: not met
    })
}
