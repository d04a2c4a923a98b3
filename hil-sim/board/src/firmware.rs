use std::{
    fs::File,
    io::{ErrorKind, Read},
    path::{Path, PathBuf},
};

use crate::error::SimError;

pub const FILE_NAME: &str = "farnear-nucleo-f429zi.elf";
pub const VARIABLE: &str = "FARNEAR_FIRMWARE";
const ELF_MAGIC: [u8; 4] = *b"\x7fELF";

/// Fingerprint of a firmware: FNV-1a, 64 bit (Fowler, Noll, Vo).
pub fn fingerprint(elf: &[u8]) -> u64 {
    let hash = |sum: u64, byte: &u8| (sum ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
    elf.iter().fold(0xcbf2_9ce4_8422_2325, hash)
}

/// ELF path: `named`, else `FARNEAR_FIRMWARE`, else next to the running program (for tests, above `deps`).
pub fn find(named: Option<&Path>) -> Result<PathBuf, SimError> {
    let path = match (named, std::env::var_os(VARIABLE)) {
        (Some(path), _) => path.to_path_buf(),
        (None, Some(path)) => path.into(),
        (None, None) => next_to_program(),
    };
    if !path.is_file() {
        return Err(SimError::NoFirmware(path));
    }
    let mut start = [0; 4];
    let reason = match File::open(&path).and_then(|mut file| file.read_exact(&mut start)) {
        Ok(()) if start == ELF_MAGIC => return Ok(path),
        Ok(()) => "it is not an ELF file".to_string(),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => "it is empty or cut short".to_string(),
        Err(error) => error.to_string(),
    };
    Err(SimError::Firmware { path, reason })
}

fn next_to_program() -> PathBuf {
    let program = std::env::current_exe().unwrap_or_default();
    let mut folder = program.parent().unwrap_or(Path::new(""));
    if folder.ends_with("deps") {
        folder = folder.parent().unwrap_or(folder);
    }
    folder.join(FILE_NAME)
}
