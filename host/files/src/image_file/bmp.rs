//! BMP with run lengths. Pixels that the runs skip have colour 0; the `image` crate makes them black.

/// The file with the numbers of its colours as their grey, and the colours; `None` without run lengths.
pub(super) fn numbered(bytes: &[u8]) -> Option<(Vec<u8>, Vec<[u8; 3]>)> {
    let number = |at: usize| Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?) as usize);
    let (header, bits, compression, used) = (number(14)?, number(28)? & 0xffff, number(30)?, number(46)?);
    if !matches!((header, compression, bits), (40.., 1, 8) | (40.., 2, 4)) {
        return None;
    }
    let colours = if used == 0 { 1 << bits } else { used };
    let begin = header.checked_add(14)?;
    let mut numbered = bytes.to_vec();
    // Fewer colours than stated may be stored before the pixels.
    let end = begin.checked_add(colours.checked_mul(4)?)?.min(number(10)?);
    let palette = numbered.get_mut(begin..end)?;
    let entries = palette.as_chunks_mut::<4>().0.iter_mut().zip(0..=u8::MAX);
    let colours = entries.map(|(entry, number)| {
        let [blue, green, red, _] = std::mem::replace(entry, [number, number, number, 0]);
        [red, green, blue]
    });
    let colours = colours.collect();
    Some((numbered, colours))
}

/// RGB of pixels with numbers of colours; without a palette they remain.
pub(super) fn coloured(pixels: Vec<u8>, palette: Option<&[[u8; 3]]>) -> Vec<u8> {
    let Some(palette) = palette else { return pixels };
    let pixels = pixels.chunks_exact(3);
    pixels.flat_map(|pixel| palette.get(usize::from(pixel[0])).copied().unwrap_or_default()).collect()
}
