//! Errors as the page receives them.

use axum::{
    Json,
    http::StatusCode,
    response::{IntoResponse, Response},
};
use farnear_capture::{ClientError, expose::CaptureError, focus::FocusSearchError};
use farnear_protocol::RequestError;
use farnear_workflows::{WorkflowError, simulator::SimulatorError};
use schemars::JsonSchema;
use serde::Serialize;

use crate::stopping::StopError;

/// Why a request was not carried out.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, JsonSchema)]
pub struct Failure {
    /// Message with the offending value and the expected ones.
    pub error: String,
    /// What to do on the page.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hint: Option<String>,
    #[serde(skip)]
    #[schemars(skip)]
    status: StatusCode,
}

impl Failure {
    pub fn new(status: StatusCode, error: impl Into<String>) -> Self {
        Self { error: error.into(), hint: None, status }
    }

    pub fn with_hint(self, hint: impl Into<String>) -> Self {
        Self { hint: Some(hint.into()), ..self }
    }

    pub fn bad_request(error: impl Into<String>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, error)
    }

    pub fn missing(what: &str) -> Self {
        Self::new(StatusCode::NOT_FOUND, format!("there is no {what}"))
    }

    pub fn busy(with: &str) -> Self {
        Self::new(StatusCode::CONFLICT, format!("busy: {with}")).with_hint("Wait for its end, or press Stop.")
    }
}

impl IntoResponse for Failure {
    fn into_response(self) -> Response {
        (self.status, Json(self)).into_response()
    }
}

impl From<WorkflowError> for Failure {
    fn from(error: WorkflowError) -> Self {
        let status = match &error {
            error if error.is_usage() => StatusCode::BAD_REQUEST,
            WorkflowError::Optics(_) | WorkflowError::Parse(_) => StatusCode::BAD_REQUEST,
            WorkflowError::Read { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                StatusCode::NOT_FOUND
            }
            _ => StatusCode::INTERNAL_SERVER_ERROR,
        };
        let hint = hint(&error).map(Into::into);
        Self { error: error.to_string(), hint, status }
    }
}

impl From<StopError> for Failure {
    fn from(error: StopError) -> Self {
        match error {
            StopError::Unanswered => Self::new(StatusCode::GATEWAY_TIMEOUT, error.to_string()),
            StopError::Workflow(error) => error.into(),
        }
    }
}

/// Remedies on the page for errors of workflows.
pub fn hint(error: &WorkflowError) -> Option<&'static str> {
    match error {
        WorkflowError::About { source, .. } => hint(source),
        WorkflowError::Simulator(SimulatorError::Missing { .. }) => Some(
            "Build the emulated rig with `cargo xtask demo`, or install both with `cargo xtask install`.",
        ),
        WorkflowError::Client(error)
        | WorkflowError::Capture(CaptureError::Board(error))
        | WorkflowError::Focus(FocusSearchError::Capture(CaptureError::Board(error))) => of_client(error),
        _ => None,
    }
}

fn of_client(error: &ClientError) -> Option<&'static str> {
    match error {
        ClientError::Refused { error: RequestError::NotHomed { .. }, .. } => Some("Press Home first."),
        ClientError::Refused { error: RequestError::Busy { .. }, .. } => Some("Press Stop, then try again."),
        ClientError::Refused { error: RequestError::Alarm { .. }, .. }
        | ClientError::Failed { alarm: Some(_), .. } => Some("Mend the cause, then clear the alarm."),
        _ => None,
    }
}
