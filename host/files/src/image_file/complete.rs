//! Checks for truncated files and unsupported formats.

use std::ops::Range;

use super::tiff_tags;

pub(super) const RAW: &str = "it is a camera's raw file: develop it to a 16-bit TIFF, linear and without sharpening (with `dcraw -4 -T`, \
                              RawTherapee or darktable), and give that";

const VIDEO: &str =
    "it is a video: extract its frames (`ffmpeg -i FILE frames/%04d.png`) and give their folder";
const MICROSCOPE: &str =
    "it is a microscope's file, which is not read: convert it to OME-TIFF (Bio-Formats: bfconvert)";
const ARRAYS: &str = "it is a file of several arrays: save an image as float TIFF (`tifffile.imwrite`), a map as .npy (`numpy.save`)";

const DPX: &str = "DPX is not read: convert it to 16-bit TIFF";
const MRC: &str = "MRC is not read: convert it to TIFF (`mrc2tif`, or ImageJ)";

/// Formats that are not read, by bytes at a place.
const OTHERS: [(usize, &[u8], &str); 34] = [
    (0, b"GIF8", "GIF is not read: convert it to PNG or TIFF"),
    (0, b"\x76\x2f\x31\x01", "OpenEXR is not read: convert it to float TIFF"),
    (0, b"\xff\x0a", "JPEG XL is not read: convert it to PNG or TIFF"),
    (0, b"\0\0\0\x0cJXL ", "JPEG XL is not read: convert it to PNG or TIFF"),
    (0, b"\0\0\0\x0cjP  ", "JPEG 2000 is not read: convert it to PNG or TIFF"),
    (0, b"\xff\x4f\xff\x51", "JPEG 2000 is not read: convert it to PNG or TIFF"),
    (0, b"SIMPLE  =", "FITS is not read: convert it to float TIFF"),
    (0, b"#?RADIANCE", "Radiance HDR is not read: convert it to float TIFF"),
    (0, b"8BPS", "Photoshop's .psd is not read: save it as PNG or TIFF"),
    (0, b"SDPX", DPX),
    (0, b"XPDS", DPX),
    (128, b"DICM", "DICOM is not read: convert it to PNG or TIFF (ImageJ)"),
    (0, b"NRRD000", "NRRD is not read: convert it to float TIFF or .npy"),
    (208, b"MAP DD\0\0", MRC),
    (208, b"MAP DA\0\0", MRC),
    (208, b"MAP \x11\x11\0\0", MRC),
    (0, b"ZISRAWFILE", MICROSCOPE),
    (0, b"\xda\xce\xbe\x0a", MICROSCOPE),
    (0, b"\x70\0\0\0", MICROSCOPE),
    // Gatan's .dm3 and .dm4.
    (0, b"\0\0\0\x03", MICROSCOPE),
    (0, b"\0\0\0\x04\0\0\0\0", MICROSCOPE),
    (
        0,
        b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",
        "it is an OLE file (a microscope's .zvi or .oib), which is not read: convert it to OME-TIFF (Bio-Formats: bfconvert)",
    ),
    (0, b"\x89HDF\r\n\x1a\n", ARRAYS),
    (0, b"MATLAB 5.0 MAT-file", ARRAYS),
    (
        0,
        b"PK\x03\x04",
        "it is an archive (.zip or .npz): unpack it; save an image as float TIFF (`tifffile.imwrite`), a map as .npy (`numpy.save`)",
    ),
    (0, b"Pf\n", "PFM is not read: convert it to float TIFF or .npy"),
    (0, b"PF\n", "PFM is not read: convert it to float TIFF or .npy"),
    (
        0,
        b"\x93NUMPY",
        ".npy is read for maps, not for images: save an image as float TIFF (`tifffile.imwrite`)",
    ),
    (0, b"PIEH", "Sintel's .dpt is not read: convert it to float TIFF or .npy"),
    (0, b"DIGITAL SURF", "Digital Surf's .sur is not read: export the heights as float TIFF"),
    (0, b"DSCOMPRESSED", "Digital Surf's .sur is not read: export the heights as float TIFF"),
    (0, b"%PDF", "it is a PDF file: export its image as PNG or TIFF"),
    (0, b"\x1aE\xdf\xa3", VIDEO),
    (
        0,
        b"version https://git-lfs.github.com/spec/",
        "it is a Git LFS pointer, not the file: fetch the file with `git lfs pull`",
    ),
];

/// Bytes at the beginning that tell a format.
pub(super) const HEAD_BYTES: u64 = 256;

/// Description and remedy of an unsupported format, else `None`.
pub(super) fn unsupported(bytes: &[u8]) -> Option<&'static str> {
    // Of an ISO base media file: the major brand, a version, compatible brands (ISO 14496-12, section 4.3).
    let is_media = bytes.get(4..8) == Some(b"ftyp");
    let length = bytes.first_chunk().map_or(0, |length| u32::from_be_bytes(*length) as usize);
    let brands = bytes.get(8..length.clamp(8, bytes.len().max(8))).filter(|_| is_media).unwrap_or_default();
    let brands = brands.as_chunks::<4>().0;
    let brand = |names: &[&[u8; 4]]| brands.iter().any(|brand| names.contains(&brand));
    // Of Fujifilm, Olympus, Panasonic, Sigma, Minolta and old Canon cameras.
    let raw_magics: [&[u8]; 8] =
        [b"FUJIFILMCCD-RAW", b"IIRO", b"IIRS", b"MMOR", b"IIU\0", b"FOVb", b"\0MRM", b"II\x1a\0\0\0HEAPCCDR"];
    if bytes.get(8..10) == Some(b"CR") && bytes.starts_with(b"II*\0")
        || brand(&[b"crx "])
        || raw_magics.iter().any(|magic| bytes.starts_with(magic))
    {
        return Some(RAW);
    }
    if brand(&[b"avif", b"avis"]) || bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        return Some("AVIF and WebP are not read: convert it to PNG or TIFF");
    }
    if brand(&[b"heic", b"heix", b"mif1", b"msf1", b"hevc", b"hevx"]) {
        return Some(
            "it is a HEIC file, which is not read: convert it to PNG or TIFF, or set the phone to \"most compatible\"",
        );
    }
    if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"AVI ") || is_media {
        return Some(VIDEO);
    }
    // A TIFF may hold the mark of another format, behind its own.
    let from = |at: usize| bytes.get(at..).filter(|_| at == 0 || !tiff_tags::is_tiff(bytes));
    let found = OTHERS.iter().find(|(at, magic, _)| from(*at).is_some_and(|rest| rest.starts_with(magic)));
    found.map(|(.., advice)| *advice)
}

/// A JPEG up to its end marker, without stray bytes between its segments, which decoders skip; `None` without an end. Later data
/// (previews, films) is ignored.
pub(super) fn whole_jpeg(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut whole = bytes.get(..2)?.to_vec();
    let (mut at, mut in_scan) = (2, false);
    loop {
        let rest = bytes.get(at..)?;
        let found = rest.windows(2).position(|two| two[0] == 0xff && two[1] != 0xff && two[1] != 0)?;
        if in_scan {
            // Bytes of 0xff before a marker are fill.
            let fill = rest[..found].iter().rev().take_while(|byte| **byte == 0xff).count();
            whole.extend_from_slice(&rest[..found - fill]);
        }
        at += found;
        let length = match bytes[at + 1] {
            0x01 | 0xd0..=0xd7 | 0xd9 => 2,
            // Another image begins.
            0xd8 => return None,
            _ => 2 + usize::from(u16::from_be_bytes(*bytes.get(at + 2..)?.first_chunk()?)).max(2),
        };
        whole.extend_from_slice(bytes.get(at..at + length)?);
        match bytes[at + 1] {
            0xd9 => return Some(whole),
            0x01 | 0xd0..=0xd7 => {}
            marker => in_scan = marker == 0xda,
        }
        at += length;
    }
}

/// Markers of a JPEG with the data of their segments and what follows these, up to the first that is incomplete.
fn jpeg_segments(bytes: &[u8]) -> impl Iterator<Item = (u8, &[u8], &[u8])> {
    let mut at = 2;
    std::iter::from_fn(move || {
        at += scan_length(bytes.get(at..)?);
        let &[0xff, marker, high, low] = bytes.get(at..at + 4)? else { return None };
        let end = at + 2 + usize::from(u16::from_be_bytes([high, low]));
        let data = bytes.get(at + 4..end)?;
        at = end;
        Some((marker, data, &bytes[end..]))
    })
}

/// Bytes before the next marker of a segment: data of a scan with its restart markers, or fill.
fn scan_length(bytes: &[u8]) -> usize {
    let begins = |two: &[u8]| two[0] == 0xff && !matches!(two[1], 0 | 0xff | 0xd0..=0xd7);
    bytes.windows(2).position(begins).unwrap_or(bytes.len())
}

/// The first EXIF of a JPEG: longer ones continue in segments of the same mark.
pub(super) fn jpeg_exif(bytes: &[u8]) -> Option<&[u8]> {
    let mut segments = jpeg_segments(bytes).take_while(|(marker, ..)| *marker != 0xda);
    segments.find_map(|(marker, data, _)| data.strip_prefix(b"Exif\0\0").filter(|_| marker == 0xe1))
}

/// Whether a JPEG with its end lacks data before it. A progressive one was cut between two scans if some coefficients of its brightness lack their last
/// bits (T.81, G.1.2); a copy may have left a part of a scan as zeros.
pub(super) fn lacks_data(jpeg: &[u8]) -> bool {
    /// No picture has as many where zeros encode coefficients: each block would have all of them.
    const ZEROS: usize = 64;
    /// Some cameras fill a scan up to its end, at most to the next page of memory.
    const PADDING: usize = 4096;
    // Components of a progressive frame with the coefficients that are whole.
    let mut whole: Vec<(u8, [bool; 64])> = Vec::new();
    let mut zeros_are_coefficients = [false; 256];
    for (marker, mut data, after) in jpeg_segments(jpeg) {
        match marker {
            0xc2 => {
                let components = data.get(6..).unwrap_or_default().chunks_exact(3);
                whole = components.map(|component| (component[0], [false; 64])).collect();
            }
            0xc4 => {
                while let [table, rest @ ..] = data {
                    let Some((lengths, values)) = rest.split_at_checked(16) else { break };
                    let count: usize = lengths.iter().map(|length| usize::from(*length)).sum();
                    let Some((values, rest)) = values.split_at_checked(count) else { break };
                    // The first value has the code of zeros; its lower half is the size of a coefficient.
                    zeros_are_coefficients[usize::from(*table)] =
                        values.first().is_some_and(|value| value & 15 != 0);
                    data = rest;
                }
            }
            0xda => {
                let Some((count, rest)) = data.split_first() else { continue };
                let Some((selectors, &[first, last, bits])) = rest.split_at_checked(2 * usize::from(*count))
                else {
                    continue;
                };
                let selectors = selectors.as_chunks::<2>().0;
                let has_last_bits = |id: u8| bits & 15 == 0 && selectors.iter().any(|[of, _]| *of == id);
                for (_, done) in whole.iter_mut().filter(|(id, _)| has_last_bits(*id)) {
                    if let Some(part) = done.get_mut(usize::from(first)..=usize::from(last)) {
                        part.fill(true);
                    }
                }
                let of_zeros =
                    |[_, tables]: &[u8; 2]| zeros_are_coefficients[0x10 | usize::from(tables & 15)];
                let encodes = last == 63 && bits >> 4 == 0 && selectors.iter().any(of_zeros);
                let mut zeros = after[..scan_length(after)].rsplit(|byte| *byte != 0).map(<[u8]>::len);
                let at_end = zeros.next().unwrap_or(0);
                if encodes && (at_end > PADDING || zeros.any(|zeros| zeros >= ZEROS)) {
                    return true;
                }
            }
            _ => {}
        }
    }
    // Some programs leave colours coarse.
    whole.first().is_some_and(|(_, done)| done.contains(&false))
}

/// Why a JPEG of this coding is not read (T.81, table B.1; JPEG-LS), from the marker and precision of its frame.
pub(super) fn unsupported_jpeg(bytes: &[u8]) -> Option<String> {
    // Colours of a frame whose scans hold all of them.
    let mut together = 0;
    for (marker, data, _) in jpeg_segments(bytes) {
        let first = data.first().copied().unwrap_or(0);
        let coding = match marker {
            0xc2 if first == 8 => return None,
            0xc0 | 0xc1 if first == 8 => {
                let components = data.get(6..)?.chunks_exact(3);
                let colours = components.len();
                together =
                    if components.into_iter().any(|component| component[1] & 15 > 1) { colours } else { 0 };
                continue;
            }
            // The decoder confuses their rows.
            0xda if usize::from(first) < together => "a JPEG with subsampled colours in separate scans",
            0xc0..=0xc2 => &format!("a JPEG of {first} bits"),
            0xc3 | 0xc7 | 0xcb | 0xcf => "a lossless JPEG",
            0xc5 | 0xc6 | 0xcd | 0xce => "a hierarchical JPEG",
            0xc9 | 0xca => "a JPEG with arithmetic coding",
            0xf7 => "JPEG-LS",
            0xd9 | 0xda => return None,
            _ => continue,
        };
        return Some(format!("it is {coding}, which is not read: convert it to PNG or TIFF"));
    }
    None
}

/// Variance of a grey pixel by the rounding of a JPEG's coefficients, as a part of full scale squared: a twelfth of the
/// squared steps of brightness (T.81, B.2.4.1), averaged over the frequencies that depth from defocus uses.
pub(super) fn jpeg_coding_variance(bytes: &[u8]) -> Option<f64> {
    /// Cycles per pixel.
    const USED: std::ops::Range<f64> = 0.08..0.3;
    let mut tables: [Option<[f64; 64]>; 4] = [None; 4];
    let mut of_brightness = 0;
    for (marker, mut data, _) in jpeg_segments(bytes) {
        match marker {
            0xdb => {
                while let [kind, rest @ ..] = data {
                    let wide = 1 + usize::from(kind >> 4 != 0);
                    let (steps, rest) = rest.split_at_checked(64 * wide)?;
                    let step = |k: usize| {
                        steps[k * wide..][..wide].iter().fold(0.0, |all, byte| 256.0 * all + f64::from(*byte))
                    };
                    *tables.get_mut(usize::from(kind & 15))? = Some(std::array::from_fn(step));
                    data = rest;
                }
            }
            0xc0..=0xc2 => of_brightness = usize::from(*data.get(8)?),
            0xda => {
                let steps = (*tables.get(of_brightness)?)?;
                let used: Vec<f64> = zigzag()
                    .zip(steps)
                    .filter(|([u, v], _)| USED.contains(&(f64::from(*u).hypot(f64::from(*v)) / 16.0)))
                    .map(|(_, step)| step * step / 12.0)
                    .collect();
                return Some(used.iter().sum::<f64>() / used.len() as f64 / (255.0 * 255.0));
            }
            _ => {}
        }
    }
    None
}

/// Horizontal and vertical frequency of a block's coefficients in the order of T.81, figure A.6.
fn zigzag() -> impl Iterator<Item = [u8; 2]> {
    (0..15_u8).flat_map(|sum| {
        let along = sum.saturating_sub(7)..=sum.min(7);
        along.map(move |k| if sum % 2 == 0 { [k, sum - k] } else { [sum - k, k] })
    })
}

/// Number of images of an animated PNG (chunk acTL), else 1.
pub(super) fn png_images(bytes: &[u8]) -> u32 {
    png_chunk(bytes, b"acTL").and_then(|data| Some(u32::from_be_bytes(*data.first_chunk()?))).unwrap_or(1)
}

/// Significant bits of a PNG's first channel (chunk sBIT), if given.
pub(super) fn png_significant_bits(bytes: &[u8]) -> Option<u8> {
    png_chunk(bytes, b"sBIT")?.first().copied().filter(|bits| (1..=16).contains(bits))
}

/// Bits of a grey PNG that has fewer than 8.
pub(super) fn png_grey_bits(bytes: &[u8]) -> Option<u8> {
    let [bits, kind] = *bytes.get(24..)?.first_chunk()?;
    (kind == 0 && bits < 8).then_some(bits)
}

/// Names of a PNG's chunks with their places, up to the first that is incomplete.
pub(super) fn png_chunks(bytes: &[u8]) -> impl Iterator<Item = (&[u8; 4], Range<usize>)> {
    let mut at = 8;
    std::iter::from_fn(move || {
        let (length, rest) = bytes.get(at..)?.split_first_chunk::<4>()?;
        let end = at.checked_add(u32::from_be_bytes(*length) as usize)?.checked_add(12)?;
        let (name, place): (&[u8; 4], _) = (rest.first_chunk()?, at..end);
        bytes.get(place.clone())?;
        at = end;
        Some((name, place))
    })
}

fn png_chunk<'a>(bytes: &'a [u8], name: &[u8; 4]) -> Option<&'a [u8]> {
    let mut before = png_chunks(bytes).take_while(|(name, _)| !matches!(*name, b"IDAT" | b"IEND"));
    let (_, place) = before.find(|(found, _)| *found == name)?;
    bytes.get(place.start + 8..place.end - 4)
}
