//! `batch.toml`: what a result was made from. The next run skips a job with matching provenance.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Component, Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::fields::Fields;
use crate::{
    MADE_BY,
    cache::{FileVersion, LeastRecentlyUsed},
    error::Result,
    inputs::{self, HashedFile},
};

const FORMAT: u32 = 1;
/// Files shared by jobs (optics, corrections, models) are hashed once; each job has a few more.
const SUMS: usize = 64;

#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) struct Provenance {
    format: u32,
    made_by: String,
    #[serde(rename = "do")]
    kind: String,
    /// The job's fields except `out`.
    settings: BTreeMap<String, Vec<String>>,
    /// The job's output as JSON, for later runs.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    figures: String,
    /// The job's warnings, for later runs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    #[serde(default)]
    input: Vec<HashedFile>,
    #[serde(default)]
    output: Vec<HashedFile>,
}

/// Hashes of files; recent ones are cached.
pub(super) struct Sums(LeastRecentlyUsed<FileVersion, HashedFile>);

impl Default for Sums {
    fn default() -> Self {
        Self(LeastRecentlyUsed::new(SUMS))
    }
}

impl Sums {
    /// Hashes the files of a job's inputs, except the results of jobs in an input folder.
    pub fn of(
        &self,
        paths: &[PathBuf],
        base: &Path,
        is_result: &dyn Fn(&Path) -> bool,
    ) -> Result<Vec<HashedFile>> {
        let files = inputs::files(paths, is_result)?;
        let sum = |file: &PathBuf| {
            // Relative to the manifest and with `/`, so that the whole can be moved, also to another system.
            let name = file.strip_prefix(base).unwrap_or(file).display().to_string();
            let name = name.replace(std::path::MAIN_SEPARATOR, "/");
            let summed = self.0.get(FileVersion::of("the input", file)?, || inputs::hash(file, &name))?;
            Ok(HashedFile { file: name, ..HashedFile::clone(&summed) })
        };
        files.iter().map(sum).collect()
    }
}

impl Provenance {
    pub fn new(kind: &str, fields: &Fields, input: Vec<HashedFile>) -> Self {
        Self {
            format: FORMAT,
            made_by: MADE_BY.into(),
            kind: kind.into(),
            settings: fields.without("out"),
            figures: String::new(),
            warnings: Vec::new(),
            input,
            output: Vec::new(),
        }
    }

    pub fn figures(&self) -> Option<Value> {
        serde_json::from_str(&self.figures).ok()
    }

    /// Adds the figures except the duration, so that a record depends on the inputs only.
    pub fn with_figures(self, figures: &Value) -> Self {
        let mut figures = figures.clone();
        if let Some(figures) = figures.as_object_mut() {
            figures.remove("seconds");
        }
        Self { figures: figures.to_string(), ..self }
    }

    pub fn with_output(mut self, result: &Path) -> Result<Self> {
        let files = if result.is_dir() { inputs::files_below(result)? } else { vec![result.to_path_buf()] };
        let root = if result.is_dir() { result } else { result.parent().unwrap_or(Path::new("")) };
        let summed = |file: &PathBuf| {
            let name = file.strip_prefix(root).unwrap_or(file);
            // Same separator on all systems.
            let parts: Vec<_> = name.components().map(|part| part.as_os_str().to_string_lossy()).collect();
            inputs::hash(file, &parts.join("/"))
        };
        self.output = files.iter().map(summed).collect::<Result<_>>()?;
        Ok(self)
    }

    /// The record while files of this result replace those of `earlier`: it lists both and matches no job.
    pub fn unfinished(&self, earlier: Option<&Self>) -> Self {
        let new: BTreeSet<&str> = self.output.iter().map(|output| output.file.as_str()).collect();
        let stale = earlier.into_iter().flat_map(|earlier| &earlier.output);
        let stale = stale.filter(|output| !new.contains(output.file.as_str())).cloned();
        let mut record = self.clone();
        record.made_by.clear();
        record.output.extend(stale);
        record
    }

    /// Files of the result, relative to its folder. A name that leads out of the folder is not one.
    pub fn outputs(&self) -> impl Iterator<Item = &Path> {
        let inside = |name: &&Path| name.components().all(|part| matches!(part, Component::Normal(_)));
        self.output.iter().map(|output| Path::new(&output.file)).filter(inside)
    }

    /// Reads a record; `None` if missing or of another version.
    pub fn read(file: &Path) -> Option<Self> {
        let text = fs::read_to_string(file).ok()?;
        toml::from_str(&text).ok().filter(|record: &Self| record.format == FORMAT)
    }

    /// Whether the record matches `wanted` and its files are complete: by length, or by hash with `verify`.
    pub fn fulfils(&self, wanted: &Self, root: &Path, verify: bool) -> bool {
        let made_alike = (&self.made_by, &self.kind, &self.settings, &self.input)
            == (&wanted.made_by, &wanted.kind, &wanted.settings, &wanted.input);
        let whole = |output: &HashedFile| {
            let file = root.join(&output.file);
            match verify {
                true => inputs::hash(&file, &output.file).is_ok_and(|found| found == *output),
                false => fs::metadata(&file).is_ok_and(|found| found.len() == output.bytes),
            }
        };
        made_alike && !self.output.is_empty() && self.output.iter().all(whole)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_leads_out_of_the_folder_is_no_output() {
        let files = ["a.npy", "sub/b.npy", "../c.npy", "/d.npy", "sub/../../e.npy"];
        let output = files.map(|file| HashedFile { file: file.into(), bytes: 1, sha256: String::new() });
        let record =
            Provenance { output: output.into(), ..Provenance::new("depth", &Fields::default(), Vec::new()) };
        assert_eq!(record.outputs().collect::<Vec<_>>(), [Path::new("a.npy"), Path::new("sub/b.npy")]);
    }

    #[test]
    fn a_result_is_done_while_nothing_has_changed() {
        let folder = tempfile::tempdir().expect("a folder");
        let (input, result) = (folder.path().join("in"), folder.path().join("result"));
        let write = |file: &Path, text: &str| fs::write(file, text).expect("a writable folder");
        fs::create_dir(&result).expect("a writable folder");
        write(&input, "abc");
        write(&result.join("map"), "1234");
        let no_result = |_: &Path| false;
        let sums = || {
            let inputs = std::slice::from_ref(&input);
            Sums::default().of(inputs, folder.path(), &no_result).expect("readable")
        };
        let mut fields = Fields::new(folder.path());
        fields.insert("out", vec!["result".into()]).expect("a new field");
        fields.insert("smooth", vec!["7".into()]).expect("a new field");
        let wanted = |fields: &Fields| Provenance::new("depth", fields, sums());
        let made = wanted(&fields).with_output(&result).expect("readable");
        // Output of sha256sum.
        let of_abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!((made.input[0].file.as_str(), made.input[0].sha256.as_str()), ("in", of_abc));
        assert!(made.fulfils(&wanted(&fields), &result, true));

        let mut other = fields.clone();
        other.remove("smooth");
        other.insert("smooth", vec!["9".into()]).expect("a new field");
        assert!(!made.fulfils(&wanted(&other), &result, false), "another setting");
        assert!(!Provenance { made_by: "farnear 0".into(), ..made.clone() }.fulfils(
            &wanted(&fields),
            &result,
            false
        ));
        write(&input, "abd");
        assert!(!made.fulfils(&wanted(&fields), &result, false), "another input of the same length");
        write(&input, "abc");
        write(&result.join("map"), "1235");
        assert!(made.fulfils(&wanted(&fields), &result, false));
        assert!(!made.fulfils(&wanted(&fields), &result, true), "a changed result");
        write(&result.join("map"), "123");
        assert!(!made.fulfils(&wanted(&fields), &result, false), "a cut result");
    }

    #[test]
    fn a_rewritten_file_gets_a_new_checksum() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("optics.toml");
        let sums = Sums::default();
        let sum = |text: &str| {
            fs::write(&file, text).expect("a writable folder");
            sums.of(std::slice::from_ref(&file), folder.path(), &|_| false).expect("readable")
        };
        assert_ne!(sum("a"), sum("longer"));
    }
}
