//! Atomic output: written to a temporary name, then renamed.

mod held;

use std::{
    collections::BTreeSet,
    ffi::{OsStr, OsString},
    fs::{self, File, TryLockError},
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
    sync::{Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

pub use held::{remove_file, rename};

#[derive(Debug, thiserror::Error)]
pub enum StagingError {
    #[error("{} exists already and is not an empty folder; name another folder or remove it", path.display())]
    Exists { path: PathBuf },
    #[error("cannot write {}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
}

impl StagingError {
    pub fn at(path: &Path) -> impl FnOnce(io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.into(), source }
    }
}

/// Part of all temporary names.
pub const PARTIAL: &str = ".partial-";
/// A younger folder may be about to be locked by its program.
const JUST_BEGUN: Duration = Duration::from_secs(10);
/// Longest wait for another program that publishes into the same folder.
const PUBLICATION_MAX: Duration = Duration::from_secs(if cfg!(test) { 10 } else { 1 });
const LOOK: Duration = Duration::from_millis(5);
/// Bytes of a temporary name that come from the final one: a name of 255 bytes has no room for more.
const NAME_BYTES: usize = 200;
/// Limit of leftover folders of one name, before the user must check.
const LEFT_BEHIND_MAX: u32 = 100;

/// Longer pieces, such as the rows of a large mesh, go to the file without a copy.
const BUFFER_BYTES: usize = 1 << 15;

/// Parents that were searched for leftovers: a series of folders would list its parent for each one.
static SWEPT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Folders of this process that are not published, and the targets created for them. Locked while something is published.
static UNPUBLISHED: Mutex<Vec<(PathBuf, Option<PathBuf>)>> = Mutex::new(Vec::new());

fn unpublished() -> MutexGuard<'static, Vec<(PathBuf, Option<PathBuf>)>> {
    UNPUBLISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes all unpublished files of this process, for an exit during work. Waits until a publication has ended. Later
/// staging blocks forever.
pub fn abandon_all() {
    let mut folders = unpublished();
    for (folder, target) in folders.drain(..) {
        // Another thread may still write into it.
        let _ = (0..3).find(|_| fs::remove_dir_all(&folder).is_ok());
        let _ = target.map(fs::remove_dir); // fails if it is not empty, as intended
    }
    std::mem::forget(folders);
}

/// Runs `work`, which moves or removes files of a result. [`abandon_all`] waits for its end.
pub fn uninterrupted<T>(work: impl FnOnce() -> T) -> T {
    let _working = unpublished();
    work()
}

/// A folder for unfinished files. Dropping it removes it, and so does [`abandon_all`].
#[derive(Debug)]
pub struct Unfinished(PathBuf);

impl Unfinished {
    pub fn new(folder: PathBuf) -> Self {
        unpublished().push((folder.clone(), None));
        Self(folder)
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0); // else the next run does
        unpublished().retain(|(folder, _)| *folder != self.0);
    }
}

/// A folder that appears under its name once complete. Dropping it earlier removes everything.
#[derive(Debug)]
pub struct Staging {
    folder: PathBuf,
    /// Lock that marks the folder as in use.
    _in_use: Option<File>,
    target: PathBuf,
    /// Whether the target folder was created for these files.
    made_target: bool,
    /// Files of an earlier result; those not written again are removed.
    replaced: Vec<&'static str>,
    /// The file that describes the others: removed first, published last.
    record: Option<&'static str>,
}

impl Staging {
    /// Begins a new folder and its parents. Returns [`StagingError::Exists`] unless it is missing or empty.
    pub fn new_folder(target: &Path) -> Result<Self, StagingError> {
        let target: PathBuf = target.components().collect(); // without a slash at its end
        if occupied(&target) {
            return Err(StagingError::Exists { path: target });
        }
        let parent = match target.parent() {
            Some(parent) if parent != Path::new("") => parent.to_path_buf(),
            _ => PathBuf::from("."),
        };
        fs::create_dir_all(&parent).map_err(StagingError::at(&parent))?;
        let name = target.file_name().unwrap_or_default().to_string_lossy();
        Self::begin(parent.join(partial_name(&name)), target, false)
    }

    /// Begins a set of files for a folder, created if missing. Files of equal names are replaced, others stay.
    pub fn into_folder(target: &Path) -> Result<Self, StagingError> {
        let made_target = !target.exists();
        fs::create_dir_all(target).map_err(StagingError::at(target))?;
        Self::begin(target.join(partial_name("files")), target.into(), made_target)
    }

    /// Replaces an earlier result: unwritten files of these names are removed. `record` describes the result and is
    /// absent while files of two results are in the folder.
    pub fn replacing(mut self, record: &'static str, files: impl IntoIterator<Item = &'static str>) -> Self {
        self.replaced.extend(files);
        self.record = Some(record);
        self
    }

    fn begin(folder: PathBuf, target: PathBuf, made_target: bool) -> Result<Self, StagingError> {
        let parent = folder.parent().unwrap_or(Path::new("."));
        if SWEPT.lock().unwrap_or_else(PoisonError::into_inner).insert(parent.into()) {
            sweep(parent);
        }
        // A killed program may have left this name, because containers reuse process ids; another thread may take it.
        let (mut free, mut number) = (folder.clone(), 0);
        while let Err(error) = fs::create_dir(&free) {
            number += 1;
            if error.kind() != io::ErrorKind::AlreadyExists || number == LEFT_BEHIND_MAX {
                return Err(StagingError::at(&target)(error));
            }
            free = folder.with_added_extension(number.to_string());
        }
        unpublished().push((free.clone(), made_target.then(|| target.clone())));
        let in_use = File::open(&free).ok().filter(|folder| folder.try_lock().is_ok());
        let (replaced, record) = (Vec::new(), None);
        Ok(Self { folder: free, _in_use: in_use, target, made_target, replaced, record })
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Creates a subfolder with its parents; `name` may be a path.
    pub fn make_folder(&self, name: &str) -> Result<(), StagingError> {
        fs::create_dir_all(self.path(name)).map_err(StagingError::at(&self.target.join(name)))
    }

    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), StagingError> {
        let path = self.path(name);
        fs::write(&path, bytes).map_err(StagingError::at(&self.target.join(name)))
    }

    pub fn fill(
        &self,
        name: &str,
        fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
    ) -> Result<(), StagingError> {
        let written = File::create(self.path(name)).and_then(|file| {
            let mut file = BufWriter::with_capacity(BUFFER_BYTES, file);
            fill(&mut file)?;
            // Flushes explicitly, because drop hides errors.
            file.flush()
        });
        written.map_err(StagingError::at(&self.target.join(name)))
    }

    /// Publishes everything: a new folder with one rename, files with one rename each.
    pub fn finish(self) -> Result<(), StagingError> {
        let into_folder = self.folder.parent() == Some(self.target.as_path());
        let _alone = into_folder.then(|| lock_to_publish(&self.target));
        // Released before `self` is dropped.
        let _publishing = unpublished();
        if !into_folder {
            if occupied(&self.target) {
                return Err(StagingError::Exists { path: self.target.clone() });
            }
            if self.target.is_dir() {
                fs::remove_dir(&self.target).map_err(StagingError::at(&self.target))?;
            }
            return rename(&self.folder, &self.target).map_err(StagingError::at(&self.target));
        }
        let entries = fs::read_dir(&self.folder).and_then(Iterator::collect::<io::Result<Vec<_>>>);
        let mut names: Vec<OsString> = entries
            .map_err(StagingError::at(&self.folder))?
            .into_iter()
            .map(|entry| entry.file_name())
            .collect();
        let is_record = |name: &OsStr| self.record.is_some_and(|record| name == record);
        names.sort_by_key(|name| is_record(name));
        let stale = |name: &&str| !names.iter().any(|new| new == OsStr::new(name));
        for name in self.record.iter().copied().chain(self.replaced.iter().copied().filter(stale)) {
            let place = self.target.join(name);
            match remove_file(&place) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    return Err(StagingError::at(&place)(error));
                }
                _ => {}
            }
        }
        for name in names {
            let place = self.target.join(&name);
            rename(&self.folder.join(&name), &place).map_err(StagingError::at(&place))?;
        }
        Ok(())
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        // Nothing is left after `finish` of a new folder.
        let _ = fs::remove_dir_all(&self.folder);
        unpublished().retain(|(folder, _)| *folder != self.folder);
        if self.made_target {
            // Fails if it is not empty, as intended.
            let _ = fs::remove_dir(&self.target);
        }
    }
}

/// Writes one file atomically.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), StagingError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let partial = path.with_file_name(partial_name(&name));
    let _publishing = unpublished();
    let written = fs::write(&partial, bytes).and_then(|()| rename(&partial, path));
    written.map_err(|source| {
        let _ = fs::remove_file(&partial);
        StagingError::Io { path: path.into(), source }
    })
}

/// Removes leftovers of killed programs. Active writers hold a lock that ends with them; locked folders stay.
fn sweep(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let partial = name.to_str().is_some_and(|name| name.starts_with('.') && name.contains(PARTIAL));
        let left = |path: &Path| -> io::Result<bool> {
            let age = fs::metadata(path)?.modified()?.elapsed().unwrap_or_default();
            Ok(path.is_dir() && age >= JUST_BEGUN && File::open(path)?.try_lock().is_ok())
        };
        if partial && left(&entry.path()).unwrap_or(false) {
            let _ = fs::remove_dir_all(entry.path()); // failure is harmless
        }
    }
}

/// Locks a folder while files move into it, so that two programs do not mix theirs. A lock that someone else keeps, such as
/// flock(1) around this program, only delays the publication, and a system without locks of folders does not prevent it.
fn lock_to_publish(folder: &Path) -> Option<File> {
    let folder = File::open(folder).ok()?;
    let start = Instant::now();
    while matches!(folder.try_lock(), Err(TryLockError::WouldBlock)) && start.elapsed() < PUBLICATION_MAX {
        std::thread::sleep(LOOK);
    }
    Some(folder)
}

/// Hidden and unique per process.
fn partial_name(name: &str) -> String {
    let name = &name[..name.floor_char_boundary(NAME_BYTES)];
    format!(".{name}{PARTIAL}{}", std::process::id())
}

fn occupied(path: &Path) -> bool {
    match fs::read_dir(path) {
        Ok(mut entries) => entries.next().is_some(),
        // A link without a target is an entry, too.
        Err(_) => fs::symlink_metadata(path).is_ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_folder_appears_whole_or_not_at_all() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("deep/er/");
        let staged = Staging::new_folder(&target).unwrap();
        staged.write("a", b"1").unwrap();
        assert!(!target.exists());
        drop(staged);
        assert_eq!(names(&root.path().join("deep")), Vec::<String>::new());

        let staged = Staging::new_folder(&target).unwrap();
        staged.write("a", b"1").unwrap();
        staged.finish().unwrap();
        assert_eq!(names(&target), ["a"]);
        assert!(matches!(Staging::new_folder(&target), Err(StagingError::Exists { .. })));
    }

    #[test]
    fn leftovers_of_a_killed_program_do_not_block() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("pair");
        std::mem::forget(Staging::new_folder(&target).unwrap());
        let staged = Staging::new_folder(&target).unwrap();
        staged.write("a", b"1").unwrap();
        staged.finish().unwrap();
        assert_eq!(names(&target), ["a"]);
    }

    #[cfg(unix)]
    #[test]
    fn removes_leftovers_of_a_killed_program_but_not_active_output() {
        let root = tempfile::tempdir().unwrap();
        let old = |path: &Path| {
            let folder = File::open(path).unwrap();
            folder.set_modified(std::time::SystemTime::now() - 2 * JUST_BEGUN).unwrap();
        };
        let living = Staging::new_folder(&root.path().join("living")).unwrap();
        // Unlocked as after a kill; the other one is recent.
        let dead = root.path().join(".dead.partial-1");
        fs::create_dir(&dead).unwrap();
        fs::write(dead.join("half"), b"1").unwrap();
        let young = root.path().join(".young.partial-2");
        fs::create_dir(&young).unwrap();
        let bystander = root.path().join("of the user");
        fs::create_dir(&bystander).unwrap();
        for path in [&living.folder, &dead, &bystander] {
            old(path);
        }
        sweep(root.path());
        assert!(!dead.exists());
        assert!(living.folder.exists() && young.exists() && bystander.exists());
        living.finish().unwrap();
        assert!(root.path().join("living").exists());
    }

    #[test]
    fn threads_that_write_to_one_place_have_their_own_folders() {
        let root = tempfile::tempdir().unwrap();
        let (target, start) = (root.path().join("out"), std::sync::Barrier::new(16));
        std::thread::scope(|scope| {
            let begin = || {
                start.wait();
                Staging::new_folder(&target).unwrap()
            };
            let begun: Vec<_> = (0..16).map(|_| scope.spawn(begin)).collect();
            let begun: Vec<Staging> = begun.into_iter().map(|thread| thread.join().unwrap()).collect();
            let folders: BTreeSet<&PathBuf> = begun.iter().map(|staging| &staging.folder).collect();
            assert_eq!(folders.len(), begun.len());
        });
    }

    #[cfg(unix)]
    #[test]
    fn searches_a_parent_for_leftovers_once() {
        let root = tempfile::tempdir().unwrap();
        let begin = |name: &str| {
            let dead = root.path().join(".dead.partial-1");
            fs::create_dir_all(&dead).unwrap();
            let long_ago = std::time::SystemTime::now() - 2 * JUST_BEGUN;
            File::open(&dead).unwrap().set_modified(long_ago).unwrap();
            Staging::new_folder(&root.path().join(name)).unwrap().finish().unwrap();
            dead.exists()
        };
        assert_eq!([begin("first"), begin("second")], [false, true]);
    }

    #[test]
    fn names_may_be_as_long_as_the_system_allows() {
        let root = tempfile::tempdir().unwrap();
        // A two-byte letter lies across the limit.
        let [file, folder] = ["f", "d"].map(|first| first.repeat(199) + &"\u{e9}".repeat(28));
        assert_eq!(file.len(), 255);
        write_file(&root.path().join(&file), b"1").unwrap();
        Staging::new_folder(&root.path().join(&folder)).unwrap().finish().unwrap();
        assert_eq!(names(root.path()), [folder, file]);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_without_a_target_is_refused_before_the_work() {
        let root = tempfile::tempdir().unwrap();
        let link = root.path().join("link");
        std::os::unix::fs::symlink("nowhere", &link).unwrap();
        assert!(matches!(Staging::new_folder(&link), Err(StagingError::Exists { .. })));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn two_programs_publish_into_a_folder_one_after_the_other() {
        let root = tempfile::tempdir().unwrap();
        let staged = Staging::into_folder(root.path()).unwrap();
        staged.write("a", b"1").unwrap();
        let other = File::open(root.path()).unwrap();
        other.lock().unwrap();
        let publishing = std::thread::spawn(move || staged.finish());
        std::thread::sleep(Duration::from_millis(100));
        assert!(!root.path().join("a").exists());
        other.unlock().unwrap();
        publishing.join().unwrap().unwrap();
        assert_eq!(names(root.path()), ["a"]);
    }

    #[test]
    fn fills_an_empty_folder() {
        let root = tempfile::tempdir().unwrap();
        let staged = Staging::new_folder(root.path()).unwrap();
        staged.write("a", b"1").unwrap();
        staged.finish().unwrap();
        assert_eq!(names(root.path()), ["a"]);
    }

    #[test]
    fn publishes_files_of_a_folder_together() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("old"), b"0").unwrap();
        fs::write(root.path().join("b"), b"0").unwrap();
        let staged = Staging::into_folder(root.path()).unwrap();
        staged.fill("b", |file| file.write_all(b"1")).unwrap();
        let full = staged.fill("c", |_| Err(io::ErrorKind::StorageFull.into())).unwrap_err();
        assert!(full.to_string().contains(&root.path().join("c").display().to_string()), "{full}");
        fs::remove_file(staged.path("c")).unwrap();
        assert_eq!(fs::read(root.path().join("b")).unwrap(), b"0");
        staged.finish().unwrap();
        assert_eq!(names(root.path()), ["b", "old"]);
        assert_eq!(fs::read(root.path().join("b")).unwrap(), b"1");
        write_file(&root.path().join("b"), b"2").unwrap();
        assert_eq!(names(root.path()), ["b", "old"]);
    }

    #[test]
    fn replaces_an_earlier_result_and_leaves_other_files() {
        let root = tempfile::tempdir().unwrap();
        let write = |names: &[&str]| {
            let staged = Staging::into_folder(root.path()).unwrap().replacing("record", ["a", "b", "c"]);
            names.iter().for_each(|name| staged.write(name, name.as_bytes()).unwrap());
            staged
        };
        fs::write(root.path().join("notes"), "mine").unwrap();
        write(&["a", "b", "record"]).finish().unwrap();
        drop(write(&["c", "record"]));
        assert_eq!(names(root.path()), ["a", "b", "notes", "record"]);
        write(&["c", "record"]).finish().unwrap();
        assert_eq!(names(root.path()), ["c", "notes", "record"]);
        write(&["a"]).finish().unwrap();
        assert_eq!(names(root.path()), ["a", "notes"], "the record of another result goes with it");
    }

    #[test]
    fn a_folder_made_for_files_that_never_came_goes_again() {
        let root = tempfile::tempdir().unwrap();
        let (new, old) = (root.path().join("new"), root.path().join("old"));
        fs::create_dir(&old).unwrap();
        for target in [&new, &old] {
            let staged = Staging::into_folder(target).unwrap();
            staged.write("a", b"1").unwrap();
        }
        assert_eq!(names(root.path()), ["old"]);
        assert_eq!(names(&old), Vec::<String>::new());
    }
}
