use std::{fmt::Write as _, fs, path::Path};

use super::{
    depth,
    page::{Page, escaped},
};
use crate::{
    error::{Result, WorkflowError},
    result_folder::{DEPTH_RECORD, STACK_RECORD},
    sessions::{self, Capture},
};

/// Most pictures shown: a result can have thousands of masks.
const PICTURES_MAX: usize = 12;
const TEXTS: [&str; 5] = ["toml", "json", "jsonl", "csv", "md"];
/// Records that identify a farnear result.
const RECORDS: [&str; 8] = [
    "silhouettes.toml",
    "samples.toml",
    "shadow.toml",
    "evaluation.toml",
    "recognition.json",
    "confusion.md",
    "grab.toml",
    "batch.toml",
];

pub(super) fn capture(folder: &Path) -> Result<String> {
    let capture = sessions::read(folder)?;
    let mut page = begun(&capture.name, &subtitle(&capture));
    if !capture.note.text.is_empty() || capture.note.rating > 0 {
        let stars = "★".repeat(capture.note.rating.into());
        let _ =
            write!(page.0, "<section class=note><b>{stars}</b> {}</section>", escaped(&capture.note.text));
    }
    if capture.has_depth {
        depth(&mut page, folder)?;
    }
    page.0.push_str("<section><h2>Images</h2><div class=row>");
    for image in &capture.images {
        picture(&mut page, folder, image)?;
    }
    page.0.push_str("</div></section>");
    for (heading, file) in [("How it was captured", "capture.toml"), ("How depth was computed", DEPTH_RECORD)]
    {
        if let Ok(text) = fs::read_to_string(folder.join(file)) {
            page.text(heading, &text);
        }
    }
    Ok(page.end())
}

pub(super) fn depth_result(folder: &Path) -> Result<String> {
    let (record, kind) = if folder.join(DEPTH_RECORD).is_file() {
        (DEPTH_RECORD, "depth from a far- and a near-focused image")
    } else {
        (STACK_RECORD, "depth from a focus stack")
    };
    let mut page = begun(&name(folder), kind);
    depth(&mut page, folder)?;
    let path = folder.join(record);
    let text = fs::read_to_string(&path).map_err(WorkflowError::read("the record", &path))?;
    page.text("How depth was computed", &text);
    Ok(page.end())
}

pub(super) fn other(folder: &Path) -> Result<String> {
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
    let entries = entries.map_err(WorkflowError::read("the folder", folder))?;
    let mut files: Vec<String> = entries
        .iter()
        .filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_file()))
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .filter(|name| !name.starts_with('.'))
        .collect();
    files.sort();
    if !files.iter().any(|file| RECORDS.contains(&file.as_str())) {
        let expected = "the folder of a capture or of a result of farnear, with one of its records (capture.toml, depth.toml, \
                        stack.toml, silhouettes.toml, evaluation.toml, recognition.json, ...)";
        return Err(WorkflowError::parameter("folder", folder.display(), expected));
    }
    let ending = |file: &str| Path::new(file).extension().map(|e| e.to_string_lossy().to_lowercase());
    let pictures: Vec<&String> = files.iter().filter(|file| ending(file).as_deref() == Some("png")).collect();
    let mut page = begun(&name(folder), &format!("{} files", files.len()));
    if !pictures.is_empty() {
        let shown = pictures.len().min(PICTURES_MAX);
        let _ =
            write!(page.0, "<section><h2>Pictures</h2><p>{shown} of {}</p><div class=row>", pictures.len());
        // Evenly spread over the recording.
        for index in 0..shown {
            picture(&mut page, folder, pictures[index * pictures.len() / shown])?;
        }
        page.0.push_str("</div></section>");
    }
    for file in
        files.iter().filter(|file| ending(file).is_some_and(|ending| TEXTS.contains(&ending.as_str())))
    {
        let path = folder.join(file);
        let bytes = fs::read(&path).map_err(WorkflowError::read("the record", &path))?;
        page.text(file, &String::from_utf8_lossy(&bytes));
    }
    Ok(page.end())
}

fn begun(name: &str, subtitle: &str) -> Page {
    let mut page = Page::begin(&format!("{name} · farnear"));
    let _ = write!(page.0, "<header><h1>{}</h1><p>{}</p></header>", escaped(name), escaped(subtitle));
    page
}

/// The folder's name, also of `.`.
fn name(folder: &Path) -> String {
    let whole = fs::canonicalize(folder).unwrap_or_else(|_| folder.into());
    whole.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn picture(page: &mut Page, folder: &Path, image: &str) -> Result<()> {
    let path = folder.join(image);
    let bytes = fs::read(&path).map_err(WorkflowError::read("the image", &path))?;
    page.picture(&bytes, image);
    Ok(())
}

fn subtitle(capture: &Capture) -> String {
    let mut parts =
        vec![format!("{} of {} x {} px, {} bit", capture.kind, capture.width, capture.height, capture.bits)];
    parts.push(format!("{} us exposure", capture.exposure_us));
    parts.extend(capture.time.clone());
    parts.extend(
        capture.scene.as_ref().map(|scene| format!("emulated scene {scene}: no hardware was involved")),
    );
    parts.join(" · ")
}
