//! A folder as a camera: whatever takes the pictures (a maker's program, `gphoto2 --capture-tethered`, a phone
//! that synchronises) puts an image file into it for each trigger.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant, SystemTime},
};

use farnear_files::image_file::decode_grey;
use farnear_protocol::{
    message::{ShotRecord, TriggerMode},
    units::Micros,
};

use super::{Camera, CameraError, Frame, Image, Stamp, pixels::of_picture};
use crate::describe::trigger_name;

const POLL: Duration = Duration::from_millis(20);
/// A file that does not change for this long and still is no image will not become one.
const QUIET: Duration = Duration::from_secs(2);
const ENDINGS: [&str; 7] = ["png", "tif", "tiff", "jpg", "jpeg", "pgm", "ppm"];

/// Images that appear in a folder, in the order in which they were written.
#[derive(Debug)]
pub struct FolderCamera {
    folder: PathBuf,
    used: BTreeSet<PathBuf>,
    /// The next image, while it may still be being written: its bytes, and since when they are the same.
    candidate: Option<(PathBuf, Vec<u8>, Instant)>,
}

impl FolderCamera {
    /// Watches a folder, which must exist.
    pub fn watch(folder: &Path) -> Result<Self, CameraError> {
        let mut camera = Self { folder: folder.into(), used: BTreeSet::new(), candidate: None };
        camera.forget_what_is_there()?;
        Ok(camera)
    }

    fn forget_what_is_there(&mut self) -> Result<(), CameraError> {
        let fresh = self.fresh()?;
        self.used.extend(fresh.into_iter().map(|(_, path)| path));
        Ok(())
    }

    /// Image files that were not used yet, oldest first; those written within the same tick of the file
    /// system's clock by name.
    fn fresh(&self) -> Result<Vec<(SystemTime, PathBuf)>, CameraError> {
        let failed = |source| CameraError::Folder { folder: self.folder.clone(), source };
        let mut fresh = Vec::new();
        for entry in fs::read_dir(&self.folder).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            let ending =
                path.extension().and_then(|ending| ending.to_str()).unwrap_or("").to_ascii_lowercase();
            if self.used.contains(&path) || !ENDINGS.contains(&ending.as_str()) {
                continue;
            }
            // A file that is renamed away in between is no image any more.
            if let Ok(written) = fs::metadata(&path).and_then(|data| data.modified()) {
                fresh.push((written, path));
            }
        }
        fresh.sort();
        Ok(fresh)
    }
}

impl FolderCamera {
    /// The next image; `None` when time is up.
    fn next(&mut self, wait: Duration) -> Result<Option<Image>, CameraError> {
        let until = Instant::now() + wait;
        loop {
            if let Some((_, path)) = self.fresh()?.into_iter().next() {
                let bytes = fs::read(&path).unwrap_or_default();
                match &self.candidate {
                    // The same bytes twice: it is no longer being written (half a JPEG would decode, too).
                    Some((same, content, since)) if *same == path && *content == bytes => {
                        match decode_grey(&bytes) {
                            Ok(picture) => {
                                self.used.insert(path.clone());
                                return of_picture(picture)
                                    .map(Some)
                                    .map_err(|reason| CameraError::File { path, reason });
                            }
                            Err(reason) if since.elapsed() > QUIET => {
                                return Err(CameraError::File { path, reason });
                            }
                            Err(_) => {}
                        }
                    }
                    _ => self.candidate = Some((path, bytes, Instant::now())),
                }
            }
            if Instant::now() >= until {
                return Ok(None);
            }
            std::thread::sleep(POLL);
        }
    }
}

impl Camera for FolderCamera {
    fn kind(&self) -> &'static str {
        "folder"
    }

    fn arm(&mut self, mode: TriggerMode, _: Micros) -> Result<(), CameraError> {
        // Of a camera that runs freely nobody could tell which file belongs to which exposure.
        if mode == TriggerMode::FreeRunning {
            return Err(CameraError::Trigger { camera: self.kind(), mode: trigger_name(mode) });
        }
        self.forget_what_is_there()
    }

    fn trigger(&mut self, _: u32, _: Micros) -> Result<(), CameraError> {
        Err(CameraError::Trigger { camera: self.kind(), mode: trigger_name(TriggerMode::Software) })
    }

    fn image(&mut self, shot: &ShotRecord, wait: Duration) -> Result<Image, CameraError> {
        self.next(wait)?.ok_or_else(|| CameraError::Late {
            camera: format!("folder {}", self.folder.display()),
            trigger_number: shot.trigger_number,
            waited: wait,
        })
    }

    fn watch(&mut self) -> Result<(), CameraError> {
        self.forget_what_is_there()
    }

    fn newest(&mut self, wait: Duration) -> Result<Option<Frame>, CameraError> {
        Ok(self.next(wait)?.map(|image| Frame { image, stamp: Stamp::default() }))
    }
}
