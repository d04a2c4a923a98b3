//! A folder of pictures as a video, ordered by number ([`crate::order`]).

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{Pixels, VideoError, VideoFrame};
use crate::{
    image_file::{self, ImageError, Reading},
    order::{self, composed},
};

/// Lower-case endings of pictures; other files are ignored, also .pbm, the masks that programs write next to pictures.
pub const EXTENSIONS: [&str; 13] =
    ["png", "tif", "tiff", "jpg", "jpeg", "jfif", "jpe", "bmp", "dib", "pgm", "ppm", "pnm", "pam"];

/// Pictures surveyed for their reading.
const SURVEYED: usize = 8;

pub fn list(folder: &Path) -> Result<Vec<PathBuf>, VideoError> {
    let entries = fs::read_dir(folder).map_err(|source| VideoError::io(folder, source))?;
    let mut paths = Vec::new();
    for entry in entries {
        let path = entry.map_err(|source| VideoError::io(folder, source))?.path();
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if hidden(&path) || path.is_dir() || !EXTENSIONS.contains(&extension.as_str()) {
            continue;
        }
        if !path.is_file() {
            return Err(VideoError::NotAFile { path });
        }
        paths.push(path);
    }
    if paths.is_empty() {
        return Err(VideoError::NoPictures { path: folder.into() });
    }
    order::sort(&mut paths);
    if let Some([first, second]) = order::same_stem(&paths) {
        return Err(VideoError::SameStem { first, second });
    }
    Ok(paths)
}

/// Hidden files, and [`left_by_system`].
pub fn hidden(path: &Path) -> bool {
    path.file_name().unwrap_or_default().to_string_lossy().starts_with('.') || left_by_system(path)
}

/// Files that macOS and Windows add to folders: `.DS_Store`, `._name.png` next to `name.png`, `Thumbs.db`.
pub fn left_by_system(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let by_windows = ["Thumbs.db", "desktop.ini"].iter().any(|left| name.eq_ignore_ascii_case(left));
    name == ".DS_Store" || name.starts_with("._") || by_windows
}

pub(super) fn open(
    folder: &Path,
) -> Result<impl Iterator<Item = Result<VideoFrame, VideoError>> + 'static, VideoError> {
    let paths = list(folder)?;
    let reading = reading_of(&paths);
    Ok(paths.into_iter().map(move |path| Ok(VideoFrame { name: stem(&path), pixels: read(&path, reading)? })))
}

/// How pictures of a folder are read, by some throughout it. Those that cannot be read fail later.
pub fn reading_of(paths: &[PathBuf]) -> Reading {
    let mut bits: Option<u32> = None;
    let mut opacity = false;
    for path in paths.iter().step_by(paths.len().div_ceil(SURVEYED).max(1)) {
        let Ok((of_one, is_opacity)) = image_file::reading_of(path) else { continue };
        // A picture of 8 bits does not tell how others are read.
        bits = bits.max(of_one);
        opacity |= is_opacity;
    }
    Reading { bits: bits.unwrap_or(Reading::default().bits), opacity }
}

/// Samples of a picture: grey or RGB.
pub fn read(path: &Path, reading: Reading) -> Result<Pixels, VideoError> {
    image_file::read_8_bit(path, reading).map_err(|error| match error {
        ImageError::Read { path, source } => VideoError::io(&path, source),
        ImageError::Format { path, reason } => VideoError::Picture { path, reason },
        other => VideoError::Picture { path: path.into(), reason: other.to_string() },
    })
}

pub fn stem(path: &Path) -> String {
    composed(&path.file_stem().unwrap_or_default().to_string_lossy())
}
