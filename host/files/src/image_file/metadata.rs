//! Orientation and time of exposure from EXIF and XMP.

use std::{borrow::Cow, io::Cursor, path::Path};

use image::{ImageDecoder, ImageFormat, ImageReader};

use super::{complete, tiff_tags};

/// Orientation as in EXIF, 1 to 8; 1 = upright. EXIF comes before XMP.
pub(super) fn orientation(exif: Option<&[u8]>, xmp: Option<&[u8]>) -> u8 {
    exif.and_then(tiff_tags::orientation).or_else(|| of_xmp(xmp?)).unwrap_or(1)
}

/// `tiff:Orientation`, as an attribute or an element.
fn of_xmp(xmp: &[u8]) -> Option<u8> {
    let text = String::from_utf8_lossy(xmp);
    let value = text.split("tiff:Orientation").nth(1)?.trim_start_matches(['=', '"', '\'', '>', ' ']);
    let value = value.chars().next()?.to_digit(10)? as u8;
    (1..=8).contains(&value).then_some(value)
}

/// A PNG with its EXIF, XMP and texts before the pixels, where decoders look for them. ExifTool writes them after.
pub(super) fn metadata_first(png: &[u8]) -> Cow<'_, [u8]> {
    let mut chunks = complete::png_chunks(png).take_while(|(name, _)| *name != b"IEND");
    let pixels = chunks.find(|(name, _)| *name == b"IDAT");
    let after = chunks.filter(|(name, _)| matches!(*name, b"eXIf" | b"iTXt" | b"tEXt" | b"zTXt"));
    let after: Vec<_> = after.map(|(_, place)| place).collect();
    let Some((_, pixels)) = pixels.filter(|_| !after.is_empty()) else { return png.into() };
    let mut ordered = png[..pixels.start].to_vec();
    after.iter().for_each(|place| ordered.extend_from_slice(&png[place.clone()]));
    let mut at = pixels.start;
    for place in after {
        ordered.extend_from_slice(&png[at..place.start]);
        at = place.end;
    }
    ordered.extend_from_slice(&png[at..]);
    ordered.into()
}

/// EXIF and XMP of an image that is neither JPEG nor TIFF.
pub(super) fn of_decoder(
    decoder: &mut impl ImageDecoder,
    bytes: &[u8],
) -> (Option<Vec<u8>>, Option<Vec<u8>>) {
    let exif = decoder.exif_metadata().ok().flatten().or_else(|| raw_profile(bytes));
    // Some programs keep the mark of a JPEG's segment.
    let exif = exif.map(|exif| exif.strip_prefix(b"Exif\0\0").map(<[u8]>::to_vec).unwrap_or(exif));
    (exif, decoder.xmp_metadata().ok().flatten())
}

/// EXIF in hexadecimal, in a text chunk of a PNG, as ImageMagick writes it: an empty line, `exif`, the length, the data.
fn raw_profile(bytes: &[u8]) -> Option<Vec<u8>> {
    const NAMES: [&str; 2] = ["Raw profile type exif", "Raw profile type APP1"];
    let png = png::Decoder::new(Cursor::new(bytes)).read_info().ok()?;
    let info = png.info();
    let plain = info.uncompressed_latin1_text.iter().find(|text| NAMES.contains(&text.keyword.as_str()));
    let packed = || info.compressed_latin1_text.iter().find(|text| NAMES.contains(&text.keyword.as_str()));
    let text = plain.map(|plain| plain.text.clone()).or_else(|| packed()?.get_text().ok())?;
    let digits: Vec<u8> = text
        .trim_start()
        .lines()
        .skip(2)
        .flat_map(str::chars)
        .filter_map(|digit| Some(digit.to_digit(16)? as u8))
        .collect();
    Some(digits.chunks_exact(2).map(|two| 16 * two[0] + two[1]).collect())
}

/// Time of the exposure, `2026:11:25 20:15:03`, with the fraction of a second where it is stated.
pub(crate) fn taken(path: &Path) -> Option<String> {
    exposure_time(&std::fs::read(path).ok()?)
}

/// Time of the exposure in an image file's bytes, `2026:11:25 20:15:03`; later times are larger.
pub fn exposure_time(bytes: &[u8]) -> Option<String> {
    let exif = if tiff_tags::is_tiff(bytes) {
        bytes.to_vec()
    } else if bytes.starts_with(b"\xff\xd8") {
        complete::jpeg_exif(bytes)?.to_vec()
    } else {
        let format: ImageFormat = image::guess_format(bytes).ok()?;
        let bytes = if format == ImageFormat::Png { metadata_first(bytes) } else { bytes.into() };
        let mut decoder = ImageReader::with_format(Cursor::new(&*bytes), format).into_decoder().ok()?;
        of_decoder(&mut decoder, &bytes).0?
    };
    let directory = tiff_tags::directories(exif.as_slice()).ok()?.into_iter().next()?;
    let exposed = directory.exposed.or(directory.date_time)?;
    Some(exposed + "." + directory.exposed_fraction.as_deref().unwrap_or_default())
}

#[cfg(test)]
pub(crate) mod tests {
    use std::fmt::Write;

    use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

    use super::super::{complete, decode_grey};

    /// EXIF with an orientation, and the exposure's time in its own directory.
    fn exif(orientation: u8, time: &str) -> Vec<u8> {
        assert_eq!(time.len(), 19);
        let entry = |tag: u16, kind: u16, count: u32, value: u32| {
            [&tag.to_le_bytes()[..], &kind.to_le_bytes(), &count.to_le_bytes(), &value.to_le_bytes()].concat()
        };
        let first = [entry(274, 3, 1, orientation.into()), entry(34665, 4, 1, 38)].concat();
        let second = entry(36867, 2, 20, 56);
        let end = [0; 4];
        [&b"II*\0\x08\0\0\0\x02\0"[..], &first, &end, b"\x01\0", &second, &end, time.as_bytes(), b"\0"]
            .concat()
    }

    fn png(add: impl FnOnce(&mut png::Encoder<&mut Vec<u8>>)) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 3, 2);
        add(&mut encoder);
        encoder.write_header().unwrap().write_image_data(&[0, 50, 100, 150, 200, 250]).unwrap();
        bytes
    }

    pub(crate) fn png_with_exif(orientation: u8, time: &str) -> Vec<u8> {
        let profile = [&b"Exif\0\0"[..], &exif(orientation, time)].concat();
        let mut text = format!("\nexif\n{:8}\n", profile.len());
        for line in profile.chunks(36) {
            line.iter().for_each(|byte| write!(text, "{byte:02x}").unwrap());
            text.push('\n');
        }
        png(|encoder| encoder.add_ztxt_chunk("Raw profile type exif".into(), text).unwrap())
    }

    const TIME: &str = "2026:11:25 20:00:00";

    fn png_with_exif_chunk(exif: Vec<u8>) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = PngEncoder::new(&mut bytes);
        encoder.set_exif_metadata(exif).unwrap();
        encoder.write_image(&[0, 50, 100, 150, 200, 250], 3, 2, ExtendedColorType::L8).unwrap();
        bytes
    }

    /// With the metadata after the pixels.
    fn appended(png: &[u8]) -> Vec<u8> {
        let chunks = complete::png_chunks(png);
        let (moved, others): (Vec<_>, Vec<_>) =
            chunks.partition(|(name, _)| matches!(*name, b"eXIf" | b"iTXt" | b"zTXt"));
        assert_eq!(moved.len(), 1);
        let (end, others) = others.split_last().unwrap();
        let chunks = others.iter().chain(&moved).chain([end]);
        let chunks: Vec<u8> = chunks.flat_map(|(_, place)| png[place.clone()].to_vec()).collect();
        [&png[..8], &chunks].concat()
    }

    #[test]
    fn xmp_and_text_chunks_turn_an_image() {
        let xmp = |text: &str| {
            let text = format!("<x:xmpmeta xmlns:x='adobe:ns:meta/'><rdf:Description {text}</x:xmpmeta>");
            png(|encoder| encoder.add_itxt_chunk("XML:com.adobe.xmp".into(), text).unwrap())
        };
        let files = [
            xmp("tiff:Orientation=\"6\"/>"),
            xmp("><tiff:Orientation>6</tiff:Orientation>"),
            png_with_exif(6, TIME),
            png_with_exif_chunk(exif(6, TIME)),
            png_with_exif_chunk([&b"Exif\0\0"[..], &exif(6, TIME)].concat()),
        ];
        for file in files.iter().flat_map(|file| [file.clone(), appended(file)]) {
            let pixels = decode_grey(&file).unwrap().pixels.mapv(|v| (255.0 * v).round() as u8);
            assert_eq!(pixels, ndarray::array![[150, 0], [200, 50], [250, 100]]);
        }
        assert_eq!(super::exposure_time(&appended(&files[2])), Some(format!("{TIME}.")));
        assert_eq!(decode_grey(&xmp("tiff:Orientation=\"9\"/>")).unwrap().pixels.dim(), (2, 3));
    }
}
