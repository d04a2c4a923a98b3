//! The kinds of jobs: a new one is a line in the table and a function that makes a workflow's settings of fields.

mod campaign;
mod depth;
mod evaluate;
mod people;

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{BatchError, Shared, fields::Fields};
use crate::{
    context::Context,
    correct::{self, CorrectSettings},
    error::{Result, WorkflowError},
};

/// A kind of job.
pub(super) struct Kind {
    /// What `do` says.
    pub name: &'static str,
    /// Whether its result is one file and not a folder.
    pub makes_file: bool,
    /// What is to be done, by the fields.
    pub work: fn(&mut Fields) -> Result<Box<dyn Work>>,
}

#[rustfmt::skip]
const KINDS: &[Kind] = &[
    Kind { name: "depth", makes_file: false, work: depth::work },
    Kind { name: "correct", makes_file: true, work: correct_work },
    Kind { name: "silhouettes-video", makes_file: false, work: people::video },
    Kind { name: "silhouettes-markers", makes_file: false, work: people::markers },
    Kind { name: "shadow-remove", makes_file: false, work: people::shadow },
    Kind { name: "recognise", makes_file: false, work: people::recognise },
    Kind { name: "evaluate", makes_file: false, work: evaluate::work },
    Kind { name: "campaign", makes_file: false, work: campaign::work },
];

/// A job that is understood: everything but where its result goes.
pub(super) trait Work {
    /// The files, and folders of files, that the result depends on.
    fn inputs(&self) -> Vec<PathBuf>;

    /// Makes the result at `out`, which is not there yet, and gives its figures.
    fn run(&self, out: &Path, shared: &Shared, context: &Context<'_>) -> Result<Value>;
}

/// The kind of this name.
pub(super) fn kind(name: &str) -> Result<&'static Kind, BatchError> {
    KINDS
        .iter()
        .find(|kind| kind.name == name)
        .ok_or_else(|| BatchError::UnknownKind { name: name.into(), known: names().join(", ") })
}

pub(super) fn is_kind(name: &str) -> bool {
    KINDS.iter().any(|kind| kind.name == name)
}

/// All names, in the table's order.
pub(super) fn names() -> Vec<&'static str> {
    KINDS.iter().map(|kind| kind.name).collect()
}

/// A workflow that is told by its settings, its inputs and how it is called.
struct Call<S> {
    settings: S,
    inputs: Vec<PathBuf>,
    run: fn(&S, &Path, &Shared, &Context<'_>) -> Result<Value>,
}

impl<S> Work for Call<S> {
    fn inputs(&self) -> Vec<PathBuf> {
        self.inputs.clone()
    }

    fn run(&self, out: &Path, shared: &Shared, context: &Context<'_>) -> Result<Value> {
        (self.run)(&self.settings, out, shared, context)
    }
}

/// Figures as they are printed; a number that JSON does not know becomes null.
pub(super) fn value(figures: impl serde::Serialize) -> Result<Value> {
    serde_json::to_value(figures).map_err(|error| {
        WorkflowError::parameter("figures", error, "figures that JSON can hold") // they are plain structs: not met
    })
}

fn correct_work(fields: &mut Fields) -> Result<Box<dyn Work>> {
    let (depth, correction) = (fields.path("depth")?, fields.path("correction")?);
    let out = fields.path("out")?;
    correct::format_of(&out)?;
    let as_board = fields.flag("as_board")?;
    let inputs = vec![depth.clone(), correction.clone()];
    let settings = CorrectSettings { depth, correction, out, as_board };
    Ok(Box::new(Call {
        settings,
        inputs,
        run: |settings, out, _, context| {
            value(correct::apply(&CorrectSettings { out: out.into(), ..settings.clone() }, context)?)
        },
    }))
}
