//! Place of a job's result, moved there when complete. Files that no batch wrote stay.

use std::{
    ffi::OsString,
    fs::{self, File},
    io,
    path::{Path, PathBuf},
};

use serde_json::Value;

use super::{BatchError, provenance::Provenance};
use crate::{error::Result, inputs};

/// Provenance in a result folder; suffix of the provenance of a result file.
pub(crate) const RECORD: &str = "batch.toml";
const ASIDE: &str = ".batch-partial";

/// The final folder of a result, if `out` is a batch's temporary place.
pub(crate) fn final_place(out: &Path) -> PathBuf {
    let aside = out.parent().filter(|parent| parent.to_string_lossy().ends_with(ASIDE));
    let beside = aside.and_then(|aside| Some(aside.parent()?.join(out.file_name()?)));
    beside.unwrap_or_else(|| out.into())
}

pub(super) struct Place {
    target: PathBuf,
    is_file: bool,
}

pub(super) enum Found {
    /// Up to date, with its figures.
    Done(Option<Value>),
    /// Missing, incomplete, or made from something else.
    ToDo,
}

impl Place {
    pub fn new(target: PathBuf, is_file: bool) -> Self {
        let target = target.components().collect(); // without a slash at its end
        Self { target, is_file }
    }

    /// Examines the place. Returns [`BatchError::Foreign`] for files that no batch wrote.
    pub fn look(&self, wanted: &Provenance, verify: bool) -> Result<Found> {
        let (record, root) = (self.record(), self.root());
        if let Some(found) = Provenance::read(&record) {
            let done = found.fulfils(wanted, root, verify);
            return Ok(if done { Found::Done(found.figures()) } else { Found::ToDo });
        }
        let empty = fs::read_dir(&self.target).is_ok_and(|mut entries| entries.next().is_none());
        // An unreadable record still marks a batch's file.
        if !self.target.exists() || empty || record.exists() {
            return Ok(Found::ToDo);
        }
        Err(BatchError::Foreign { path: self.target.clone() }.into())
    }

    /// Runs `make` with a temporary place and moves its result. First removes remains of an interrupted run.
    pub fn fill(&self, wanted: Provenance, make: impl FnOnce(&Path) -> Result<Value>) -> Result<Value> {
        let name = self.target.file_name().unwrap_or_default();
        let aside = self.beside(".", ASIDE);
        let unwritable = |source| BatchError::Write { path: self.target.clone(), source };
        if let Some(parent) = aside.parent() {
            fs::create_dir_all(parent).map_err(unwritable)?;
        }
        let _lock = self.lock(&aside)?;
        let clearing = Clearing(&aside);
        clear(&aside).map_err(unwritable)?;
        let made = aside.join(name);
        let found = make(&made)?;
        let strangers = self.strangers().map_err(unwritable)?;
        if let Some(name) = strangers.iter().find(|name| made.join(name).exists()) {
            return Err(BatchError::Foreign { path: self.target.join(name) }.into());
        }
        let record = toml::to_string(&wanted.with_figures(&found).with_output(&made)?)?;
        self.put(&aside, &made, &record, &strangers).map_err(unwritable)?;
        drop(clearing);
        Ok(found)
    }

    /// Removes the result of an earlier run after a failure. Keeps files that no batch wrote.
    pub fn discard(&self) -> io::Result<()> {
        let record = self.record();
        let Some(found) = Provenance::read(&record) else { return Ok(()) };
        fs::remove_file(record)?;
        for file in found.outputs().map(|name| self.root().join(name)).filter(|file| file.exists()) {
            fs::remove_file(&file)?;
            // A folder that holds other files stays.
            let folders = file.ancestors().skip(1).take_while(|folder| folder.starts_with(&self.target));
            folders.map(fs::remove_dir).take_while(io::Result::is_ok).for_each(drop);
        }
        Ok(())
    }

    /// Files of the result's folder that no batch wrote, relative to it.
    fn strangers(&self) -> io::Result<Vec<PathBuf>> {
        let Some(found) = Provenance::read(&self.record()).filter(|_| !self.is_file && self.target.exists())
        else {
            return Ok(Vec::new());
        };
        let files = inputs::files_below(&self.target).map_err(io::Error::other)?;
        let names = files.iter().filter_map(|file| file.strip_prefix(&self.target).ok());
        let ours = |name: &Path| name == Path::new(RECORD) || found.outputs().any(|output| output == name);
        Ok(names.filter(|name| !ours(name)).map(Path::to_path_buf).collect())
    }

    /// Locks the temporary folder for this process, so that two runs of a job do not mix.
    fn lock(&self, aside: &Path) -> Result<File, BatchError> {
        let unwritable = |source| BatchError::Write { path: self.target.clone(), source };
        match fs::create_dir(aside) {
            Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(unwritable(error)),
            _ => {}
        }
        let lock = File::open(aside).map_err(unwritable)?;
        match lock.try_lock() {
            Err(fs::TryLockError::WouldBlock) => Err(BatchError::InUse { path: self.target.clone() }),
            // Continue on systems that cannot lock folders.
            Ok(()) | Err(fs::TryLockError::Error(_)) => Ok(lock),
        }
    }

    fn put(&self, aside: &Path, made: &Path, record: &str, strangers: &[PathBuf]) -> io::Result<()> {
        if self.is_file {
            // Remove the old record first, so that it never accompanies another result.
            let (old, new) = (self.record(), aside.join("record"));
            fs::write(&new, record)?;
            if old.exists() {
                fs::remove_file(&old)?;
            }
            fs::rename(made, &self.target)?;
            return fs::rename(new, old);
        }
        fs::write(made.join(RECORD), record)?;
        if self.target.exists() {
            for name in strangers {
                if let Some(folder) = made.join(name).parent() {
                    fs::create_dir_all(folder)?;
                }
                fs::rename(self.target.join(name), made.join(name))?;
            }
            fs::rename(&self.target, aside.join("old"))?;
        }
        fs::rename(made, &self.target)
    }

    fn record(&self) -> PathBuf {
        if self.is_file { self.beside("", &format!(".{RECORD}")) } else { self.target.join(RECORD) }
    }

    fn root(&self) -> &Path {
        if self.is_file { self.target.parent().unwrap_or(Path::new("")) } else { &self.target }
    }

    fn beside(&self, before: &str, after: &str) -> PathBuf {
        let mut name = OsString::from(before);
        name.push(self.target.file_name().unwrap_or_default());
        name.push(after);
        self.target.with_file_name(name)
    }
}

/// Removes the temporary folder when dropped.
struct Clearing<'a>(&'a Path);

impl Drop for Clearing<'_> {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(self.0); // else the next run does
    }
}

fn clear(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() { fs::remove_dir_all(path)? } else { fs::remove_file(path)? }
    }
    Ok(())
}
