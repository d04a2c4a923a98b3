//! Values shared by jobs: operators, corrections, calibration frames, models. Drops the least recently used.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
    time::SystemTime,
};

use farnear_depth::{corrections::Correction, operators::Operators, optics::Optics, prepare::CameraFrames};

use crate::{
    activity::recognition::{MODEL_FILE, Model},
    camera_frames, correction_file,
    error::{Result, WorkflowError},
    operators,
};

/// Operators and corrections: some kilobytes each.
const SMALL_VALUES: usize = 16;
/// Cameras with maps as large as images.
const CAMERAS: usize = 4;
const MODELS: usize = 2;

/// Shared by the tasks of one [`Context`](crate::Context) and its clones. Changed files are read again.
pub struct Cache {
    operators: LeastRecentlyUsed<OperatorKey, Operators>,
    corrections: LeastRecentlyUsed<FileVersion, Correction>,
    cameras: LeastRecentlyUsed<FileVersion, CameraFrames>,
    models: LeastRecentlyUsed<(PathBuf, Option<FileVersion>), Model>,
}

#[derive(PartialEq)]
struct OperatorKey {
    name: Option<PathBuf>,
    file: Option<FileVersion>,
    optics: Optics,
}

impl Default for Cache {
    fn default() -> Self {
        Self {
            operators: LeastRecentlyUsed::new(SMALL_VALUES),
            corrections: LeastRecentlyUsed::new(SMALL_VALUES),
            cameras: LeastRecentlyUsed::new(CAMERAS),
            models: LeastRecentlyUsed::new(MODELS),
        }
    }
}

impl Cache {
    pub(crate) fn operators(&self, name: Option<&Path>, optics: &Optics) -> Result<Arc<Operators>> {
        let file = name.and_then(|path| FileVersion::of(operators::KIND, path).ok());
        let key = OperatorKey { name: name.map(Path::to_path_buf), file, optics: *optics };
        self.operators.get(key, || operators::find(name, optics))
    }

    pub(crate) fn correction(&self, file: &Path) -> Result<Arc<Correction>> {
        self.corrections.get(FileVersion::of(correction_file::KIND, file)?, || correction_file::read(file))
    }

    pub(crate) fn camera(&self, folder: &Path) -> Result<Arc<CameraFrames>> {
        match FileVersion::of("the camera's frames", folder) {
            Ok(version) => self.cameras.get(version, || camera_frames::read(folder)),
            Err(_) => camera_frames::read(folder).map(Arc::new), // its error is more precise
        }
    }

    pub(crate) fn model(&self, path: &Path) -> Result<Arc<Model>> {
        let version = Model::file(path).map(|path| FileVersion::of(MODEL_FILE, path)).transpose()?;
        self.models.get((path.into(), version), || Model::read(path))
    }
}

/// Ordered by last use, the latest at the end.
pub(crate) struct LeastRecentlyUsed<K, V> {
    entries: Mutex<Vec<(K, Arc<V>)>>,
    most: usize,
}

impl<K: PartialEq, V> LeastRecentlyUsed<K, V> {
    pub fn new(most: usize) -> Self {
        Self { entries: Mutex::new(Vec::with_capacity(most)), most }
    }

    /// The value of `key`, made if absent. Two threads may make it simultaneously.
    pub fn get(&self, key: K, make: impl FnOnce() -> Result<V>) -> Result<Arc<V>> {
        if let Some(found) = self.find(&key) {
            return Ok(found);
        }
        let made = Arc::new(make()?);
        let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        if entries.len() >= self.most {
            entries.remove(0);
        }
        entries.push((key, Arc::clone(&made)));
        Ok(made)
    }

    fn find(&self, key: &K) -> Option<Arc<V>> {
        let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        let place = entries.iter().position(|(known, _)| known == key)?;
        let entry = entries.remove(place);
        let value = Arc::clone(&entry.1);
        entries.push(entry);
        Some(value)
    }
}

/// Identifies a version of a file by length and modification time.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct FileVersion {
    path: PathBuf,
    bytes: u64,
    modified: Option<SystemTime>,
}

impl FileVersion {
    pub fn of(what: &'static str, path: &Path) -> Result<Self> {
        let found = fs::metadata(path).map_err(WorkflowError::read(what, path))?;
        Ok(Self { path: path.into(), bytes: found.len(), modified: found.modified().ok() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_made_once_and_the_least_recently_used_is_dropped() {
        let cache = LeastRecentlyUsed::new(2);
        let made = Mutex::new(Vec::new());
        let get = |key: u32| {
            cache
                .get(key, || {
                    made.lock().unwrap_or_else(PoisonError::into_inner).push(key);
                    Ok(key * 10)
                })
                .map(|value| *value)
                .expect("nothing fails")
        };
        for key in [1, 2, 1, 3, 1, 2] {
            assert_eq!(get(key), key * 10);
        }
        assert_eq!(*made.lock().unwrap_or_else(PoisonError::into_inner), [1, 2, 3, 2]);
    }

    #[test]
    fn failures_are_not_stored() {
        let cache: LeastRecentlyUsed<u32, u32> = LeastRecentlyUsed::new(2);
        assert!(cache.get(1, || Err(WorkflowError::parameter("a", 1, "no"))).is_err());
        assert_eq!(cache.get(1, || Ok(7)).map(|value| *value).expect("made again"), 7);
    }
}
