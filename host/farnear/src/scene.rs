//! Scenes by name or from a scene file with its maps. A scene file is TOML; paths in it are relative to its folder:
//! ```toml
//! depth = "bust.npy"      # depths in mm (.npy or float TIFF), stretched over the image; or: scene = "cone"
//! texture = "bricks.png"  # any picture that `farnear depth` reads; or: "sand" (also without the line), "fractal"
//! contrast = 0.3          # standard deviation of sand or fractal, whose mean is 1
//! ```

use std::{
    fs,
    path::{Path, PathBuf},
    str::FromStr,
    sync::Arc,
};

use anyhow::{Context, Result, bail};
use farnear_files::{image_file::read_grey, map};
use farnear_scene::{PackedScene, Scene, SceneError, SceneFile};

#[derive(Clone, Debug)]
pub enum SceneArgument {
    /// `cone`, `plane:900,contrast=0.3`, ...
    Named(Box<Scene>),
    File(PathBuf),
}

impl FromStr for SceneArgument {
    type Err = SceneError;

    /// A text that ends with `.toml` or exists is a file, any other a name.
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
    pub fn read(self) -> Result<Scene> {
        match self {
            Self::Named(scene) => Ok(*scene),
            Self::File(path) => {
                read(&path).and_then(|file| Ok(file.into_scene()?)).with_context(|| of(&path))
            }
        }
    }
}

/// Data of a scene file with its maps, checked; `None` if the emulated rig needs only the scene's name.
pub fn packed(scene: Option<&str>) -> Result<Option<Arc<[u8]>>> {
    let Some(SceneArgument::File(path)) = scene.map(str::parse).transpose()? else { return Ok(None) };
    let packed = || {
        let file = read(&path)?;
        let bytes = file.to_bytes()?;
        file.into_scene()?;
        anyhow::Ok(bytes.into())
    };
    packed().map(Some).with_context(|| of(&path))
}

fn of(path: &Path) -> String {
    format!("the scene {}", path.display())
}

fn read(path: &Path) -> Result<PackedScene> {
    let text = fs::read_to_string(path).context("cannot read it")?;
    let file = SceneFile::parse(&text)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let depth_mm = file.depth.as_ref().map(|name| map::read(&folder.join(name))).transpose()?;
    let texture = match &file.texture {
        Some(name) => {
            let picture = folder.join(name);
            if !picture.is_file() {
                bail!(
                    "texture = \"{name}\" is neither sand nor fractal, and not a file: {}",
                    picture.display()
                );
            }
            Some(read_grey(&picture)?.pixels)
        }
        None => None,
    };
    Ok(PackedScene { text, depth_mm, texture })
}
