//! Depth maps and masks in files: `.npy` (f32) and float TIFF.

use std::{
    io::{self, Cursor, Seek, Write},
    path::{Path, PathBuf},
};

use ndarray::{Array2, ArrayView1, ArrayView2, Axis};
use rayon::prelude::*;
use tiff::{
    TiffError,
    encoder::{TiffEncoder, colortype::Gray32Float},
};

use crate::{
    EncodeError,
    image_file::{
        self, ImageError, ReadSettings, Signed,
        tiff_tags::{self, Directory},
    },
    npy::{self, NpyError},
};

#[derive(Debug, thiserror::Error)]
pub enum MapError {
    #[error("cannot read {}: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{} is empty", path.display())]
    Empty { path: PathBuf },
    #[error("{} is not a map, a 2-D array of f16, f32 or f64: {reason}", path.display())]
    Npy { path: PathBuf, reason: NpyError },
    #[error("{} is not a map that farnear reads (.npy, float TIFF): {reason}", path.display())]
    Format { path: PathBuf, reason: String },
    #[error("{} is not a mask: {reason}", path.display())]
    Mask { path: PathBuf, reason: String },
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error("{} has three channels, and a map has one: store the depth as grey", path.display())]
    Colours { path: PathBuf },
    /// Integers have no known unit.
    #[error("{} holds {samples} integers, not mm; give the .npy or the float .tiff", path.display())]
    Integers { path: PathBuf, samples: image_file::Samples },
}

/// Pixels that a file marks as holes by a value.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct NoData {
    pub value: f32,
    pub pixels: usize,
}

/// Reads a file, or a page of one (`file.tif#3`).
pub fn read(path: &Path) -> Result<Array2<f32>, MapError> {
    Ok(read_with_nodata(path)?.0)
}

/// Pixels of the value that GDAL's tag of a TIFF states for holes are NaN.
pub fn read_with_nodata(path: &Path) -> Result<(Array2<f32>, Option<NoData>), MapError> {
    let (file, page) = image_file::file_and_page(path);
    let bytes = std::fs::read(&file).map_err(|source| MapError::Read { path: path.into(), source })?;
    if bytes.is_empty() {
        return Err(MapError::Empty { path: path.into() });
    }
    let refused = |reason: String| MapError::Format { path: path.into(), reason };
    if bytes.starts_with(npy::MAGIC) {
        image_file::only_page(page).map_err(refused)?;
        let values = npy::read(&bytes).map_err(|reason| MapError::Npy { path: path.into(), reason })?;
        return Ok((values, None));
    }
    let image = image_file::decode_with(&bytes, page, Signed::Refused)
        .and_then(|decoded| decoded.grey(&ReadSettings::default()))
        .map_err(refused)?;
    if image.samples != image_file::Samples::Float {
        return Err(MapError::Integers { path: path.into(), samples: image.samples });
    }
    if image.colour {
        return Err(MapError::Colours { path: path.into() });
    }
    let directory = directory(&bytes, page).unwrap_or_default();
    if is_scaled(&directory) {
        let reason = "GDAL's metadata scale or shift its values: store the depths themselves as floats (`gdal_translate -unscale`)";
        return Err(refused(reason.into()));
    }
    let mut values = image.pixels;
    let Some(value) = nodata(&directory) else { return Ok((values, None)) };
    let mut pixels = 0;
    values.iter_mut().filter(|pixel| **pixel == value).for_each(|pixel| {
        *pixel = f32::NAN;
        pixels += 1;
    });
    Ok((values, (pixels > 0).then_some(NoData { value, pixels })))
}

fn nodata(directory: &Directory) -> Option<f32> {
    directory.nodata.as_deref()?.trim().parse::<f64>().ok().map(|value| value as f32)
}

/// Whether GDAL's metadata have a scale or an offset, by which the values become depths.
fn is_scaled(directory: &Directory) -> bool {
    let metadata = directory.gdal.as_deref().unwrap_or_default();
    let differs = |(role, usual): (&str, f64)| {
        let mut values = metadata.split(role).skip(1).map(|rest| rest.split('<').next().unwrap_or_default());
        values.any(|value| value.trim().parse::<f64>() != Ok(usual))
    };
    [("role=\"scale\">", 1.0), ("role=\"offset\">", 0.0)].into_iter().any(differs)
}

/// The directory of a page, or of the only one.
fn directory(tiff: &[u8], page: Option<usize>) -> Option<Directory> {
    let directories = tiff_tags::directories(tiff).ok()?;
    let mut pages = directories.into_iter().filter(|directory| !directory.reduced() && !directory.mask());
    pages.nth(page.unwrap_or(1).saturating_sub(1))
}

/// Where a mask is not 0: an image without lossy compression, or a `.npy` of bool, integers or floats.
pub fn read_mask(path: &Path) -> Result<Array2<bool>, MapError> {
    let (file, page) = image_file::file_and_page(path);
    let bytes = image_file::read_bytes(&file)?;
    if bytes.starts_with(npy::MAGIC) {
        return image_file::only_page(page)
            .and_then(|()| npy::read_mask(&bytes).map_err(|error| error.to_string()))
            .map_err(|reason| MapError::Mask { path: path.into(), reason });
    }
    let refused = |reason: String| ImageError::Format { path: path.into(), reason };
    let decoded = image_file::decode_with(&bytes, page, Signed::AsUnsigned).map_err(refused)?;
    if decoded.only_alpha_differs() {
        let reason = "all its pixels have one colour and differ only in alpha: store the mask as grey".into();
        return Err(refused(reason).into());
    }
    let grey = decoded.grey(&ReadSettings::default()).map_err(refused)?;
    if grey.coding_variance > 0.0 {
        let reason =
            "its lossy compression (JPEG) changes values next to edges: store the mask as PNG".into();
        return Err(refused(reason).into());
    }
    let mask = grey.pixels.mapv(|value| value != 0.0 && !value.is_nan());
    let first = grey.pixels.first();
    let differ = || grey.pixels.iter().any(|value| Some(value) != first);
    if grey.samples != image_file::Samples::Float && mask.iter().all(|set| *set) && differ() {
        let reason =
            "its pixels differ and none is 0: a mask is 0 where it is not set, and anything else where it is"
                .into();
        return Err(MapError::Mask { path: path.into(), reason });
    }
    Ok(mask)
}

/// Distance of a value from all others, relative to their range, beyond which it is not a depth.
const FAR: f32 = 20.0;

/// Values at the ends of a map that several pixels have, far from all others, with their numbers of pixels.
pub fn far_from_others(map: ArrayView2<f32>) -> Vec<NoData> {
    let mut found = Vec::new();
    let mut rest = map.to_owned();
    while let Some([low, high]) = range(rest.view()) {
        let before = found.len();
        for value in [low, high] {
            let others = rest.mapv(|other| if other == value { f32::NAN } else { other });
            let pixels = rest.iter().filter(|other| **other == value).count();
            let Some([least, most]) = range(others.view()).filter(|[least, most]| least < most) else {
                continue;
            };
            let distance = (least - value).max(value - most);
            if pixels > 1 && distance > FAR * (most - least) {
                found.push(NoData { value, pixels });
                rest = others;
                break;
            }
        }
        if found.len() == before {
            break;
        }
    }
    found
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Format {
    Npy,
    Tiff,
}

impl Format {
    /// Format of a file name; `None` for another ending.
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_lowercase().as_str() {
            "npy" => Some(Self::Npy),
            "tif" | "tiff" => Some(Self::Tiff),
            _ => None,
        }
    }

    pub fn encode(self, map: ArrayView2<f32>) -> Result<Vec<u8>, EncodeError> {
        match self {
            Self::Npy => Ok(npy::write(map)),
            Self::Tiff => tiff(map),
        }
    }
}

pub fn tiff(map: ArrayView2<f32>) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = Cursor::new(Vec::new());
    tiff_to(map, &mut bytes).map_err(EncodeError::of("a TIFF"))?;
    Ok(bytes.into_inner())
}

/// [`tiff()`] into a file, without a copy in memory.
pub fn tiff_to(map: ArrayView2<f32>, to: &mut (impl Write + Seek)) -> io::Result<()> {
    let (height, width) = map.dim();
    let standard = map.as_standard_layout();
    let Some(values) = standard.as_slice() else { unreachable!("made in standard layout") };
    TiffEncoder::new(to)
        .and_then(|mut file| file.write_image::<Gray32Float>(width as u32, height as u32, values))
        .map_err(|error| match error {
            TiffError::IoError(error) => error,
            other => io::Error::other(other),
        })
}

/// Codes of a 16-bit depth image: `mm = offset_mm + scale_mm * code`, 0 = no value.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub struct Scale {
    pub offset_mm: f64,
    pub scale_mm: f64,
}

/// Least and largest finite value; `None` without one.
pub(crate) fn range(map: ArrayView2<f32>) -> Option<[f32; 2]> {
    let nothing = [f32::INFINITY, f32::NEG_INFINITY];
    // Comparisons are one instruction each, and false for NaN.
    let wider = |[low, high]: [f32; 2], [other_low, other_high]: [f32; 2]| {
        [if other_low < low { other_low } else { low }, if other_high > high { other_high } else { high }]
    };
    let with = |range: [f32; 2], value: f32| {
        let value = if value.is_finite() { value } else { f32::NAN };
        wider(range, [value, value])
    };
    let of_row = |row: ArrayView1<f32>| {
        let Some(values) = row.as_slice() else { return row.iter().copied().fold(nothing, with) };
        // Eight parallel ranges, which the compiler vectorises.
        let (parts, rest) = values.as_chunks::<8>();
        let mut ranges = [nothing; 8];
        for part in parts {
            ranges.iter_mut().zip(part).for_each(|(range, value)| *range = with(*range, *value));
        }
        rest.iter().copied().fold(ranges.into_iter().fold(nothing, wider), with)
    };
    let [low, high] = map.axis_iter(Axis(0)).into_par_iter().map(of_row).reduce(|| nothing, wider);
    (low <= high).then_some([low, high])
}

pub fn scale(map: ArrayView2<f32>) -> Scale {
    let Some([low, high]) = range(map) else { return Scale { offset_mm: 0.0, scale_mm: 1.0 } };
    // Code 1 is the nearest depth, code 65535 the farthest.
    let scale_mm = f64::from(high - low).max(1e-6) / 65_534.0;
    Scale { offset_mm: f64::from(low) - scale_mm, scale_mm }
}

pub fn codes(map: ArrayView2<f32>, Scale { offset_mm, scale_mm }: Scale) -> Array2<u16> {
    // Positive: adding a half and truncating rounds to nearest.
    let code = |value: f32| ((f64::from(value) - offset_mm) / scale_mm + 0.5) as u16;
    map.mapv(|value| if value.is_finite() { code(value) } else { 0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn maps_round_trip_through_npy_and_tiff() {
        let map = array![[933.0f32, f32::NAN, 900.5], [887.0, 888.0, 889.0]];
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.npy", "a.tiff", "b.TIF"] {
            let path = folder.path().join(name);
            std::fs::write(&path, Format::of(&path).unwrap().encode(map.view()).unwrap()).unwrap();
            let back = read(&path).unwrap();
            assert!(back.iter().zip(&map).all(|(a, b)| a.to_bits() == b.to_bits()), "{name}");
        }
        assert_eq!(Format::of(Path::new("a.png")), None);
    }

    fn stored(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        (folder, path)
    }

    #[test]
    fn pixels_of_gdals_nodata_are_holes() {
        for (text, value) in [("-9999", -9999.0), ("1e10\n", 1e10), ("-3.4028234663852886e+38", f32::MIN)] {
            let mut bytes = Cursor::new(Vec::new());
            let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
            let mut image = encoder.new_image::<Gray32Float>(3, 1).unwrap();
            image.encoder().write_tag(tiff::tags::Tag::Unknown(42113), text).unwrap();
            image.write_data(&[5.0, value, value]).unwrap();
            let (_folder, path) = stored("a.tif", bytes.get_ref());
            let (values, nodata) = read_with_nodata(&path).unwrap();
            assert_eq!((values[[0, 0]], values[[0, 1]].is_nan()), (5.0, true));
            assert_eq!(nodata, Some(NoData { value, pixels: 2 }), "{text}");
        }
    }

    #[test]
    fn values_that_gdal_scales_are_refused() {
        let item = |role: &str, value: &str| format!("<Item name=\"X\" role=\"{role}\">{value}</Item>");
        for (scale, offset, is_read) in [("1000", "0", false), ("1", "0.5", false), ("1", "0", true)] {
            let metadata = [item("offset", offset), item("scale", scale)].concat();
            let mut bytes = Cursor::new(Vec::new());
            let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
            let mut image = encoder.new_image::<Gray32Float>(1, 1).unwrap();
            image.encoder().write_tag(tiff::tags::Tag::Unknown(42112), metadata.as_str()).unwrap();
            image.write_data(&[0.9]).unwrap();
            let (_folder, path) = stored("a.tif", bytes.get_ref());
            let found = read(&path);
            assert_eq!(found.is_ok(), is_read, "{scale} {offset}: {found:?}");
            assert!(is_read || found.unwrap_err().to_string().contains("-unscale"));
        }
    }

    #[test]
    fn a_map_of_three_channels_is_refused() {
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
        encoder.write_image::<tiff::encoder::colortype::RGB32Float>(1, 1, &[1.0, 2.0, 900.0]).unwrap();
        let (_folder, path) = stored("xyz.tif", bytes.get_ref());
        assert!(matches!(read(&path), Err(MapError::Colours { .. })));
    }

    #[test]
    fn a_page_of_a_file_is_read_by_its_number() {
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
        for (value, nodata) in [(5.0, "0"), (0.0, "-1")] {
            let mut image = encoder.new_image::<Gray32Float>(1, 1).unwrap();
            image.encoder().write_tag(tiff::tags::Tag::Unknown(42113), nodata).unwrap();
            image.write_data(&[value]).unwrap();
        }
        let (_folder, path) = stored("two.tif", bytes.get_ref());
        let page = |number: usize| PathBuf::from(format!("{}#{number}", path.display()));
        assert_eq!((read(&page(1)).unwrap(), read(&page(2)).unwrap()), (array![[5.0]], array![[0.0]]));
        assert_eq!(read_mask(&page(1)).unwrap(), array![[true]]);
        assert_eq!(read_mask(&page(2)).unwrap(), array![[false]]);
        for (path, part) in [(page(3), "numbered from 1 to 2"), (path.clone(), "FILE#1")] {
            let error = read(&path).unwrap_err().to_string();
            assert!(error.contains(part) && error.contains("reads (.npy, float TIFF)"), "{error}");
            assert!(read_mask(&path).unwrap_err().to_string().contains(part));
        }
        let (_folder, path) = stored("a.npy", &npy::write(array![[5.0]].view()));
        let page = |number: usize| PathBuf::from(format!("{}#{number}", path.display()));
        assert!(read(&page(1)).is_ok() && read_mask(&page(1)).is_ok());
        for error in [read(&page(7)).unwrap_err(), read_mask(&page(7)).unwrap_err()] {
            assert!(error.to_string().contains("only TIFF files have pages"), "{error}");
        }
    }

    #[test]
    fn constant_values_far_from_all_others_are_found() {
        let mut map = Array2::from_shape_fn((8, 8), |(y, x)| 900.0 + (y + x) as f32);
        assert_eq!(far_from_others(map.view()), []);
        map[[0, 0]] = 1e10;
        assert_eq!(far_from_others(map.view()), [], "one pixel only");
        map[[0, 1]] = 1e10;
        map.row_mut(7).fill(-9999.0);
        let found = [NoData { value: 1e10, pixels: 2 }, NoData { value: -9999.0, pixels: 8 }];
        assert_eq!(far_from_others(map.view()), found);
        assert_eq!(far_from_others(array![[500.0, 500.0, 900.0, 900.0]].view()), [], "two planes");
        assert_eq!(far_from_others(array![[f32::NAN]].view()), []);
    }

    #[test]
    fn masks_of_signed_labels_and_arrays_are_read_and_alpha_is_refused() {
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
        encoder.write_image::<tiff::encoder::colortype::GrayI32>(3, 1, &[0, 7, -1]).unwrap();
        let (_folder, path) = stored("labels.tif", bytes.get_ref());
        assert_eq!(read_mask(&path).unwrap(), array![[false, true, true]]);
        let (_folder, path) = stored("a.npy", &npy::write(array![[0.0, f32::NAN, 0.2]].view()));
        assert_eq!(read_mask(&path).unwrap(), array![[false, false, true]]);
        let mut png = Cursor::new(Vec::new());
        let image = image::GrayAlphaImage::from_fn(2, 1, |x, _| image::LumaA([0, 255 * x as u8]));
        image.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let (_folder, path) = stored("alpha.png", png.get_ref());
        let error = read_mask(&path).unwrap_err().to_string();
        assert!(error.contains("only in alpha"), "{error}");
        // Ringing leaves small values around the mask.
        let mut jpeg = Cursor::new(Vec::new());
        let image = image::GrayImage::from_fn(16, 16, |x, _| image::Luma([255 * u8::from(x > 5)]));
        image.write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
        let (_folder, path) = stored("mask.jpg", jpeg.get_ref());
        let error = read_mask(&path).unwrap_err().to_string();
        assert!(error.contains("JPEG") && error.contains("PNG"), "{error}");
    }

    #[test]
    fn a_mask_that_is_set_everywhere_by_several_values_is_refused() {
        for ([left, right], accepted) in [([1, 2], false), ([0, 2], true), ([255, 255], true)] {
            let png = image_file::encode_png(array![[left, right]].view(), 8).unwrap();
            let (_folder, path) = stored("mask.png", &png);
            assert_eq!(read_mask(&path).is_ok(), accepted, "{left} {right}");
        }
    }

    #[test]
    fn codes_round_trip_to_depths() {
        let map = array![[933.0f32, f32::NAN], [887.0, 900.0]];
        let scale = scale(map.view());
        let codes = codes(map.view(), scale);
        assert_eq!((codes[[0, 1]], codes[[1, 0]], codes[[0, 0]]), (0, 1, 65_535));
        let back = scale.offset_mm + scale.scale_mm * f64::from(codes[[1, 1]]);
        assert!((back - 900.0).abs() <= scale.scale_mm, "{back}");
    }

    #[test]
    fn a_map_of_one_depth_and_a_map_of_none_have_codes() {
        let codes = |map: Array2<f32>| codes(map.view(), scale(map.view()));
        assert_eq!(codes(array![[5.0f32, 5.0]]), array![[1, 1]]);
        assert_eq!(codes(array![[f32::NAN]]), array![[0]]);
    }
}
