//! Reading a saved depth correction.

use std::{fs, path::Path};

use farnear_depth::corrections::Correction;

use crate::error::{Result, WorkflowError};

/// What the file holds, as [`WorkflowError::File`] names it.
pub const KIND: &str = "a saved correction";

/// Reads and checks a correction.
pub fn read(path: &Path) -> Result<Correction> {
    let text = fs::read_to_string(path).map_err(WorkflowError::read(KIND, path))?;
    toml::from_str(&text).map_err(WorkflowError::file(path, KIND))
}
