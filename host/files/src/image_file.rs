//! Reads and writes images.
//!
//! | format | supported |
//! |---|---|
//! | PNG, BMP, PBM/PGM/PPM/PAM | all that `image` reads, apart from PAM of 16 bits without TUPLTYPE |
//! | JPEG | complete files only (`zune-jpeg`, strict mode) |
//! | TIFF, BigTIFF | 1 to 16-bit and 32-bit integers, 16 to 64-bit float, grey, RGB and palettes of up to 8 bits (ImageJ: their numbers, without the colours), planar or not, strips or tiles (planes in padded tiles are refused) |
//!
//! The content, not the name, selects the format. EXIF orientation is applied. Raw camera files, previews and other
//! formats are rejected with a remedy. `file.tif#3` is page 3 (from 1) of a multi-page TIFF. Colour becomes
//! `(R + G + B) / 3`, as in Li 2014, unless [`Grey`] differs. Pixels whose alpha is 0 are NaN, unless all have it; other alpha is
//! ignored.

mod bmp;
mod complete;
mod decode;
pub(crate) mod metadata;
mod tiff_file;
pub(crate) mod tiff_tags;
mod write;

use std::{
    fs,
    io::Read,
    path::{Path, PathBuf},
    str::FromStr,
};

use image::ImageFormat;
use ndarray::Array2;

use decode::largest_but_defective;
pub(crate) use decode::{Decoded, Samples8, decode, decode_with, only_page};
pub use metadata::exposure_time;
pub use tiff_file::page_count;
pub(crate) use tiff_file::{Page, Pages, Signed};
pub(crate) use write::encode_to;
pub use write::{encode_png, encode_tiff, png_to, png8_to};

#[derive(Clone, PartialEq, Debug)]
pub struct GreyImage {
    /// (height, width). Integers are divided by their full scale (0..=1); floats are unchanged. NaN where transparent.
    pub pixels: Array2<f32>,
    pub samples: Samples,
    /// Whether red, green and blue differ anywhere.
    pub colour: bool,
    /// Saturation value, if known to be below full scale (12 bits in 16).
    pub white_level: Option<f32>,
    /// Variance of a pixel by lossy compression (JPEG), in the pixels' units; 0 without.
    pub coding_variance: f64,
}

impl GreyImage {
    /// Rescales to a white level (in units of the pixels) and its bit depth.
    pub fn relative_to(mut self, white_level: f32) -> Self {
        let Samples::Integer(bits) = self.samples else { return self };
        let code = (f64::from(white_level) * (2_f64.powi(i32::from(bits)) - 1.0)).round() as u32;
        let shifted = code.trailing_zeros();
        // Shifted up to 16 bits, or in the lower bits.
        let of_camera =
            if code == 0xffff << shifted & 0xffff { 16 - shifted } else { 32 - code.leading_zeros() };
        self.samples = Samples::Integer(bits.min(of_camera as u8).max(1));
        self.pixels.mapv_inplace(|value| relative(value, white_level));
        self.coding_variance /= f64::from(white_level).powi(2);
        self.white_level = None;
        self
    }
}

/// The value where white is 1. Brighter pixels are saturated; those without a value stay so.
pub fn relative(value: f32, white_level: f32) -> f32 {
    if value > white_level { 1.0 } else { value / white_level }
}

/// Common white level of images of one camera: the lowest of all, if no image exceeds it or it `is_stated` by the user.
pub fn shared_white_level<'a>(
    images: impl Iterator<Item = &'a GreyImage> + Clone,
    is_stated: bool,
) -> Option<f32> {
    images.clone().find_map(|image| image.white_level)?;
    let mut shared = SharedWhiteLevel::default();
    images.for_each(|image| shared.add(image));
    shared.get(is_stated)
}

/// [`shared_white_level`] of images that are not in memory together.
#[derive(Clone, Copy, Debug, Default)]
pub struct SharedWhiteLevel {
    lowest: Option<f32>,
    brightest: f32,
    float: bool,
}

impl SharedWhiteLevel {
    pub fn add(&mut self, image: &GreyImage) {
        self.lowest = self.lowest.into_iter().chain(image.white_level).reduce(f32::min);
        self.brightest = self.brightest.max(brightest(image));
        self.float |= image.samples == Samples::Float;
    }

    /// The level, which brighter pixels contradict, unless it `is_stated` by the user: they are saturated then.
    pub fn get(self, is_stated: bool) -> Option<f32> {
        self.lowest.filter(|white| is_stated || !self.float && self.brightest <= white * 1.000_001)
    }
}

/// Without defective pixels, where integers tell.
fn brightest(image: &GreyImage) -> f32 {
    if image.samples != Samples::Integer(16) {
        return image.pixels.iter().copied().fold(0.0, f32::max);
    }
    let mut counts = vec![0; 1 << 16];
    image.pixels.iter().for_each(|value| counts[usize::from((value * 65535.0).round() as u16)] += 1);
    largest_but_defective(&counts).map_or(0.0, |code| f32::from(code) / 65535.0)
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Samples {
    Integer(u8),
    Float,
}

impl std::fmt::Display for Samples {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Integer(bits) => write!(f, "{bits}-bit"),
            Self::Float => write!(f, "float"),
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Grey {
    #[default]
    Mean,
    /// 0.299 R + 0.587 G + 0.114 B (ITU-R BT.601).
    Luma,
    Red,
    /// Least noise and chromatic aberration with a Bayer sensor.
    Green,
    Blue,
}

impl Grey {
    fn weights(self) -> [f64; 3] {
        match self {
            Self::Mean => [1.0 / 3.0; 3],
            Self::Luma => [0.299, 0.587, 0.114],
            Self::Red => [1.0, 0.0, 0.0],
            Self::Green => [0.0, 1.0, 0.0],
            Self::Blue => [0.0, 0.0, 1.0],
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::Luma => "luma",
            Self::Red => "red",
            Self::Green => "green",
            Self::Blue => "blue",
        }
    }
}

impl std::fmt::Display for Grey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Grey {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let all = [Self::Mean, Self::Luma, Self::Red, Self::Green, Self::Blue];
        let found = all.into_iter().find(|grey| grey.name() == text);
        found.ok_or_else(|| "expected mean, luma, red, green or blue".into())
    }
}

/// Properties that a file does not state.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct ReadSettings {
    pub grey: Grey,
    /// Saturation code, e.g. 4095; `None`: from metadata or values.
    pub white_level: Option<u32>,
}

#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    #[error("cannot read {}: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{} is empty", path.display())]
    Empty { path: PathBuf },
    #[error("{} is not an image that farnear reads (PNG, TIFF, JPEG, BMP, PGM): {reason}", path.display())]
    Format { path: PathBuf, reason: String },
    #[error("{}: {reason}", path.display())]
    Setting { path: PathBuf, reason: String },
    #[error("cannot write {}: {reason}", path.display())]
    Write { path: PathBuf, reason: String },
}

/// Splits `stack.tif#3` into file and page, unless a file has that name.
pub fn file_and_page(path: &Path) -> (PathBuf, Option<usize>) {
    let split = |text: &str| {
        let (file, page) = text.rsplit_once('#')?;
        Some((PathBuf::from(file), Some(page.parse::<usize>().ok()?)))
    };
    // A name need not be UTF-8; its ending is.
    let named = || match path.to_str() {
        Some(text) => split(text),
        None => {
            let (ending, page) = split(path.extension()?.to_str()?)?;
            Some((path.with_extension(ending), page))
        }
    };
    if path.exists() { (path.into(), None) } else { named().unwrap_or_else(|| (path.into(), None)) }
}

/// Reads an image file or page (`file.tif#3`). Fails if broken, not grey or RGB, or multi-page without a number.
pub fn read_grey(path: &Path) -> Result<GreyImage, ImageError> {
    read_grey_with(path, &ReadSettings::default())
}

pub fn read_grey_with(path: &Path, settings: &ReadSettings) -> Result<GreyImage, ImageError> {
    let (decoded, path) = read_decoded(path)?;
    decoded.grey(settings).map_err(|reason| ImageError::Setting { path, reason })
}

/// How 8 bits are made of the images of a folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// Significant bits of 16.
    pub bits: u32,
    /// Whether the content is the opacity of images of one colour.
    pub opacity: bool,
}

impl Default for Reading {
    fn default() -> Self {
        Self { bits: 16, opacity: false }
    }
}

/// Reads with 8 bits per sample: grey, or RGB (height, width, 3). 16 bits are scaled from [`Reading::bits`]; floats are rejected.
pub(crate) fn read_8_bit(path: &Path, reading: Reading) -> Result<Samples8, ImageError> {
    let (decoded, path) = read_decoded(path)?;
    let decoded = if reading.opacity { decoded.alpha() } else { decoded };
    decoded.in_8_bits(reading.bits).map_err(|reason| ImageError::Format { path, reason })
}

/// Used bits of an image of 16 bits, and whether its content is the opacity.
pub(crate) fn reading_of(path: &Path) -> Result<(Option<u32>, bool), ImageError> {
    let (decoded, _) = read_decoded(path)?;
    Ok((decoded.used_bits(), decoded.only_alpha_differs()))
}

/// Why a file is not read that is an image by its content; `None` if it is not.
pub(crate) fn unread(path: &Path) -> Option<ImageError> {
    let mut head = Vec::new();
    fs::File::open(path).ok()?.take(complete::HEAD_BYTES).read_to_end(&mut head).ok()?;
    let refused = |reason: &str| ImageError::Format { path: path.into(), reason: reason.into() };
    if let Some(reason) = complete::unsupported(&head) {
        return Some(refused(reason));
    }
    let rename = || refused("its name does not end in .png, .tif, .jpg, .bmp or .pgm: rename it");
    match image::guess_format(&head).ok()? {
        ImageFormat::Tiff => Some(Pages::open(path).err().unwrap_or_else(rename)),
        ImageFormat::Png | ImageFormat::Jpeg => Some(rename()),
        _ => None,
    }
}

fn read_decoded(path: &Path) -> Result<(Decoded, PathBuf), ImageError> {
    let (file, page) = file_and_page(path);
    if let Some(page) = page {
        if let Some(pages) = Pages::open(&file)? {
            return Ok((pages.decode(page)?, path.into()));
        }
        only_page(Some(page)).map_err(|reason| ImageError::Format { path: path.into(), reason })?;
    }
    let bytes = read_bytes(&file)?;
    let decoded = decode(&bytes).map_err(|reason| ImageError::Format { path: file, reason })?;
    Ok((decoded, path.into()))
}

pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>, ImageError> {
    let bytes = fs::read(path).map_err(|source| ImageError::Read { path: path.into(), source })?;
    if bytes.is_empty() {
        return Err(ImageError::Empty { path: path.into() });
    }
    Ok(bytes)
}

pub fn decode_grey(bytes: &[u8]) -> Result<GreyImage, String> {
    decode(bytes)?.grey(&ReadSettings::default())
}

#[cfg(test)]
mod tests;
