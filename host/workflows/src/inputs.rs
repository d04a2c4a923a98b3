//! Input files of a result, with their hashes.

use std::{
    fs::{self, File},
    io::{self, Read},
    path::{Component, Path, PathBuf},
};

use farnear_files::image_file::file_and_page;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::{
    batch,
    error::{Result, WorkflowError},
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

/// Hashes inputs of a result in `out`: all files of a folder; the file of a TIFF page (`stack.tif#3`).
pub(crate) fn hashed(inputs: &[PathBuf], out: &Path) -> Result<Vec<HashedFile>> {
    let place = batch::final_place(out);
    files(inputs)?.par_iter().map(|file| hash(file, &relative(file, &place))).collect()
}

pub(crate) fn files(inputs: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut files: Vec<PathBuf> = Vec::new();
    for input in inputs {
        let (input, _) = file_and_page(input);
        let found = if input.is_dir() { files_below(&input)? } else { vec![input] };
        for file in found {
            if !files.contains(&file) {
                files.push(file);
            }
        }
    }
    Ok(files)
}

pub(crate) fn files_below(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<io::Result<Vec<_>>>);
    let entries = entries.map_err(WorkflowError::read("the folder", folder))?;
    let mut entries: Vec<PathBuf> = entries.iter().map(fs::DirEntry::path).collect();
    entries.sort();
    let mut files = Vec::new();
    for entry in entries {
        if entry.is_dir() {
            files.extend(files_below(&entry)?);
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
}
