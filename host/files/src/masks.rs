//! Masks as pictures: grey PNGs (or other pictures) of two [`levels`], one per frame.

pub mod levels;

use std::{
    io::Cursor,
    path::{Path, PathBuf},
};

use image::{GrayImage, ImageFormat, Luma};
use ndarray::{Array2, Axis};

pub use crate::image_file::Reading;

use self::levels::{Histogram, Levels};
use crate::{
    EncodeError,
    video::{Pixels, VideoError, pictures},
};

/// (height, width); true = set.
pub type Mask = Array2<bool>;

#[derive(Debug, thiserror::Error)]
pub enum MaskError {
    #[error("{}: no such picture or folder", path.display())]
    Missing { path: PathBuf },
    #[error(transparent)]
    Picture(#[from] VideoError),
    #[error("{}: colour {colour:?} at column {column}, row {row}; masks and truths are grey", path.display())]
    Coloured {
        path: PathBuf,
        /// RGB of the first coloured pixel.
        colour: [u8; 3],
        column: usize,
        row: usize,
    },
    #[error(
        "{}: grey levels {levels:?} and none from 128 on; masks have two levels, or 0, 127 and 255", path.display()
    )]
    Levels { path: PathBuf, levels: Vec<u8> },
    #[error(
        "{}: grey levels {levels:?}: a mask has two, these label several things: write masks of the person alone",
        path.display()
    )]
    Labels { path: PathBuf, levels: Vec<u8> },
    #[error(
        "{}: {percent} % of the masks' pixels are set, and {of_border} % of their border: is the person black on white? Masks have the person white, on black",
        path.display()
    )]
    Inverted { path: PathBuf, percent: u64, of_border: u64 },
    #[error(
        "{}: the mask is {}x{}, but `{first}` is {}x{}; the masks of a sequence must be alike",
        path.display(), found.1, found.0, expected.1, expected.0
    )]
    Size {
        path: PathBuf,
        /// (height, width), as `expected`.
        found: (usize, usize),
        first: String,
        expected: (usize, usize),
    },
}

pub struct Named {
    /// File name without extension.
    pub name: String,
    pub mask: Mask,
}

/// The pictures of a folder in natural order, or the one picture.
pub fn listed(path: &Path) -> Result<Vec<PathBuf>, MaskError> {
    if path.is_dir() {
        return Ok(pictures::list(path)?);
    }
    if !path.is_file() {
        return Err(MaskError::Missing { path: path.into() });
    }
    Ok(vec![path.into()])
}

/// Grey levels of a picture; coloured ones must have equal channels.
pub fn grey(path: &Path, reading: Reading) -> Result<Array2<u8>, MaskError> {
    match pictures::read(path, reading)? {
        Pixels::Grey(levels) => Ok(levels),
        Pixels::Rgb(rgb) => {
            for ((row, column), pixel) in rgb.map_axis(Axis(2), |p| [p[0], p[1], p[2]]).indexed_iter() {
                if pixel[0] != pixel[1] || pixel[1] != pixel[2] {
                    return Err(MaskError::Coloured { path: path.into(), colour: *pixel, column, row });
                }
            }
            Ok(rgb.index_axis_move(Axis(2), 0))
        }
    }
}

/// Reads the mask in a picture, as [`grey`].
pub fn read(path: &Path, levels: &Levels) -> Result<Mask, MaskError> {
    Ok(grey(path, levels.reading)?.mapv(|level| level >= levels.set_from))
}

pub fn levels_of(files: &[PathBuf]) -> Result<Levels, MaskError> {
    let Some(first) = files.first() else { return Ok(Levels::default()) };
    Levels::of_masks(&Histogram::of(files)?, first)
}

pub struct Masks {
    pub named: Vec<Named>,
    pub levels: Levels,
}

impl Masks {
    #[must_use]
    pub fn pixels(self) -> Vec<Mask> {
        self.named.into_iter().map(|named| named.mask).collect()
    }
}

/// All masks of a folder (or one picture), in natural order; they must have one size.
pub fn read_all(path: &Path) -> Result<Masks, MaskError> {
    let mut all: Vec<(String, Array2<u8>)> = Vec::new();
    let Sequence { levels, .. } = surveyed(path, |file, grey| all.push((pictures::stem(file), grey)))?;
    let named = |(name, grey): (String, Array2<u8>)| Named {
        name,
        mask: grey.mapv(|level| level >= levels.set_from),
    };
    Ok(Masks { named: all.into_iter().map(named).collect(), levels })
}

/// Masks that are read one at a time.
pub struct Sequence {
    pub files: Vec<PathBuf>,
    pub levels: Levels,
}

impl Sequence {
    /// Reads every picture for the levels and sizes, and keeps none; fails as [`read_all`].
    pub fn open(path: &Path) -> Result<Self, MaskError> {
        surveyed(path, |_, _| ())
    }

    /// In natural order.
    pub fn named(&self) -> impl ExactSizeIterator<Item = Result<Named, MaskError>> {
        let named = move |file: &PathBuf| {
            read(file, &self.levels).map(|mask| Named { name: pictures::stem(file), mask })
        };
        self.files.iter().map(named)
    }
}

/// Reads all pictures once; the levels are those of all.
fn surveyed(path: &Path, mut each: impl FnMut(&Path, Array2<u8>)) -> Result<Sequence, MaskError> {
    let files = listed(path)?;
    let reading = pictures::reading_of(&files);
    let mut histogram = Histogram::new(reading);
    let mut size = None;
    for file in &files {
        let grey = grey(file, reading)?;
        let found = grey.dim();
        let (first, expected) = size.get_or_insert_with(|| (pictures::stem(file), found));
        if found != *expected {
            let (path, first, expected) = (file.clone(), first.clone(), *expected);
            return Err(MaskError::Size { path, found, first, expected });
        }
        histogram.add(&grey);
        each(file, grey);
    }
    let levels = Levels::of_masks(&histogram, files.first().map_or(path, PathBuf::as_path))?;
    Ok(Sequence { files, levels })
}

/// PNG with 255 = set.
pub fn png(mask: &Mask) -> Result<Vec<u8>, EncodeError> {
    encoded(mask, |&set| if set { 255 } else { 0 })
}

/// Grey PNG with `level` per pixel.
pub fn encoded<T>(pixels: &Array2<T>, level: impl Fn(&T) -> u8) -> Result<Vec<u8>, EncodeError> {
    let (height, width) = pixels.dim();
    let levels = |x: u32, y: u32| Luma([level(&pixels[[y as usize, x as usize]])]);
    let mut bytes = Vec::new();
    GrayImage::from_fn(width as u32, height as u32, levels)
        .write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png)
        .map_err(EncodeError::of("a mask"))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ImageBuffer, LumaA, Rgba};

    #[test]
    fn masks_in_the_opacity_and_in_16_bits_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let set = |x: u32, y: u32| x == 1 && y < 2;
        ImageBuffer::from_fn(4, 3, |x, y| Rgba([255_u8, 255, 255, if set(x, y) { 255 } else { 0 }]))
            .save(path("rgba.png"))
            .unwrap();
        ImageBuffer::from_fn(4, 3, |x, y| LumaA([0_u8, if set(x, y) { 200 } else { 0 }]))
            .save(path("la.png"))
            .unwrap();
        ImageBuffer::from_fn(4, 3, |x, y| Luma([u16::from(set(x, y))])).save(path("labels.png")).unwrap();
        for name in ["rgba.png", "la.png", "labels.png"] {
            let masks = read_all(&path(name)).unwrap().pixels();
            let expected = Array2::from_shape_fn((3, 4), |(y, x)| set(x as u32, y as u32));
            assert_eq!(masks, [expected], "{name}");
        }
    }

    #[test]
    fn masks_of_a_folder_are_read_alike() {
        let folder = tempfile::tempdir().unwrap();
        let of_kind = |kind: &str| {
            let path = folder.path().join(kind);
            std::fs::create_dir(&path).unwrap();
            path
        };
        // Somebody in the first frame only; white with an opacity, and probabilities with noise.
        let (opacity, probabilities) = (of_kind("opacity"), of_kind("probabilities"));
        for frame in 0..3_u32 {
            let set = |x: u32| frame == 0 && x == 1;
            ImageBuffer::from_fn(4, 3, |x, _| Rgba([255_u8, 255, 255, if set(x) { 255 } else { 0 }]))
                .save(opacity.join(format!("{frame}.png")))
                .unwrap();
            ImageBuffer::from_fn(4, 3, |x, _| Luma([if set(x) { u16::MAX } else { 190 }]))
                .save(probabilities.join(format!("{frame}.png")))
                .unwrap();
        }
        for path in [opacity, probabilities] {
            let set = read_all(&path).unwrap().pixels();
            let set: Vec<usize> = set.iter().map(|mask| mask.iter().filter(|set| **set).count()).collect();
            assert_eq!(set, [3, 0, 0], "{}", path.display());
            let one_by_one = Sequence::open(&path).unwrap();
            let masks: Vec<Mask> = one_by_one.named().map(|named| named.unwrap().mask).collect();
            assert_eq!(masks, read_all(&path).unwrap().pixels());
            let files = listed(&path).unwrap();
            assert!(!read(&files[1], &levels_of(&files).unwrap()).unwrap().iter().any(|set| *set));
        }
    }
}
