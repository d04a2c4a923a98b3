//! Reading a saved depth correction.

use std::{fs, path::Path};

use farnear_depth::corrections::Correction;

use crate::error::{Result, WorkflowError};

/// Reads and checks a correction.
///
/// # Errors
/// [`WorkflowError::Read`], [`WorkflowError::File`].
pub fn read(path: &Path) -> Result<Correction> {
    let text = fs::read_to_string(path).map_err(WorkflowError::read("the correction", path))?;
    toml::from_str(&text).map_err(WorkflowError::file(path, "a saved correction"))
}
