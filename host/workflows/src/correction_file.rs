//! Reads a saved depth correction.

use std::path::Path;

use farnear_depth::corrections::Correction;

use crate::{
    error::{Result, WorkflowError},
    text_file,
};

pub const KIND: &str = "a saved correction";

pub fn read(path: &Path) -> Result<Correction> {
    let text = text_file::read(path).map_err(WorkflowError::read(KIND, path))?;
    toml::from_str(&text).map_err(WorkflowError::file(path, KIND))
}
