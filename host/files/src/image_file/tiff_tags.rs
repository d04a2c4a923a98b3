//! TIFF directories without pixels, from memory or a file: sizes, kinds and descriptions (TIFF 6.0, section 2; BigTIFF as in libtiff). The
//! `tiff` crate rejects files such as raw files, whose kind error messages need.

use std::{
    borrow::Cow,
    cell::RefCell,
    fs,
    io::{self, Read, Seek, SeekFrom},
    path::Path,
};

const DIRECTORIES_MAX: usize = 100_000;
const ENTRIES_MAX: u64 = 4096;
/// OME-XML of large stacks has megabytes.
const TEXT_MAX: u64 = 64 << 20;
const SUB_IMAGES_MAX: usize = 16;
/// Three values for each of 256 colours.
const COLOUR_MAP_MAX: u64 = 3 << 8;
const BLOCK_BYTES: u64 = 1 << 16;

/// Contents of a file, by places.
pub(crate) trait Source {
    fn size(&self) -> u64;
    /// Up to this many bytes, fewer only at the end.
    fn read(&self, at: u64, length: u64) -> Option<Cow<'_, [u8]>>;
}

impl Source for [u8] {
    fn size(&self) -> u64 {
        self.len() as u64
    }

    fn read(&self, at: u64, length: u64) -> Option<Cow<'_, [u8]>> {
        let end = at.checked_add(length)?.min(self.size());
        Some(self.get(usize::try_from(at).ok()?..end as usize)?.into())
    }
}

/// A file, of which the last block is in memory.
pub(crate) struct InFile {
    file: fs::File,
    size: u64,
    block: RefCell<(u64, Vec<u8>)>,
}

impl InFile {
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = fs::File::open(path)?;
        Ok(Self { size: file.metadata()?.len(), file, block: RefCell::new((0, Vec::new())) })
    }

    fn at(&self, at: u64, length: u64) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        (&self.file).seek(SeekFrom::Start(at))?;
        (&self.file).take(length).read_to_end(&mut bytes)?;
        Ok(bytes)
    }
}

impl Source for InFile {
    fn size(&self) -> u64 {
        self.size
    }

    fn read(&self, at: u64, length: u64) -> Option<Cow<'_, [u8]>> {
        let length = length.min(self.size.checked_sub(at)?);
        if length > BLOCK_BYTES {
            return Some(self.at(at, length).ok()?.into());
        }
        let mut block = self.block.borrow_mut();
        if at < block.0 || at + length > block.0 + block.1.len() as u64 {
            *block = (at, self.at(at, BLOCK_BYTES).ok()?);
        }
        let from = (at - block.0) as usize;
        Some(block.1.get(from..from + length as usize)?.to_vec().into())
    }
}

#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Directory {
    pub width: u64,
    pub height: u64,
    /// Tag 254: bit 0 = reduced resolution, bit 2 = mask.
    pub subfile: u64,
    /// Tag 255 (obsolete): 2 = reduced resolution.
    pub old_subfile: u64,
    pub photometric: u64,
    /// Place of its value in the file.
    pub photometric_at: u64,
    /// Tag 320: red of each colour of a palette, then green, then blue.
    pub colour_map: Vec<u64>,
    /// Tag 266: 2 = the lowest bit of a byte comes first.
    pub fill_order: u64,
    pub planar: u64,
    /// Tag 317: 1 = none.
    pub predictor: u64,
    /// Tag 322.
    pub tile_width: Option<u64>,
    /// Tag 323.
    pub tile_length: Option<u64>,
    /// Tag 274, 1 to 8, of any type of integers, as in libtiff.
    pub orientation: Option<u8>,
    pub samples_per_pixel: u64,
    pub bits: u64,
    /// Tag 339: 1 = unsigned, 2 = signed, 3 = float, 5 and 6 = complex.
    pub sample_format: u64,
    /// Tag 32997: slices of a volume in one page.
    pub image_depth: u64,
    pub compression: u64,
    pub strip_offset: u64,
    pub strips: u64,
    /// Tags 273 and 279, or 324 and 325: place and length of the last strip or tile.
    pub last_strip: [u64; 2],
    pub x_resolution: Option<f64>,
    pub y_resolution: Option<f64>,
    /// Tag 281.
    pub max_sample_value: Option<u64>,
    pub extra_samples: Option<u64>,
    pub description: Option<String>,
    pub make: Option<String>,
    pub software: Option<String>,
    pub date_time: Option<String>,
    /// Tags 36867 and 37521 of the EXIF directory: second and fraction of a second of the exposure.
    pub exposed: Option<String>,
    pub exposed_fraction: Option<String>,
    pub is_dng: bool,
    /// Width and height of the images in tag 330, without those of reduced resolution.
    pub sub_images: Vec<(u64, u64)>,
    pub micro_manager: Option<String>,
    /// Tag 33629 of MetaMorph: planes behind this one, without directories.
    pub metamorph_planes: u64,
    /// Tag 42112, `GDAL_METADATA`, in XML.
    pub gdal: Option<String>,
    /// Tag 42113, `GDAL_NODATA`: the value of pixels without one.
    pub nodata: Option<String>,
}

impl Directory {
    pub fn reduced(&self) -> bool {
        self.subfile & 1 != 0 || self.old_subfile == 2
    }

    pub fn mask(&self) -> bool {
        self.subfile & 4 != 0
    }

    /// Why a page that holds a volume is refused.
    pub fn volume(&self) -> Option<String> {
        (self.image_depth > 1).then(|| {
            format!(
                "its page is a volume of {} slices (tag ImageDepth), which is not read: store each slice as a page (tifffile: without \
                 volumetric=True)",
                self.image_depth
            )
        })
    }
}

pub(crate) fn is_tiff(bytes: &[u8]) -> bool {
    [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|magic| bytes.starts_with(*magic))
}

/// Whether ImageJ or ImageJ2 (SCIFIO) wrote a description.
pub(crate) fn is_image_j(description: &str) -> bool {
    ["ImageJ=", "SCIFIO="].iter().any(|program| description.starts_with(program))
}

/// All directories in file order. Fails for a directory beyond the end, or an endless chain.
pub(crate) fn directories<S: Source + ?Sized>(source: &S) -> Result<Vec<Directory>, String> {
    let file = File::new(source)?;
    let mut at = file.first;
    let mut seen = std::collections::HashSet::new();
    let mut found = Vec::new();
    while at != 0 {
        if !seen.insert(at) || found.len() >= DIRECTORIES_MAX {
            return Err("its list of images has no end".into());
        }
        let directory = file.directory(at, true).and_then(|(directory, next)| Some((directory, next?)));
        let (directory, next) =
            directory.ok_or("it is incomplete: an image's directory lies beyond its end")?;
        found.push(directory);
        at = next;
    }
    Ok(found)
}

/// Orientation in EXIF, whose list of directories often is cut.
pub(crate) fn orientation(exif: &[u8]) -> Option<u8> {
    let file = is_tiff(exif).then(|| File::new(exif).ok())??;
    file.directory(file.first, false)?.0.orientation
}

struct File<'a, S: ?Sized> {
    source: &'a S,
    little: bool,
    big: bool,
    first: u64,
}

impl<'a, S: Source + ?Sized> File<'a, S> {
    fn new(source: &'a S) -> Result<Self, String> {
        let little = source.read(0, 2).is_some_and(|order| *order == *b"II");
        let mut file = Self { source, little, big: false, first: 0 };
        file.big = file.number(2, 2) == Some(43);
        let first = if file.big { file.number(8, 8) } else { file.number(4, 4) };
        file.first = first.ok_or("it ends within its header")?;
        Ok(file)
    }

    fn number(&self, at: u64, size: usize) -> Option<u64> {
        let bytes = self.source.read(at, size as u64).filter(|bytes| bytes.len() == size)?;
        let shift = |value: u64, byte: &u8| value << 8 | u64::from(*byte);
        Some(if self.little { bytes.iter().rev().fold(0, shift) } else { bytes.iter().fold(0, shift) })
    }

    fn directory(&self, at: u64, with_sub_images: bool) -> Option<(Directory, Option<u64>)> {
        let (count_size, entry_size, offset_size) = if self.big { (8, 20, 8) } else { (2, 12, 4) };
        let count = self.number(at, count_size)?;
        if count > ENTRIES_MAX {
            return None;
        }
        let entries = at + count_size as u64;
        let next = self.number(entries + count * entry_size, offset_size);
        let mut directory = Directory {
            samples_per_pixel: 1,
            bits: 1,
            sample_format: 1,
            predictor: 1,
            image_depth: 1,
            compression: 1,
            ..Directory::default()
        };
        for entry in (0..count).map(|index| entries + index * entry_size) {
            self.entry(entry, &mut directory, with_sub_images)?;
        }
        Some((directory, next))
    }

    fn entry(&self, at: u64, directory: &mut Directory, with_sub_images: bool) -> Option<()> {
        let tag = self.number(at, 2)?;
        let kind = self.number(at + 2, 2)?;
        let size = match kind {
            1 | 2 | 6 | 7 => 1,
            3 | 8 => 2,
            4 | 9 | 11 | 13 => 4,
            5 | 10 | 12 | 16 | 17 | 18 => 8,
            _ => return Some(()),
        };
        let inline = if self.big { 8 } else { 4 };
        let count = self.number(at + 4, inline)?;
        let field = at + 4 + inline as u64;
        let fits = count.checked_mul(size as u64).is_some_and(|bytes| bytes <= inline as u64);
        let place = if fits { field } else { self.number(field, inline)? };
        let value = |index: u64| self.number(place.checked_add(index.checked_mul(size as u64)?)?, size);
        let text = || {
            let bytes = self.source.read(place, count.min(TEXT_MAX))?;
            // Old programs write Latin-1, whose codes are those of Unicode.
            let latin_1 = |bytes: &[u8]| bytes.iter().map(|byte| char::from(*byte)).collect::<String>();
            let chunks =
                bytes.utf8_chunks().map(|chunk| chunk.valid().to_owned() + &latin_1(chunk.invalid()));
            Some(chunks.collect::<String>().trim_end_matches('\0').to_owned())
        };
        let ratio = || {
            let [above, below] = [0, 4].map(|skip| self.number(place.saturating_add(skip), 4));
            above.zip(below).map(|(above, below)| above as f64 / below as f64)
        };
        let first = || value(0).unwrap_or(0);
        let last = || value(count.saturating_sub(1)).unwrap_or(0);
        match tag {
            254 => directory.subfile = first(),
            255 => directory.old_subfile = first(),
            256 => directory.width = first(),
            257 => directory.height = first(),
            258 => directory.bits = first(),
            259 => directory.compression = first(),
            262 => (directory.photometric, directory.photometric_at) = (first(), place),
            266 => directory.fill_order = first(),
            284 => directory.planar = first(),
            317 => directory.predictor = first(),
            322 => directory.tile_width = value(0),
            323 => directory.tile_length = value(0),
            324 => directory.last_strip[0] = last(),
            279 | 325 => directory.last_strip[1] = last(),
            270 => directory.description = text(),
            271 => directory.make = text(),
            273 => {
                (directory.strip_offset, directory.strips) = (first(), count);
                directory.last_strip[0] = last();
            }
            274 => {
                let integer = !matches!(kind, 2 | 5 | 7 | 10..=12);
                let upright = |value: &u8| (1..=8).contains(value);
                directory.orientation =
                    value(0).filter(|_| integer).and_then(|value| u8::try_from(value).ok()).filter(upright);
            }
            277 => directory.samples_per_pixel = first(),
            281 => directory.max_sample_value = value(0),
            282 => directory.x_resolution = ratio(),
            283 => directory.y_resolution = ratio(),
            305 => directory.software = text(),
            306 => directory.date_time = text(),
            320 => directory.colour_map = (0..count.min(COLOUR_MAP_MAX)).filter_map(value).collect(),
            330 if with_sub_images => {
                let sub = |index| self.directory(value(index)?, false);
                let images = (0..count).take(SUB_IMAGES_MAX).filter_map(sub).map(|(sub, _)| sub);
                let whole = images.filter(|sub| !sub.reduced());
                directory.sub_images = whole.map(|sub| (sub.width, sub.height)).collect();
            }
            34665 if with_sub_images => {
                if let Some((exif, _)) = value(0).and_then(|at| self.directory(at, false)) {
                    (directory.exposed, directory.exposed_fraction) = (exif.exposed, exif.exposed_fraction);
                }
            }
            36867 => directory.exposed = text(),
            37521 => directory.exposed_fraction = text(),
            338 => directory.extra_samples = value(0),
            339 => directory.sample_format = first(),
            32997 => directory.image_depth = first(),
            33629 => directory.metamorph_planes = count,
            42112 => directory.gdal = text(),
            42113 => directory.nodata = text(),
            50706 => directory.is_dng = true,
            51123 => directory.micro_manager = text(),
            _ => {}
        }
        Some(())
    }
}
