//! Scene files, whose maps are separate files:
//! ```toml
//! depth = "bust.npy"      # depths in mm; or: scene = "cone"
//! texture = "bricks.png"  # a picture; or: "sand", "fractal"
//! contrast = 0.3          # of a random texture
//! ```
//! This crate opens no files: the caller reads the named maps and passes arrays.

use ndarray::Array2;
use serde::Deserialize;

use crate::maps::{HeightMap, Picture};
use crate::scene::{Scene, Shape};
use crate::scene_error::SceneError;
use crate::texture::Texture;

/// A scene description with the names of its maps.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneFile {
    /// File of the depth map, relative to the scene file.
    pub depth: Option<String>,
    /// File of the picture, relative to the scene file.
    pub texture: Option<String>,
    scene: Option<Scene>,
    random: Option<Texture>,
    contrast: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    scene: Option<String>,
    depth: Option<String>,
    texture: Option<String>,
    contrast: Option<f64>,
}

impl SceneFile {
    /// Parses a scene file; errors have key and expectation.
    pub fn parse(text: &str) -> Result<Self, SceneError> {
        let raw: Raw =
            toml::from_str(text).map_err(|error| SceneError::Syntax(error.to_string().trim_end().into()))?;
        let scene = match (&raw.scene, &raw.depth) {
            (Some(scene), None) => Some(scene.parse()?),
            (None, Some(_)) => None,
            _ => {
                return Err(SceneError::Syntax(
                    "expected exactly one of depth = FILE and scene = NAME".into(),
                ));
            }
        };
        if let Some(contrast) = raw.contrast
            && !(0.0..=1.0).contains(&contrast)
        {
            let value = contrast.to_string();
            return Err(SceneError::Value { name: "contrast", value, expected: "0 to 1" });
        }
        let random = raw.texture.as_deref().and_then(|name| name.parse().ok());
        let texture = raw.texture.filter(|_| random.is_none());
        if let (Some(name), Some(_)) = (&texture, raw.contrast) {
            return Err(SceneError::Syntax(format!(
                "contrast applies to sand and fractal; the picture {name:?} has its own"
            )));
        }
        Ok(Self { depth: raw.depth, texture, scene, random, contrast: raw.contrast })
    }

    /// Combines the scene with its maps, depth in mm; fails for a missing, surplus or invalid map.
    pub fn into_scene(
        self,
        depth_mm: Option<Array2<f32>>,
        texture: Option<Array2<f32>>,
    ) -> Result<Scene, SceneError> {
        for (what, wanted, given) in [
            ("depth", self.depth.is_some(), depth_mm.is_some()),
            ("texture", self.texture.is_some(), texture.is_some()),
        ] {
            if wanted != given {
                let found = if given { "was given but not requested" } else { "is missing" };
                return Err(SceneError::Maps { what, found });
            }
        }
        let mut scene = match (self.scene, depth_mm) {
            (Some(scene), _) => scene,
            (None, Some(depth_mm)) => Scene::new(Shape::HeightMap(HeightMap::new(depth_mm)?)),
            (None, None) => return Err(SceneError::Maps { what: "depth", found: "is missing" }),
        };
        if let Some(random) = self.random {
            scene.texture = random;
        }
        if let Some(texture) = texture {
            scene.texture = Texture::Picture(Picture::new(texture)?);
        }
        scene.contrast = self.contrast.unwrap_or(scene.contrast);
        Ok(scene)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_file_names_its_maps() {
        let file = SceneFile::parse("depth = \"bust.npy\"\ntexture = \"bricks.png\"").unwrap();
        assert_eq!((file.depth.as_deref(), file.texture.as_deref()), (Some("bust.npy"), Some("bricks.png")));
        let (depth, texture) = (Array2::from_elem((2, 2), 900.0), Array2::ones((3, 3)));
        let scene = file.clone().into_scene(Some(depth), Some(texture)).unwrap();
        assert!(matches!((&scene.shape, &scene.texture), (Shape::HeightMap(_), Texture::Picture(_))));
        let error = file.into_scene(None, Some(Array2::ones((3, 3)))).unwrap_err();
        assert_eq!(error.to_string(), "scene file: depth map is missing");
    }

    #[test]
    fn a_named_scene_with_a_random_texture_needs_no_maps() {
        let file = SceneFile::parse("scene = \"cone\"\ntexture = \"fractal\"\ncontrast = 0.4").unwrap();
        assert_eq!((&file.depth, &file.texture), (&None, &None));
        assert_eq!(file.into_scene(None, None).unwrap().to_string(), "cone,texture=fractal,contrast=0.4");
    }

    #[test]
    fn mistakes_are_named() {
        for (text, expected) in [
            ("", "exactly one of"),
            ("scene = \"cone\"\ndepth = \"d.npy\"", "exactly one of"),
            ("scene = \"cube\"", "unknown scene \"cube\""),
            ("scene = \"cone\"\ncontrast = 3.0", "contrast = 3"),
            ("depht = \"d.npy\"", "unknown field `depht`"),
            ("scene = \"cone\"\ntexture = \"b.png\"\ncontrast = 0.3", "the picture \"b.png\" has its own"),
        ] {
            let error = SceneFile::parse(text).unwrap_err().to_string();
            assert!(error.contains(expected), "{error:?} should contain {expected:?}");
        }
    }
}
