//! What to type next: the workflows' errors carry facts, the command line knows the commands that mend them.

use farnear_capture::{ClientError, expose::CaptureError, focus::FocusSearchError};
use farnear_protocol::RequestError;
use farnear_workflows::{WorkflowError, correction_file, operators, simulator::SimulatorError};

/// The commands that help with an error, where there are some.
pub fn hint(error: &anyhow::Error) -> Option<String> {
    error.chain().find_map(|cause| {
        cause.downcast_ref().and_then(of_workflow).or_else(|| cause.downcast_ref().and_then(of_client))
    })
}

fn of_workflow(error: &WorkflowError) -> Option<String> {
    match error {
        WorkflowError::About { source, .. } => of_workflow(source),
        WorkflowError::Read { what: operators::KIND, .. } => {
            Some("operators have a name such as gro:linear, or `farnear operators --out` saves them".into())
        }
        WorkflowError::File { expected: operators::KIND, .. } => {
            Some("`farnear operators --out` saves some".into())
        }
        WorkflowError::File { expected: correction_file::KIND, .. } => {
            Some("`farnear calibrate correction --out` saves one".into())
        }
        WorkflowError::NoOptics { .. } => Some("name a file with --optics".into()),
        WorkflowError::Simulator(SimulatorError::Missing) => {
            Some("`cargo xtask install` installs both, `cargo xtask demo` builds them".into())
        }
        WorkflowError::Client(error)
        | WorkflowError::Capture(CaptureError::Board(error))
        | WorkflowError::Focus(FocusSearchError::Capture(CaptureError::Board(error))) => of_client(error),
        _ => None,
    }
}

fn of_client(error: &ClientError) -> Option<String> {
    match error {
        ClientError::Refused { error, .. } => of_refusal(error),
        ClientError::Failed { alarm: Some(record), .. } => Some(clear(record.number)),
        _ => None,
    }
}

fn of_refusal(error: &RequestError) -> Option<String> {
    match error {
        RequestError::Busy { .. } => Some("stop it with `farnear rig stop`".into()),
        RequestError::NotHomed { .. } => Some("`farnear rig home` finds the home switches".into()),
        RequestError::Alarm { number, .. } => Some(clear(*number)),
        _ => None,
    }
}

fn clear(number: u32) -> String {
    format!("then clear it with `farnear rig alarms --clear {number}`")
}
