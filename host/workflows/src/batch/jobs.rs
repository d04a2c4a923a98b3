//! Kinds of jobs: tasks that write their result to `out` and need no rig, and campaigns.

use super::{BatchError, campaign::CampaignRequest};
use crate::request::{TASKS, Task};

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::PathKind;

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
}
