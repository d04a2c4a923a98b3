//! Reading `optics.toml`.

use std::{fs, path::Path};

use anyhow::{Context, Result};
use farnear_depth::optics::{Optics, OpticsFile};

/// Reads and checks an optics file.
pub fn read(path: &Path) -> Result<Optics> {
    let text = text(path)?;
    let about = || format!("the optics in {}", path.display());
    let file: OpticsFile = toml::from_str(&text).with_context(about)?;
    file.check().with_context(about)
}

/// The file's text.
pub fn text(path: &Path) -> Result<String> {
    fs::read_to_string(path).with_context(|| format!("cannot read the optics file {}", path.display()))
}
