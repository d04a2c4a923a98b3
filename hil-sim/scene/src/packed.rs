//! A scene with its maps as bytes, for programs that open no map files (`farnear-sim run --scene -`).
//! Little-endian: `FNSCENE1`, length of the scene text in bytes (u32), the text, then depth map (mm) and
//! texture, each as height and width (u32) and values (f32) by rows; 0 x 0 means none. Reads no later bytes.

use std::io::{self, Read};

use ndarray::Array2;
use thiserror::Error;

use crate::{scene::Scene, scene_error::SceneError, scene_file::SceneFile};

const MAGIC: [u8; 8] = *b"FNSCENE1";
const LONGEST_TEXT: usize = 1 << 16;
/// Largest map: 100 million values are 400 MB.
const MOST_VALUES: u64 = 100_000_000;

/// Scene text with its maps.
#[derive(Debug, Clone, PartialEq)]
pub struct PackedScene {
    /// Text of the scene file.
    pub text: String,
    /// Depths in mm, rows from the top.
    pub depth_mm: Option<Array2<f32>>,
    /// Radiances in any unit, rows from the top.
    pub texture: Option<Array2<f32>>,
}

/// Why packed bytes were rejected.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum PackedSceneError {
    #[error("a packed scene cannot be read: {0}")]
    Read(#[from] io::Error),
    #[error("a packed scene begins with {MAGIC:?}, found {found:?}")]
    Magic { found: [u8; 8] },
    #[error("a packed scene's {what} has {found}, expected at most {most}")]
    Size { what: &'static str, found: u64, most: u64 },
    #[error(transparent)]
    Scene(#[from] SceneError),
}

impl PackedScene {
    /// Serialises the scene; fails for maps that are too large.
    pub fn to_bytes(&self) -> Result<Vec<u8>, PackedSceneError> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(bounded("text", self.text.len() as u64, LONGEST_TEXT as u64)?.to_le_bytes());
        bytes.extend(self.text.as_bytes());
        for map in [&self.depth_mm, &self.texture] {
            let (height, width) = map.as_ref().map_or((0, 0), Array2::dim);
            bounded("map", height as u64 * width as u64, MOST_VALUES)?;
            bytes.extend((height as u32).to_le_bytes());
            bytes.extend((width as u32).to_le_bytes());
            bytes.extend(map.iter().flatten().flat_map(|value| value.to_le_bytes()));
        }
        Ok(bytes)
    }

    /// Reads exactly one scene from `source`.
    pub fn read(source: &mut impl Read) -> Result<Self, PackedSceneError> {
        let mut found = [0; 8];
        source.read_exact(&mut found)?;
        if found != MAGIC {
            return Err(PackedSceneError::Magic { found });
        }
        let length = bounded("text", number(source)?.into(), LONGEST_TEXT as u64)?;
        let mut text = vec![0; length as usize];
        source.read_exact(&mut text)?;
        let text = String::from_utf8(text).map_err(|error| SceneError::Syntax(error.to_string()))?;
        Ok(Self { text, depth_mm: map(source)?, texture: map(source)? })
    }

    /// Parses text and maps.
    pub fn into_scene(self) -> Result<Scene, PackedSceneError> {
        Ok(SceneFile::parse(&self.text)?.into_scene(self.depth_mm, self.texture)?)
    }
}

fn bounded(what: &'static str, found: u64, most: u64) -> Result<u32, PackedSceneError> {
    if found > most {
        return Err(PackedSceneError::Size { what, found, most });
    }
    Ok(found as u32) // every bound is below 2^32
}

fn number(source: &mut impl Read) -> io::Result<u32> {
    let mut bytes = [0; 4];
    source.read_exact(&mut bytes)?;
    Ok(u32::from_le_bytes(bytes))
}

fn map(source: &mut impl Read) -> Result<Option<Array2<f32>>, PackedSceneError> {
    let (height, width) = (number(source)?, number(source)?);
    let values = bounded("map", u64::from(height) * u64::from(width), MOST_VALUES)?;
    if values == 0 {
        return Ok(None);
    }
    // Grows with the data, so that a wrong size allocates nothing.
    let mut bytes = Vec::new();
    let all = u64::from(values) * 4;
    if source.take(all).read_to_end(&mut bytes)? as u64 != all {
        return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
    }
    let value = |bytes: &[u8]| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    let values = bytes.chunks_exact(4).map(value).collect();
    let shaped = Array2::from_shape_vec((height as usize, width as usize), values);
    Ok(Some(shaped.map_err(io::Error::other)?))
}

#[cfg(test)]
mod tests {
    use proptest::{collection::vec, prelude::*};

    use super::*;

    fn bust() -> PackedScene {
        PackedScene {
            text: "depth = \"bust.npy\"\ntexture = \"bricks.png\"".into(),
            depth_mm: Some(Array2::from_shape_fn((2, 3), |(y, x)| 900.0 + y as f32 + 0.1 * x as f32)),
            texture: Some(Array2::from_elem((1, 2), 7.0)),
        }
    }

    #[test]
    fn reads_a_packed_scene_and_leaves_later_bytes() {
        let bytes = [bust().to_bytes().unwrap(), b"the rest".to_vec()].concat();
        let mut source = bytes.as_slice();
        let read = PackedScene::read(&mut source).unwrap();
        assert_eq!((&read, source), (&bust(), b"the rest".as_slice()));
        let whole = bust();
        let file = SceneFile::parse(&whole.text).unwrap();
        assert_eq!(read.into_scene().unwrap(), file.into_scene(whole.depth_mm, whole.texture).unwrap());
    }

    #[test]
    fn packs_a_scene_without_maps() {
        let cone = PackedScene { text: "scene = \"cone\"".into(), depth_mm: None, texture: None };
        let bytes = cone.to_bytes().unwrap();
        assert_eq!(PackedScene::read(&mut bytes.as_slice()).unwrap(), cone);
    }

    #[test]
    fn rejects_invalid_bytes_with_a_reason() {
        let good = bust().to_bytes().unwrap();
        let mut other = good.clone();
        other[7] = b'2';
        let mut long = good.clone();
        long[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
        let mut wide = good.clone();
        let maps = 12 + bust().text.len();
        wide[maps..maps + 8].fill(0xff);
        for (bytes, expected) in [
            (&good[..good.len() - 1], "cannot be read"),
            (&other, "a packed scene begins with"),
            (&long, "text has 4294967295, expected at most 65536"),
            (&wide, "map has 18446744065119617025, expected at most 100000000"),
        ] {
            let error = PackedScene::read(&mut &bytes[..]).unwrap_err().to_string();
            assert!(error.contains(expected), "{error:?} should contain {expected:?}");
        }
    }

    fn read_text(bytes: &[u8]) -> String {
        let length = u32::from_le_bytes(bytes[8..12].try_into().unwrap()) as usize;
        String::from_utf8(bytes[12..12 + length].to_vec()).unwrap()
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_scene_or_an_error(
            length in 0_u32..8, text in "[a-z]{4}", sizes in vec(0_u32..4, 4), tail in vec(any::<u8>(), 0..200)
        ) {
            // Small lengths; otherwise most inputs would end early.
            let sizes = sizes.iter().flat_map(|size| size.to_le_bytes()).collect::<Vec<u8>>();
            let bytes = [&MAGIC[..], &length.to_le_bytes(), text.as_bytes(), &sizes, &tail].concat();
            if let Ok(read) = PackedScene::read(&mut bytes.as_slice()) {
                // A map of 0 x 3 is invalid; bytes are compared because of NaN.
                let once = read.to_bytes().unwrap();
                let twice = PackedScene::read(&mut once.as_slice()).unwrap().to_bytes().unwrap();
                prop_assert_eq!((once, read.text), (twice, read_text(&bytes)));
            }
        }
    }
}
