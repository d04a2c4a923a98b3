//! Input files of a result, with their hashes.

use std::{
    fs::{self, File},
    io::{self, Read},
    path::{Component, Path, PathBuf},
};

use farnear_files::{image_file::file_and_page, video::pictures::left_by_system};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::{
    batch,
    error::{Result, WorkflowError},
    request::outputs::on_disk,
};

const BUFFER_BYTES: usize = 1 << 16;

/// Length and SHA-256 of a file.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct HashedFile {
    /// Relative to the folder of the record.
    pub file: String,
    pub bytes: u64,
    pub sha256: String,
}

/// Hashes inputs of a result in `out`: all files of a folder except that result; the file of a TIFF page (`stack.tif#3`).
pub(crate) fn hashed(inputs: &[PathBuf], out: &Path) -> Result<Vec<HashedFile>> {
    let place = batch::final_place(out);
    let current = std::env::current_dir().unwrap_or_default();
    let result = on_disk(&current, &place);
    let files = files(inputs, &|path: &Path| on_disk(&current, path) == result)?;
    files.par_iter().map(|file| hash(file, &relative(file, &place))).collect()
}

/// All files of the inputs, each once. Below a folder, results with their records, unfinished files and those of the system are
/// left out.
pub(crate) fn files(inputs: &[PathBuf], is_result: &dyn Fn(&Path) -> bool) -> Result<Vec<PathBuf>> {
    let mut files: Vec<PathBuf> = Vec::new();
    for input in inputs {
        let (input, _) = file_and_page(input);
        let found = if input.is_dir() { inputs_below(&input, is_result)? } else { vec![input] };
        for file in found {
            if !files.contains(&file) {
                files.push(file);
            }
        }
    }
    Ok(files)
}

/// Follows links to folders, each folder once, because they may form a cycle.
fn inputs_below(folder: &Path, is_result: &dyn Fn(&Path) -> bool) -> Result<Vec<PathBuf>> {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.into());
    let is_record = |path: &Path| batch::result_of(path).is_some_and(|result| is_result(&result));
    let mut followed = vec![real(folder)];
    let mut skips = |path: &Path| {
        if batch::is_unfinished(path) || left_by_system(path) || is_result(path) || is_record(path) {
            return true;
        }
        if !path.is_symlink() || !path.is_dir() {
            return false;
        }
        let place = real(path);
        let again = followed.contains(&place);
        followed.push(place);
        again
    };
    below(folder, true, &mut skips)
}

/// All files in a folder and its subfolders. A link is one file.
pub(crate) fn files_below(folder: &Path) -> Result<Vec<PathBuf>> {
    below(folder, false, &mut |_| false)
}

fn below(folder: &Path, follow: bool, skips: &mut dyn FnMut(&Path) -> bool) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<io::Result<Vec<_>>>);
    let entries = entries.map_err(WorkflowError::read("the folder", folder))?;
    let mut entries: Vec<PathBuf> = entries.iter().map(fs::DirEntry::path).collect();
    entries.sort();
    let mut files = Vec::new();
    for entry in entries {
        if skips(&entry) {
            continue;
        }
        if entry.is_dir() && (follow || !entry.is_symlink()) {
            files.extend(below(&entry, follow, skips)?);
        } else {
            files.push(entry);
        }
    }
    Ok(files)
}

pub(crate) fn hash(file: &Path, name: &str) -> Result<HashedFile> {
    let mut hasher = Sha256::new();
    let mut opened = File::open(file).map_err(WorkflowError::read("the input", file))?;
    let mut buffer = vec![0; BUFFER_BYTES];
    let mut bytes = 0;
    loop {
        match opened.read(&mut buffer) {
            Ok(0) => break,
            Ok(count) => {
                hasher.update(&buffer[..count]);
                bytes += count as u64;
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(WorkflowError::read("the input", file)(error)),
        }
    }
    let sha256 = hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    Ok(HashedFile { file: name.into(), bytes, sha256 })
}

/// With `/` on all systems; the whole path without a common root.
fn relative(file: &Path, folder: &Path) -> String {
    let complete = |path: &Path| {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.into());
        let mut parts: Vec<Component<'_>> = Vec::new();
        for part in path.components() {
            match part {
                Component::ParentDir => drop(parts.pop()),
                part => parts.push(part),
            }
        }
        parts.iter().map(|part| part.as_os_str().to_string_lossy().into_owned()).collect::<Vec<_>>()
    };
    let (file, folder) = (complete(file), complete(folder));
    let shared = file.iter().zip(&folder).take_while(|(a, b)| a == b).count();
    if shared == 0 {
        return file.join("/");
    }
    let up = (shared..folder.len()).map(|_| "..");
    up.chain(file[shared..].iter().map(String::as_str)).collect::<Vec<_>>().join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_relative_to_the_result() {
        for (file, folder, expected) in [
            ("/a/far.png", "/a", "far.png"),
            ("/a/b/../far.png", "/a/depth", "../far.png"),
            ("/data/1/far.png", "/results/1", "../../data/1/far.png"),
        ] {
            assert_eq!(relative(file.as_ref(), folder.as_ref()), expected);
        }
    }

    #[test]
    fn folders_and_pages_represent_their_files() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["b.tif", "camera/dark.npy"] {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
            fs::write(path, "abc").expect("a writable folder");
        }
        let inputs = ["b.tif#1", "b.tif#2", "camera"].map(|name| folder.path().join(name));
        let found = hashed(&inputs, &folder.path().join("out")).expect("readable");
        let names: Vec<_> = found.iter().map(|file| file.file.as_str()).collect();
        assert_eq!(names, ["../b.tif", "../camera/dark.npy"]);
        // Output of sha256sum.
        assert_eq!(found[0].sha256, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    }

    #[test]
    fn files_that_a_file_manager_leaves_are_not_inputs() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["1.png", ".DS_Store", "._1.png", "THUMBS.DB", "Desktop.ini", ".hidden.png"] {
            fs::write(folder.path().join(name), "abc").expect("a writable folder");
        }
        let found = hashed(&[folder.path().into()], &folder.path().join("out")).expect("readable");
        let names: Vec<_> = found.iter().map(|file| file.file.as_str()).collect();
        assert_eq!(names, ["../.hidden.png", "../1.png"], "looking at a folder does not change its records");
    }

    #[cfg(unix)]
    #[test]
    fn results_and_unfinished_files_are_not_inputs() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in [
            "1.png",
            "sub/2.png",
            "depth/map.npy",
            ".other.batch-partial/other/map.npy",
            ".next.partial-7/map.npy",
            "page.html",
            "page.html.batch.toml",
            "x.batch.toml",
        ] {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
            fs::write(path, "abc").expect("a writable folder");
        }
        for (to, name) in [(".", "again"), ("sub", "linked"), ("..", "sub/up")] {
            std::os::unix::fs::symlink(to, folder.path().join(name)).expect("a writable folder");
        }
        let results = ["depth", "page.html"].map(|name| folder.path().join(name));
        let is_result = |path: &Path| results.iter().any(|result| result == path);
        let found = files(&[folder.path().into()], &is_result).expect("readable");
        let names: Vec<_> =
            found.iter().filter_map(|file| file.strip_prefix(folder.path()).ok()?.to_str()).collect();
        assert_eq!(names, ["1.png", "linked/2.png", "sub/2.png", "x.batch.toml"]);
        let found = hashed(&[folder.path().into()], &folder.path().join("depth")).expect("readable");
        assert!(found.iter().all(|file| !file.file.contains("map.npy")), "{found:?}");
    }
}
