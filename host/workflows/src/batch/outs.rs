//! Where all jobs of a manifest put their results. Compares places on disk, not their spelling.

use std::{
    collections::HashMap,
    fs::File,
    hash::{BuildHasher, RandomState},
    io::{BufRead, BufReader, ErrorKind, Read},
    path::{Path, PathBuf},
};

use super::{
    BatchError,
    manifest::{JOB_BYTES_MAX, Manifest},
};
use crate::request::outputs::on_disk;

pub(super) struct Outs {
    jobs: usize,
    /// The manifest's folder on disk.
    base: PathBuf,
    /// Line of the first job by the hash of its place, because paths of a million jobs need much memory.
    lines: HashMap<u64, usize>,
    hasher: RandomState,
}

impl Outs {
    /// Reads the whole manifest.
    pub fn of(manifest: &Path) -> Result<Self, BatchError> {
        let base = on_disk(&current_folder()?, manifest.parent().unwrap_or(Path::new("")));
        let mut outs = Self { jobs: 0, base, lines: HashMap::new(), hasher: RandomState::new() };
        let mut entries = Manifest::open(manifest)?;
        while let Some(entry) = entries.next()? {
            outs.jobs += 1;
            if let Ok(out) = entry.job.and_then(|(_, fields)| fields.text("out")) {
                let place = outs.hasher.hash_one(on_disk(&outs.base, out.as_ref()));
                outs.lines.entry(place).or_insert(entry.line);
            }
        }
        Ok(outs)
    }

    pub fn jobs(&self) -> usize {
        self.jobs
    }

    /// Whether a job makes `path`.
    pub fn makes(&self, path: &Path) -> bool {
        current_folder()
            .is_ok_and(|current| self.lines.contains_key(&self.hasher.hash_one(on_disk(&current, path))))
    }

    /// Line of the job that makes `path`, or a folder around it, unless that is the job on `line`.
    pub fn maker_of(&self, path: &Path, line: usize) -> Result<Option<usize>, BatchError> {
        let place = on_disk(&current_folder()?, path);
        Ok(self.maker(&place, Some(line)).map(|(maker, _)| maker))
    }

    /// Checks that the job on `line` may make `out`: no earlier job makes it, and no job makes a folder around it.
    pub fn check(&self, line: usize, out: &str) -> Result<(), BatchError> {
        match self.maker(&on_disk(&self.base, out.as_ref()), Some(line)) {
            Some((other, place)) => {
                let reason = format!(
                    "another job (line {other}) makes {}; name a place outside of it",
                    place.display()
                );
                Err(BatchError::field("out", out, reason))
            }
            None => Ok(()),
        }
    }

    /// Checks that `path` may become a report of the batch. A file that exists must be such a report, as
    /// `begins` finds from its first line, or be empty.
    pub fn check_report(
        &self,
        what: &'static str,
        path: &Path,
        begins: fn(&str) -> bool,
    ) -> Result<(), BatchError> {
        let wrong = |reason| Err(BatchError::Report { what, path: path.into(), reason });
        if let Some((line, place)) = self.maker(&on_disk(&current_folder()?, path), None) {
            return wrong(format!("the job on line {line} makes {}", place.display()));
        }
        match is_report(path, begins) {
            Ok(true) => Ok(()),
            Ok(false) => wrong(format!("it exists and does not hold the {what} of an earlier batch")),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            Err(source) => Err(BatchError::Read { path: path.into(), source }),
        }
    }

    /// The first job that makes `place` or a folder around it, except the job on the line `except`.
    fn maker<'a>(&self, place: &'a Path, except: Option<usize>) -> Option<(usize, &'a Path)> {
        place.ancestors().find_map(|folder| {
            let line = *self.lines.get(&self.hasher.hash_one(folder))?;
            (Some(line) != except).then_some((line, folder))
        })
    }
}

/// Whether two paths name the same place on disk.
pub(super) fn are_same(a: &Path, b: &Path) -> Result<bool, BatchError> {
    let current = current_folder()?;
    Ok(on_disk(&current, a) == on_disk(&current, b))
}

fn is_report(path: &Path, begins: fn(&str) -> bool) -> std::io::Result<bool> {
    // Opening a pipe would wait for its other end.
    if !path.metadata()?.is_file() {
        return Ok(false);
    }
    let mut line = String::new();
    match BufReader::new(File::open(path)?.take(JOB_BYTES_MAX)).read_line(&mut line) {
        Err(error) if error.kind() == ErrorKind::InvalidData => Ok(false),
        read => Ok(read? == 0 || begins(&line)),
    }
}

fn current_folder() -> Result<PathBuf, BatchError> {
    std::env::current_dir().map_err(|source| BatchError::Read { path: ".".into(), source })
}
