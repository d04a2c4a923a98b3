//! Kinds of jobs: tasks that write their result to `out` and need no rig, and campaigns.

use super::{BatchError, campaign::CampaignRequest, fields::Fields};
use crate::request::{PathKind, TASKS, Task};

const CAMPAIGN: Task = Task::of::<CampaignRequest>();

fn all() -> impl Iterator<Item = &'static Task> {
    let tasks = TASKS.iter().filter(|task| task.output().is_some_and(|(name, _)| name == "out"));
    tasks.chain([&CAMPAIGN])
}

/// Words of a command may be joined by hyphens: `silhouettes-video`.
fn named(name: &str) -> Option<&'static Task> {
    all().find(|task| task.name.replace(' ', "-") == name.replace(' ', "-"))
}

pub(super) fn kind(name: &str) -> Result<&'static Task, BatchError> {
    named(name).ok_or_else(|| BatchError::UnknownKind { name: name.into(), known: names().join(", ") })
}

pub(super) fn is_kind(name: &str) -> bool {
    named(name).is_some()
}

pub(super) fn names() -> Vec<String> {
    all().map(|task| task.name.replace(' ', "-")).collect()
}

/// Refuses fields for further results: only `out` is moved into place when complete, recorded and kept from other jobs.
pub(super) fn check_outputs(task: &Task, fields: &Fields) -> Result<(), BatchError> {
    let is_output = |kind: &PathKind| matches!(kind, PathKind::OutputFile | PathKind::OutputFolder);
    let further = task.paths.iter().filter(|(name, kind)| *name != "out" && is_output(kind));
    for (name, _) in further {
        if let Some(value) = fields.all().get(*name) {
            let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            let reason = format!("leave `{name}` out in a batch, where a job writes only `out`");
            return Err(BatchError::field(*name, value, reason));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn every_task_with_a_result_is_a_job_but_none_that_moves_a_rig() {
        let names = names();
        for name in [
            "depth",
            "focus-stack",
            "calibrate-stack",
            "calibrate-camera",
            "activity-train",
            "activity-recognise",
            "activity-evaluate",
            "report",
            "campaign",
        ] {
            assert!(names.iter().any(|known| known == name), "{name} of {names:?}");
        }
        assert!(!names.iter().any(|name| name.starts_with("rig")), "{names:?}");
        let output = kind("calibrate stack").expect("a kind").output();
        assert_eq!(output, Some(("out", PathKind::OutputFile)));
    }

    #[test]
    fn a_job_writes_nothing_but_its_out() {
        for (name, field) in [
            ("operators", "plot"),
            ("calibrate-stack", "plot"),
            ("shadow-remove", "stages"),
            ("activity-recognise", "video-out"),
            ("silhouettes-video", "labels"),
        ] {
            let mut fields = Fields::new(Path::new(""));
            fields.insert("out", vec!["a".into()]).expect("a new field");
            assert!(check_outputs(kind(name).expect("a kind"), &fields).is_ok());
            fields.insert(field, vec!["b".into()]).expect("a new field");
            let error = check_outputs(kind(name).expect("a kind"), &fields).expect_err("refused").to_string();
            let field = field.replace('-', "_");
            assert!(error.starts_with(&format!("the field `{field}` is b: leave `{field}` out")), "{error}");
        }
    }
}
