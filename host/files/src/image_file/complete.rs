//! Checks for truncated files and unsupported formats.

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
    let raw_magics: [&[u8]; 6] = [b"FUJIFILMCCD-RAW", b"IIRO", b"IIRS", b"MMOR", b"IIU\0", b"FOVb"];
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

/// Markers of a JPEG with the data of their segments, up to the first that is incomplete.
fn jpeg_segments(bytes: &[u8]) -> impl Iterator<Item = (u8, &[u8])> {
    let mut at = 2;
    std::iter::from_fn(move || {
        while bytes.get(at..at + 2)? == [0xff, 0xff] {
            at += 1;
        }
        let &[0xff, marker, high, low] = bytes.get(at..at + 4)? else { return None };
        let end = at + 2 + usize::from(u16::from_be_bytes([high, low]));
        let data = bytes.get(at + 4..end)?;
        at = end;
        Some((marker, data))
    })
}

/// Why a JPEG of this coding is not read (T.81, table B.1; JPEG-LS), from the marker and precision of its frame.
pub(super) fn unsupported_jpeg(bytes: &[u8]) -> Option<String> {
    // Colours of a frame whose scans hold all of them.
    let mut together = 0;
    for (marker, data) in jpeg_segments(bytes) {
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
    for (marker, mut data) in jpeg_segments(bytes) {
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

fn png_chunk<'a>(bytes: &'a [u8], name: &[u8; 4]) -> Option<&'a [u8]> {
    let mut at = 8;
    loop {
        let length = u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize;
        match bytes.get(at + 4..at + 8)? {
            found if found == name => return bytes.get(at + 8..at.checked_add(length)?.checked_add(8)?),
            b"IDAT" | b"IEND" => return None,
            _ => at = at.checked_add(length)?.checked_add(12)?,
        }
    }
}
