//! Kinds of jobs, each with its fields.

mod campaign;
mod evaluate;

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{BatchError, fields::Fields};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    request::{Job, PathKind, TASKS, Task},
};

/// What a job does: any task that writes its result to `out` and needs no rig, or one of two more.
#[derive(Clone, Copy)]
pub(super) enum Kind {
    Task(&'static Task),
    Evaluate,
    Campaign,
}

impl Kind {
    fn all() -> impl Iterator<Item = Self> {
        let tasks = TASKS.iter().filter(|task| task.output().is_some_and(|(name, _)| name == "out"));
        tasks.map(Self::Task).chain([Self::Evaluate, Self::Campaign])
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Task(task) => task.name,
            Self::Evaluate => "evaluate",
            Self::Campaign => "campaign",
        }
    }

    pub fn makes_file(self) -> bool {
        matches!(self, Self::Task(task) if matches!(task.output(), Some((_, PathKind::OutputFile))))
    }

    pub fn job(self, fields: &mut Fields) -> Result<Box<dyn Job>> {
        match self {
            Self::Task(task) => {
                let base = fields.base().to_path_buf();
                (task.job)(fields.take_all(), &base)
            }
            Self::Evaluate => evaluate::work(fields),
            Self::Campaign => campaign::work(fields),
        }
    }

    /// Accepts hyphens between the words of a command: `silhouettes-video`.
    fn is_named(self, name: &str) -> bool {
        self.name().replace(' ', "-") == name.replace(' ', "-")
    }
}

pub(super) fn kind(name: &str) -> Result<Kind, BatchError> {
    Kind::all()
        .find(|kind| kind.is_named(name))
        .ok_or_else(|| BatchError::UnknownKind { name: name.into(), known: names().join(", ") })
}

pub(super) fn is_kind(name: &str) -> bool {
    Kind::all().any(|kind| kind.is_named(name))
}

pub(super) fn names() -> Vec<String> {
    Kind::all().map(|kind| kind.name().replace(' ', "-")).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_task_with_a_result_is_a_job_but_none_that_moves_a_rig() {
        let names = names();
        for name in
            ["depth", "focus-stack", "calibrate-stack", "calibrate-camera", "activity-recognise", "report"]
        {
            assert!(names.iter().any(|known| known == name), "{name} of {names:?}");
        }
        assert!(!names.iter().any(|name| name.starts_with("rig")), "{names:?}");
        assert!(kind("calibrate stack").is_ok_and(Kind::makes_file));
    }
}
