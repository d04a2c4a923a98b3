//! Commands that remedy an error: the workflows' errors carry facts only.

use std::{io::ErrorKind, path::Path};

use farnear_capture::{
    ClientError, PortError, board_correction::BoardCorrectionError, expose::CaptureError,
    focus::FocusSearchError,
};
use farnear_files::{masks::MaskError, video::VideoError};
use farnear_protocol::RequestError;
use farnear_silhouettes::readers::READERS;
use farnear_workflows::{
    WorkflowError,
    activity::{recognition::MODEL_FILE, samples::SamplesError, shipped},
    correction_file, operators, optics,
    shadow::removal::CAMERA_FILE,
    silhouettes::SilhouettesError,
    simulator::SimulatorError,
};

/// Lower-case endings of common videos.
const VIDEOS: [&str; 11] = ["avi", "gif", "m4v", "mkv", "mov", "mp4", "mpeg", "mpg", "webm", "wmv", "y4m"];

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
        WorkflowError::Read { what: optics::KIND, source, .. }
            if matches!(source.kind(), ErrorKind::InvalidData | ErrorKind::IsADirectory) =>
        {
            let command = "farnear optics --distance-mm 300 --range-mm 40 --out optics.toml";
            Some(format!("expected a TOML file, as `{command}` writes it"))
        }
        WorkflowError::File { expected: operators::KIND, .. } => {
            Some("`farnear operators --out` saves some".into())
        }
        WorkflowError::File { expected: correction_file::KIND, .. } => {
            Some("`farnear calibrate correction --out` saves one".into())
        }
        WorkflowError::NoOptics { .. } | WorkflowError::NoStackOptics { .. } => {
            Some("name a file with --optics".into())
        }
        WorkflowError::Simulator(SimulatorError::Missing { .. }) => {
            Some("`cargo xtask install` installs both, `cargo xtask demo` builds them".into())
        }
        WorkflowError::Unanswered { .. } => {
            Some("--no-prompt (targets) or --no-actuation (check) asks nothing".into())
        }
        WorkflowError::InsideFocalLength { .. } => {
            Some("`farnear rig settings get datum_nm` shows it".into())
        }
        WorkflowError::StepsFailed { alarm: Some(number), .. } => Some(clear(*number)),
        WorkflowError::Client(error)
        | WorkflowError::BoardCorrection(BoardCorrectionError::Board(error))
        | WorkflowError::Capture(CaptureError::Board(error))
        | WorkflowError::Focus(FocusSearchError::Capture(CaptureError::Board(error))) => of_client(error),
        WorkflowError::Read { what: CAMERA_FILE, .. } => {
            Some("`farnear shadow remove --help` shows its contents".into())
        }
        WorkflowError::Read { what: MODEL_FILE, path, source }
            if is_name(path) && source.kind() == ErrorKind::NotFound =>
        {
            let names = shipped::names();
            Some(format!("expected a file, or {names} (`farnear activity models` describes them)"))
        }
        WorkflowError::Video(error) | WorkflowError::Masks(MaskError::Picture(error)) => of_video(error),
        WorkflowError::Silhouettes(SilhouettesError::TooLarge { .. }) => {
            Some("--units names a recording's unit, a larger --mm-per-px makes the picture smaller".into())
        }
        WorkflowError::Samples(error) => of_samples(error).map(Into::into),
        _ => None,
    }
}

/// Whether it has no folder and no ending.
fn is_name(path: &Path) -> bool {
    path.extension().is_none() && path.file_name() == Some(path.as_os_str())
}

fn of_video(error: &VideoError) -> Option<String> {
    match error {
        VideoError::Ffmpeg { path, .. } | VideoError::NoFfmpeg { path }
            if READERS.iter().any(|reader| has_ending(path, reader.extensions)) =>
        {
            Some("`farnear silhouettes markers` makes masks of motion capture and keypoints".into())
        }
        VideoError::NoPictures { path } => of_folder(path),
        _ => None,
    }
}

/// For a folder without pictures: one of views or of videos.
fn of_folder(folder: &Path) -> Option<String> {
    let view = folder.join("view1");
    if view.is_dir() {
        return Some(format!("give the folder of a view, such as {}", view.display()));
    }
    let files = folder.read_dir().ok()?.filter_map(|entry| Some(entry.ok()?.path()));
    let video = files.filter(|file| has_ending(file, &VIDEOS)).min()?;
    Some(format!("give a video itself, such as {}", video.display()))
}

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    path.extension().is_some_and(|ending| endings.contains(&ending.to_string_lossy().to_lowercase().as_str()))
}

fn of_samples(error: &SamplesError) -> Option<&'static str> {
    match error {
        SamplesError::Views { .. } => {
            Some("`--any-view` (train) or `--views each` (evaluate) take every view by itself")
        }
        SamplesError::OtherViews { .. } => Some("`--views each` takes every view by itself"),
        SamplesError::SamePerson { .. } => {
            Some("add --leave-one-subject-out to leave them out of the training in turn")
        }
        _ => None,
    }
}

fn of_client(error: &ClientError) -> Option<String> {
    match error {
        ClientError::Refused { error, .. } => of_refusal(error),
        ClientError::Failed { alarm: Some(record), .. } => Some(clear(record.number)),
        ClientError::Version { .. } | ClientError::Schema { .. } => {
            Some("`cargo xtask firmware` builds the firmware of these sources".into())
        }
        ClientError::Port(PortError::NoBoard { .. } | PortError::SeveralBoards { .. }) => {
            Some("name its port with --port or in FARNEAR_PORT; `--port sim` starts the emulated rig".into())
        }
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
