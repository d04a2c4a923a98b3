//! ZIP archives such as NumPy's `.npz`: stored or deflated, without encryption, below 4 GiB.

use std::io::Read;

use flate2::read::DeflateDecoder;

use super::recording::RecordingError;

/// Limit of the unpacked size relative to the archive's.
const LARGEST_RATIO: usize = 64;
const SPARE_BYTES: usize = 1 << 20;

pub fn entries(
    bytes: &[u8],
    wanted: impl Fn(&str) -> bool,
) -> Result<Vec<(String, Vec<u8>)>, RecordingError> {
    let bad = |reason: &str| RecordingError::Kind { kind: "NPZ", reason: reason.into() };
    if !bytes.starts_with(b"PK\x03\x04") {
        return Err(bad("it does not start as a ZIP archive"));
    }
    let end = bytes.windows(4).rposition(|window| window == b"PK\x05\x06");
    let end = end.ok_or_else(|| bad("its directory is missing: it was cut short"))?;
    let count = u16_at(bytes, end + 10)?;
    let mut at = u32_at(bytes, end + 16)?;
    let mut left = bytes.len().saturating_mul(LARGEST_RATIO) + SPARE_BYTES;
    let mut found = Vec::new();
    for _ in 0..count {
        if bytes.get(at..at + 4) != Some(b"PK\x01\x02".as_slice()) {
            return Err(bad("its directory is damaged"));
        }
        let (method, packed, header) =
            (u16_at(bytes, at + 10)?, u32_at(bytes, at + 20)?, u32_at(bytes, at + 42)?);
        let (name, extra, comment) =
            (u16_at(bytes, at + 28)?, u16_at(bytes, at + 30)?, u16_at(bytes, at + 32)?);
        let name_bytes = piece(bytes, at + 46, name)?;
        let name_text = String::from_utf8_lossy(name_bytes).into_owned();
        at += 46 + name + extra + comment;
        if !wanted(&name_text) {
            continue;
        }
        let data_at = header + 30 + u16_at(bytes, header + 26)? + u16_at(bytes, header + 28)?;
        let data = piece(bytes, data_at, packed)?;
        let mut unpacked = Vec::new();
        match method {
            0 => unpacked.extend_from_slice(data),
            8 => {
                let read = DeflateDecoder::new(data).take(left as u64).read_to_end(&mut unpacked);
                read.map_err(|error| bad(&format!("its entry `{name_text}` is damaged: {error}")))?;
            }
            other => return Err(bad(&format!("its entry `{name_text}` is packed by method {other}"))),
        }
        left = left.saturating_sub(unpacked.len());
        if left == 0 {
            return Err(bad("it unpacks to more than 64 times its size"));
        }
        found.push((name_text, unpacked));
    }
    Ok(found)
}

fn piece(bytes: &[u8], at: usize, length: usize) -> Result<&[u8], RecordingError> {
    let end = at.saturating_add(length);
    bytes.get(at..end).ok_or(RecordingError::Truncated {
        kind: "NPZ",
        what: "an entry",
        needed: end,
        found: bytes.len(),
    })
}

fn u16_at(bytes: &[u8], at: usize) -> Result<usize, RecordingError> {
    let raw = piece(bytes, at, 2)?;
    Ok(usize::from(u16::from_le_bytes([raw[0], raw[1]])))
}

fn u32_at(bytes: &[u8], at: usize) -> Result<usize, RecordingError> {
    let raw = piece(bytes, at, 4)?;
    Ok(u32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]]) as usize)
}
