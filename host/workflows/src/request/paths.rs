//! Files in a request's texts.

use std::path::Path;

use serde_json::Value;

use super::PathKind;

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
