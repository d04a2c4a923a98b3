//! Where the firmware's ELF lies.

use std::{
    fs::File,
    io::{ErrorKind, Read},
    path::{Path, PathBuf},
};

use crate::error::SimError;

/// Name of the ELF beside the programs.
pub const FILE_NAME: &str = "farnear-nucleo-f429zi.elf";
/// Environment variable that names the ELF for tests.
pub const VARIABLE: &str = "FARNEAR_FIRMWARE";
const ELF_MAGIC: [u8; 4] = *b"\x7fELF";

/// Tells a firmware from another one: FNV-1a, 64 bit (Fowler, Noll, Vo).
pub fn fingerprint(elf: &[u8]) -> u64 {
    let hash = |sum: u64, byte: &u8| (sum ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
    elf.iter().fold(0xcbf2_9ce4_8422_2325, hash)
}

/// The ELF: the one named, else the one `FARNEAR_FIRMWARE` names, else the one beside the running program (for a
/// test, which lies in `deps`, one folder up).
///
/// # Errors
/// [`SimError::NoFirmware`] with the place where it should be; [`SimError::Firmware`] where that is no ELF.
pub fn find(named: Option<&Path>) -> Result<PathBuf, SimError> {
    let path = match (named, std::env::var_os(VARIABLE)) {
        (Some(path), _) => path.to_path_buf(),
        (None, Some(path)) => path.into(),
        (None, None) => beside_program(),
    };
    if !path.is_file() {
        return Err(SimError::NoFirmware(path));
    }
    let mut start = [0; 4];
    let reason = match File::open(&path).and_then(|mut file| file.read_exact(&mut start)) {
        Ok(()) if start == ELF_MAGIC => return Ok(path),
        Ok(()) => "it is no ELF file".to_string(),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => "it is empty or cut short".to_string(),
        Err(error) => error.to_string(),
    };
    Err(SimError::Firmware { path, reason })
}

fn beside_program() -> PathBuf {
    let program = std::env::current_exe().unwrap_or_default();
    let mut folder = program.parent().unwrap_or(Path::new(""));
    if folder.ends_with("deps") {
        folder = folder.parent().unwrap_or(folder);
    }
    folder.join(FILE_NAME)
}
