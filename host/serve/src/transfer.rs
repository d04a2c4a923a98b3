//! File transfer in pieces: memory does not grow with file size or with slow clients.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, Read, Write},
    path::{Path, PathBuf},
    pin::{Pin, pin},
    sync::{Arc, Mutex},
    task::{Context, Poll},
    time::Duration,
};

use axum::{
    body::{Body, Bytes},
    http::StatusCode,
};
use futures_core::Stream;
use zip::{
    CompressionMethod, ZipWriter,
    write::{SimpleFileOptions, StreamWriter},
};

use crate::{
    app::lock,
    failure::Failure,
    upload_quota::{PART, Upload},
};

const PIECE: usize = 64 * 1024;

pub fn file_body(file: File) -> Body {
    Body::from_stream(FileStream { file, buffer: vec![0; PIECE] })
}

struct FileStream {
    file: File,
    buffer: Vec<u8>,
}

impl Stream for FileStream {
    type Item = io::Result<Bytes>;

    fn poll_next(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        let Self { file, buffer } = &mut *self;
        Poll::Ready(match file.read(buffer) {
            Ok(0) => None,
            Ok(count) => buffer.get(..count).map(|piece| Ok(Bytes::copy_from_slice(piece))),
            Err(error) => Some(Err(error)),
        })
    }
}

/// Bytes of the archive that are written but not sent.
#[derive(Clone, Default)]
struct Unsent(Arc<Mutex<Vec<u8>>>);

impl Write for Unsent {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        lock(&self.0).extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Files of `folder` as a ZIP; `files` are paths relative to it, `name` is the folder in the archive.
pub fn zip_body(folder: PathBuf, name: String, mut files: Vec<String>) -> Body {
    files.reverse();
    let unsent = Unsent::default();
    let archive = Some(ZipWriter::new_stream(unsent.clone()));
    Body::from_stream(ZipStream {
        folder,
        name,
        files,
        current: None,
        archive,
        unsent,
        buffer: vec![0; PIECE],
    })
}

struct ZipStream {
    folder: PathBuf,
    name: String,
    files: Vec<String>,
    current: Option<File>,
    archive: Option<ZipWriter<StreamWriter<Unsent>>>,
    unsent: Unsent,
    buffer: Vec<u8>,
}

impl ZipStream {
    /// Writes the next piece; `false` after the last.
    fn step(&mut self) -> io::Result<bool> {
        let Some(archive) = &mut self.archive else { return Ok(false) };
        if let Some(file) = &mut self.current {
            match file.read(&mut self.buffer)? {
                0 => self.current = None,
                count => archive.write_all(self.buffer.get(..count).unwrap_or_default())?,
            }
            return Ok(true);
        }
        if let Some(file) = self.files.pop() {
            // Images are compressed already, and noise in maps hardly compresses.
            let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
            archive.start_file(format!("{}/{file}", self.name), options)?;
            self.current = Some(regular_file(&self.folder.join(file))?);
            return Ok(true);
        }
        if let Some(archive) = self.archive.take() {
            archive.finish()?;
        }
        Ok(true)
    }
}

impl Stream for ZipStream {
    type Item = io::Result<Bytes>;

    fn poll_next(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        loop {
            match self.step() {
                Err(error) => {
                    self.archive = None;
                    return Poll::Ready(Some(Err(error)));
                }
                Ok(more) => {
                    let piece = std::mem::take(&mut *lock(&self.unsent.0));
                    if !piece.is_empty() {
                        return Poll::Ready(Some(Ok(piece.into())));
                    }
                    if !more {
                        return Poll::Ready(None);
                    }
                }
            }
        }
    }
}

/// Opens a regular file; links, FIFOs and devices are not found.
pub fn regular_file(path: &Path) -> io::Result<File> {
    match fs::symlink_metadata(path)?.is_file() {
        true => File::open(path),
        false => Err(io::ErrorKind::NotFound.into()),
    }
}

/// Whether there is a regular file at `path`, not a link to one.
pub fn is_regular(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|found| found.is_file())
}

/// A folder of the session. A link is refused: it may lead out of the session.
pub fn session_folder(session: &Path, name: &str) -> Result<PathBuf, Failure> {
    let folder = session.join(name);
    if folder.is_symlink() {
        let error = format!("{} is a link; expected a folder", folder.display());
        return Err(Failure::new(StatusCode::CONFLICT, error)
            .with_hint("Replace it by a folder, or name a session on the other disk with --session."));
    }
    Ok(folder)
}

/// Writes an uploaded body to its target; a failed, broken off or stopped upload leaves no file.
pub async fn receive(body: Body, mut upload: Upload, pause_max: Duration) -> Result<(), Failure> {
    let target = upload.target().to_path_buf();
    let prefix = format!(".{}.", target.file_name().unwrap_or_default().to_string_lossy());
    // Random: two uploads of one name do not write into one file.
    let part = tempfile::Builder::new()
        .prefix(&prefix)
        .suffix(PART)
        .make_in(target.parent().unwrap_or(Path::new(".")), |path| {
            OpenOptions::new().write(true).create_new(true).open(path)
        });
    let mut part = part.map_err(|error| disk(&target, &error))?;
    receive_part(body, part.as_file_mut(), &mut upload, pause_max).await?;
    if part.as_file().metadata().is_ok_and(|file| file.len() == 0) {
        let name = target.file_name().unwrap_or_default().to_string_lossy();
        let error = format!("the upload {name} has 0 bytes; expected a video");
        return Err(Failure::bad_request(error).with_hint("Choose a file with contents."));
    }
    let published = upload.finish(|target| part.persist(target).map(drop).map_err(|failed| failed.error));
    published.map_err(|error| disk(&target, &error))
}

fn disk(path: &Path, error: &io::Error) -> Failure {
    Failure::new(StatusCode::INTERNAL_SERVER_ERROR, format!("cannot write {}: {error}", path.display()))
}

async fn receive_part(
    body: Body,
    part: &mut File,
    upload: &mut Upload,
    pause_max: Duration,
) -> Result<(), Failure> {
    let mut stream = pin!(body.into_data_stream());
    loop {
        let next = std::future::poll_fn(|cx| stream.as_mut().poll_next(cx));
        let piece = match tokio::time::timeout(pause_max, next).await {
            Ok(None) => return Ok(()),
            Ok(Some(Ok(piece))) => piece,
            Ok(Some(Err(error))) => {
                return Err(Failure::bad_request(format!("the upload broke off: {error}")));
            }
            Err(_) => {
                let error = format!("the upload paused for more than {} s", pause_max.as_secs());
                return Err(Failure::new(StatusCode::REQUEST_TIMEOUT, error));
            }
        };
        upload.add(piece.len() as u64).map_err(|left| {
            let error = format!("the upload is larger than {:.1} MB, the space left", left as f64 / 1e6);
            Failure::new(StatusCode::PAYLOAD_TOO_LARGE, error)
                .with_hint("Delete videos in the session's folder people, or raise --upload-quota-mb.")
        })?;
        part.write_all(&piece).map_err(|error| disk(upload.target(), &error))?;
    }
}
