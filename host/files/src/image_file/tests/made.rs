//! Builds TIFF files tag by tag, and JPEG files with EXIF.

use std::io::Cursor;

#[derive(Clone, Copy)]
pub(super) struct Layout {
    pub little: bool,
    pub big: bool,
}

pub(super) const CLASSIC: Layout = Layout { little: true, big: false };

/// Tags (number, values) and strips; types follow from the values.
#[derive(Clone, Default)]
pub(super) struct Page {
    pub shorts: Vec<(u16, Vec<u16>)>,
    pub texts: Vec<(u16, String)>,
    pub strips: Vec<Vec<u8>>,
}

impl Page {
    pub(super) fn grey(width: u16, height: u16, bits: u16, data: Vec<u8>) -> Self {
        let shorts = vec![
            (256, vec![width]),
            (257, vec![height]),
            (258, vec![bits]),
            (259, vec![1]),
            (262, vec![1]),
            (277, vec![1]),
            (278, vec![height]),
        ];
        Self { shorts, texts: Vec::new(), strips: vec![data] }
    }

    pub(super) fn with(mut self, tag: u16, values: &[u16]) -> Self {
        self.shorts.retain(|(other, _)| *other != tag);
        self.shorts.push((tag, values.to_vec()));
        self
    }
}

pub(super) fn tiff(layout: Layout, pages: &[Page]) -> Vec<u8> {
    let number = |value: u64, size: usize| {
        if layout.little {
            value.to_le_bytes()[..size].to_vec()
        } else {
            value.to_be_bytes()[8 - size..].to_vec()
        }
    };
    let offset_size = if layout.big { 8 } else { 4 };
    let mut file = if layout.little { b"II".to_vec() } else { b"MM".to_vec() };
    file.extend(number(if layout.big { 43 } else { 42 }, 2));
    if layout.big {
        file.extend([number(8, 2), number(0, 2)].concat());
    }
    let mut link = file.len();
    file.extend(number(0, offset_size));
    for page in pages {
        let put = |bytes: &[u8], file: &mut Vec<u8>| {
            file.resize(file.len().next_multiple_of(8), 0);
            let at = file.len() as u64;
            file.extend_from_slice(bytes);
            at
        };
        // (tag, type, count, bytes of the values)
        let mut entries: Vec<(u16, u16, usize, Vec<u8>)> = Vec::new();
        for (tag, values) in &page.shorts {
            let bytes = values.iter().flat_map(|value| number(u64::from(*value), 2)).collect();
            entries.push((*tag, 3, values.len(), bytes));
        }
        for (tag, text) in &page.texts {
            entries.push((*tag, 2, text.len() + 1, [text.as_bytes(), &[0]].concat()));
        }
        let places: Vec<u64> = page.strips.iter().map(|strip| put(strip, &mut file)).collect();
        let longs = |values: &[u64]| values.iter().flat_map(|value| number(*value, 4)).collect::<Vec<u8>>();
        let lengths: Vec<u64> = page.strips.iter().map(|strip| strip.len() as u64).collect();
        let tiled = page.shorts.iter().any(|(tag, _)| *tag == 322);
        let [place_tag, length_tag] = if tiled { [324, 325] } else { [273, 279] };
        entries.push((place_tag, 4, places.len(), longs(&places)));
        entries.push((length_tag, 4, lengths.len(), longs(&lengths)));
        entries.sort_by_key(|entry| entry.0);
        let fields: Vec<Vec<u8>> = entries
            .iter()
            .map(|(_, _, _, bytes)| {
                let mut field = if bytes.len() <= offset_size {
                    bytes.clone()
                } else {
                    number(put(bytes, &mut file), offset_size)
                };
                field.resize(offset_size, 0);
                field
            })
            .collect();
        let mut directory = number(entries.len() as u64, if layout.big { 8 } else { 2 });
        for ((tag, kind, count, _), field) in entries.iter().zip(fields) {
            directory.extend(number(u64::from(*tag), 2));
            directory.extend(number(u64::from(*kind), 2));
            directory.extend(number(*count as u64, offset_size));
            directory.extend(field);
        }
        let next = directory.len();
        directory.extend(number(0, offset_size));
        let at = put(&directory, &mut file);
        file[link..link + offset_size].copy_from_slice(&number(at, offset_size));
        link = at as usize + next;
    }
    file
}

pub(super) fn jpeg(width: u32, height: u32) -> Vec<u8> {
    let image = image::GrayImage::from_fn(width, height, |x, y| {
        image::Luma([(200 * x / width + (x * 7 + y * 13) % 11) as u8])
    });
    let mut bytes = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 95).encode_image(&image).unwrap();
    bytes
}

pub(super) fn jpeg_turned(width: u32, height: u32, orientation: u8) -> Vec<u8> {
    let jpeg = jpeg(width, height);
    let mut exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0".to_vec();
    exif.extend([orientation, 0, 0, 0, 0, 0, 0]);
    let length = (exif.len() as u16 + 2).to_be_bytes();
    [&jpeg[..2], &[0xff, 0xe1], &length, &exif, &jpeg[2..]].concat()
}

pub(super) fn bmp(image: image::DynamicImage) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    // The encoder belongs to the feature that reads it.
    image.write_to(&mut bytes, image::ImageFormat::Bmp).unwrap();
    bytes.into_inner()
}
