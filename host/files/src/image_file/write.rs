use std::io::{self, Cursor, Write};

use image::{
    ExtendedColorType, ImageEncoder,
    codecs::png::{CompressionType, FilterType, PngEncoder},
};
use ndarray::ArrayView2;
use tiff::{
    encoder::{
        TiffEncoder,
        colortype::{Gray8, Gray16},
    },
    tags::Tag,
};

use crate::EncodeError;

/// Encodes a camera picture as grey PNG: 8 bits unchanged, 9 to 16 bits shifted to full 16-bit scale so that viewers
/// show the right brightness; chunk sBIT has the bit depth.
pub fn encode_png(pixels: ArrayView2<u16>, bits: u8) -> Result<Vec<u8>, EncodeError> {
    let mut png = Vec::new();
    png_to(pixels, bits, &mut png)?;
    Ok(png)
}

const HEADER_BYTES: usize = 8 + 25;

/// Inserts a chunk sBIT after a PNG's header.
struct WithSignificantBits<W> {
    to: W,
    significant: Option<u8>,
    passed: usize,
}

impl<W: Write> Write for WithSignificantBits<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.passed < HEADER_BYTES {
            let now = &bytes[..bytes.len().min(HEADER_BYTES - self.passed)];
            let written = self.to.write(now)?;
            self.passed += written;
            if let (HEADER_BYTES.., Some(bits)) = (self.passed, self.significant) {
                let chunk = [b"sBIT".as_slice(), &[bits]].concat();
                self.to.write_all(&1_u32.to_be_bytes())?;
                self.to.write_all(&chunk)?;
                self.to.write_all(&crc32(&chunk).to_be_bytes())?;
            }
            return Ok(written);
        }
        self.to.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

/// CRC-32 of PNG chunks (ISO 3309), bit by bit for five bytes.
fn crc32(bytes: &[u8]) -> u32 {
    let shifted = |crc: u32, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), shifted))
}

/// [`encode_png`] into a file.
pub fn png_to(pixels: ArrayView2<u16>, bits: u8, to: &mut impl Write) -> Result<(), EncodeError> {
    if bits <= 8 {
        return png8_to(pixels.mapv(|value| value.min(255) as u8).view(), to);
    }
    let shift = 16 - u32::from(bits.min(16));
    // `image` expects 16-bit samples in native byte order.
    let samples: Vec<[u8; 2]> = pixels.iter().map(|value| (value << shift).to_ne_bytes()).collect();
    let to = WithSignificantBits { to, significant: (bits < 16).then_some(bits), passed: 0 };
    encode_to(samples.as_flattened(), pixels.dim(), ExtendedColorType::L16, to)
}

pub fn png8_to(pixels: ArrayView2<u8>, to: &mut impl Write) -> Result<(), EncodeError> {
    let samples: Vec<u8> = pixels.iter().copied().collect();
    encode_to(&samples, pixels.dim(), ExtendedColorType::L8, to)
}

/// A single filter for all rows: trying all five takes three quarters of the time and saves few percent.
pub(crate) fn encode_to(
    samples: &[u8],
    (height, width): (usize, usize),
    colour: ExtendedColorType,
    to: impl Write,
) -> Result<(), EncodeError> {
    PngEncoder::new_with_quality(to, CompressionType::Fast, FilterType::Up)
        .write_image(samples, width as u32, height as u32, colour)
        .map_err(EncodeError::of("a PNG"))
}

/// Encodes a grey TIFF of 8 or 16 bits with unchanged values and the white level in its description.
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
                let mut image = file.new_image::<Gray16>(width, height)?;
                if bits < 16 {
                    // Read by `tiff_file::camera_white`.
                    let white = format!("white_level={}", (1_u32 << bits) - 1);
                    image.encoder().write_tag(Tag::ImageDescription, white.as_str())?;
                }
                image.write_data(&values)
            }
        })
        .map_err(EncodeError::of("a TIFF"))?;
    Ok(bytes.into_inner())
}
