//! What several jobs need alike, made once: a bounded number of values, of which the least recently used goes.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
    time::SystemTime,
};

use crate::error::{Result, WorkflowError};

/// Values by their keys, the last used at the end.
pub(crate) struct Kept<K, V> {
    entries: Mutex<Vec<(K, Arc<V>)>>,
    most: usize,
}

impl<K: PartialEq, V> Kept<K, V> {
    /// At most so many values.
    pub fn new(most: usize) -> Self {
        Self { entries: Mutex::new(Vec::with_capacity(most)), most }
    }

    /// The value of `key`, made where it is not there. Two threads may make one at the same time; one of them stays.
    ///
    /// # Errors
    /// Those of `make`; nothing is kept then.
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

/// A file as it lies there now: another one as soon as it is written anew.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Stamp {
    path: PathBuf,
    bytes: u64,
    modified: Option<SystemTime>,
}

impl Stamp {
    /// # Errors
    /// [`WorkflowError::Read`] where there is no such file.
    pub fn of(what: &'static str, path: &Path) -> Result<Self> {
        let found = fs::metadata(path).map_err(WorkflowError::read(what, path))?;
        Ok(Self { path: path.into(), bytes: found.len(), modified: found.modified().ok() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_made_once_and_the_least_used_goes() {
        let kept = Kept::new(2);
        let made = Mutex::new(Vec::new());
        let get = |key: u32| {
            kept.get(key, || {
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
    fn what_cannot_be_made_is_not_kept() {
        let kept: Kept<u32, u32> = Kept::new(2);
        assert!(kept.get(1, || Err(WorkflowError::parameter("a", 1, "no"))).is_err());
        assert_eq!(kept.get(1, || Ok(7)).map(|value| *value).expect("made anew"), 7);
    }
}
