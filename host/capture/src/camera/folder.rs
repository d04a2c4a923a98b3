//! A folder as a camera: a vendor program, `gphoto2 --capture-tethered` or a phone stores one image file per trigger.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant, SystemTime},
};

use farnear_files::{
    image_file::{decode_grey, exposure_time},
    video::pictures,
};
use farnear_protocol::{
    message::{ShotRecord, TriggerMode},
    units::Micros,
};

use super::{
    Camera, CameraError, Frame, Image, Stamp,
    pairing::{self, Belongs, Evidence, Pairing, by_number, content},
    pixels::of_picture,
};
use crate::describe::trigger_name;

const POLL: Duration = Duration::from_millis(20);
/// A non-image file is invalid after this time without a change.
const QUIET: Duration = Duration::from_secs(2);

/// Uses new image files in order of writing.
#[derive(Debug)]
pub struct FolderCamera {
    folder: PathBuf,
    used: BTreeMap<PathBuf, Used>,
    /// Other files and folders at arming.
    others: Vec<PathBuf>,
    /// The next file, possibly incomplete: contents and the time of the last change.
    candidate: Option<(PathBuf, Vec<u8>, Instant)>,
    pairing: Pairing,
}

#[derive(Clone, Debug)]
struct Used {
    written: SystemTime,
    bytes: u64,
    /// Hash of the file if it was paired since arming, rather than present before.
    paired: Option<u64>,
}

impl FolderCamera {
    pub fn watch(folder: &Path) -> Result<Self, CameraError> {
        let mut camera = Self {
            folder: folder.into(),
            used: BTreeMap::new(),
            others: Vec::new(),
            candidate: None,
            pairing: Pairing::default(),
        };
        camera.forget_what_is_there()?;
        Ok(camera)
    }

    fn forget_what_is_there(&mut self) -> Result<(), CameraError> {
        self.used.clear();
        self.candidate = None;
        for (written, path, bytes) in self.pictures()? {
            self.used.insert(path, Used { written, bytes, paired: None });
        }
        self.others = self.files()?.into_iter().filter(|path| !is_picture(path)).collect();
        Ok(())
    }

    fn files(&self) -> Result<Vec<PathBuf>, CameraError> {
        let failed = |source| CameraError::Folder { folder: self.folder.clone(), source };
        let mut files = Vec::new();
        for entry in fs::read_dir(&self.folder).map_err(failed)? {
            files.push(entry.map_err(failed)?.path());
        }
        files.retain(|path| !pictures::hidden(path));
        Ok(files)
    }

    fn pictures(&self) -> Result<Vec<(SystemTime, PathBuf, u64)>, CameraError> {
        let mut pictures = Vec::new();
        for path in self.files()?.into_iter().filter(|path| is_picture(path)) {
            // A file renamed meanwhile is no longer an image.
            let Ok(data) = fs::metadata(&path) else { continue };
            if let Ok(written) = data.modified() {
                pictures.push((written, path, data.len()));
            }
        }
        Ok(pictures)
    }

    /// New images, oldest first, then by number or name. Returns [`CameraError::Overwritten`] for a rewritten file,
    /// [`CameraError::File`] for one picture in two formats.
    fn fresh(&mut self) -> Result<Vec<(SystemTime, PathBuf)>, CameraError> {
        let mut fresh = Vec::new();
        for (written, path, bytes) in self.pictures()? {
            match self.used.get_mut(&path) {
                None => fresh.push((written, path)),
                Some(used) if (used.written, used.bytes) == (written, bytes) => {}
                Some(used) => match (used.paired, fs::read(&path).ok().map(|bytes| hash_of(&bytes))) {
                    // Another program holds it, or it was being written when the camera was armed.
                    (Some(_), None) => {}
                    (None, _) if !was_complete(used, written) => {}
                    // Some programs set the time of a complete file.
                    (Some(before), Some(now)) if before == now => {
                        used.written = written;
                        self.pairing.retimed(&path, written);
                    }
                    _ => return Err(CameraError::Overwritten { path }),
                },
            }
        }
        for (at, (_, path)) in fresh.iter().enumerate() {
            let paired = self.used.iter().filter(|(_, used)| used.paired.is_some()).map(|(path, _)| path);
            let mut others = fresh[..at].iter().map(|(_, other)| other).chain(paired);
            if let Some(twin) = others.find(|other| other.with_extension("") == path.with_extension("")) {
                let twin = twin.file_name().unwrap_or_default().display();
                let reason = format!(
                    "{twin} is the same picture in another format; let the camera write one format only"
                );
                return Err(CameraError::File { path: path.clone(), reason });
            }
        }
        fresh.sort_by(|(written, path), (other_written, other)| {
            let by_name = || by_number(path, other).unwrap_or_else(|| path.cmp(other));
            written.cmp(other_written).then_with(by_name)
        });
        Ok(fresh)
    }

    /// The next image with its times and file; `None` at the timeout.
    fn next(&mut self, wait: Duration) -> Result<Option<(Image, Evidence)>, CameraError> {
        let until = Instant::now() + wait;
        loop {
            if let Some((written, path)) = self.fresh()?.into_iter().next() {
                let bytes = fs::read(&path).unwrap_or_default();
                match &self.candidate {
                    // Equal bytes twice: the file is complete.
                    Some((same, read, since)) if *same == path && *read == bytes => {
                        match complete(&bytes).and_then(|()| decode_grey(&bytes)) {
                            Ok(picture) => {
                                let paired = Some(hash_of(&bytes));
                                let used = Used { written, bytes: bytes.len() as u64, paired };
                                self.used.insert(path.clone(), used);
                                let failed = |reason| CameraError::File { path: path.clone(), reason };
                                let image = of_picture(picture).map_err(failed)?;
                                let evidence = Evidence {
                                    taken: Some((written, path)),
                                    exposed: exposure_time(&bytes),
                                    content: content(&image),
                                    ..Evidence::default()
                                };
                                return Ok(Some((image, evidence)));
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
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            std::thread::sleep(POLL.min(left));
        }
    }
}

fn is_picture(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or("").to_ascii_lowercase();
    pictures::EXTENSIONS.contains(&ending.as_str())
}

fn hash_of(bytes: &[u8]) -> u64 {
    pairing::hash(bytes.iter().map(|byte| u64::from(*byte)))
}

/// Whether the file had been complete before it was rewritten.
fn was_complete(used: &Used, written: SystemTime) -> bool {
    written.duration_since(used.written).is_ok_and(|apart| apart > QUIET)
}

/// Rejects a truncated JPEG: decoders fill missing rows.
fn complete(bytes: &[u8]) -> Result<(), String> {
    let last = |marker: u8| bytes.windows(2).rposition(|pair| pair == [0xff, marker]);
    // An embedded thumbnail has its own end marker before the main scan.
    match (bytes.starts_with(&[0xff, 0xd8]), last(0xda), last(0xd9)) {
        (false, ..) => Ok(()),
        (true, Some(scan), Some(end)) if end > scan => Ok(()),
        _ => Err("the file is incomplete: the end of the JPEG is missing".into()),
    }
}

impl Camera for FolderCamera {
    fn kind(&self) -> &'static str {
        "folder"
    }

    fn arm(&mut self, mode: TriggerMode, _: Micros) -> Result<(), CameraError> {
        // Files of a free-running camera cannot be assigned to exposures, and a folder takes no software trigger.
        if mode != TriggerMode::Hardware {
            return Err(CameraError::Trigger { camera: self.kind(), mode: trigger_name(mode) });
        }
        self.pairing.begin();
        self.forget_what_is_there()
    }

    fn trigger(&mut self, _: u32, _: Micros) -> Result<(), CameraError> {
        Err(CameraError::Trigger { camera: self.kind(), mode: trigger_name(TriggerMode::Software) })
    }

    fn image(&mut self, shot: &ShotRecord, wait: Duration) -> Result<Image, CameraError> {
        let camera = format!("folder {}", self.folder.display());
        let Some((image, evidence)) = self.next(wait)? else {
            let is_new = |path: &PathBuf| !is_picture(path) && !self.others.contains(path);
            let camera = match self.files()?.into_iter().find(is_new) {
                Some(other) => {
                    let name = other.file_name().unwrap_or_default().display();
                    format!(
                        "{camera}, where {name} came; expected a file of {}",
                        pictures::EXTENSIONS.join(", ")
                    )
                }
                None => camera,
            };
            return Err(CameraError::Late { camera, trigger_number: shot.trigger_number, waited: wait });
        };
        match self.pairing.judge(&camera, evidence, shot)? {
            Belongs::Here => Ok(image),
            Belongs::Earlier | Belongs::Later(_) => Err(CameraError::Surplus { camera }),
        }
    }

    fn reported(&mut self, shot: &ShotRecord, received: Instant) {
        self.pairing.reported(shot, received);
    }

    fn quiet_time(&self) -> Duration {
        self.pairing.quiet_time()
    }

    fn finish(&mut self, wait: Duration) -> Result<(), CameraError> {
        std::thread::sleep(wait);
        match self.fresh()?.into_iter().next() {
            Some((_, path)) => Err(CameraError::Surplus { camera: path.display().to_string() }),
            None => Ok(()),
        }
    }

    fn watch(&mut self) -> Result<(), CameraError> {
        self.forget_what_is_there()
    }

    fn newest(&mut self, wait: Duration) -> Result<Option<Frame>, CameraError> {
        Ok(self.next(wait)?.map(|(image, ..)| Frame { image, stamp: Stamp::default() }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_macos_writes_next_to_a_picture_is_not_one() {
        let folder = tempfile::tempdir().unwrap();
        let mut camera = FolderCamera::watch(folder.path()).unwrap();
        for name in ["._1.jpg", ".part.jpg", "1.jpg"] {
            fs::write(folder.path().join(name), name).unwrap();
        }
        let found: Vec<PathBuf> = camera.fresh().unwrap().into_iter().map(|(_, path)| path).collect();
        assert_eq!(found, [folder.path().join("1.jpg")]);
    }
}
