//! What maps are computed with, found once for all that need it alike.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use farnear_depth::{corrections::Correction, operators::Operators, optics::Optics, prepare::CameraFrames};

use crate::{
    camera_frames, correction_file,
    error::Result,
    kept::{Kept, Stamp},
    operators,
};

/// Kinds of operators and corrections that are kept; a lab has a handful. Each is some kilobytes.
const KINDS: usize = 16;
/// Cameras that are kept; their frames are as large as images.
const CAMERAS: usize = 4;

/// Operators, corrections and cameras' frames, kept from one map to the next; a file that is written anew is read anew.
pub struct Shared {
    operators: Kept<Asked, Operators>,
    corrections: Kept<Stamp, Correction>,
    cameras: Kept<Stamp, CameraFrames>,
}

/// What operators were asked for.
#[derive(PartialEq)]
struct Asked {
    name: Option<PathBuf>,
    file: Option<Stamp>,
    optics: Optics,
}

impl Default for Shared {
    fn default() -> Self {
        Self { operators: Kept::new(KINDS), corrections: Kept::new(KINDS), cameras: Kept::new(CAMERAS) }
    }
}

impl Shared {
    /// As [`operators::find`].
    pub(super) fn operators(&self, asked: Option<&Path>, optics: &Optics) -> Result<Arc<Operators>> {
        let file = asked.and_then(|path| Stamp::of(operators::KIND, path).ok());
        let key = Asked { name: asked.map(Path::to_path_buf), file, optics: *optics };
        self.operators.get(key, || operators::find(asked, optics))
    }

    /// As [`correction_file::read`].
    pub(super) fn correction(&self, file: &Path) -> Result<Arc<Correction>> {
        self.corrections.get(Stamp::of(correction_file::KIND, file)?, || correction_file::read(file))
    }

    /// As [`camera_frames::read`].
    pub(super) fn camera(&self, folder: &Path) -> Result<Arc<CameraFrames>> {
        match Stamp::of("the camera's frames", folder) {
            Ok(stamp) => self.cameras.get(stamp, || camera_frames::read(folder)),
            Err(_) => camera_frames::read(folder).map(Arc::new), // says what is wrong
        }
    }
}
