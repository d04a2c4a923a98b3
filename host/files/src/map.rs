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
    image_file::{self, ImageError},
    npy::{self, NpyError},
};

#[derive(Debug, thiserror::Error)]
pub enum MapError {
    #[error("cannot read {}: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{} is empty", path.display())]
    Empty { path: PathBuf },
    #[error("{} is not a map, a 2-D array of f32 or f64: {reason}", path.display())]
    Npy { path: PathBuf, reason: NpyError },
    #[error("{} is neither .npy nor TIFF: {reason}", path.display())]
    Format { path: PathBuf, reason: String },
    /// Integers have no known unit.
    #[error("{} holds {samples} integers, not mm; give the .npy or the float .tiff", path.display())]
    Integers { path: PathBuf, samples: image_file::Samples },
}

pub fn read(path: &Path) -> Result<Array2<f32>, MapError> {
    let bytes = std::fs::read(path).map_err(|source| MapError::Read { path: path.into(), source })?;
    if bytes.is_empty() {
        return Err(MapError::Empty { path: path.into() });
    }
    if bytes.starts_with(npy::MAGIC) {
        return npy::read(&bytes).map_err(|reason| MapError::Npy { path: path.into(), reason });
    }
    let image =
        image_file::decode_grey(&bytes).map_err(|reason| MapError::Format { path: path.into(), reason })?;
    if image.samples != image_file::Samples::Float {
        return Err(MapError::Integers { path: path.into(), samples: image.samples });
    }
    Ok(image.pixels)
}

pub fn read_mask(path: &Path) -> Result<Array2<bool>, ImageError> {
    Ok(image_file::read_grey(path)?.pixels.mapv(|value| value > 0.0))
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
