//! TIFF pages and their pixels.

mod palette;

use std::{
    fs::File,
    io::{self, BufReader, Cursor, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

use tiff::{
    ColorType,
    decoder::{Decoder, DecodingResult, Limits},
};

use super::{
    ImageError, complete,
    decode::{Decoded, INCOMPLETE, Values, most_bytes, said},
    tiff_tags::{self, Directory, InFile, Source},
};

/// Colour filter array and linear raw (TIFF/EP, DNG).
const RAW_PHOTOMETRIC: [u64; 2] = [32803, 34892];

/// How signed integers are read, whose black is not known.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Signed {
    Refused,
    /// By their bits: 0 remains 0.
    AsUnsigned,
}

#[derive(Debug, Clone)]
pub(crate) struct Page {
    pub index: usize,
    pub directory: Directory,
}

/// A TIFF file whose pages are read one at a time.
pub(crate) struct Pages {
    path: PathBuf,
    size: u64,
    pub pages: Vec<Page>,
}

impl Pages {
    /// `None` for other formats and those that [`super::decode()`] refuses. Fails for raw files and mere previews.
    pub fn open(path: &Path) -> Result<Option<Self>, ImageError> {
        let failed = |source| ImageError::Read { path: path.into(), source };
        let file = InFile::open(path).map_err(failed)?;
        let head = file.read(0, complete::HEAD_BYTES).unwrap_or_default();
        if !tiff_tags::is_tiff(&head) || complete::unsupported(&head).is_some() {
            return Ok(None);
        }
        let pages = pages(&file).map_err(|reason| ImageError::Format { path: path.into(), reason })?;
        Ok(Some(Self { path: path.into(), size: file.size(), pages }))
    }

    /// Decodes page `number` (from 1).
    pub fn decode(&self, number: usize) -> Result<Decoded, ImageError> {
        let file =
            File::open(&self.path).map_err(|source| ImageError::Read { path: self.path.clone(), source })?;
        let decoded = page(&self.pages, number)
            .and_then(|page| decode_page(BufReader::new(file), self.size, page, Signed::Refused));
        decoded.map_err(|reason| {
            let path = format!("{}#{number}", self.path.display()).into();
            ImageError::Format { path, reason }
        })
    }
}

/// Number of full-resolution images; 1 for other formats. Fails for raw files and mere previews.
pub fn page_count(path: &Path) -> Result<usize, ImageError> {
    Ok(Pages::open(path)?.map_or(1, |file| file.pages.len()))
}

/// Full-resolution images. Fails for raw files, or previews only.
fn pages<S: Source + ?Sized>(source: &S) -> Result<Vec<Page>, String> {
    let mut directories = tiff_tags::directories(source)?;
    palette::without_display(&mut directories);
    let Some(first) = directories.first() else { return Err("it holds no image".into()) };
    if directories.iter().any(|d| d.is_dng || RAW_PHOTOMETRIC.contains(&d.photometric)) {
        return Err(complete::RAW.into());
    }
    if let ([only], true) = (directories.as_slice(), first.metamorph_planes > 1) {
        return Err(format!(
            "it is a MetaMorph stack of {} planes, of which only the first has a directory: open it in ImageJ and save it as TIFF",
            only.metamorph_planes
        ));
    }
    let larger = |d: &Directory| {
        d.sub_images.iter().copied().filter(|(w, h)| w * h > d.width * d.height).max_by_key(|(w, h)| w * h)
    };
    if let Some((width, height)) = directories.iter().filter_map(larger).next() {
        return Err(format!(
            "its page is a preview of {}x{} px, the image of {width}x{height} px is inside: {}",
            first.width,
            first.height,
            complete::RAW
        ));
    }
    let (width, height) = (first.width, first.height);
    let pages: Vec<Page> = directories
        .into_iter()
        .enumerate()
        .filter(|(_, directory)| !directory.reduced() && !directory.mask())
        .map(|(index, directory)| Page { index, directory })
        .collect();
    if pages.is_empty() {
        return Err(format!(
            "it holds only a preview of {width}x{height} px (reduced resolution): give the image of full resolution; of a \
             camera's raw file develop it first, for instance with `dcraw -4 -T`"
        ));
    }
    Ok(pages)
}

fn page(pages: &[Page], number: usize) -> Result<&Page, String> {
    let page = number.checked_sub(1).and_then(|index| pages.get(index));
    page.ok_or_else(|| format!("it has no page {number}: pages are numbered from 1 to {}", pages.len()))
}

/// Decodes page `number` (from 1), or the only one.
pub(super) fn decode(bytes: &[u8], number: Option<usize>, signed: Signed) -> Result<Decoded, String> {
    let pages = pages(bytes)?;
    let page = match (number, pages.as_slice()) {
        (Some(number), all) => Some(page(all, number)?),
        (None, [page]) => Some(page),
        (None, _) => None,
    };
    if let Some(page) = page {
        return decode_page(Cursor::new(bytes), bytes.len() as u64, page, signed);
    }
    let sizes: Vec<String> =
        pages.iter().take(3).map(|p| format!("{}x{}", p.directory.width, p.directory.height)).collect();
    Err(format!(
        "it holds {} images ({}{}): name one as FILE#1 to FILE#{}",
        pages.len(),
        sizes.join(", "),
        if pages.len() > 3 { ", ..." } else { "" },
        pages.len()
    ))
}

fn compression(code: u64) -> String {
    let name = match code {
        2..=4 => "fax",
        6 | 7 => "JPEG",
        34712 => "JPEG 2000",
        34887 => "LERC",
        34925 => "LZMA",
        34933 => "PNG",
        34934 => "JPEG XR",
        50000 => "zstd",
        50001 => "WebP",
        50002 => "JPEG XL",
        33003..=33005 => "Aperio JPEG 2000",
        34892 => "lossy DNG",
        _ => return format!("compression {code}"),
    };
    format!("{name} compression")
}

/// Kinds of pages that are not read, with what to do.
fn unsupported(page: &Directory) -> Option<String> {
    let &Directory { bits, sample_format, photometric, .. } = page;
    if !matches!(page.compression, 1 | 5 | 8 | 32773 | 32946) {
        return Some(format!(
            "its {} is not read: store it uncompressed, with LZW or with deflate (`tiffcp -c lzw`)",
            compression(page.compression)
        ));
    }
    if page.fill_order == 2 {
        return Some("its bits are in reverse order (FillOrder 2), which is not read: rewrite it (`tiffcp -f msb2lsb`)".into());
    }
    if let Some(volume) = page.volume() {
        return Some(volume);
    }
    // The decoder takes the padding below the lowest tiles for pixels in all planes but the first.
    if page.planar == 2
        && page.samples_per_pixel > 1
        && page.tile_length.is_some_and(|length| length == 0 || !page.height.is_multiple_of(length))
    {
        return Some(
            "its channels are separate planes in tiles that reach beyond its height, which is not read: store it in strips \
             (`tiffcp -s`)"
                .into(),
        );
    }
    let colours = match photometric {
        0..=2 => None,
        3 if palette::is_read(page) => None,
        3 => Some("colours from a palette that is incomplete or of more than 8 bits".into()),
        5 => Some("CMYK colours".into()),
        6 => Some("YCbCr colours".into()),
        8..=10 => Some("L*a*b* colours".into()),
        32844 | 32845 => Some("logarithmic colours".into()),
        other => Some(format!("colours of kind {other} (PhotometricInterpretation)")),
    };
    if let Some(colours) = colours {
        return Some(format!("it has {colours}, which are not read: convert it to grey or RGB"));
    }
    match (sample_format, bits) {
        (2, _) => Some(
            "its samples are signed integers, whose black and white are not known: convert it to float or unsigned integers"
                .into(),
        ),
        (5 | 6, _) => Some("its samples are complex numbers: store their magnitude as float".into()),
        (3, 16 | 32 | 64) if photometric == 0 => {
            Some("its white is 0, which float samples do not define: store it with black as 0".into())
        }
        (3, 16 | 32 | 64) | (0 | 1 | 4, 8 | 16 | 32) => None,
        (0 | 1 | 4, 1 | 2 | 4) if page.samples_per_pixel == 1 => None,
        _ => Some(format!(
            "its samples have {bits} bits, of which 8, 16 and 32 are read, and 1, 2 and 4 in grey: convert it to 16 bits"
        )),
    }
}

/// Whether deflate data and the file end in zeros, as a cut copy does in a file that had its size before. The data end in a checksum,
/// which the decoder does not read.
fn ends_in_zeros(file: &mut (impl Read + Seek), page: &Directory) -> io::Result<bool> {
    const ZEROS: [u8; 64] = [0; 64];
    let [at, length] = page.last_strip;
    let Some(before) = length.checked_sub(ZEROS.len() as u64) else { return Ok(false) };
    let mut is_zero = |place: SeekFrom| {
        let mut found = ZEROS;
        // Some programs state too many bytes.
        file.seek(place).and_then(|_| file.read_exact(&mut found)).is_ok() && found == ZEROS
    };
    let are_zeros =
        is_zero(SeekFrom::End(-(ZEROS.len() as i64))) && is_zero(SeekFrom::Start(at.saturating_add(before)));
    file.rewind()?;
    Ok(are_zeros)
}

/// A page of a file of this size, upright.
fn decode_page(
    mut file: impl Read + Seek,
    size: u64,
    page: &Page,
    signed: Signed,
) -> Result<Decoded, String> {
    let mut kind = page.directory.clone();
    if signed == Signed::AsUnsigned && kind.sample_format == 2 {
        kind.sample_format = 1;
    }
    if let Some(advice) = unsupported(&kind) {
        return Err(advice);
    }
    let Directory { width, height, samples_per_pixel, bits, .. } = page.directory;
    let decoded_bytes = (width * height).saturating_mul(samples_per_pixel).saturating_mul(bits.max(8) / 8);
    if decoded_bytes > most_bytes(size) {
        return Err(format!("it is incomplete: {size} bytes cannot hold {width}x{height} px"));
    }
    let say = |error: tiff::TiffError| {
        let text = said(error);
        if text == INCOMPLETE {
            return text;
        }
        if text.contains("no lzw end code") {
            return "its LZW data have no end: copy the file again; if they still have none, store it uncompressed or with deflate"
                .into();
        }
        format!("{text}; rewrite it, for instance with `tiffcp -c lzw`")
    };
    let mut limits = Limits::default();
    limits.decoding_buffer_size = usize::try_from(most_bytes(size)).unwrap_or(usize::MAX);
    limits.intermediate_buffer_size = limits.decoding_buffer_size;
    limits.ifd_value_size = usize::try_from(size).unwrap_or(usize::MAX).max(1 << 20);
    let is_deflate = matches!(page.directory.compression, 8 | 32946);
    if is_deflate && ends_in_zeros(&mut file, &page.directory).map_err(said)? {
        return Err(INCOMPLETE.into());
    }
    let file = palette::AsGrey::new(file, &page.directory);
    let mut decoder = Decoder::new(file).map_err(say)?.with_limits(limits);
    if page.index > 0 {
        decoder.seek_to_image(page.index).map_err(say)?;
    }
    let colour = decoder.colortype().map_err(say)?;
    let alpha = matches!(page.directory.extra_samples, Some(1 | 2));
    let colours = match colour {
        ColorType::Gray(_) => 1,
        ColorType::GrayA(_) | ColorType::Multiband { num_samples: 2, .. } if alpha => 1,
        ColorType::RGB(_) | ColorType::RGBA(_) => 3,
        ColorType::Multiband { num_samples, .. } => {
            return Err(format!(
                "it has {num_samples} channels that are not colours: store one channel as grey"
            ));
        }
        other => return Err(format!("its pixels are {other:?}: convert it to grey or RGB")),
    };
    // The decoder leaves out extra samples other than alpha, which it does right only here.
    let extra = samples_per_pixel > u64::from(colour.num_samples());
    if extra
        && page.directory.planar != 2
        && (page.directory.tile_width.is_some() || page.directory.predictor > 1)
    {
        return Err(format!(
            "it has {samples_per_pixel} samples per pixel, of which the last have no stated meaning (ExtraSamples 0): store it \
             as RGB, or in strips without a predictor"
        ));
    }
    let mut data = DecodingResult::U8(Vec::new());
    let layout = decoder.read_image_to_buffer(&mut data).map_err(say)?;
    if data.as_buffer(0).byte_len() < layout.complete_len {
        return Err(format!("its {width}x{height} px in {} planes are more than it can hold", layout.planes));
    }
    let planes = if layout.plane_stride.is_some() && layout.planes > 1 { layout.planes } else { 1 };
    let samples = if planes > 1 { planes } else { usize::from(colour.num_samples()) };
    // A sample that is not stated as alpha has no meaning.
    let channels = samples.min(colours + usize::from(alpha));
    let order = (planes, samples, channels);
    let (width, height) = (width as usize, height as usize);
    let data = match data {
        DecodingResult::I8(v) => DecodingResult::U8(v.into_iter().map(i8::cast_unsigned).collect()),
        DecodingResult::I16(v) => DecodingResult::U16(v.into_iter().map(i16::cast_unsigned).collect()),
        DecodingResult::I32(v) => DecodingResult::U32(v.into_iter().map(i32::cast_unsigned).collect()),
        other => other,
    };
    let values = match data {
        DecodingResult::U8(v) if matches!(colour.bit_depth(), 1 | 2 | 4) && planes == 1 && samples == 1 => {
            let mut samples = unpacked(&v, width, height, colour.bit_depth())?;
            if is_bool_of_tifffile(&page.directory) {
                samples.iter_mut().for_each(|sample| *sample = 255 - *sample);
            }
            Values::U8(samples)
        }
        DecodingResult::U8(v) if colour.bit_depth() == 8 => Values::U8(interleaved(v, order)),
        DecodingResult::U16(v) if colour.bit_depth() == 16 => Values::U16(interleaved(v, order)),
        DecodingResult::U32(v) => {
            let full = f64::from(u32::MAX);
            Values::U32(interleaved(v, order).into_iter().map(|v| (f64::from(v) / full) as f32).collect())
        }
        DecodingResult::F16(v) => Values::F32(interleaved(v, order).into_iter().map(f32::from).collect()),
        DecodingResult::F32(v) => Values::F32(interleaved(v, order)),
        DecodingResult::F64(v) => Values::F32(interleaved(v, order).into_iter().map(|v| v as f32).collect()),
        _ => return Err(format!("its samples are {colour:?}: convert it to grey or RGB of 8 or 16 bits")),
    };
    let white_level = camera_white(&page.directory);
    let largest = [1, 2, 4].contains(&bits).then(|| (1 << bits) - 1);
    let decoded =
        Decoded { width, height, channels, colours, values, white_level, largest, coding_variance: 0.0 };
    let decoded = palette::coloured(decoded, &page.directory);
    Ok(decoded.turned(page.directory.orientation.unwrap_or(1)))
}

/// Saturation code from the description (as written by farnear), or the maximum sample value below 16 bits.
fn camera_white(directory: &Directory) -> Option<u16> {
    let described = directory.description.as_deref().and_then(|text| {
        text.split_whitespace().find_map(|word| word.strip_prefix("white_level=")?.parse().ok())
    });
    // Tag 281 is often the image's maximum instead.
    let largest = directory.max_sample_value.and_then(|v| u16::try_from(v).ok());
    let of_bits = largest.filter(|v| *v >= 255 && *v < u16::MAX && (u32::from(*v) + 1).is_power_of_two());
    described.or(of_bits)
}

/// `tifffile` stores True as 1 in a file whose white is 0, and reads it back as True.
fn is_bool_of_tifffile(directory: &Directory) -> bool {
    let described = directory.description.as_deref().is_some_and(|text| text.starts_with("{\"shape\""));
    directory.bits == 1 && directory.photometric == 0 && described
}

/// Pixel by pixel, the first `kept` of the samples.
fn interleaved<T: Copy>(values: Vec<T>, (planes, samples, kept): (usize, usize, usize)) -> Vec<T> {
    if planes == 1 {
        if kept == samples {
            return values;
        }
        return values.chunks_exact(samples).flat_map(|pixel| &pixel[..kept]).copied().collect();
    }
    let size = values.len() / planes;
    (0..size)
        .flat_map(|at| (0..kept).map(move |plane| (plane, at)))
        .map(|(plane, at)| values[plane * size + at])
        .collect()
}

/// Unpacks samples of 1, 2 or 4 bits, MSB first, with byte-aligned rows.
fn unpacked(bytes: &[u8], width: usize, height: usize, bits: u8) -> Result<Vec<u8>, String> {
    let per_byte = usize::from(8 / bits);
    let row_bytes = width.div_ceil(per_byte);
    if bytes.len() < row_bytes * height {
        return Err("it has fewer pixels than its header says".into());
    }
    let largest = (1_u16 << bits) - 1;
    let sample = |row: &[u8], x: usize| {
        let shift = 8 - bits as usize * (x % per_byte + 1);
        let value = (u16::from(row[x / per_byte]) >> shift) & largest;
        (value * 255 / largest) as u8
    };
    Ok(bytes
        .chunks_exact(row_bytes)
        .take(height)
        .flat_map(|row| (0..width).map(move |x| sample(row, x)))
        .collect())
}
