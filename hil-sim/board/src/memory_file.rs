//! File with the bytes of the FRAM, kept between runs.

use std::{
    fs,
    io::ErrorKind,
    path::{Path, PathBuf},
};

use rigless::chip::fram::SIZE;

use crate::error::SimError;

fn failed(what: &str, path: &Path) -> impl FnOnce(std::io::Error) -> SimError {
    let what = format!("cannot {what} the memory's file {}", path.display());
    move |source| SimError::Io { what, source }
}

/// Contents at the end of the last run; `None` without a file.
pub fn read(path: &Path) -> Result<Option<Box<[u8; SIZE]>>, SimError> {
    let unlike = |length| SimError::Memory { path: path.into(), length, expected: SIZE };
    match fs::metadata(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        // A device, which may have no end, has the length 0.
        Ok(found) if !found.is_dir() && found.len() != SIZE as u64 => {
            return Err(unlike(usize::try_from(found.len()).unwrap_or(usize::MAX)));
        }
        _ => {}
    }
    let bytes = fs::read(path).map_err(failed("read", path))?;
    let length = bytes.len();
    bytes.into_boxed_slice().try_into().map(Some).map_err(|_| unlike(length))
}

fn aside(path: &Path) -> PathBuf {
    path.with_added_extension(format!("partial-{}", std::process::id()))
}

/// Fails if the file could not be written at the end of the run.
fn check_writable(path: &Path) -> Result<(), SimError> {
    let aside = aside(path);
    fs::write(&aside, []).and_then(|()| fs::remove_file(&aside)).map_err(failed("write", path))
}

/// The file of a run with its contents at the start.
#[derive(Debug)]
pub struct Kept {
    path: PathBuf,
    before: Option<Box<[u8; SIZE]>>,
}

impl Kept {
    pub fn read(path: &Path) -> Result<Self, SimError> {
        let before = read(path)?;
        check_writable(path)?;
        Ok(Self { path: path.into(), before })
    }

    pub fn before(&self) -> Option<&[u8; SIZE]> {
        self.before.as_deref()
    }

    /// Writes changed contents. Fails if the file has changed, too: another rig's records would be lost.
    pub fn write(&self, contents: &[u8]) -> Result<(), SimError> {
        if self.before().is_some_and(|before| before == contents) {
            return Ok(());
        }
        if read(&self.path)?.as_deref() != self.before() {
            return Err(SimError::MemoryChanged { path: self.path.clone() });
        }
        write(&self.path, contents)
    }
}

fn write(path: &Path, contents: &[u8]) -> Result<(), SimError> {
    let aside = aside(path);
    let written = fs::write(&aside, contents).and_then(|()| fs::rename(&aside, path));
    written.map_err(|error| {
        let _ = fs::remove_file(&aside);
        failed("write", path)(error)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_the_contents_and_refuses_a_file_of_another_size() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("memory.bin");
        assert!(read(&path).expect("a missing file is accepted").is_none());
        check_writable(&path).expect("writable");
        assert_eq!(fs::read_dir(folder.path()).expect("readable").count(), 0, "the check leaves nothing");
        assert!(check_writable(&folder.path().join("absent/memory.bin")).is_err());
        let mut contents = [0; SIZE];
        contents[77] = 0xa5;
        write(&path, &contents).expect("writable");
        assert_eq!(read(&path).expect("readable").as_deref(), Some(&contents));
        let kept = Kept::read(&path).expect("readable");
        kept.write(&[1; SIZE]).expect("unchanged");
        let refused = kept.write(&[2; SIZE]).expect_err("another rig has written it").to_string();
        assert!(refused.contains("memory.bin") && refused.contains("its own file"), "{refused}");
        assert_eq!(read(&path).expect("readable").as_deref(), Some(&[1; SIZE]));
        fs::write(&path, [1, 2, 3]).expect("writable");
        let refused = read(&path).expect_err("three bytes are refused").to_string();
        assert!(refused.contains("3 bytes") && refused.contains("32768"), "{refused}");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_device_without_an_end_is_refused() {
        let refused = Kept::read(Path::new("/dev/zero")).expect_err("it has no end").to_string();
        assert!(refused.contains("/dev/zero") && refused.contains("32768"), "{refused}");
    }
}
