//! Place of a job's result, moved there when complete. Files that no batch wrote stay where they are.

use std::{
    collections::BTreeSet,
    ffi::OsString,
    fs::{self, File},
    io,
    path::{Path, PathBuf},
};

use farnear_files::staging::{PARTIAL, Unfinished, remove_file, rename, uninterrupted};
use serde_json::Value;

use super::{BatchError, provenance::Provenance};
use crate::{error::Result, inputs};

/// Provenance in a result folder; suffix of the provenance of a result file.
pub(crate) const RECORD: &str = "batch.toml";
const ASIDE: &str = ".batch-partial";
/// File in the temporary folder, locked where folders cannot be opened.
const LOCK: &str = ".batch-lock";

/// The final folder of a result, if `out` is a batch's temporary place.
pub(crate) fn final_place(out: &Path) -> PathBuf {
    let aside = out.parent().filter(|parent| parent.to_string_lossy().ends_with(ASIDE));
    let beside = aside.and_then(|aside| Some(aside.parent()?.join(out.file_name()?)));
    beside.unwrap_or_else(|| out.into())
}

/// Whether `path` is named as unfinished files of a batch or a command.
pub(crate) fn is_unfinished(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.starts_with('.') && (name.ends_with(ASIDE) || name.contains(PARTIAL))
}

/// The result file whose record is at `path`, by its name.
pub(crate) fn result_of(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?.strip_suffix(RECORD)?.strip_suffix('.')?;
    (!name.is_empty()).then(|| path.with_file_name(name))
}

pub(super) struct Place {
    target: PathBuf,
    is_file: bool,
}

pub(super) enum Found {
    /// Up to date, with its figures and warnings.
    Done(Option<Value>, Vec<String>),
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
            return Ok(if done { Found::Done(found.figures(), found.warnings) } else { Found::ToDo });
        }
        let empty = fs::read_dir(&self.target).is_ok_and(|mut entries| entries.next().is_none());
        let is_free = fs::symlink_metadata(&self.target).is_err();
        // An unreadable record still marks a batch's file.
        if is_free || empty || record.exists() {
            return Ok(Found::ToDo);
        }
        Err(BatchError::Foreign { path: self.target.clone() }.into())
    }

    /// Runs `make` with a temporary place and moves its result. First removes remains of an interrupted run. `warnings`
    /// are those of `make`.
    pub fn fill(
        &self,
        mut wanted: Provenance,
        make: impl FnOnce(&Path) -> Result<Value>,
        warnings: impl FnOnce() -> Vec<String>,
    ) -> Result<Value> {
        let name = self.target.file_name().unwrap_or_default();
        let aside = self.beside(".", ASIDE);
        let unwritable = |source| BatchError::Write { path: self.target.clone(), source };
        if let Some(parent) = aside.parent() {
            fs::create_dir_all(parent).map_err(unwritable)?;
        }
        let _lock = self.lock(&aside)?;
        let clearing = Unfinished::new(aside.clone());
        clear(&aside).map_err(|source| self.not_locked(source))?;
        let made = aside.join(name);
        let found = make(&made)?;
        let earlier = Provenance::read(&self.record());
        let strangers = earlier.as_ref().map_or(Ok(Vec::new()), |earlier| self.strangers(earlier))?;
        let is_in_the_way = |name: &&PathBuf| {
            made.join(name).exists() || name.ancestors().any(|part| made.join(part).is_file())
        };
        if let Some(name) = strangers.iter().find(is_in_the_way) {
            return Err(BatchError::Foreign { path: self.target.join(name) }.into());
        }
        wanted.warnings = warnings();
        let new = wanted.with_figures(&found).with_output(&made)?;
        let records = [toml::to_string(&new.unfinished(earlier.as_ref()))?, toml::to_string(&new)?];
        uninterrupted(|| self.put(&made, earlier.as_ref(), records)).map_err(unwritable)?;
        drop(clearing);
        Ok(found)
    }

    /// Removes the result of an earlier run after a failure. Keeps files that no batch wrote.
    pub fn discard(&self) -> io::Result<()> {
        let record = self.record();
        let Some(found) = Provenance::read(&record) else { return Ok(()) };
        // The record goes last: without it, the files of an interrupted removal would be strangers.
        let record = Path::new(record.file_name().unwrap_or_default());
        uninterrupted(|| found.outputs().chain([record]).try_for_each(|name| self.remove(name)))
    }

    /// Removes a file of the result and the folders that it leaves empty.
    fn remove(&self, name: &Path) -> io::Result<()> {
        let file = self.root().join(name);
        if file.exists() {
            remove_file(&file)?;
            let folders = file.ancestors().skip(1).take_while(|folder| folder.starts_with(&self.target));
            folders.map(fs::remove_dir).take_while(io::Result::is_ok).for_each(drop);
        }
        Ok(())
    }

    /// Files of the result's folder that no batch wrote, relative to it.
    fn strangers(&self, earlier: &Provenance) -> Result<Vec<PathBuf>> {
        if self.is_file || !self.target.exists() {
            return Ok(Vec::new());
        }
        let ours: BTreeSet<&Path> = earlier.outputs().chain([Path::new(RECORD)]).collect();
        let files = inputs::files_below(&self.target)?;
        let names = files.iter().filter_map(|file| file.strip_prefix(&self.target).ok());
        Ok(names.filter(|name| !ours.contains(name)).map(Path::to_path_buf).collect())
    }

    /// Locks the temporary folder for this process, so that two runs of a job do not mix.
    fn lock(&self, aside: &Path) -> Result<File, BatchError> {
        match fs::create_dir(aside) {
            Err(error) if error.kind() != io::ErrorKind::AlreadyExists => {
                return Err(BatchError::Write { path: self.target.clone(), source: error });
            }
            _ => {}
        }
        let lock = lockable(aside, File::open(aside)).map_err(|source| self.not_locked(source))?;
        match lock.try_lock() {
            Err(fs::TryLockError::WouldBlock) => Err(BatchError::InUse { path: self.target.clone() }),
            // Continue on systems that cannot lock folders.
            Ok(()) | Err(fs::TryLockError::Error(_)) => Ok(lock),
        }
    }

    /// A temporary folder that disappears is removed by another run, which has just ended.
    fn not_locked(&self, source: io::Error) -> BatchError {
        let path = self.target.clone();
        match source.kind() {
            io::ErrorKind::NotFound => BatchError::InUse { path },
            _ => BatchError::Write { path, source },
        }
    }

    /// Moves a result to its place: a new folder whole, otherwise each file alone. Until the last file is moved the
    /// record is `unfinished`: the next run of an interrupted batch knows which files are its own.
    fn put(
        &self,
        made: &Path,
        earlier: Option<&Provenance>,
        [unfinished, finished]: [String; 2],
    ) -> io::Result<()> {
        if !self.is_file && !self.target.exists() {
            fs::write(made.join(RECORD), finished)?;
            return rename(made, &self.target);
        }
        let (from, files) = if self.is_file {
            (made.parent().unwrap_or(Path::new("")), vec![made.to_path_buf()])
        } else {
            (made, inputs::files_below(made).map_err(io::Error::other)?)
        };
        let names: BTreeSet<&Path> = files.iter().filter_map(|file| file.strip_prefix(from).ok()).collect();
        let waiting = made.with_added_extension(RECORD);
        let write = |record: String| {
            fs::write(&waiting, record)?;
            rename(&waiting, &self.record())
        };
        write(unfinished)?;
        let stale = earlier.into_iter().flat_map(Provenance::outputs);
        stale.filter(|name| !names.contains(name)).try_for_each(|name| self.remove(name))?;
        for name in names {
            let place = self.root().join(name);
            if let Some(folder) = place.parent() {
                fs::create_dir_all(folder)?;
            }
            rename(&from.join(name), &place)?;
        }
        write(finished)
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

/// The opened folder, or a file in it where the system does not open folders, as Windows.
fn lockable(folder: &Path, opened: io::Result<File>) -> io::Result<File> {
    opened.or_else(|_| File::options().read(true).append(true).create(true).open(folder.join(LOCK)))
}

/// Removes all files but the lock, which another run tries.
fn clear(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.ends_with(LOCK) {
            continue;
        }
        if path.is_dir() { fs::remove_dir_all(path)? } else { remove_file(&path)? }
    }
    Ok(())
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::{MetadataExt, symlink};

    use super::*;
    use crate::batch::fields::Fields;

    fn fill(place: &Place, names: &[&str]) -> Result<Value> {
        let make = |made: &Path| {
            for name in names {
                let file = if place.is_file { made.to_path_buf() } else { made.join(name) };
                fs::create_dir_all(file.parent().expect("a parent")).expect("a folder");
                fs::write(file, name).expect("a writable folder");
            }
            Ok(Value::Null)
        };
        let warnings = || vec!["too dark".into()];
        place.fill(Provenance::new("depth", &Fields::default(), Vec::new()), make, warnings)
    }

    fn listing(folder: &Path) -> Vec<String> {
        let entries =
            fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").file_name());
        let mut names: Vec<_> = entries.map(|name| name.to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn files_that_no_batch_wrote_are_not_moved() {
        let root = tempfile::tempdir().expect("a folder");
        let target = root.path().join("result");
        let (raw, notes) = (root.path().join("raw/1.png"), target.join("notes.txt"));
        let place = Place::new(target.clone(), false);
        fill(&place, &["a", "b", "sub/x"]).expect("a result");
        fs::create_dir(root.path().join("raw")).expect("a folder");
        fs::write(&raw, "original").expect("a writable folder");
        fs::write(&notes, "mine").expect("a writable folder");
        symlink("../raw", target.join("raw")).expect("a link");
        symlink(".", target.join("loop")).expect("a link");
        let folder = fs::metadata(&target).expect("a folder").ino();

        fill(&place, &["b", "c"]).expect("a result");
        assert_eq!(listing(&target), ["b", "batch.toml", "c", "loop", "notes.txt", "raw"]);
        assert_eq!(fs::metadata(&target).expect("a folder").ino(), folder, "the folder is the same");
        assert!(raw.exists() && target.join("raw").is_symlink(), "a linked folder is not entered");
        for names in [&["notes.txt"][..], &["notes.txt/x"], &["raw"], &["raw/2.png"]] {
            let error = fill(&place, names).expect_err("a file of the user").to_string();
            assert!(error.contains("was not made by a batch"), "{error}");
        }
        assert_eq!(listing(&root.path().join("raw")), ["1.png"]);
        assert_eq!(fs::read_to_string(notes).expect("the notes"), "mine");
    }

    #[test]
    fn an_interrupted_replacement_is_resumed() {
        let root = tempfile::tempdir().expect("a folder");
        let target = root.path().join("result");
        let place = Place::new(target.clone(), false);
        fill(&place, &["a", "b"]).expect("a result");
        fs::write(target.join("notes.txt"), "mine").expect("a writable folder");
        // A file cannot replace a folder.
        fs::create_dir(target.join("d")).expect("a folder");
        fill(&place, &["c", "d"]).expect_err("no place for a file");
        assert_eq!(listing(&target), ["batch.toml", "c", "d", "notes.txt"]);
        assert_eq!(listing(root.path()), ["result"]);
        let wanted = Provenance::new("depth", &Fields::default(), Vec::new());
        assert!(matches!(place.look(&wanted, false), Ok(Found::ToDo)));
        fs::remove_dir(target.join("d")).expect("an empty folder");
        fill(&place, &["d"]).expect("a result");
        assert_eq!(listing(&target), ["batch.toml", "d", "notes.txt"]);
        let Ok(Found::Done(_, warnings)) = place.look(&wanted, false) else { panic!("it is done") };
        assert_eq!(warnings, ["too dark"], "those of the run that made it");
    }

    #[test]
    fn an_interrupted_removal_leaves_the_record() {
        let root = tempfile::tempdir().expect("a folder");
        let target = root.path().join("result");
        let place = Place::new(target.clone(), false);
        fill(&place, &["a", "b"]).expect("a result");
        fs::remove_file(target.join("b")).expect("a file");
        fs::create_dir(target.join("b")).expect("a folder");
        place.discard().expect_err("a folder in the place of a file");
        assert_eq!(listing(&target), ["b", "batch.toml"]);
        let wanted = Provenance::new("depth", &Fields::default(), Vec::new());
        assert!(matches!(place.look(&wanted, false), Ok(Found::ToDo)));
        fs::remove_dir(target.join("b")).expect("an empty folder");
        place.discard().expect("the rest is removed");
        assert_eq!(listing(root.path()), Vec::<String>::new());
    }

    #[test]
    fn a_folder_that_cannot_be_opened_is_locked_by_a_file_in_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let on_windows = || Err(io::ErrorKind::PermissionDenied.into());
        let locked = || lockable(folder.path(), on_windows()).expect("a file");
        let held = locked();
        held.try_lock().expect("it is free");
        fs::write(folder.path().join("half"), "1").expect("a writable folder");
        clear(folder.path()).expect("a writable folder");
        assert_eq!(listing(folder.path()), [LOCK]);
        assert!(matches!(locked().try_lock(), Err(fs::TryLockError::WouldBlock)));
        drop(held);
        assert!(locked().try_lock().is_ok());
    }

    #[test]
    fn a_link_without_a_target_is_not_replaced() {
        let root = tempfile::tempdir().expect("a folder");
        symlink("nowhere", root.path().join("link")).expect("a link");
        let place = Place::new(root.path().join("link"), true);
        let wanted = Provenance::new("depth", &Fields::default(), Vec::new());
        assert!(place.look(&wanted, false).is_err());
    }

    #[test]
    fn a_result_file_may_have_the_name_of_a_record() {
        let root = tempfile::tempdir().expect("a folder");
        let place = Place::new(root.path().join("record"), true);
        for text in ["one", "two"] {
            fill(&place, &[text]).expect("a result");
            assert_eq!(fs::read_to_string(root.path().join("record")).expect("a file"), text);
            assert_eq!(listing(root.path()), ["record", "record.batch.toml"]);
        }
    }
}
