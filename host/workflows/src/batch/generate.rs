//! Writes a manifest with a row for each file that matches a pattern.

use std::{
    fs,
    path::{Component, Path, PathBuf},
    str::FromStr,
};

use farnear_files::{staging::write_file, video::pictures::left_by_system};

use super::{BatchError, fields::Fields, jobs, manifest::KIND};
use crate::error::Result;

/// A field and its value. Each `*` stands for the text matched by the same `*` of the first pattern.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Pattern {
    name: String,
    value: String,
}

impl FromStr for Pattern {
    type Err = BatchError;

    fn from_str(text: &str) -> std::result::Result<Self, BatchError> {
        match text.split_once('=') {
            Some((name, value)) if !name.trim().is_empty() && !value.trim().is_empty() => {
                Ok(Self { name: name.trim().into(), value: value.trim().into() })
            }
            _ => Err(BatchError::Pattern(format!("`{text}`: expected NAME=VALUE, such as far=*/far.png"))),
        }
    }
}

/// Writes a CSV manifest, a job of `kind` per match, by name; returns the number. Patterns are relative to its folder.
pub fn generate(manifest: &Path, kind: &str, fields: &[Pattern]) -> Result<usize> {
    jobs::kind(kind)?;
    let pattern = |reason: String| BatchError::Pattern(reason);
    if manifest.extension().is_none_or(|ending| ending != "csv") {
        return Err(pattern(format!(
            "{}: a manifest from patterns is CSV; name it with .csv",
            manifest.display()
        ))
        .into());
    }
    if manifest.exists() {
        return Err(pattern(format!("{} exists; remove it or name another one", manifest.display())).into());
    }
    let Some(first) = fields.first() else {
        return Err(pattern("name a field with a pattern, such as far=*/far.png".into()).into());
    };
    let mut names = Fields::default();
    std::iter::once(KIND)
        .chain(fields.iter().map(|field| field.name.as_str()))
        .try_for_each(|name| names.insert(name, Vec::new()))?;
    let stars = first.value.matches('*').count();
    if let Some(wrong) = fields.iter().find(|field| field.value.matches('*').count() > stars) {
        let reason = format!(
            "{}={} has more * than {}={}, which has {stars}",
            wrong.name, wrong.value, first.name, first.value
        );
        return Err(pattern(reason).into());
    }
    let base = manifest.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut found = Vec::new();
    let (root, parts) = split(&first.value);
    search(&base.join(root), &parts, &mut Vec::new(), &mut found);
    found.sort();
    if found.is_empty() {
        return Err(
            pattern(format!("no file matches {}={} in {}", first.name, first.value, base.display())).into()
        );
    }
    let mut writer = csv::Writer::from_writer(Vec::new());
    let unwritable = |source: std::io::Error| BatchError::Write { path: PathBuf::from(manifest), source };
    let header = std::iter::once(KIND).chain(fields.iter().map(|field| field.name.as_str()));
    writer.write_record(header).map_err(|error| unwritable(error.into()))?;
    for captured in &found {
        let row: Vec<String> = std::iter::once(kind.to_owned())
            .chain(fields.iter().map(|field| filled(&field.value, captured)))
            .collect();
        if let Some(cell) = row.iter().find(|cell| !survives(cell)) {
            return Err(pattern(format!(
                "the name {cell:?} would be another one in a CSV: expected UTF-8 without blanks at its ends and \
                 without carriage returns; rename the file or its folder"
            ))
            .into());
        }
        writer.write_record(&row).map_err(|error| unwritable(error.into()))?;
    }
    let text = writer.into_inner().map_err(|error| unwritable(error.into_error()))?;
    write_file(manifest, &text)?;
    Ok(found.len())
}

/// Whether [`Manifest`](super::manifest::Manifest) reads the same text. Names that are not UTF-8 have a replacement character.
fn survives(cell: &str) -> bool {
    cell.trim() == cell && !cell.contains(['\r', char::REPLACEMENT_CHARACTER])
}

fn filled(value: &str, captured: &[String]) -> String {
    let mut parts = value.split('*');
    let mut text = parts.next().unwrap_or_default().to_owned();
    for (part, star) in parts.zip(captured) {
        text.push_str(star);
        text.push_str(part);
    }
    text
}

/// Root and parts of a pattern, as the system separates them: `C:\shots\*` on Windows.
fn split(pattern: &str) -> (PathBuf, Vec<String>) {
    let (mut root, mut parts) = (PathBuf::new(), Vec::new());
    for part in Path::new(pattern).components() {
        match part {
            Component::Prefix(_) | Component::RootDir => root.push(part),
            Component::CurDir => {}
            part => parts.push(part.as_os_str().to_string_lossy().into_owned()),
        }
    }
    (root, parts)
}

/// Texts matched by the `*` of each part of a path, for each file below `folder`.
fn search(folder: &Path, parts: &[String], captured: &mut Vec<String>, found: &mut Vec<Vec<String>>) {
    let Some((part, rest)) = parts.split_first() else { return };
    if !part.contains('*') {
        let path = folder.join(part);
        return match rest.is_empty() {
            true if path.is_file() => found.push(captured.clone()),
            true => {}
            false => search(&path, rest, captured, found),
        };
    }
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let Some(stars) = matched(part, &name) else { continue };
        if left_by_system(&entry.path()) || name.starts_with('.') && !part.starts_with('.') {
            continue;
        }
        let before = captured.len();
        captured.extend(stars);
        match rest.is_empty() {
            true if entry.path().is_file() => found.push(captured.clone()),
            true => {}
            false => search(&entry.path(), rest, captured, found),
        }
        captured.truncate(before);
    }
}

/// Texts matched by each `*` of a pattern; the first ones are as short as possible.
fn matched(pattern: &str, name: &str) -> Option<Vec<String>> {
    let Some((before, after)) = pattern.split_once('*') else { return (pattern == name).then(Vec::new) };
    let rest = name.strip_prefix(before)?;
    (0..=rest.len()).filter(|end| rest.is_char_boundary(*end)).find_map(|end| {
        let mut stars = vec![rest[..end].to_owned()];
        stars.extend(matched(after, &rest[end..])?);
        Some(stars)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_is_split_into_root_and_parts() {
        let split = |pattern: &str| {
            let (root, parts) = split(pattern);
            (root.display().to_string(), parts.join(" "))
        };
        assert_eq!(split("./shots/*/far.png"), (String::new(), "shots * far.png".into()));
        if cfg!(windows) {
            assert_eq!(split(r"C:\shots\*\far.png"), (r"C:\".into(), "shots * far.png".into()));
        } else {
            assert_eq!(split("/shots/../*.png"), ("/".into(), "shots .. *.png".into()));
        }
    }

    #[test]
    fn a_manifest_is_written_from_a_pattern() {
        let folder = tempfile::tempdir().unwrap();
        for pair in ["b 2", "a1", ".hidden"] {
            fs::create_dir_all(folder.path().join("shots").join(pair)).unwrap();
            fs::write(folder.path().join("shots").join(pair).join("far_7.png"), "").unwrap();
        }
        fs::create_dir_all(folder.path().join("shots/c/far_8.png")).unwrap();
        let manifest = folder.path().join("pairs.csv");
        let fields: Vec<Pattern> =
            ["far=shots/*/far_*.png", "near=shots/*/near_*.png", "out=depth/*", "optics=rig.toml"]
                .map(|text| text.parse().unwrap())
                .into();
        assert_eq!(generate(&manifest, "depth", &fields).unwrap(), 2);
        assert_eq!(
            fs::read_to_string(&manifest).unwrap(),
            "do,far,near,out,optics\n\
             depth,shots/a1/far_7.png,shots/a1/near_7.png,depth/a1,rig.toml\n\
             depth,shots/b 2/far_7.png,shots/b 2/near_7.png,depth/b 2,rig.toml\n"
        );
        let error = |kind: &str, fields: &[&str]| {
            let fields: Vec<Pattern> = fields.iter().map(|text| text.parse().unwrap()).collect();
            generate(&folder.path().join("new.csv"), kind, &fields).unwrap_err().to_string()
        };
        assert!(generate(&manifest, "depth", &fields).unwrap_err().to_string().contains("exists"));
        assert!(error("depth", &["far=*/none.png"]).contains("no file matches"));
        assert!(error("depth", &["far=a.png", "out=*"]).contains("more *"));
        assert!(error("dept", &["far=*"]).contains("dept"));
        assert!(error("depth", &["far=*", "out=a", "out=b"]).contains("`out` is given twice"));
        fs::write(folder.path().join(" a.png"), "").unwrap();
        assert!(error("depth", &["far=*.png"]).contains("\" a.png\" would be another one"));
        assert!(survives("a b/ c\n;.png"));
        for name in [" a", "b ", "c\r.png", "d\u{fffd}.png"] {
            assert!(!survives(name), "{name:?}");
        }
        assert!("far".parse::<Pattern>().is_err() && "=x".parse::<Pattern>().is_err());
    }
}
