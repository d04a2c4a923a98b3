//! Palettes. The decoder refuses them, so that it reads the numbers of the colours as grey. Those of ImageJ are for display only: the
//! numbers are the brightness.

use std::{
    io::{self, Read, Seek, SeekFrom},
    ops::Range,
};

use super::{Decoded, Directory, Values, tiff_tags};

/// PhotometricInterpretation of a palette, and of grey whose black is 0.
const PALETTE: u8 = 3;
const GREY: u8 = 1;

pub(super) fn is_read(page: &Directory) -> bool {
    matches!(page.bits, 1 | 2 | 4 | 8)
        && page.samples_per_pixel == 1
        && matches!(page.sample_format, 0 | 1 | 4)
        && page.colour_map.len() == 3 << page.bits
}

/// Pages with a palette for display only become grey: one of ImageJ whose colours change gradually. Colours of a picture
/// (8-bit Color) leap.
pub(super) fn without_display(pages: &mut [Directory]) {
    let described = pages.first().and_then(|first| first.description.as_deref());
    if described.is_some_and(tiff_tags::is_image_j) {
        let is_palette = |page: &&mut Directory| page.photometric == u64::from(PALETTE) && is_gradual(page);
        pages.iter_mut().filter(is_palette).for_each(|page| page.photometric = u64::from(GREY));
    }
}

fn is_gradual(page: &Directory) -> bool {
    /// Largest step of a channel, of 65535: that of 16 levels.
    const LARGEST: u64 = 65535 / 15;
    let colours = (page.colour_map.len() / 3).max(1);
    let mut channels = page.colour_map.chunks(colours);
    // The ends may mark saturated pixels (HiLo).
    channels.all(|channel| {
        let inner = channel.get(1..channel.len() - 1).unwrap_or_default();
        inner.array_windows().all(|[a, b]| a.abs_diff(*b) <= LARGEST)
    })
}

/// A file whose palette page reads as grey.
pub(super) struct AsGrey<R> {
    file: R,
    at: u64,
    kind: Range<u64>,
}

impl<R: Seek> AsGrey<R> {
    pub fn new(file: R, page: &Directory) -> Self {
        let kind = page.photometric_at..page.photometric_at.saturating_add(4);
        Self { file, at: 0, kind }
    }
}

impl<R: Read> Read for AsGrey<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        for at in self.kind.clone().filter_map(|at| usize::try_from(at.checked_sub(self.at)?).ok()) {
            if let Some(byte) = buffer[..count].get_mut(at).filter(|byte| **byte == PALETTE) {
                *byte = GREY;
            }
        }
        self.at += count as u64;
        Ok(count)
    }
}

impl<R: Seek> Seek for AsGrey<R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.at = self.file.seek(to)?;
        Ok(self.at)
    }
}

/// The colours of an image of their numbers, with 8 bits; an image without a palette remains.
pub(super) fn coloured(image: Decoded, page: &Directory) -> Decoded {
    if page.photometric != u64::from(PALETTE) {
        return image;
    }
    let Values::U8(numbers) = &image.values else { return image };
    // 1, 2 and 4 bits were spread over 8.
    let spread = usize::from(u8::MAX) / ((1 << page.bits) - 1);
    let colours = page.colour_map.len() / 3;
    // Some programs write 8 bits of 16, as libtiff tolerates.
    let shift = if page.colour_map.iter().all(|value| *value < 256) { 0 } else { 8 };
    let colour = |number: u8| {
        [0, 1, 2].map(|channel| {
            let value = page.colour_map.get(channel * colours + usize::from(number) / spread);
            value.map_or(0, |value| (value >> shift) as u8)
        })
    };
    let values = Values::U8(numbers.iter().flat_map(|number| colour(*number)).collect());
    Decoded { values, channels: 3, colours: 3, largest: None, ..image }
}
