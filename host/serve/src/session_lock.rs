//! One server for a session: two would overwrite each other's files.

use std::{
    fs::{self, File, TryLockError},
    path::Path,
};

use farnear_workflows::WorkflowError;

use crate::server::ServeError;

/// Hidden: the list of captures leaves it out.
const FILE: &str = ".serve.lock";

/// Creates the session's folder if it is missing, and locks it until the file is dropped or the process ends. `None`
/// where files cannot be locked, or neither written nor locked.
pub fn lock(session: &Path) -> Result<Option<File>, ServeError> {
    fs::create_dir_all(session).map_err(|source| WorkflowError::Folder { folder: session.into(), source })?;
    let path = session.join(FILE);
    // Windows locks no file that is open for appending only. Another user's lock file may be read only.
    let opened = File::options().read(true).append(true).create(true).open(&path);
    let opened = opened.or_else(|_| File::open(&path));
    let Ok(file) = opened else { return Ok(None) };
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Err(ServeError::InUse { session: session.into() }),
        Err(TryLockError::Error(_)) => Ok(None),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    #[test]
    fn the_lock_can_be_read_as_windows_wants() {
        let session = tempfile::tempdir().unwrap();
        let mut held = lock(session.path()).unwrap().unwrap();
        assert_eq!(held.read(&mut [0; 8]).unwrap(), 0);
        assert!(matches!(lock(session.path()), Err(ServeError::InUse { .. })));
    }
}
