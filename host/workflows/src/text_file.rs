//! Text files from untrusted folders.

use std::{fs, io, path::Path};

/// Reads a text file. Rejects a FIFO, socket or device, because reading may never end. Accepts those below
/// `/dev` and `/proc`, which shells pass on purpose.
pub fn read(path: &Path) -> io::Result<String> {
    let by_shell = path.starts_with("/dev") || path.starts_with("/proc");
    let found = fs::metadata(path)?;
    if !by_shell && !found.is_file() && !found.is_dir() {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "it is a FIFO, socket or device; expected a regular file",
        ));
    }
    fs::read_to_string(path)
}

#[cfg(all(test, unix))]
mod tests {
    use std::{process::Command, sync::mpsc::channel, thread, time::Duration};

    use super::*;

    #[test]
    fn refuses_a_fifo_and_a_link_to_one_without_waiting() {
        let folder = tempfile::tempdir().unwrap();
        let fifo = folder.path().join("optics.toml");
        assert!(Command::new("mkfifo").arg(&fifo).status().unwrap().success());
        let link = folder.path().join("quality.toml");
        std::os::unix::fs::symlink(&fifo, &link).unwrap();
        let (done, finished) = channel();
        thread::spawn(move || {
            for path in [fifo, link] {
                done.send(read(&path).unwrap_err().to_string()).unwrap();
            }
        });
        for _ in 0..2 {
            let error =
                finished.recv_timeout(Duration::from_secs(20)).expect("it does not wait for a writer");
            assert!(error.contains("expected a regular file"), "{error}");
        }
        assert!(read(folder.path()).is_err());
        fs::write(folder.path().join("note.toml"), "text").unwrap();
        assert_eq!(read(&folder.path().join("note.toml")).unwrap(), "text");
    }
}
