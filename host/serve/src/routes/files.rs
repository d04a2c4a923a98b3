//! Files of a capture: one by one, as a ZIP, and as a report.

use std::path::PathBuf;

use axum::{
    extract::{Path, State},
    http::{HeaderName, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use farnear_workflows::{report, sessions};

use super::{Shared, aside};
use crate::{
    api::Api,
    failure::Failure,
    transfer::{file_body, regular_file, zip_body},
};

/// A report uses its own contents only.
const REPORT_POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:";

pub fn routes(api: Api) -> Api {
    api.get_bytes(
        "/api/captures/{capture}/files/{file}",
        "A file of a capture.",
        "application/octet-stream",
        file,
    )
    .get_bytes(
        "/api/captures/{capture}/variants/{variant}/{file}",
        "A file of another map of a capture.",
        "application/octet-stream",
        variant,
    )
    .get_bytes("/api/captures/{capture}/zip", "All files of a capture as one.", "application/zip", zipped)
    .get_bytes(
        "/api/captures/{capture}/report.html",
        "A self-contained page about a capture, as `farnear report` writes it.",
        "text/html",
        page,
    )
}

async fn file(State(app): Shared, Path((name, file)): Path<(String, String)>) -> Result<Response, Failure> {
    send(sessions::existing(&app.session, &name)?, file).await
}

async fn variant(
    State(app): Shared,
    Path((name, variant, file)): Path<(String, String, String)>,
) -> Result<Response, Failure> {
    send(sessions::variant_of(&sessions::existing(&app.session, &name)?, &variant)?, file).await
}

async fn send(folder: PathBuf, file: String) -> Result<Response, Failure> {
    let path = sessions::entry_of(&folder, &file, "file")?;
    let missing = format!("file {file} in {}", folder.file_name().unwrap_or_default().to_string_lossy());
    let opened = aside(move || match regular_file(&path) {
        Ok(file) => Ok(file),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Err(Failure::missing(&missing)),
        Err(error) => Err(Failure::new(StatusCode::INTERNAL_SERVER_ERROR, format!("{missing}: {error}"))),
    })
    .await?;
    let media = match file.rsplit('.').next() {
        Some("png") => "image/png",
        Some("toml") => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    };
    // A new map can have the same name.
    Ok(([(header::CONTENT_TYPE, media), (header::CACHE_CONTROL, "no-cache")], file_body(opened))
        .into_response())
}

async fn zipped(State(app): Shared, Path(name): Path<String>) -> Result<Response, Failure> {
    let folder = sessions::existing(&app.session, &name)?;
    let read = folder.clone();
    let files = aside(move || {
        let capture = sessions::read(&read)?;
        let mut files = capture.files;
        for variant in &capture.variants {
            let of = sessions::variant_of(&read, variant)?;
            let entries = std::fs::read_dir(&of).into_iter().flatten().flatten();
            let regular = entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_file()));
            let inside = of.file_name().unwrap_or_default().to_string_lossy().into_owned();
            files.extend(regular.map(|entry| format!("{inside}/{}", entry.file_name().display())));
        }
        Ok(files)
    })
    .await?;
    let body = zip_body(folder, name.clone(), files);
    let disposition = format!("attachment; filename=\"{name}.zip\"");
    let headers: [(HeaderName, HeaderValue); 2] = [
        (header::CONTENT_TYPE, HeaderValue::from_static("application/zip")),
        (
            header::CONTENT_DISPOSITION,
            HeaderValue::try_from(disposition).unwrap_or(HeaderValue::from_static("attachment")),
        ),
    ];
    Ok((headers, body).into_response())
}

async fn page(State(app): Shared, Path(name): Path<String>) -> Result<Response, Failure> {
    let folder = sessions::existing(&app.session, &name)?;
    let page = aside(move || Ok(report::html(&folder)?)).await?;
    let headers = [
        (header::CONTENT_TYPE, "text/html; charset=utf-8"),
        (header::CONTENT_SECURITY_POLICY, REPORT_POLICY),
    ];
    Ok((headers, page).into_response())
}
