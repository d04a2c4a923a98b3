//! Where the firmware's ELF lies.

use std::path::{Path, PathBuf};

use crate::error::SimError;

/// Name of the ELF beside the programs.
pub const FILE_NAME: &str = "farnear-nucleo-f429zi.elf";
/// Environment variable that names the ELF for tests.
pub const VARIABLE: &str = "FARNEAR_FIRMWARE";

/// The ELF: the one named, else the one `FARNEAR_FIRMWARE` names, else the one beside the running program (for a
/// test, which lies in `deps`, one folder up).
///
/// # Errors
/// [`SimError::NoFirmware`] with the place where it should be.
pub fn find(named: Option<&Path>) -> Result<PathBuf, SimError> {
    let path = match (named, std::env::var_os(VARIABLE)) {
        (Some(path), _) => path.to_path_buf(),
        (None, Some(path)) => path.into(),
        (None, None) => beside_program(),
    };
    if path.is_file() { Ok(path) } else { Err(SimError::NoFirmware(path)) }
}

fn beside_program() -> PathBuf {
    let program = std::env::current_exe().unwrap_or_default();
    let mut folder = program.parent().unwrap_or(Path::new(""));
    if folder.ends_with("deps") {
        folder = folder.parent().unwrap_or(folder);
    }
    folder.join(FILE_NAME)
}
