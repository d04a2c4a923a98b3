//! Quota of uploaded files, which simultaneous uploads share.

use std::{
    fs, io,
    path::{Path, PathBuf},
    sync::{Arc, Mutex},
};

use crate::app::lock;

/// Ending of an unfinished upload's name, which begins with a dot.
pub const PART: &str = ".part";

#[derive(Default)]
pub struct UploadQuota(Mutex<Used>);

#[derive(Default)]
struct Used {
    /// Of the folder's files, and received by running uploads.
    bytes: u64,
    uploads: usize,
}

/// A running upload. Dropping it before [`Self::finish`] frees its bytes.
pub struct Upload {
    quota: Arc<UploadQuota>,
    target: PathBuf,
    quota_bytes: u64,
    bytes_max: u64,
    bytes: u64,
}

impl Upload {
    /// Reads the folder's size, unless running uploads keep it up to date. `quota_bytes` is the limit of the folder,
    /// `bytes_max` that of one file.
    pub fn begin(quota: Arc<UploadQuota>, target: PathBuf, quota_bytes: u64, bytes_max: u64) -> Self {
        let mut used = lock(&quota.0);
        if used.uploads == 0 {
            used.bytes = target.parent().map_or(0, size_without_parts);
        }
        used.uploads += 1;
        drop(used);
        Self { quota, target, quota_bytes, bytes_max, bytes: 0 }
    }

    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Counts received bytes. The error is the largest size that this upload may have.
    pub fn add(&mut self, bytes: u64) -> Result<(), u64> {
        let mut used = lock(&self.quota.0);
        // The target is replaced, so its space is free.
        let others = used.bytes.saturating_sub(self.bytes + size_of(&self.target));
        let left = self.quota_bytes.saturating_sub(others).min(self.bytes_max);
        if self.bytes + bytes > left {
            return Err(left);
        }
        self.bytes += bytes;
        used.bytes += bytes;
        Ok(())
    }

    /// Counts the target instead of the file that `publish` replaces by it.
    pub fn finish(mut self, publish: impl FnOnce(&Path) -> io::Result<()>) -> io::Result<()> {
        let mut used = lock(&self.quota.0);
        let replaced = size_of(&self.target);
        publish(&self.target)?;
        used.bytes = used.bytes.saturating_sub(replaced);
        drop(used);
        self.bytes = 0;
        Ok(())
    }
}

impl Drop for Upload {
    fn drop(&mut self) {
        let mut used = lock(&self.quota.0);
        used.bytes = used.bytes.saturating_sub(self.bytes);
        used.uploads -= 1;
    }
}

/// Size of the folder's regular files. Removes parts, which a killed program has left: no upload is running.
fn size_without_parts(folder: &Path) -> u64 {
    let mut bytes = 0;
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let Some(file) = entry.metadata().ok().filter(fs::Metadata::is_file) else { continue };
        if name.starts_with('.') && name.ends_with(PART) && fs::remove_file(entry.path()).is_ok() {
            continue;
        }
        bytes += file.len();
    }
    bytes
}

fn size_of(path: &Path) -> u64 {
    fs::symlink_metadata(path).ok().filter(fs::Metadata::is_file).map_or(0, |file| file.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn begin(quota: &Arc<UploadQuota>, folder: &Path, name: &str) -> Upload {
        Upload::begin(Arc::clone(quota), folder.join(name), 100, 80)
    }

    fn publish(bytes: usize) -> impl FnOnce(&Path) -> io::Result<()> {
        move |target: &Path| fs::write(target, vec![0; bytes])
    }

    #[test]
    fn simultaneous_uploads_share_the_quota() {
        let folder = tempfile::tempdir().unwrap();
        let (folder, quota) = (folder.path(), Arc::default());
        fs::write(folder.join("before"), [0; 10]).unwrap();
        let (mut a, mut b) = (begin(&quota, folder, "a"), begin(&quota, folder, "b"));
        assert_eq!((a.add(60), b.add(31), b.add(30), a.add(1)), (Ok(()), Err(30), Ok(()), Err(60)));
        drop(b);
        assert_eq!((a.add(20), a.add(1)), (Ok(()), Err(80)), "largest size of a file");
        a.finish(publish(80)).unwrap();
        let mut c = begin(&quota, folder, "c");
        assert_eq!((c.add(11), c.add(10)), (Err(10), Ok(())));
    }

    #[test]
    fn a_replaced_file_gives_its_space_to_one_upload() {
        let folder = tempfile::tempdir().unwrap();
        let (folder, quota) = (folder.path(), Arc::default());
        fs::write(folder.join("a"), [0; 70]).unwrap();
        let (mut first, mut second) = (begin(&quota, folder, "a"), begin(&quota, folder, "a"));
        assert_eq!((first.add(60), second.add(41), second.add(40)), (Ok(()), Err(40), Ok(())));
        first.finish(publish(60)).unwrap();
        assert_eq!((second.add(41), second.add(40)), (Err(80), Ok(())), "the first's 60 bytes are replaced");
        second.finish(publish(80)).unwrap();
        let mut other = begin(&quota, folder, "b");
        assert_eq!((other.add(21), other.add(20)), (Err(20), Ok(())));
    }

    #[test]
    fn parts_of_a_killed_program_are_removed_and_running_ones_stay() {
        let folder = tempfile::tempdir().unwrap();
        let (folder, quota) = (folder.path(), Arc::default());
        fs::write(folder.join(".a.y4m.x1.part"), [0; 90]).unwrap();
        fs::write(folder.join("named.part"), [0; 30]).unwrap();
        let mut a = begin(&quota, folder, "a");
        assert_eq!((a.add(71), a.add(70)), (Err(70), Ok(())));
        fs::write(folder.join(".a.x2.part"), [0; 70]).unwrap();
        let _b = begin(&quota, folder, "b");
        assert!(folder.join(".a.x2.part").exists() && folder.join("named.part").exists());
        assert!(!folder.join(".a.y4m.x1.part").exists());
    }
}
