//! A folder of pictures as a video, in natural order (`in9` before `in10`).

use std::{
    cmp::Ordering,
    fs,
    path::{Path, PathBuf},
};

use image::{DynamicImage, ImageReader};
use ndarray::{Array2, Array3};

use super::{Pixels, VideoError, VideoFrame};

/// Endings of files that count as pictures, small letters; other files are left alone.
pub const EXTENSIONS: [&str; 5] = ["png", "jpg", "jpeg", "pgm", "ppm"];

/// Paths of the pictures in a folder, in natural order.
///
/// # Errors
/// [`VideoError::Io`] for a folder that cannot be listed, [`VideoError::NoPictures`] where there is none.
pub fn list(folder: &Path) -> Result<Vec<PathBuf>, VideoError> {
    let entries = fs::read_dir(folder).map_err(|source| VideoError::io(folder, source))?;
    let mut paths = Vec::new();
    for entry in entries {
        let path = entry.map_err(|source| VideoError::io(folder, source))?.path();
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if path.is_file() && EXTENSIONS.contains(&extension.as_str()) {
            paths.push(path);
        }
    }
    if paths.is_empty() {
        return Err(VideoError::NoPictures { path: folder.into() });
    }
    paths.sort_by(|a, b| natural(&stem(a), &stem(b)));
    Ok(paths)
}

/// The frames of a folder.
pub(super) fn open(
    folder: &Path,
) -> Result<impl Iterator<Item = Result<VideoFrame, VideoError>> + 'static, VideoError> {
    let paths = list(folder)?;
    Ok(paths.into_iter().map(|path| Ok(VideoFrame { name: stem(&path), pixels: read(&path)? })))
}

/// A picture's samples: grey stays grey, everything else becomes RGB; 16 bits lose their lower half.
///
/// # Errors
/// [`VideoError`] for a file that cannot be opened or decoded.
pub fn read(path: &Path) -> Result<Pixels, VideoError> {
    let reader = ImageReader::open(path)
        .and_then(ImageReader::with_guessed_format)
        .map_err(|source| VideoError::io(path, source))?;
    let damaged = |reason: String| VideoError::Picture { path: path.into(), reason };
    let picture = reader.decode().map_err(|error| damaged(error.to_string()))?;
    let size = (picture.height() as usize, picture.width() as usize);
    let pixels = match picture {
        DynamicImage::ImageLuma8(_)
        | DynamicImage::ImageLumaA8(_)
        | DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_) => {
            Array2::from_shape_vec(size, picture.into_luma8().into_raw()).map(Pixels::Grey)
        }
        colour => Array3::from_shape_vec((size.0, size.1, 3), colour.into_rgb8().into_raw()).map(Pixels::Rgb),
    };
    pixels.map_err(|error| damaged(error.to_string()))
}

/// A file's name without its extension.
pub fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Text by letters, runs of digits by value.
fn natural(a: &str, b: &str) -> Ordering {
    let (mut a_rest, mut b_rest) = (a, b);
    while let (Some(x), Some(y)) = (a_rest.chars().next(), b_rest.chars().next()) {
        let (a_digits, b_digits) = (digits(a_rest), digits(b_rest));
        let (order, a_step, b_step) = if a_digits > 0 && b_digits > 0 {
            let (m, n) =
                (a_rest[..a_digits].trim_start_matches('0'), b_rest[..b_digits].trim_start_matches('0'));
            (m.len().cmp(&n.len()).then_with(|| m.cmp(n)), a_digits, b_digits)
        } else {
            (x.cmp(&y), x.len_utf8(), y.len_utf8())
        };
        if order != Ordering::Equal {
            return order;
        }
        (a_rest, b_rest) = (&a_rest[a_step..], &b_rest[b_step..]);
    }
    // Equal up to here: the shorter first, and `01` before `1` so that the order is total.
    a_rest.len().cmp(&b_rest.len()).then_with(|| a.cmp(b))
}

fn digits(text: &str) -> usize {
    text.bytes().take_while(u8::is_ascii_digit).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_sort_by_value_and_letters_by_letter() {
        let mut names =
            ["in10", "in9", "in010", "b", "in9b", "in", "a2b10", "a2b9", "in123456789012345678901234"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(
            names,
            ["a2b9", "a2b10", "b", "in", "in9", "in9b", "in010", "in10", "in123456789012345678901234"]
        );
    }
}
