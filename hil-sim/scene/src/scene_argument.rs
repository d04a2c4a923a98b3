//! Scenes by name or from a scene file with its maps.
//!
//! A scene file is TOML; files that it names lie relative to it:
//! ```toml
//! depth = "bust.npy"      # depths in mm (.npy or float TIFF), stretched over the image; or: scene = "cone"
//! texture = "bricks.png"  # any picture that `farnear depth` reads; or: "sand" (also without the line), "fractal"
//! contrast = 0.3          # standard deviation of sand or fractal, whose mean is 1
//! ```
//! Only with the feature `files`: the rest of this crate opens none.

use std::{
    fs,
    path::{Path, PathBuf},
    str::FromStr,
};

use farnear_files::{image_file::read_grey, map};
use thiserror::Error;

use crate::scene::Scene;
use crate::scene_error::SceneError;
use crate::scene_file::SceneFile;

/// A scene as an argument names it.
#[derive(Clone, Debug)]
pub enum SceneArgument {
    /// `cone`, `plane:900,contrast=0.3`, ...
    Named(Box<Scene>),
    /// A scene file.
    File(PathBuf),
}

/// Why a scene file was refused.
#[derive(Debug, Error)]
#[error("the scene {}: {reason}", path.display())]
pub struct SceneFileError {
    /// The scene file.
    pub path: PathBuf,
    /// Which file cannot be read, or what in it makes no scene.
    pub reason: String,
}

impl FromStr for SceneArgument {
    type Err = SceneError;

    /// What ends with `.toml` or exists is a file, everything else a name.
    fn from_str(text: &str) -> Result<Self, SceneError> {
        let path = Path::new(text);
        let ending = path.extension().unwrap_or_default();
        if ending.eq_ignore_ascii_case("toml") || path.is_file() {
            return Ok(Self::File(path.to_path_buf()));
        }
        Ok(Self::Named(Box::new(text.parse()?)))
    }
}

impl SceneArgument {
    /// The scene, with its maps.
    ///
    /// # Errors
    /// [`SceneFileError`].
    pub fn read(self) -> Result<Scene, SceneFileError> {
        match self {
            Self::Named(scene) => Ok(*scene),
            Self::File(path) => read(&path).map_err(|reason| SceneFileError { path, reason }),
        }
    }
}

fn read(path: &Path) -> Result<Scene, String> {
    let text = fs::read_to_string(path).map_err(|error| format!("cannot read it: {error}"))?;
    let file = SceneFile::parse(&text).map_err(|error| error.to_string())?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let depth_mm = file.depth.as_ref().map(|name| map::read(&folder.join(name)));
    let depth_mm = depth_mm.transpose().map_err(|error| error.to_string())?;
    let texture = match &file.texture {
        Some(name) => {
            let picture = folder.join(name);
            if !picture.is_file() {
                return Err(format!(
                    "texture = \"{name}\" is neither sand nor fractal, and there is no file {}",
                    picture.display()
                ));
            }
            Some(read_grey(&picture).map_err(|error| error.to_string())?.pixels)
        }
        None => None,
    };
    file.into_scene(depth_mm, texture).map_err(|error| error.to_string())
}
