//! What can go wrong in a workflow, as facts: which value, which file, what was expected. What to type or click next is
//! for the face to add.

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
        value: String,
        expected: String,
    },
    /// A field of a request.
    #[error(transparent)]
    Request(#[from] crate::request::RequestError),
    /// A file with invalid contents.
    #[error("{} does not hold {expected}: {reason}", path.display())]
    File {
        path: PathBuf,
        /// The expected contents.
        expected: &'static str,
        reason: String,
    },
    /// A file that cannot be read at all.
    #[error("cannot read {what} {}: {source}", path.display())]
    Read {
        /// Its meaning: "the optics file".
        what: &'static str,
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The work was cancelled; a rig has been stopped.
    #[error("interrupted while {during}")]
    Cancelled { during: String },
    /// The sharpest image would lie where no lens puts one.
    #[error(
        "the sharpest image lies {sensor_mm:.4} mm behind the lens, inside its focal length of {focal_length_mm} mm: is the \
         rig's setting datum_nm right?"
    )]
    InsideFocalLength {
        /// Sensor distance of the best focus.
        sensor_mm: f64,
        /// The lens' focal length.
        focal_length_mm: f64,
    },
    /// The board calculates otherwise than this computer, which should give the same bits.
    #[error("the board's answer differs from this computer's: {0}")]
    Differs(String),
    /// The bring-up checklist found something.
    #[error("{failed} of the steps failed; put that right before anything moves further (docs/bring-up.md)")]
    StepsFailed {
        failed: usize,
        /// Number of the alarm that is latched.
        alarm: Option<u32>,
    },
    /// The output is closed.
    #[error("the result cannot be passed on: {source}")]
    Sink {
        /// What the system says.
        source: std::io::Error,
    },
    /// A folder that cannot be made.
    #[error("cannot make the folder {}: {source}", folder.display())]
    Folder {
        folder: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A prompt without an answer.
    #[error("no answer, the input has ended: {question}")]
    Unanswered { question: String },
    /// The optics of a pair are unknown.
    #[error("no optics: none were named, and neither capture.toml nor optics.toml is next to {}", far.display())]
    NoOptics {
        /// The pair's far-focused image.
        far: PathBuf,
    },
    /// Images that are not a pair.
    #[error("{} and {}: {reason}", far.display(), near.display())]
    Pair {
        /// The image that was given as far-focused.
        far: PathBuf,
        /// The image that was given as near-focused.
        near: PathBuf,
        reason: String,
    },
    /// The same, about something.
    #[error("{about}: {source}")]
    About {
        /// Its subject: a pair, a file, a step.
        about: String,
        source: Box<Self>,
    },
    /// Values that make no optics.
    #[error(transparent)]
    Optics(#[from] OpticsError),
    /// A design of operators that cannot be.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// A pair that gives no depth.
    #[error(transparent)]
    Depth(#[from] RunError),
    /// Images that do not form a pair.
    #[error(transparent)]
    Unpaired(PrepareError),
    /// A camera's dark and flat frames.
    #[error(transparent)]
    CameraFrames(#[from] CameraFramesError),
    /// The same with a method to compare with.
    #[error(transparent)]
    Baseline(#[from] BaselineError),
    /// A correction that cannot be learned or does not fit.
    #[error(transparent)]
    Correction(#[from] CorrectionError),
    /// Images that give no point spread function.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// Images that do not form a focus stack.
    #[error(transparent)]
    Stack(#[from] StackError),
    /// Files that do not form a focus stack.
    #[error(transparent)]
    StackFiles(#[from] farnear_files::stack::StackError),
    /// Maps that cannot be compared.
    #[error(transparent)]
    Compare(#[from] CompareError),
    /// A text that is not TOML of the expected kind.
    #[error(transparent)]
    Parse(#[from] toml::de::Error),
    #[error(transparent)]
    Simulator(#[from] crate::simulator::SimulatorError),
    /// The board, or the way to it.
    #[error(transparent)]
    Client(#[from] ClientError),
    #[error(transparent)]
    Capture(#[from] CaptureError),
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// Where the stages would have to go.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The search for the focus.
    #[error(transparent)]
    Focus(#[from] FocusSearchError),
    #[error(transparent)]
    Program(#[from] ProgramError),
    /// The board's log.
    #[error(transparent)]
    Log(#[from] LogEnded),
    /// A capture's record.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Correction by the board.
    #[error(transparent)]
    BoardCorrection(#[from] BoardCorrectionError),
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A map of numbers.
    #[error(transparent)]
    Map(#[from] MapError),
    #[error(transparent)]
    Masks(#[from] MaskError),
    #[error(transparent)]
    Video(#[from] VideoError),
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// Results that cannot be put in place.
    #[error(transparent)]
    Staging(#[from] StagingError),
    /// A thread that cannot be started.
    #[error("cannot start a thread: {reason}")]
    Thread {
        /// What the system says.
        reason: String,
    },
    /// Where the sun stands.
    #[error(transparent)]
    Sun(#[from] SunError),
    #[error(transparent)]
    Silhouettes(#[from] crate::silhouettes::SilhouettesError),
    /// Moving regions of a video.
    #[error(transparent)]
    Background(#[from] BackgroundError),
    /// Pictures that a shadow detector cannot take.
    #[error(transparent)]
    ShadowImages(#[from] ImagesError),
    #[error(transparent)]
    CameraFile(#[from] CameraFileError),
    /// Where a shadow falls.
    #[error(transparent)]
    Shadow(#[from] ShadowError),
    /// How sure a shadow is.
    #[error(transparent)]
    ShadowUncertainty(#[from] UncertaintyError),
    /// Pictures that do not belong together.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// A score of shadow removal.
    #[error(transparent)]
    Score(#[from] crate::shadow::score::ScoreError),
    /// Samples of activities.
    #[error(transparent)]
    Samples(#[from] crate::activity::samples::SamplesError),
    /// A motion file that teaches nothing.
    #[error(transparent)]
    Motion(#[from] crate::activity::motion::MotionError),
    /// A model of activities.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Other views than a model's.
    #[error(transparent)]
    Views(#[from] crate::activity::recognition::ViewsError),
    /// What several people cannot be recognised in.
    #[error(transparent)]
    MultiPerson(#[from] crate::activity::multi_person::MultiPersonError),
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    #[error(transparent)]
    Batch(#[from] crate::batch::BatchError),
    /// A record that cannot be put into TOML.
    #[error("cannot write a record: {0}")]
    Toml(#[from] toml::ser::Error),
}

impl From<PrepareError> for WorkflowError {
    fn from(error: PrepareError) -> Self {
        match error {
            PrepareError::Pair(error) => Self::Depth(error),
            PrepareError::Camera(error) => Self::CameraFrames(error),
            error @ PrepareError::Unrelated { .. } => Self::Unpaired(error),
        }
    }
}

impl From<MeasureError> for WorkflowError {
    fn from(error: MeasureError) -> Self {
        match error {
            MeasureError::Run(error) => Self::Depth(error),
            MeasureError::Prepare(error) => error.into(),
            MeasureError::Baseline(error) => Self::Baseline(error),
            MeasureError::Design(error) => Self::Design(error),
            MeasureError::LearnedForWhitened => Self::parameter(
                "method",
                "ro or another",
                "the optics were learned by calibrate stack: use --method whitened",
            ),
        }
    }
}

impl WorkflowError {
    /// A parameter that cannot be.
    pub fn parameter(name: &'static str, value: impl ToString, expected: impl Into<String>) -> Self {
        Self::Parameter { name, value: value.to_string(), expected: expected.into() }
    }

    /// For `map_err`: a file with invalid contents.
    pub fn file<E: std::fmt::Display>(path: &Path, expected: &'static str) -> impl FnOnce(E) -> Self {
        move |error| Self::File { path: path.into(), expected, reason: error.to_string() }
    }

    /// For `map_err`: a file that cannot be read.
    pub fn read(what: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::Read { what, path: path.into(), source }
    }

    /// Whether the work was cancelled.
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

    /// Whether the request was invalid: nothing has been done.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Parameter { .. } | Self::Request(_) => true,
            Self::About { source, .. } => source.is_usage(),
            _ => false,
        }
    }
}

/// Adds the subject of an error.
pub trait About<T> {
    /// The same result, whose error names its subject.
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
