//! Errors of workflows: the value or file, and what was expected. Interfaces add what to do.

use std::path::{Path, PathBuf};

use farnear_capture::{
    ClientError, board_correction::BoardCorrectionError, camera::CameraError, expose::CaptureError,
    focus::FocusSearchError, log_stream::LogEnded, plan::PlanError, record::RecordError,
    sequence::ProgramError,
};
use farnear_depth::{
    baselines::BaselineError,
    calibrate::CalibrationError,
    corrections::CorrectionError,
    focus_stack::StackError,
    measure::MeasureError,
    metrics::CompareError,
    operators::DesignError,
    optics::OpticsError,
    pipeline::RunError,
    prepare::{CameraError as CameraFramesError, PrepareError},
};
use farnear_files::{
    EncodeError, image_file::ImageError, map::MapError, masks::MaskError, staging::StagingError,
    video::VideoError,
};
use farnear_recognition::evaluation::leave_one_out::EvaluationError;
use farnear_recognition::model::ModelError;
use farnear_shadow::ShadowError;
use farnear_shadow::camera::CameraError as CameraFileError;
use farnear_shadow::detectors::ImagesError;
use farnear_shadow::score::ShapeError;
use farnear_shadow::sun::SunError;
use farnear_shadow::uncertainty::UncertaintyError;
use farnear_silhouettes::background::BackgroundError;

pub type Result<T, E = WorkflowError> = std::result::Result<T, E>;

#[derive(Debug, thiserror::Error)]
pub enum WorkflowError {
    /// Bad usage, found before any work.
    #[error("{name} {value}: {expected}")]
    Parameter {
        /// The field's term; interfaces translate it to their own.
        name: &'static str,
        value: String,
        expected: String,
    },
    #[error(transparent)]
    Request(#[from] crate::request::RequestError),
    #[error("{} does not hold {expected}: {reason}", path.display())]
    File { path: PathBuf, expected: &'static str, reason: String },
    #[error("cannot read {what} {}: {source}", path.display())]
    Read {
        /// For example "the optics file".
        what: &'static str,
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("interrupted while {during}")]
    Cancelled { during: String },
    #[error(
        "the sharpest image lies {sensor_mm:.4} mm behind the lens, inside its focal length of {focal_length_mm} mm: move the \
         coarse stage into focus before the stack; if it was, the rig's setting datum_nm is wrong"
    )]
    InsideFocalLength { sensor_mm: f64, focal_length_mm: f64 },
    /// Board and host calculate different bits.
    #[error("the board's answer differs from this computer's: {0}")]
    Differs(String),
    #[error("{failed} of the steps failed; put that right before anything moves further (docs/bring-up.md)")]
    StepsFailed { failed: usize, alarm: Option<u32> },
    #[error("the result cannot be passed on: {source}")]
    Sink { source: std::io::Error },
    #[error("cannot make the folder {}: {source}", folder.display())]
    Folder { folder: PathBuf, source: std::io::Error },
    #[error("no answer, the input has ended: {question}")]
    Unanswered { question: String },
    #[error("no optics: none were named, and neither capture.toml nor optics.toml is next to {}", far.display())]
    NoOptics { far: PathBuf },
    #[error(
        "no optics: distances from lens to sensor give object distances only with a lens; none was named, and the stack {} has \
         neither capture.toml nor optics.toml",
        stack.display()
    )]
    NoStackOptics { stack: PathBuf },
    #[error("{} and {}: {reason}", far.display(), near.display())]
    Pair { far: PathBuf, near: PathBuf, reason: String },
    #[error("{about}: {source}")]
    About { about: String, source: Box<Self> },
    #[error(transparent)]
    Optics(#[from] OpticsError),
    #[error(transparent)]
    Depth(#[from] RunError),
    #[error(transparent)]
    Baseline(#[from] BaselineError),
    #[error(transparent)]
    Parse(#[from] toml::de::Error),
    #[error(transparent)]
    Simulator(#[from] crate::simulator::SimulatorError),
    #[error(transparent)]
    Client(#[from] ClientError),
    #[error(transparent)]
    Capture(#[from] CaptureError),
    #[error(transparent)]
    Camera(#[from] CameraError),
    #[error(transparent)]
    Focus(#[from] FocusSearchError),
    #[error(transparent)]
    BoardCorrection(#[from] BoardCorrectionError),
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error(transparent)]
    Masks(#[from] MaskError),
    #[error(transparent)]
    Video(#[from] VideoError),
    #[error("cannot start a thread: {reason}")]
    Thread { reason: String },
    #[error(transparent)]
    Sun(#[from] SunError),
    #[error(transparent)]
    Silhouettes(#[from] crate::silhouettes::SilhouettesError),
    #[error(transparent)]
    Background(#[from] BackgroundError),
    #[error(transparent)]
    Shadow(#[from] ShadowError),
    #[error(transparent)]
    Samples(#[from] crate::activity::samples::SamplesError),
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error("cannot write a record: {0}")]
    Toml(#[from] toml::ser::Error),
    /// An error of a library that no caller tells from others.
    #[error(transparent)]
    Library(Box<dyn std::error::Error + Send + Sync>),
}

macro_rules! library_errors {
    ($($error:ty),+ $(,)?) => {
        $(impl From<$error> for WorkflowError {
            fn from(error: $error) -> Self {
                Self::Library(Box::new(error))
            }
        })+
    };
}

library_errors! {
    CalibrationError,
    CameraFileError,
    CameraFramesError,
    CompareError,
    CorrectionError,
    DesignError,
    EncodeError,
    EvaluationError,
    ImagesError,
    LogEnded,
    MapError,
    PlanError,
    ProgramError,
    RecordError,
    ShapeError,
    StackError,
    StagingError,
    UncertaintyError,
    crate::activity::motion::MotionError,
    crate::activity::multi_person::MultiPersonError,
    crate::activity::recognition::ViewsError,
    crate::batch::BatchError,
    crate::shadow::score::ScoreError,
    farnear_files::stack::StackError,
}

impl From<PrepareError> for WorkflowError {
    fn from(error: PrepareError) -> Self {
        match error {
            PrepareError::Pair(error) => Self::Depth(error),
            PrepareError::Camera(error) => error.into(),
            PrepareError::Optics(error) => error.into(),
            error @ PrepareError::Unrelated { .. } => Self::Library(Box::new(error)),
        }
    }
}

impl From<MeasureError> for WorkflowError {
    fn from(error: MeasureError) -> Self {
        match error {
            MeasureError::Run(error) => Self::Depth(error),
            MeasureError::Prepare(error) => error.into(),
            MeasureError::Baseline(error) => Self::Baseline(error),
            MeasureError::Design(error) => error.into(),
            MeasureError::LearnedForWhitened => Self::parameter(
                "method",
                "ro or another",
                "the optics were learned by calibrate stack: use --method whitened",
            ),
            MeasureError::FixedWindow => Self::parameter(
                "window",
                "adaptive",
                "only method whitened chooses windows: give a number of pixels",
            ),
        }
    }
}

impl WorkflowError {
    pub fn parameter(name: &'static str, value: impl ToString, expected: impl Into<String>) -> Self {
        Self::Parameter { name, value: value.to_string(), expected: expected.into() }
    }

    /// For `map_err`: a file with invalid contents.
    pub fn file<E: std::fmt::Display>(path: &Path, expected: &'static str) -> impl FnOnce(E) -> Self {
        move |error| Self::File { path: path.into(), expected, reason: error.to_string() }
    }

    pub fn read(what: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::Read { what, path: path.into(), source }
    }

    pub fn is_cancelled(&self) -> bool {
        match self {
            Self::Cancelled { .. }
            | Self::Client(ClientError::Interrupted { .. })
            | Self::Capture(CaptureError::Board(ClientError::Interrupted { .. }))
            | Self::Focus(FocusSearchError::Capture(CaptureError::Board(ClientError::Interrupted {
                ..
            })))
            | Self::BoardCorrection(
                BoardCorrectionError::Interrupted { .. }
                | BoardCorrectionError::Board(ClientError::Interrupted { .. }),
            ) => true,
            Self::About { source, .. } => source.is_cancelled(),
            _ => false,
        }
    }

    /// Whether the request was invalid, so that nothing was done.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Parameter { .. } | Self::Request(_) | Self::Sun(_) => true,
            Self::About { source, .. } => source.is_usage(),
            _ => false,
        }
    }
}

pub trait About<T> {
    /// Adds the subject of an error.
    fn about(self, about: impl FnOnce() -> String) -> Result<T>;
}

impl<T, E: Into<WorkflowError>> About<T> for std::result::Result<T, E> {
    fn about(self, about: impl FnOnce() -> String) -> Result<T> {
        self.map_err(|error| WorkflowError::About { about: about(), source: Box::new(error.into()) })
    }
}
