//! Result folders: a run removes files of an earlier run that it does not write itself. Of other files, only a model may be
//! replaced by a model.

use std::{
    fs::{self, File},
    io::{self, Read},
    path::Path,
};

use farnear_capture::record::CAPTURE_FILE;
use farnear_files::staging::{Staging, StagingError};
use farnear_recognition::model_file::is_model;

use crate::{
    batch::RECORD as BATCH_RECORD,
    depth::output,
    error::{Result, WorkflowError},
};

pub const DEPTH_RECORD: &str = "depth.toml";
pub const STACK_RECORD: &str = "stack.toml";
pub(crate) const STACK_FILES: [&str; 5] =
    ["depth.npy", "confidence.npy", "all-in-focus.png", "view.png", STACK_RECORD];

/// Files of depth maps and focus stacks.
pub(crate) fn files() -> impl Iterator<Item = &'static str> {
    output::files().chain(STACK_FILES)
}

fn is_ours(record: &Path) -> bool {
    let table = fs::read_to_string(record).ok().and_then(|text| text.parse::<toml::Table>().ok());
    let made_by = table.as_ref().and_then(|table| table.get("made_by")?.as_str());
    made_by.is_some_and(|made_by| made_by.starts_with("farnear"))
}

pub(crate) fn holds_stack(folder: &Path) -> bool {
    is_ours(&folder.join(STACK_RECORD))
}

/// Begins a depth map's result in a new or existing folder, except that of a focus stack, or with files that look like a
/// depth map's, but that no record describes.
pub fn depth(out: &Path) -> Result<Staging> {
    if holds_stack(out) {
        let expected = "it holds the result of focus-stack: name another folder";
        return Err(WorkflowError::parameter("out", out.display(), expected));
    }
    let foreign = output::files().find(|file| out.join(file).exists());
    if let Some(file) = foreign.filter(|_| !is_ours(&out.join(DEPTH_RECORD))) {
        let expected = format!(
            "it holds {file}, but no {DEPTH_RECORD} of a run of depth that made it: move the file away, or name another folder"
        );
        return Err(WorkflowError::parameter("out", out.display(), expected));
    }
    let stale_batch = batch_of(out, "depth");
    Ok(Staging::into_folder(out)?.replacing(DEPTH_RECORD, output::files().chain(stale_batch)))
}

/// Begins a rendered pair in a new or existing folder, except that of a capture, or with a pair that was not rendered.
pub fn rendered(out: &Path) -> Result<Staging> {
    let has = |name: &str| out.join(name).exists();
    if has(CAPTURE_FILE) {
        let expected = format!("it holds a capture ({CAPTURE_FILE}): name another folder");
        return Err(WorkflowError::parameter("out", out.display(), expected));
    }
    let foreign = ["far.png", "near.png", "optics.toml"].into_iter().find(|name| has(name));
    if let Some(file) = foreign.filter(|_| !has("truth.npy")) {
        let expected = format!(
            "it holds {file}, but no truth.npy of a run of render that made it: move the file away, or name another folder"
        );
        return Err(WorkflowError::parameter("out", out.display(), expected));
    }
    Ok(Staging::into_folder(out)?)
}

/// Begins a focus stack's result in a new folder, an empty one, or that of an earlier focus stack.
pub(crate) fn stack(out: &Path, images: &Path) -> Result<Staging, StagingError> {
    let same =
        |a: &Path, b: &Path| fs::canonicalize(a).is_ok_and(|a| fs::canonicalize(b).is_ok_and(|b| a == b));
    if !holds_stack(out) || same(out, images) {
        return Staging::new_folder(out);
    }
    let stale_batch = batch_of(out, "focus-stack");
    Ok(Staging::into_folder(out)?.replacing(STACK_RECORD, STACK_FILES.into_iter().chain(stale_batch)))
}

/// Checks that a model may be written to `out`: a file that exists is a model or empty.
pub(crate) fn check_model(out: &Path) -> Result<()> {
    match may_become_model(out) {
        Ok(true) => Ok(()),
        Ok(false) => {
            let expected = "it exists and is not a model of farnear: name another file, or move it away";
            Err(WorkflowError::parameter("out", out.display(), expected))
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(WorkflowError::read("the file to replace", out)(error)),
    }
}

fn may_become_model(out: &Path) -> io::Result<bool> {
    // Opening a pipe would wait for its other end.
    if !out.metadata()?.is_file() {
        return Ok(false);
    }
    let mut first = Vec::new();
    File::open(out)?.take(64).read_to_end(&mut first)?;
    Ok(first.is_empty() || is_model(&first))
}

/// A batch's record of such a job: it lists files that will be replaced.
fn batch_of(folder: &Path, kind: &str) -> Option<&'static str> {
    let text = fs::read_to_string(folder.join(BATCH_RECORD)).ok()?;
    let of = text.parse::<toml::Table>().ok()?.get("do")?.as_str()? == kind;
    of.then_some(BATCH_RECORD)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_is_rendered_over_a_rendered_one_only() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str| fs::write(folder.path().join(name), "").unwrap();
        assert!(rendered(folder.path()).is_ok());
        write("far.png");
        let error = rendered(folder.path()).unwrap_err();
        assert!(error.is_usage() && error.to_string().contains("far.png"), "{error}");
        write("truth.npy");
        assert!(rendered(folder.path()).is_ok());
        write(CAPTURE_FILE);
        let error = rendered(folder.path()).unwrap_err();
        assert!(error.is_usage() && error.to_string().contains("capture.toml"), "{error}");
    }
}
