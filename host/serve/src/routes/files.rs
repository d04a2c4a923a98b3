//! A capture's files, alone, as one ZIP, and as a page.

use std::{
    io::{Cursor, Write},
    path::PathBuf,
};

use axum::{
    extract::{Path, State},
    http::{HeaderName, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use farnear_workflows::{report, sessions};
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use super::{Shared, aside};
use crate::{api::Api, failure::Failure};

/// What a report may load: what stands in it.
const REPORT_POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:";

/// Adds the routes.
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
    send(sessions::folder_of(&app.session, &name)?, file).await
}

async fn variant(
    State(app): Shared,
    Path((name, variant, file)): Path<(String, String, String)>,
) -> Result<Response, Failure> {
    send(sessions::folder_of(&sessions::folder_of(&app.session, &name)?, &variant)?, file).await
}

async fn send(folder: PathBuf, file: String) -> Result<Response, Failure> {
    let path = sessions::folder_of(&folder, &file)?;
    let missing = format!("file {file} in {}", folder.file_name().unwrap_or_default().to_string_lossy());
    let bytes = aside(move || match std::fs::read(&path) {
        Ok(bytes) => Ok(bytes),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Err(Failure::missing(&missing)),
        Err(error) => Err(Failure::new(StatusCode::INTERNAL_SERVER_ERROR, format!("{missing}: {error}"))),
    })
    .await?;
    let media = match file.rsplit('.').next() {
        Some("png") => "image/png",
        Some("toml") => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    };
    // A map may be computed anew under the same name.
    Ok(([(header::CONTENT_TYPE, media), (header::CACHE_CONTROL, "no-cache")], bytes).into_response())
}

async fn zipped(State(app): Shared, Path(name): Path<String>) -> Result<Response, Failure> {
    let folder = sessions::folder_of(&app.session, &name)?;
    let inside = name.clone();
    let bytes = aside(move || {
        let capture = sessions::read(&folder)?;
        let failed =
            |error: String| Failure::new(StatusCode::INTERNAL_SERVER_ERROR, format!("{inside}: {error}"));
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        // Pictures are compressed already, and maps of noise hardly can be.
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        for file in &capture.files {
            let content = std::fs::read(folder.join(file)).map_err(|error| failed(error.to_string()))?;
            archive
                .start_file(format!("{inside}/{file}"), options)
                .map_err(|error| failed(error.to_string()))?;
            archive.write_all(&content).map_err(|error| failed(error.to_string()))?;
        }
        Ok(archive.finish().map_err(|error| failed(error.to_string()))?.into_inner())
    })
    .await?;
    let disposition = format!("attachment; filename=\"{name}.zip\"");
    let headers: [(HeaderName, HeaderValue); 2] = [
        (header::CONTENT_TYPE, HeaderValue::from_static("application/zip")),
        (
            header::CONTENT_DISPOSITION,
            HeaderValue::try_from(disposition).unwrap_or(HeaderValue::from_static("attachment")),
        ),
    ];
    Ok((headers, bytes).into_response())
}

async fn page(State(app): Shared, Path(name): Path<String>) -> Result<Response, Failure> {
    let folder = sessions::folder_of(&app.session, &name)?;
    let page = aside(move || Ok(report::html(&folder)?)).await?;
    let headers = [
        (header::CONTENT_TYPE, "text/html; charset=utf-8"),
        (header::CONTENT_SECURITY_POLICY, REPORT_POLICY),
    ];
    Ok((headers, page).into_response())
}
