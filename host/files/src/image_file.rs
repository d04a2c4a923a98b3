//! Reading and writing grey images.
//!
//! PNG, JPEG, PGM/PPM (through `image`) and TIFF with 8, 16 or 32 bits, integer or float (through `tiff`, because
//! `image` refuses float grey TIFF). What a file is, is told by its first bytes, not by its name. Colour is
//! averaged to grey, `(R + G + B) / 3`, as Li 2014 does; alpha is ignored.

use std::{
    fs,
    io::{Cursor, Write},
    path::{Path, PathBuf},
};

use image::{
    DynamicImage, ExtendedColorType, ImageEncoder,
    codecs::png::{CompressionType, FilterType, PngEncoder},
};
use ndarray::{Array2, ArrayView2};
use tiff::{
    decoder::{Decoder, DecodingResult, Limits},
    encoder::{
        TiffEncoder,
        colortype::{Gray8, Gray16},
    },
};

use crate::EncodeError;

/// A picture as floating-point grey values.
#[derive(Clone, PartialEq, Debug)]
pub struct GreyImage {
    /// Shape (height, width). Integer files are divided by their full scale, so values lie in 0..=1; float files
    /// keep their values.
    pub pixels: Array2<f32>,
    /// How the file stored its samples.
    pub samples: Samples,
}

/// How a file stores a pixel.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Samples {
    /// Unsigned integers of so many bits.
    Integer(u8),
    /// Floating point.
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

/// An image could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file has no bytes.
    #[error("{} is empty", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The bytes are no image that can be read here.
    #[error("{} is not an image that farnear reads (PNG, TIFF, JPEG, PGM): {reason}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The file cannot be written.
    #[error("cannot write {}: {reason}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system or the encoder says.
        reason: String,
    },
}

/// Reads an image file.
///
/// # Errors
/// [`ImageError`] where it cannot be read, is empty or broken, or holds no grey or RGB picture.
pub fn read_grey(path: &Path) -> Result<GreyImage, ImageError> {
    let bytes = fs::read(path).map_err(|source| ImageError::Read { path: path.into(), source })?;
    if bytes.is_empty() {
        return Err(ImageError::Empty { path: path.into() });
    }
    decode_grey(&bytes).map_err(|reason| ImageError::Format { path: path.into(), reason })
}

/// Decodes the bytes of an image file; the error says what is wrong with them.
pub fn decode_grey(bytes: &[u8]) -> Result<GreyImage, String> {
    if bytes.starts_with(b"II*\0") || bytes.starts_with(b"MM\0*") {
        decode_tiff(bytes)
    } else {
        decode_other(bytes)
    }
}

fn decode_other(bytes: &[u8]) -> Result<GreyImage, String> {
    let format =
        image::guess_format(bytes).map_err(|_| "its first bytes are those of none of them".to_string())?;
    let image = image::load_from_memory_with_format(bytes, format).map_err(|error| error.to_string())?;
    let size = (image.height() as usize, image.width() as usize);
    use DynamicImage as Image;
    let (values, bits) = match image {
        Image::ImageLuma8(i) => (average(&i, 1, 1, 255.0), 8),
        Image::ImageLumaA8(i) => (average(&i, 2, 1, 255.0), 8),
        Image::ImageRgb8(i) => (average(&i, 3, 3, 255.0), 8),
        Image::ImageRgba8(i) => (average(&i, 4, 3, 255.0), 8),
        Image::ImageLuma16(i) => (average(&i, 1, 1, 65535.0), 16),
        Image::ImageLumaA16(i) => (average(&i, 2, 1, 65535.0), 16),
        Image::ImageRgb16(i) => (average(&i, 3, 3, 65535.0), 16),
        Image::ImageRgba16(i) => (average(&i, 4, 3, 65535.0), 16),
        other => return Err(format!("its pixels are {:?}", other.color())),
    };
    grey(size, values, Samples::Integer(bits))
}

fn decode_tiff(bytes: &[u8]) -> Result<GreyImage, String> {
    use tiff::ColorType;
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    decoder = decoder.with_limits(Limits::default());
    let (width, height) = decoder.dimensions().map_err(|error| error.to_string())?;
    let colour = decoder.colortype().map_err(|error| error.to_string())?;
    let (channels, averaged) = match colour {
        ColorType::Gray(_) => (1, 1),
        ColorType::GrayA(_) => (2, 1),
        ColorType::RGB(_) => (3, 3),
        ColorType::RGBA(_) => (4, 3),
        other => return Err(format!("its pixels are {other:?}")),
    };
    let data = decoder.read_image().map_err(|error| error.to_string())?;
    let (values, samples) = match data {
        DecodingResult::U8(v) if colour.bit_depth() == 8 => {
            (average(&v, channels, averaged, 255.0), Samples::Integer(8))
        }
        DecodingResult::U16(v) => (average(&v, channels, averaged, 65535.0), Samples::Integer(16)),
        DecodingResult::F32(v) => (average(&v, channels, averaged, 1.0), Samples::Float),
        DecodingResult::F64(v) => (average(&v, channels, averaged, 1.0), Samples::Float),
        _ => return Err(format!("its samples are {} bits of another kind", colour.bit_depth())),
    };
    grey((height as usize, width as usize), values, samples)
}

/// Mean of the first `averaged` of each pixel's `channels` samples, divided by the full scale.
fn average<T: Copy + Into<f64>>(
    samples: &[T],
    channels: usize,
    averaged: usize,
    full_scale: f64,
) -> Vec<f32> {
    let scale = 1.0 / (full_scale * averaged as f64);
    if channels == 1 {
        // A separate loop, because the compiler vectorises it.
        return samples.iter().map(|sample| ((*sample).into() * scale) as f32).collect();
    }
    samples
        .chunks_exact(channels)
        .map(|pixel| (pixel[..averaged].iter().map(|sample| (*sample).into()).sum::<f64>() * scale) as f32)
        .collect()
}

fn grey(size: (usize, usize), values: Vec<f32>, samples: Samples) -> Result<GreyImage, String> {
    let pixels =
        Array2::from_shape_vec(size, values).map_err(|_| "it has fewer pixels than it says".to_string())?;
    Ok(GreyImage { pixels, samples })
}

/// The picture of a camera with `bits` bits as the bytes of a grey PNG: 8 bits as they are, 9 to 16 bits
/// shifted up to full scale in 16 bits, so that any viewer shows it with the right brightness.
///
/// # Errors
/// An encoder that refuses.
pub fn encode_png(pixels: ArrayView2<u16>, bits: u8) -> Result<Vec<u8>, EncodeError> {
    let mut png = Vec::new();
    png_to(pixels, bits, &mut png)?;
    Ok(png)
}

/// The same into a file.
///
/// # Errors
/// What the system or the encoder says.
pub fn png_to(pixels: ArrayView2<u16>, bits: u8, to: &mut impl Write) -> Result<(), EncodeError> {
    if bits <= 8 {
        return png8_to(pixels.mapv(|value| value.min(255) as u8).view(), to);
    }
    let shift = 16 - u32::from(bits.min(16));
    // `image` takes 16-bit samples in the machine's byte order.
    let samples: Vec<[u8; 2]> = pixels.iter().map(|value| (value << shift).to_ne_bytes()).collect();
    encode_to(samples.as_flattened(), pixels.dim(), ExtendedColorType::L16, to)
}

/// A grey PNG of 8 bits.
///
/// # Errors
/// What the system or the encoder says.
pub fn png8_to(pixels: ArrayView2<u8>, to: &mut impl Write) -> Result<(), EncodeError> {
    let standard = pixels.as_standard_layout();
    let Some(samples) = standard.as_slice() else { unreachable!("made in standard layout") };
    encode_to(samples, pixels.dim(), ExtendedColorType::L8, to)
}

/// One filter for all rows: to try all five for each takes three quarters of the time and saves some percent of a noisy image.
pub(crate) fn encode_to(
    samples: &[u8],
    (height, width): (usize, usize),
    colour: ExtendedColorType,
    to: &mut impl Write,
) -> Result<(), EncodeError> {
    PngEncoder::new_with_quality(to, CompressionType::Fast, FilterType::Up)
        .write_image(samples, width as u32, height as u32, colour)
        .map_err(EncodeError::of("a PNG"))
}

/// The same as the bytes of a grey TIFF of 8 or 16 bits, whose values stay as the camera gave them.
///
/// # Errors
/// An encoder that refuses.
pub fn encode_tiff(pixels: ArrayView2<u16>, bits: u8) -> Result<Vec<u8>, EncodeError> {
    let (height, width) = pixels.dim();
    let (width, height) = (width as u32, height as u32);
    let mut bytes = Cursor::new(Vec::new());
    TiffEncoder::new(&mut bytes)
        .and_then(|mut file| match bits {
            ..=8 => {
                let values: Vec<u8> = pixels.iter().map(|value| (*value).min(255) as u8).collect();
                file.write_image::<Gray8>(width, height, &values)
            }
            _ => {
                let values: Vec<u16> = pixels.iter().copied().collect();
                file.write_image::<Gray16>(width, height, &values)
            }
        })
        .map_err(EncodeError::of("a TIFF"))?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use super::*;
    use ndarray::array;
    use proptest::{prelude::*, sample::Index};

    #[test]
    fn pgm_and_colour_are_read() {
        let image = decode_grey(b"P5 3 2 255\n\x00\x33\xff\x01\x02\x03").unwrap();
        assert_eq!(image.pixels.dim(), (2, 3));
        assert_eq!(image.samples, Samples::Integer(8));
        assert_eq!(image.pixels[[0, 1]], 0.2);
        let colour = decode_grey(b"P6 1 1 255\n\x33\x66\x99").unwrap();
        assert!((colour.pixels[[0, 0]] - 0.4).abs() < 1e-7, "{colour:?}");
    }

    #[test]
    fn tiff_keeps_its_values() {
        let pixels = array![[0u16, 1, 4095], [17, 200, 3000]];
        let back = decode_grey(&encode_tiff(pixels.view(), 12).unwrap()).unwrap();
        assert_eq!(back.samples, Samples::Integer(16));
        assert_eq!(back.pixels.mapv(|v| (v * 65535.0).round() as u16), pixels);
        let small = array![[0u16, 9], [255, 77]];
        let back = decode_grey(&encode_tiff(small.view(), 8).unwrap()).unwrap();
        assert_eq!(back.samples, Samples::Integer(8));
        assert_eq!(back.pixels.mapv(|v| (v * 255.0).round() as u16), small);
    }

    #[test]
    fn png_keeps_its_bits() {
        let pixels = array![[0u16, 1, 4095], [17, 200, 3000]];
        let back = decode_grey(&encode_png(pixels.view(), 12).unwrap()).unwrap();
        assert_eq!(back.samples, Samples::Integer(16));
        assert_eq!(back.pixels.mapv(|v| (v * 65535.0).round() as u16 >> 4), pixels);
        let small = array![[0u16, 9], [255, 77]];
        let back = decode_grey(&encode_png(small.view(), 8).unwrap()).unwrap();
        assert_eq!(back.samples, Samples::Integer(8));
        assert_eq!(back.pixels.mapv(|v| (v * 255.0).round() as u16), small);
    }

    #[test]
    fn tiff_with_16_bits_and_float_is_read() {
        use tiff::encoder::{
            TiffEncoder,
            colortype::{Gray16, Gray32Float},
        };
        let mut sixteen = Cursor::new(Vec::new());
        TiffEncoder::new(&mut sixteen).unwrap().write_image::<Gray16>(2, 1, &[65535, 0]).unwrap();
        assert_eq!(decode_grey(sixteen.get_ref()).unwrap().pixels, array![[1.0, 0.0]]);
        let mut float = Cursor::new(Vec::new());
        TiffEncoder::new(&mut float).unwrap().write_image::<Gray32Float>(1, 2, &[933.5, -2.0]).unwrap();
        let image = decode_grey(float.get_ref()).unwrap();
        assert_eq!((image.pixels, image.samples), (array![[933.5], [-2.0]], Samples::Float));
    }

    #[test]
    fn what_is_no_image_is_named() {
        let missing = read_grey(Path::new("no-such.png")).unwrap_err();
        assert!(missing.to_string().starts_with("cannot read no-such.png"), "{missing}");
        let text = read_grey(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"))).unwrap_err();
        assert!(matches!(text, ImageError::Format { .. }), "{text}");
        let mut cut = encode_png(Array2::from_elem((9, 9), 7).view(), 8).unwrap();
        cut.truncate(cut.len() / 2);
        assert!(decode_grey(&cut).is_err());
    }

    proptest! {
        /// Whatever follows an image's magic number, reading ends with an image or an error.
        #[test]
        fn broken_files_do_not_panic(kind in 0..5usize, tail in proptest::collection::vec(any::<u8>(), 0..200)) {
            let heads: [&[u8]; 5] = [b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff\xe0", b"II*\0", b"MM\0*", b"P5 "];
            let bytes = [heads[kind], &tail].concat();
            let _ = decode_grey(&bytes);
        }

        /// The same of real ones of which some bytes are others, or of which the end is lost: these are read beyond their first lines.
        #[test]
        fn damaged_pictures_are_read_or_refused(
            which in any::<Index>(),
            hits in proptest::collection::vec((any::<Index>(), any::<u8>()), 1..6),
            lost in proptest::option::of(any::<Index>()),
        ) {
            let mut bytes = which.get(&PICTURES).clone();
            for (place, byte) in hits {
                *place.get_mut(&mut bytes) = byte;
            }
            if let Some(lost) = lost {
                bytes.truncate(lost.index(bytes.len()));
            }
            if let Ok(image) = decode_grey(&bytes) {
                prop_assert!(image.pixels.iter().all(|value| image.samples == Samples::Float || (0.0..=1.0).contains(value)));
            }
        }
    }

    /// One of each kind that is read, 7 x 5 pixels.
    static PICTURES: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
        use image::{ImageFormat, Luma, Rgb, RgbImage, codecs::jpeg::JpegEncoder};
        use tiff::encoder::{Compression, colortype};
        let pixels = Array2::from_shape_fn((5, 7), |(row, column)| (500 * row + 70 * column) as u16);
        let colour = RgbImage::from_fn(7, 5, |x, y| Rgb([30 * x as u8, 40 * y as u8, 99]));
        let grey = image::GrayImage::from_fn(7, 5, |x, y| Luma([30 * x as u8 + y as u8]));
        let mut jpeg = Vec::new();
        JpegEncoder::new(&mut jpeg).encode_image(&colour).unwrap();
        let as_pnm = |image: DynamicImage| {
            let mut bytes = Cursor::new(Vec::new());
            image.write_to(&mut bytes, ImageFormat::Pnm).unwrap();
            bytes.into_inner()
        };
        let packed = |compression| {
            let mut bytes = Cursor::new(Vec::new());
            let mut file = TiffEncoder::new(&mut bytes).unwrap().with_compression(compression);
            file.write_image::<colortype::RGB8>(7, 5, colour.as_raw()).unwrap();
            bytes.into_inner()
        };
        let mut pictures = vec![
            encode_png(pixels.view(), 12).unwrap(),
            encode_tiff(pixels.view(), 8).unwrap(),
            encode_tiff(pixels.view(), 12).unwrap(),
            crate::map::tiff(pixels.mapv(f32::from).view()).unwrap(),
            jpeg,
            as_pnm(colour.clone().into()),
            as_pnm(grey.into()),
        ];
        pictures.extend([Compression::Lzw, Compression::Packbits].map(packed));
        pictures
    });
}
