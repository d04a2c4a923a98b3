//! Reading a saved correction.

use std::{fs, path::Path};

use anyhow::{Context, Result};
use farnear_depth::corrections::Correction;

/// Reads and checks a correction.
pub fn read(path: &Path) -> Result<Correction> {
    let text =
        fs::read_to_string(path).with_context(|| format!("cannot read the correction {}", path.display()))?;
    toml::from_str(&text).with_context(|| {
        format!("{} holds no correction such as `farnear calibrate correction --out` saves", path.display())
    })
}
