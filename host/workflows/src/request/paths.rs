//! Files in a request's texts.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value};

use super::{PathKind, Task};

impl Task {
    /// Files that a job with these fields may read, also those that do not exist yet.
    pub fn files(&self, fields: &Map<String, Value>, base: &Path) -> Vec<PathBuf> {
        let mut found = Vec::new();
        for (name, kind) in self.paths {
            let texts: Vec<&str> = match fields.get(*name) {
                _ if matches!(kind, PathKind::OutputFile | PathKind::OutputFolder) => Vec::new(),
                // The text may be a list.
                Some(Value::String(text)) => std::iter::once(text.as_str()).chain(text.split(';')).collect(),
                Some(Value::Array(list)) => list.iter().filter_map(Value::as_str).collect(),
                _ => Vec::new(),
            };
            found.extend(texts.into_iter().map(|text| base.join(file_part(text.trim(), *kind))));
        }
        found
    }
}

pub(super) fn file_part(text: &str, kind: PathKind) -> &str {
    match kind {
        PathKind::InputOrName => text.split(',').next().unwrap_or(text),
        PathKind::NamedInput => text.split_once('=').map_or(text, |(_, file)| file),
        _ => text,
    }
}

/// Makes the file of a text relative to `base`. The text before or after it stays.
pub(super) fn rebase(value: &mut Value, kind: PathKind, base: &Path) {
    match value {
        Value::String(text) => {
            let file = file_part(text, kind);
            let is_name = kind == PathKind::InputOrName && !base.join(file).exists();
            if !is_name {
                let joined = base.join(file).display().to_string();
                // Options follow a built-in name, and a file follows a name.
                let begin = if kind == PathKind::InputOrName { 0 } else { text.len() - file.len() };
                let place = begin..begin + file.len();
                text.replace_range(place, &joined);
            }
        }
        Value::Array(list) => list.iter_mut().for_each(|item| rebase(item, kind, base)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_file_after_a_name_is_relative_to_the_base() {
        for (given, expected) in [
            ("anna:walk=a.bvh", "anna:walk=/base/a.bvh"),
            ("a.mat", "/base/a.mat"),
            ("walk=/a.bvh", "walk=/a.bvh"),
            ("walk=walk", "walk=/base/walk"),
            ("a=a=a", "a=/base/a=a"),
        ] {
            let mut value = json!([given]);
            rebase(&mut value, PathKind::NamedInput, Path::new("/base"));
            assert_eq!(value, json!([expected]));
        }
    }

    #[test]
    fn files_of_a_job_need_not_exist() {
        let task = Task {
            name: "sample",
            schema: || Value::Null,
            required: &[],
            paths: &[
                ("views", PathKind::Input),
                ("psf", PathKind::InputOrName),
                ("clip", PathKind::NamedInput),
                ("out", PathKind::OutputFolder),
            ],
            job: |_, _| unreachable!("no job is read"),
        };
        let fields = json!({"views": "a; b", "psf": "k.toml,k=1", "clip": ["walk=c.bvh"], "out": "d"});
        let found = task.files(fields.as_object().expect("an object"), Path::new("/base"));
        let wanted = ["/base/a; b", "/base/a", "/base/b", "/base/k.toml", "/base/k.toml", "/base/c.bvh"];
        assert_eq!(found, wanted.map(PathBuf::from));
    }

    #[test]
    fn text_after_a_file_stays() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("k"), "").expect("a writable folder");
        let joined = folder.path().join("k").display().to_string();
        for (given, expected) in [("k,k=1", format!("{joined},k=1")), ("gaussian,k=1", "gaussian,k=1".into())]
        {
            let mut value = json!(given);
            rebase(&mut value, PathKind::InputOrName, folder.path());
            assert_eq!(value, json!(expected));
        }
    }
}
