//! Decodes files to upright grey samples.

use std::{borrow::Cow, io::Cursor};

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits, codecs::pnm::PnmDecoder};
use ndarray::{Array2, Array3};
use zune_jpeg::{
    JpegDecoder,
    zune_core::{bytestream::ZCursor, colorspace::ColorSpace, options::DecoderOptions},
};

use super::{
    GreyImage, ReadSettings, Samples, bmp, complete, metadata, tiff_file, tiff_file::Signed, tiff_tags,
};
use crate::video::Pixels;

pub(crate) type Samples8 = Pixels;

/// Largest expansion of a compressed byte (deflate: 1032), with a margin for small files.
const EXPANSION: u64 = 1100;
const SMALL_BYTES: u64 = 64 << 20;
/// Bit depths in the search for a saturated camera in 16-bit samples.
const CAMERA_BITS: std::ops::RangeInclusive<u32> = 8..=15;
/// Pixels at the largest code that make it the white level.
const SATURATED_PX: usize = 4;
/// Of this many pixels one may be defective, with any code.
const DEFECTIVE: usize = 20_000;

pub(crate) enum Values {
    U8(Vec<u8>),
    U16(Vec<u16>),
    /// 32-bit integers as a fraction of full scale.
    U32(Vec<f32>),
    F32(Vec<f32>),
}

pub(crate) struct Decoded {
    pub width: usize,
    pub height: usize,
    pub channels: usize,
    /// 1 (grey) or 3 (colour); further samples are alpha.
    pub colours: usize,
    pub values: Values,
    /// White level in codes from metadata on the camera's bit depth.
    pub white_level: Option<u16>,
    /// Largest code of the file, if the decoder scales it to the largest of `values`.
    pub largest: Option<u32>,
    /// As in [`GreyImage`].
    pub coding_variance: f64,
}

pub(super) const INCOMPLETE: &str =
    "it is incomplete: the data end before the image does; copy it again from the camera";

pub(super) fn said(error: impl std::fmt::Display) -> String {
    let text = error.to_string();
    let ended =
        ["failed to fill whole buffer", "unexpected end of file"].iter().any(|end| text.contains(end));
    if ended { INCOMPLETE.into() } else { text }
}

pub(super) fn most_bytes(file: u64) -> u64 {
    SMALL_BYTES.max(file.saturating_mul(EXPANSION))
}

pub(crate) fn decode(bytes: &[u8]) -> Result<Decoded, String> {
    decode_with(bytes, None, Signed::Refused)
}

/// Decodes page `number` (from 1), or the only image.
pub(crate) fn decode_with(bytes: &[u8], number: Option<usize>, signed: Signed) -> Result<Decoded, String> {
    if let Some(advice) = complete::unsupported(bytes) {
        return Err(advice.into());
    }
    if tiff_tags::is_tiff(bytes) {
        return tiff_file::decode(bytes, number, signed);
    }
    only_page(number)?;
    let (decoded, orientation) = if bytes.starts_with(b"\xff\xd8") { jpeg(bytes)? } else { other(bytes)? };
    Ok(decoded.turned(orientation))
}

/// Fails for another page than the first of a file without pages.
pub(crate) fn only_page(number: Option<usize>) -> Result<(), String> {
    match number {
        None | Some(1) => Ok(()),
        Some(_) => Err("it has one image: only TIFF files have pages".into()),
    }
}

fn jpeg(bytes: &[u8]) -> Result<(Decoded, u8), String> {
    let whole = complete::whole_jpeg(bytes);
    if let Some(advice) = complete::unsupported_jpeg(whole.as_deref().unwrap_or(bytes)) {
        return Err(advice);
    }
    let bytes = whole.as_deref().filter(|whole| !complete::lacks_data(whole)).ok_or(INCOMPLETE)?;
    let options = DecoderOptions::default().set_max_width(usize::MAX).set_max_height(usize::MAX);
    let options = options.set_strict_mode(true);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let broken =
        |error: zune_jpeg::errors::DecodeErrors| format!("its data are damaged or incomplete: {error:?}");
    decoder.decode_headers().map_err(broken)?;
    let grey = decoder.input_colorspace() == Some(ColorSpace::Luma);
    let (to, channels) = if grey { (ColorSpace::Luma, 1) } else { (ColorSpace::RGB, 3) };
    decoder.set_options(options.jpeg_set_out_colorspace(to));
    let info = decoder.info().ok_or("it has no header")?;
    let (width, height) = (usize::from(info.width), usize::from(info.height));
    let pixels = (width * height * channels) as u64;
    if pixels > most_bytes(bytes.len() as u64) {
        return Err(INCOMPLETE.into());
    }
    let values = decoder.decode().map_err(broken)?;
    if needs_more(bytes, &values, options, to) {
        return Err(INCOMPLETE.into());
    }
    let orientation = metadata::orientation(complete::jpeg_exif(bytes), decoder.xmp().map(Vec::as_slice));
    let coding_variance = complete::jpeg_coding_variance(bytes).unwrap_or(0.0);
    let values = Values::U8(values);
    let (white_level, largest) = (None, None);
    let decoded =
        Decoded { width, height, channels, colours: channels, values, white_level, largest, coding_variance };
    Ok((decoded, orientation))
}

/// Whether the decoder reads on when the data continue before the end marker, i.e. they ended early.
fn needs_more(bytes: &[u8], values: &[u8], options: DecoderOptions, to: ColorSpace) -> bool {
    const FURTHER: [u8; 64] = [0xa6; 64];
    let end = bytes.len() - 2;
    let longer = [&bytes[..end], &FURTHER, &bytes[end..]].concat();
    let options = options.set_strict_mode(false).jpeg_set_out_colorspace(to);
    let again = JpegDecoder::new_with_options(ZCursor::new(&longer), options).decode();
    again.is_ok_and(|again| again != values)
}

/// Whether what follows the pixels of a file, `size` bytes of them, is padding. A second line end or a comment before them counts as
/// pixels, so the last pixels would remain.
fn is_padding(file: &[u8], after: &[u8], size: usize) -> bool {
    let before = file.len().saturating_sub(after.len() + size);
    let (header, pixels) = file.split_at(before);
    let is_shifted = pixels.starts_with(b"#") || header.ends_with(b"\r") && pixels.starts_with(b"\n");
    after.is_empty() || !is_shifted && after.iter().all(|byte| byte.is_ascii_whitespace() || *byte == 0)
}

fn other(bytes: &[u8]) -> Result<(Decoded, u8), String> {
    let format =
        image::guess_format(bytes).map_err(|_| "its first bytes match none of these formats".to_string())?;
    let images = if format == ImageFormat::Png { complete::png_images(bytes) } else { 1 };
    if images > 1 {
        return Err(format!("it is an animation of {images} images: store each as a file"));
    }
    let numbered = if format == ImageFormat::Bmp { bmp::numbered(bytes) } else { None };
    let (bytes, palette): (Cow<'_, [u8]>, _) = match numbered {
        Some((numbered, palette)) => (Cow::Owned(numbered), Some(palette)),
        None if format == ImageFormat::Png => (metadata::metadata_first(bytes), None),
        None => (Cow::Borrowed(bytes), None),
    };
    let bytes = &*bytes;
    let mut cursor = Cursor::new(bytes);
    let mut reader = ImageReader::with_format(&mut cursor, format);
    reader.no_limits();
    let mut decoder = reader.into_decoder().map_err(said)?;
    if decoder.total_bytes() > most_bytes(bytes.len() as u64) {
        let (width, height) = decoder.dimensions();
        return Err(format!("it is incomplete: {} bytes cannot hold {width}x{height} px", bytes.len()));
    }
    // The decoded size was checked; the decoder's buffers are of that size.
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(2 * most_bytes(bytes.len() as u64));
    decoder.set_limits(limits).map_err(said)?;
    let (exif, xmp) = metadata::of_decoder(&mut decoder, bytes);
    let orientation = metadata::orientation(exif.as_deref(), xmp.as_deref());
    let image = DynamicImage::from_decoder(decoder).map_err(said)?;
    let after = bytes.get(cursor.position() as usize..).unwrap_or_default();
    if format == ImageFormat::Pnm && matches!(after.trim_ascii_start(), [b'P', b'1'..=b'7', ..]) {
        return Err("it holds several images: store each as a file (`pamsplit`)".into());
    }
    let (width, height) = (image.width() as usize, image.height() as usize);
    use DynamicImage as Image;
    let (channels, values) = match image {
        Image::ImageLuma8(i) => (1, Values::U8(i.into_raw())),
        Image::ImageLumaA8(i) => (2, Values::U8(i.into_raw())),
        Image::ImageRgb8(i) => (3, Values::U8(bmp::coloured(i.into_raw(), palette.as_deref()))),
        Image::ImageRgba8(i) => (4, Values::U8(i.into_raw())),
        Image::ImageLuma16(i) => (1, Values::U16(i.into_raw())),
        Image::ImageLumaA16(i) => (2, Values::U16(i.into_raw())),
        Image::ImageRgb16(i) => (3, Values::U16(i.into_raw())),
        Image::ImageRgba16(i) => (4, Values::U16(i.into_raw())),
        other => return Err(format!("its pixels are {:?}; convert it to grey or RGB", other.color())),
    };
    let significant = (format == ImageFormat::Png).then(|| complete::png_significant_bits(bytes)).flatten();
    // Shifted up to 16 bits: the largest code has trailing zeros.
    let white_level = significant.filter(|bits| (8..16).contains(bits)).map(|bits| 0xffff << (16 - bits));
    let largest = match format {
        ImageFormat::Pnm => PnmDecoder::new(bytes).ok().map(|pnm| pnm.header().maximal_sample()),
        ImageFormat::Png => complete::png_grey_bits(bytes).map(|bits| (1 << bits) - 1),
        _ => None,
    };
    // The decoder takes the samples of a PAM file without TUPLTYPE for 8 bits.
    if matches!(values, Values::U8(_)) && largest.is_some_and(|largest| largest > 255) {
        return Err("it is a PAM file of 16 bits without TUPLTYPE, which is not read: store it as PGM".into());
    }
    let size = width * height * channels * if matches!(values, Values::U8(_)) { 1 } else { 2 };
    if format == ImageFormat::Pnm && !is_padding(bytes, after, size) {
        return Err(format!(
            "data follow its pixels ({} bytes): remove them, and comments and second line ends before the pixels, which would count as \
             pixels",
            after.len()
        ));
    }
    let colours = if channels < 3 { 1 } else { 3 };
    let coding_variance = 0.0;
    let decoded = Decoded { width, height, channels, colours, values, white_level, largest, coding_variance };
    Ok((decoded, orientation))
}

impl Decoded {
    /// Fails for a white level outside the codes of the file.
    pub(crate) fn grey(self, settings: &ReadSettings) -> Result<GreyImage, String> {
        let of_file = if let Values::U16(codes) = &self.values {
            settings
                .white_level
                .is_none()
                .then(|| self.white_level.or_else(|| white_of_values(codes)))
                .flatten()
        } else {
            None
        };
        let full_scale = match self.values {
            Values::U8(_) => 255.0,
            Values::U16(_) => 65535.0,
            _ => 1.0,
        };
        let largest = self.largest.map_or(full_scale, f64::from);
        let white_level = match settings.white_level {
            Some(code) if !matches!(self.values, Values::U8(_) | Values::U16(_)) => {
                return Err(format!("it has no integer codes, of which {code} could be the white level"));
            }
            Some(code) if code == 0 || f64::from(code) > largest => {
                return Err(format!("a white level of {code} is outside its codes, 1 to {largest}"));
            }
            Some(code) => Some((f64::from(code) / largest) as f32),
            None => of_file.map(|code| (f64::from(code) / full_scale) as f32),
        };
        let weights = settings.grey.weights();
        let pick = (self.channels, self.colours);
        let even = settings.grey == super::Grey::Mean;
        let (values, samples) = match &self.values {
            Values::U8(v) => (greys(v, pick, weights, even, 255.0), Samples::Integer(8)),
            Values::U16(v) => (greys(v, pick, weights, even, 65535.0), Samples::Integer(16)),
            Values::U32(v) => (greys(v, pick, weights, even, 1.0), Samples::Integer(32)),
            Values::F32(v) => (greys(v, pick, weights, even, 1.0), Samples::Float),
        };
        let mut pixels = Array2::from_shape_vec((self.height, self.width), values)
            .map_err(|_| "it has fewer pixels than its header says".to_string())?;
        if let Some(transparent) = self.transparent() {
            let hidden = pixels.iter_mut().zip(transparent).filter(|(_, transparent)| *transparent);
            hidden.for_each(|(pixel, _)| *pixel = f32::NAN);
        }
        let (colour, coding_variance) = (!self.is_grey(), self.coding_variance);
        Ok(GreyImage { pixels, samples, colour, white_level, coding_variance })
    }

    /// Where alpha is 0; `None` without alpha, or where it is 0 everywhere, as programs write an alpha that they do not use.
    fn transparent(&self) -> Option<Vec<bool>> {
        if !self.has_alpha() {
            return None;
        }
        let transparent = match &self.values {
            Values::U8(v) => last_are_zero(v, self.channels),
            Values::U16(v) => last_are_zero(v, self.channels),
            Values::U32(v) | Values::F32(v) => last_are_zero(v, self.channels),
        };
        transparent.contains(&false).then_some(transparent)
    }

    /// Whether red, green and blue are equal in every pixel, as in many grey pictures stored in colour.
    fn is_grey(&self) -> bool {
        self.colours == 1
            || match &self.values {
                Values::U8(v) => channels_are_equal(v, self.channels),
                Values::U16(v) => channels_are_equal(v, self.channels),
                Values::U32(v) | Values::F32(v) => channels_are_equal(v, self.channels),
            }
    }

    /// Whether all pixels have one colour and differ only in alpha.
    pub(crate) fn only_alpha_differs(&self) -> bool {
        match &self.values {
            Values::U8(v) => only_last_differ(v, self.channels, self.colours),
            Values::U16(v) => only_last_differ(v, self.channels, self.colours),
            Values::U32(v) | Values::F32(v) => only_last_differ(v, self.channels, self.colours),
        }
    }

    fn has_alpha(&self) -> bool {
        self.channels > self.colours
    }

    /// Opacity as grey; an image without one remains.
    pub(crate) fn alpha(self) -> Self {
        if !self.has_alpha() {
            return self;
        }
        let values = match &self.values {
            Values::U8(v) => Values::U8(last_of(v, self.channels)),
            Values::U16(v) => Values::U16(last_of(v, self.channels)),
            Values::U32(v) => Values::U32(last_of(v, self.channels)),
            Values::F32(v) => Values::F32(last_of(v, self.channels)),
        };
        Self { values, channels: 1, colours: 1, ..self }
    }

    /// Bits of the largest of 16-bit samples: 16 may hold 12, or a mask of 0 and 1. `None` for other samples.
    pub(crate) fn used_bits(&self) -> Option<u32> {
        let Values::U16(values) = &self.values else { return None };
        Some(16 - values.iter().fold(0, |used, value| used | value).leading_zeros())
    }

    /// White is the largest code of this many bits of 16.
    pub(crate) fn in_8_bits(self, bits: u32) -> Result<Pixels, String> {
        let white = u32::from(u16::MAX >> (16 - bits.clamp(8, 16)));
        let scaled = |value: u16| ((u32::from(value) * 255 + white / 2) / white).min(255) as u8;
        let bytes = match self.values {
            Values::U8(values) => values,
            Values::U16(values) => values.into_iter().map(scaled).collect(),
            Values::U32(values) => values.into_iter().map(|v| (255.0 * v).round() as u8).collect(),
            Values::F32(_) => {
                return Err(
                    "it has float pixels, whose white is not known: convert it to 8 or 16 bits".into()
                );
            }
        };
        let size = (self.height, self.width);
        let wrong = |_| "it has fewer pixels than its header says".to_string();
        let kept: Vec<u8> = if self.channels == self.colours {
            bytes
        } else {
            bytes.chunks_exact(self.channels).flat_map(|pixel| &pixel[..self.colours]).copied().collect()
        };
        if self.colours == 1 {
            return Array2::from_shape_vec(size, kept).map(Pixels::Grey).map_err(wrong);
        }
        Array3::from_shape_vec((size.0, size.1, 3), kept).map(Pixels::Rgb).map_err(wrong)
    }

    /// Applies an EXIF orientation (1 to 8).
    pub(super) fn turned(mut self, orientation: u8) -> Self {
        if !(2..=8).contains(&orientation) {
            return self;
        }
        let (size, channels) = ((self.height, self.width), self.channels);
        match &mut self.values {
            Values::U8(v) => turn(v, size, channels, orientation),
            Values::U16(v) => turn(v, size, channels, orientation),
            Values::U32(v) | Values::F32(v) => turn(v, size, channels, orientation),
        }
        if orientation >= 5 {
            (self.width, self.height) = (self.height, self.width);
        }
        self
    }
}

fn last_of<T: Copy>(values: &[T], channels: usize) -> Vec<T> {
    values.chunks_exact(channels).map(|pixel| pixel[channels - 1]).collect()
}

fn last_are_zero<T: Copy + Default + PartialEq>(values: &[T], channels: usize) -> Vec<bool> {
    values.chunks_exact(channels).map(|pixel| pixel[channels - 1] == T::default()).collect()
}

fn channels_are_equal<T: PartialEq>(values: &[T], channels: usize) -> bool {
    values.chunks_exact(channels).all(|pixel| pixel[0] == pixel[1] && pixel[1] == pixel[2])
}

fn only_last_differ<T: PartialEq>(values: &[T], channels: usize, colours: usize) -> bool {
    let pixels = || values.chunks_exact(channels);
    let Some(first) = pixels().next() else { return false };
    pixels().all(|pixel| pixel[..colours] == first[..colours]) && pixels().any(|pixel| pixel != first)
}

fn turn<T: Copy>(values: &mut Vec<T>, (height, width): (usize, usize), channels: usize, orientation: u8) {
    let (to_height, to_width) = if orientation >= 5 { (width, height) } else { (height, width) };
    let mut turned = Vec::with_capacity(values.len());
    for y in 0..to_height {
        for x in 0..to_width {
            let (row, column) = match orientation {
                2 => (y, width - 1 - x),
                3 => (height - 1 - y, width - 1 - x),
                4 => (height - 1 - y, x),
                5 => (x, y),
                6 => (height - 1 - x, y),
                7 => (height - 1 - x, width - 1 - y),
                _ => (x, width - 1 - y),
            };
            let at = (row * width + column) * channels;
            turned.extend_from_slice(&values[at..at + channels]);
        }
    }
    *values = turned;
}

fn greys<T: Copy + Into<f64>>(
    samples: &[T],
    (channels, colours): (usize, usize),
    weights: [f64; 3],
    even: bool,
    full_scale: f64,
) -> Vec<f32> {
    if colours == 1 {
        let scale = 1.0 / full_scale;
        if channels == 1 {
            return samples.iter().map(|sample| ((*sample).into() * scale) as f32).collect();
        }
        return samples.iter().step_by(channels).map(|sample| ((*sample).into() * scale) as f32).collect();
    }
    if even {
        let scale = 1.0 / (full_scale * 3.0);
        let pixels = samples.chunks_exact(channels);
        return pixels.map(|p| ((p[0].into() + p[1].into() + p[2].into()) * scale) as f32).collect();
    }
    let [r, g, b] = weights.map(|weight| weight / full_scale);
    let pixels = samples.chunks_exact(channels);
    pixels.map(|p| (p[0].into() * r + p[1].into() * g + p[2].into() * b) as f32).collect()
}

/// Saturation code of a camera with fewer than 16 bits, if several pixels have it: 2^n - 1, or shifted up. Defective pixels may
/// have more.
fn white_of_values(codes: &[u16]) -> Option<u16> {
    let mut counts = vec![0; 1 << 16];
    codes.iter().for_each(|code| counts[usize::from(*code)] += 1);
    let largest = largest_but_defective(&counts)?;
    let used = (0..=u16::MAX).filter(|code| counts[usize::from(*code)] > 0).fold(0, |used, code| used | code);
    let lower = CAMERA_BITS.map(|bits| ((1_u32 << bits) - 1) as u16).any(|white| white == largest);
    let zeros = used.trailing_zeros();
    let upper = (1..=8).contains(&zeros) && largest == 0xffff << zeros;
    ((lower || upper) && counts[usize::from(largest)] >= SATURATED_PX).then_some(largest)
}

/// The largest code, from the numbers of pixels of each, where a few in 100,000 are defective.
pub(super) fn largest_but_defective(counts: &[usize]) -> Option<u16> {
    let defective = counts.iter().sum::<usize>() / DEFECTIVE;
    let mut above = 0;
    let largest = counts.iter().rposition(|count| {
        above += count;
        above > defective
    });
    largest.map(|code| code as u16)
}
