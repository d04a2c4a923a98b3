//! Stored captures of a session: folders with `capture.toml` ([`farnear_capture::record`]) and an optional `note.toml`.

use std::{
    fs,
    path::{Component, Path, PathBuf},
};

use farnear_capture::record::{CAPTURE_FILE, CaptureRecord, read_record};
use farnear_files::staging::{self, write_file};
use serde::{Deserialize, Serialize};

use crate::{
    error::{About, Result, WorkflowError},
    text_file,
};

const NOTE_FILE: &str = "note.toml";
const NOTE_MAX: usize = 64 * 1024;
/// Prefix of folders with another map of a capture.
const VARIANT: &str = "variant-";
/// Other names in a session's folder.
const RESERVED: &[&str] =
    &["people", "recordings", "flat-series", "optics.toml", "quality.toml", "correction.toml"];
const BEST: u8 = 5;

#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Note {
    #[serde(default)]
    pub rating: u8,
    #[serde(default)]
    pub text: String,
}

#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Capture {
    pub name: String,
    /// `pair` or `sequence`.
    pub kind: &'static str,
    /// In the order of the exposures.
    pub images: Vec<String>,
    pub files: Vec<String>,
    /// Folders in the capture's with a `depth.npy`: other maps of the same pair.
    pub variants: Vec<String>,
    /// When its record was written.
    pub written_unix_s: u64,
    /// Only for real hardware.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    pub width: usize,
    pub height: usize,
    pub bits: u8,
    pub exposure_us: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scene: Option<String>,
    /// The optics file as given.
    pub optics: toml::Table,
    pub has_depth: bool,
    pub note: Note,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub broken: Option<String>,
}

/// Whether a name leads to a visible entry of a folder.
fn is_plain(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    let one = matches!((parts.next(), parts.next()), (Some(Component::Normal(_)), None));
    one && !name.starts_with('.') && !name.chars().any(char::is_control)
}

/// Whether Windows takes the name for a device, with any ending: `NUL`, `com1.mp4`.
fn is_device(name: &str) -> bool {
    let stem = name.split('.').next().unwrap_or_default().trim_end().to_ascii_lowercase();
    let number = stem.strip_prefix("com").or_else(|| stem.strip_prefix("lpt"));
    ["con", "prn", "aux", "nul"].contains(&stem.as_str())
        || number.is_some_and(|number| matches!(number.as_bytes(), [b'0'..=b'9']))
}

/// Entry of a session by a name that all systems allow.
pub fn folder_of(session: &Path, name: &str) -> Result<PathBuf> {
    entry_of(session, name, "capture")
}

/// As [`folder_of`], for something that is not a capture; `kind` names it in errors.
pub fn entry_of(session: &Path, name: &str, kind: &'static str) -> Result<PathBuf> {
    let letters = !name.chars().any(|c| "/\\:*?\"<>|".contains(c));
    let everywhere = letters && name.trim() == name && !name.ends_with('.') && !is_device(name);
    if !is_plain(name) || !everywhere || name.len() > 100 {
        let expected = "expected a name of at most 100 bytes that does not begin or end with a dot or a blank, without control \
                        characters and / \\ : * ? \" < > |, and not that of a device of Windows (CON, NUL, COM1)";
        return Err(WorkflowError::parameter(kind, name, expected));
    }
    Ok(session.join(name))
}

pub fn new_capture(session: &Path, name: &str) -> Result<PathBuf> {
    let folder = folder_of(session, name)?;
    let taken = if RESERVED.iter().any(|reserved| reserved.eq_ignore_ascii_case(name)) {
        "expected another name: the session's own files have this one"
    } else if name.contains('.') {
        "expected a name without a dot"
    } else if fs::symlink_metadata(&folder).is_ok() {
        "expected a name that no capture of the session has"
    } else {
        return Ok(folder);
    };
    Err(WorkflowError::parameter("capture", name, taken))
}

/// Folder of an existing capture. Rejects links, FIFOs and devices, which may leave the session or never end.
pub fn existing(session: &Path, name: &str) -> Result<PathBuf> {
    // The system's own programs may have given it another name than the page would.
    let folder = if is_plain(name) { session.join(name) } else { folder_of(session, name)? };
    check_regular(&folder)?;
    Ok(folder)
}

fn check_regular(folder: &Path) -> Result<()> {
    let failed = WorkflowError::read("the capture", folder);
    let is_dir = fs::symlink_metadata(folder).is_ok_and(|found| found.is_dir());
    let has_record = fs::symlink_metadata(folder.join(CAPTURE_FILE)).is_ok();
    if !is_dir || !has_record {
        return Err(failed(std::io::ErrorKind::NotFound.into()));
    }
    let is_odd = |entry: &fs::DirEntry| entry.file_type().is_ok_and(|kind| !kind.is_file() && !kind.is_dir());
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
    let checked = entries.and_then(|entries| {
        let Some(entry) = entries.into_iter().find(is_odd) else { return Ok(()) };
        let name = entry.file_name();
        let text = format!("{} is a link, FIFO or device; expected a regular file", name.display());
        Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, text))
    });
    checked.map_err(failed)
}

/// Variant with the result of a focus stack.
pub const STACK_VARIANT: &str = "focus-stack";

pub fn variant_of(capture: &Path, variant: &str) -> Result<PathBuf> {
    let letters = variant.chars().all(|c| c.is_ascii_alphanumeric() || c == '-');
    if variant.is_empty() || !letters || variant.len() > 60 {
        let expected = "expected 1 to 60 letters, digits and hyphens";
        return Err(WorkflowError::parameter("variant", variant, expected));
    }
    Ok(capture.join(format!("{VARIANT}{variant}")))
}

/// Folder of a capture's map: that of a stack is the variant [`STACK_VARIANT`].
pub fn with_map(capture: PathBuf) -> PathBuf {
    let stack = capture.join(format!("{VARIANT}{STACK_VARIANT}"));
    if capture.join("depth.npy").exists() || !stack.is_dir() { capture } else { stack }
}

/// The first free names `KIND-001`, `KIND-002` and so on.
pub fn free_names(session: &Path, kind: &str, count: usize) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    let mut number = 1;
    while found.len() < count {
        let folder = folder_of(session, &format!("{kind}-{number:03}"))?;
        if !folder.exists() {
            found.push(folder);
        }
        number += 1;
    }
    Ok(found)
}

/// Captures whose record, optics or note contain all words of `search`, by name. A missing folder has none.
pub fn list(session: &Path, search: &str) -> Result<Vec<Capture>> {
    let entries = match fs::read_dir(session) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(WorkflowError::read("the session", session)(error)),
    };
    let mut found = Vec::new();
    for entry in entries {
        let path = entry.map_err(WorkflowError::read("the session", session))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let is_dir = fs::symlink_metadata(&path).is_ok_and(|found| found.is_dir());
        if name.starts_with('.') || !is_dir || fs::symlink_metadata(path.join(CAPTURE_FILE)).is_err() {
            continue;
        }
        // The folder may disappear while it is read: only this capture is broken.
        let capture = read(&path).unwrap_or_else(|error| broken(&name, &error));
        if capture.broken.is_some() && search.trim().is_empty()
            || capture.broken.is_none() && matches(&path, &capture, search)
        {
            found.push(capture);
        }
    }
    found.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(found)
}

pub fn read(folder: &Path) -> Result<Capture> {
    let missing = || WorkflowError::read("the capture", folder)(std::io::ErrorKind::NotFound.into());
    check_regular(folder)?;
    let record: CaptureRecord = read_record(folder)?.ok_or_else(missing)?;
    let (mut files, mut variants) = (Vec::new(), Vec::new());
    for entry in fs::read_dir(folder).map_err(WorkflowError::read("the capture", folder))? {
        let entry = entry.map_err(WorkflowError::read("the capture", folder))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_file = |path: &Path| fs::symlink_metadata(path).is_ok_and(|found| found.is_file());
        if is_file(&entry.path()) && !name.starts_with('.') {
            files.push(name);
        } else if let Some(variant) = name.strip_prefix(VARIANT)
            && is_file(&entry.path().join("depth.npy"))
        {
            variants.push(variant.to_owned());
        }
    }
    files.sort();
    variants.sort();
    let images: Vec<_> = record.exposure.iter().map(|exposure| exposure.image.clone()).collect();
    let pair = images == ["far.png", "near.png"];
    Ok(Capture {
        name: folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        kind: if pair { "pair" } else { "sequence" },
        images,
        has_depth: files.iter().any(|file| file == "depth.npy"),
        files,
        variants,
        written_unix_s: written(folder),
        time: record.time,
        width: record.camera.width,
        height: record.camera.height,
        bits: record.camera.bits,
        exposure_us: record.exposure.first().map_or(0, |exposure| exposure.exposure_us),
        scene: record.simulation.map(|simulation| simulation.scene),
        optics: record.optics,
        note: read_note(folder)?,
        broken: None,
    })
}

fn written(folder: &Path) -> u64 {
    let modified = fs::metadata(folder.join(CAPTURE_FILE)).and_then(|found| found.modified()).ok();
    let since = modified.and_then(|time| time.duration_since(std::time::UNIX_EPOCH).ok());
    since.map_or(0, |since| since.as_secs())
}

pub fn delete(session: &Path, name: &str) -> Result<()> {
    let folder = existing(session, name)?;
    fs::remove_dir_all(&folder).map_err(|source| WorkflowError::Folder { folder, source })
}

pub fn rename(session: &Path, name: &str, to: &str) -> Result<()> {
    let (folder, target) = (existing(session, name)?, new_capture(session, to)?);
    staging::rename(&folder, &target).map_err(|source| WorkflowError::Folder { folder, source })
}

fn broken(name: &str, error: &WorkflowError) -> Capture {
    Capture { name: name.into(), kind: "sequence", broken: Some(error.to_string()), ..Capture::default() }
}

/// Whether name, record and note contain all words, ignoring case.
fn matches(folder: &Path, capture: &Capture, search: &str) -> bool {
    if search.trim().is_empty() {
        return true;
    }
    let record = text_file::read(&folder.join(CAPTURE_FILE)).unwrap_or_default();
    let depth = text_file::read(&folder.join("depth.toml")).unwrap_or_default();
    let all = format!("{} {} {record} {depth}", capture.name, capture.note.text).to_lowercase();
    search.to_lowercase().split_whitespace().all(|word| all.contains(word))
}

pub fn read_note(folder: &Path) -> Result<Note> {
    let path = folder.join(NOTE_FILE);
    match text_file::read(&path) {
        Ok(text) => toml::from_str(&text).about(|| format!("the note {}", path.display())),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Note::default()),
        Err(error) => Err(WorkflowError::read("the note", &path)(error)),
    }
}

pub fn write_note(folder: &Path, note: &Note) -> Result<()> {
    if note.rating > BEST {
        return Err(WorkflowError::parameter("rating", note.rating, "expected 0 (not rated) to 5"));
    }
    if note.text.len() > NOTE_MAX {
        let length = note.text.len();
        return Err(WorkflowError::parameter(
            "note",
            format!("of {length} bytes"),
            format!("at most {NOTE_MAX}"),
        ));
    }
    fs::metadata(folder.join(CAPTURE_FILE)).map_err(WorkflowError::read("the capture", folder))?;
    Ok(write_file(&folder.join(NOTE_FILE), toml::to_string(note)?.as_bytes())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RECORD: &str = include_str!("sessions/capture.toml");

    fn session() -> tempfile::TempDir {
        let session = tempfile::tempdir().unwrap();
        for name in ["pair-002", "pair-001", ".partial"] {
            fs::create_dir(session.path().join(name)).unwrap();
            fs::write(session.path().join(name).join(CAPTURE_FILE), RECORD).unwrap();
        }
        fs::create_dir(session.path().join("other")).unwrap();
        session
    }

    #[test]
    fn captures_are_listed_by_name_and_others_are_not() {
        let session = session();
        let found = list(session.path(), "").unwrap();
        let names: Vec<_> = found.iter().map(|capture| capture.name.as_str()).collect();
        assert_eq!(names, ["pair-001", "pair-002"]);
        assert_eq!((found[0].kind, found[0].width, found[0].has_depth), ("pair", 640, false));
        assert_eq!(found[0].scene.as_deref(), Some("staircase"));
        assert_eq!(list(&session.path().join("absent"), "").unwrap(), []);
        let free = free_names(session.path(), "pair", 2).unwrap();
        assert_eq!(free, [session.path().join("pair-003"), session.path().join("pair-004")]);
    }

    #[test]
    fn notes_are_kept_and_found() {
        let session = session();
        let folder = folder_of(session.path(), "pair-002").unwrap();
        let note = Note { rating: 4, text: "Sandpaper, \"lamp\" left".into() };
        write_note(&folder, &note).unwrap();
        assert_eq!(read_note(&folder).unwrap(), note);
        let found = |search: &str| list(session.path(), search).unwrap().len();
        assert_eq!([found("sandpaper LAMP"), found("staircase"), found("sandpaper cone")], [1, 2, 0]);
        assert!(write_note(&folder, &Note { rating: 6, ..note.clone() }).unwrap_err().is_usage());
        assert!(write_note(&session.path().join("other"), &note).is_err(), "it is not a capture");
        assert!(!session.path().join("other").join(NOTE_FILE).exists());
    }

    #[test]
    fn a_broken_capture_is_listed_with_what_is_wrong() {
        let session = session();
        fs::write(session.path().join("pair-001").join(CAPTURE_FILE), "format = \"x\"").unwrap();
        let found = list(session.path(), "").unwrap();
        assert!(found[0].broken.as_ref().is_some_and(|reason| reason.contains("format")), "{found:?}");
        assert_eq!(found[1].broken, None);
    }

    #[test]
    fn names_that_lead_elsewhere_are_refused() {
        for name in ["..", "../x", "a/b", "/etc", "", ".hidden", "a\\b", "x\0", "x.", "Nul.mp4", "lpt9"] {
            assert!(folder_of(Path::new("s"), name).is_err(), "{name:?}");
        }
        for name in ["console", "com", "com10", "lpta", "auxiliary.y4m", "x.nul"] {
            assert!(folder_of(Path::new("s"), name).is_ok(), "{name:?}");
        }
        let error = entry_of(Path::new("s"), "../x", "video").unwrap_err().to_string();
        assert!(error.starts_with("video ../x: expected a name"), "{error}");
        let session = session();
        for name in ["..", "../x", "pair-001/..", "", ".partial"] {
            assert!(existing(session.path(), name).is_err(), "{name:?}");
        }
        fs::rename(session.path().join("pair-001"), session.path().join("what? 1")).unwrap();
        assert!(folder_of(session.path(), "what? 1").is_err());
        assert!(existing(session.path(), "what? 1").is_ok(), "it is listed, so it is found");
        assert_eq!(folder_of(Path::new("s"), "pair-001_b.2").unwrap(), Path::new("s/pair-001_b.2"));
    }
}
