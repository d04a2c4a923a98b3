//! What can go wrong in a workflow, as facts: which value, which file, what was expected. What to type or click next is
//! for the face to add.

use std::path::{Path, PathBuf};

use farnear_capture::{
    ClientError, board_correction::BoardCorrectionError, camera::CameraError, expose::CaptureError,
    focus::FocusSearchError, plan::PlanError, record::RecordError,
};
use farnear_depth::{operators::DesignError, optics::OpticsError};
use farnear_files::{
    EncodeError, image_file::ImageError, map::MapError, masks::MaskError, staging::StagingError,
    video::VideoError,
};

/// What a workflow gives.
pub type Result<T, E = WorkflowError> = std::result::Result<T, E>;

/// Why a workflow came to no result.
#[derive(Debug, thiserror::Error)]
pub enum WorkflowError {
    /// A parameter that cannot be, or contradicts another: bad usage, found before anything was done.
    #[error("{name} {value}: {expected}")]
    Parameter {
        /// The parameter, as the field's users call it; faces translate it to their own word.
        name: &'static str,
        /// The offending value.
        value: String,
        /// What was expected.
        expected: String,
    },
    /// A file that does not hold what it should.
    #[error("{} does not hold {expected}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What was expected in it.
        expected: &'static str,
        /// What is wrong.
        reason: String,
    },
    /// A file that cannot be read at all.
    #[error("cannot read {what} {}: {source}", path.display())]
    Read {
        /// What it would have been: "the optics file".
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The user, or whoever speaks for them, gave the work up; a rig has been stopped.
    #[error("interrupted while {during}")]
    Cancelled {
        /// What was under way.
        during: String,
    },
    /// A question that nobody answered.
    #[error("nobody answers, the input has ended: {question}")]
    Unanswered {
        /// The question.
        question: String,
    },
    /// Nothing says what optics a pair was taken with.
    #[error("no optics: none were named, and neither capture.toml nor optics.toml lies beside {}", far.display())]
    NoOptics {
        /// The pair's far-focused image.
        far: PathBuf,
    },
    /// The same, about something.
    #[error("{about}: {source}")]
    About {
        /// What it is about: a pair, a file, a step.
        about: String,
        /// What went wrong.
        source: Box<Self>,
    },
    /// Values that make no optics.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// A design of operators that cannot be.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// A text that is not TOML of the expected kind.
    #[error(transparent)]
    Parse(#[from] toml::de::Error),
    /// The emulated rig.
    #[error(transparent)]
    Simulator(#[from] crate::simulator::SimulatorError),
    /// The board, or the way to it.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// Exposures.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// Where the stages would have to go.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The search for the focus.
    #[error(transparent)]
    Focus(#[from] FocusSearchError),
    /// A capture's record.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Correction by the board.
    #[error(transparent)]
    BoardCorrection(#[from] BoardCorrectionError),
    /// An image file.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A map of numbers.
    #[error(transparent)]
    Map(#[from] MapError),
    /// Masks.
    #[error(transparent)]
    Masks(#[from] MaskError),
    /// Video.
    #[error(transparent)]
    Video(#[from] VideoError),
    /// An encoder.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// Results that cannot be put in place.
    #[error(transparent)]
    Staging(#[from] StagingError),
    /// A record that cannot be put into TOML.
    #[error("cannot write a record: {0}")]
    Toml(#[from] toml::ser::Error),
}

impl WorkflowError {
    /// A parameter that cannot be.
    pub fn parameter(name: &'static str, value: impl ToString, expected: impl Into<String>) -> Self {
        Self::Parameter { name, value: value.to_string(), expected: expected.into() }
    }

    /// For `map_err`: a file that does not hold what it should.
    pub fn file<E: std::fmt::Display>(path: &Path, expected: &'static str) -> impl FnOnce(E) -> Self {
        move |error| Self::File { path: path.into(), expected, reason: error.to_string() }
    }

    /// For `map_err`: a file that cannot be read.
    pub fn read(what: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::Read { what, path: path.into(), source }
    }

    /// Whether what was asked for was wrong, and not the world: nothing has been done.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Parameter { .. } => true,
            Self::About { source, .. } => source.is_usage(),
            _ => false,
        }
    }
}

/// Says what an error is about.
pub trait About<T> {
    /// The same result, whose error names what it is about.
    ///
    /// # Errors
    /// As before.
    fn about(self, about: impl FnOnce() -> String) -> Result<T>;
}

impl<T, E: Into<WorkflowError>> About<T> for std::result::Result<T, E> {
    fn about(self, about: impl FnOnce() -> String) -> Result<T> {
        self.map_err(|error| WorkflowError::About { about: about(), source: Box::new(error.into()) })
    }
}
