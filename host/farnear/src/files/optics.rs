//! Reading `optics.toml`.

use std::{fs, path::Path};

use anyhow::{Context, Result, bail};
use farnear_capture::record::{CAPTURE_FILE, read_record};
use farnear_depth::optics::{Optics, OpticsFile};

/// Reads and checks an optics file.
pub fn read(path: &Path) -> Result<Optics> {
    check(&text(path)?, path)
}

fn check(text: &str, path: &Path) -> Result<Optics> {
    let about = || format!("the optics in {}", path.display());
    let file: OpticsFile = toml::from_str(text).with_context(about)?;
    file.check().with_context(about)
}

/// The optics of a pair: the file that is named, else what the far image's folder knows.
pub fn of_pair(named: Option<&Path>, far: &Path) -> Result<Optics> {
    if let Some(path) = named {
        return read(path);
    }
    let folder = far.parent().unwrap_or(Path::new(""));
    if let Some(record) = read_record(folder)? {
        return check(&toml::to_string(&record.optics)?, &folder.join(CAPTURE_FILE));
    }
    let beside = folder.join("optics.toml");
    if beside.exists() {
        return read(&beside);
    }
    bail!(
        "no optics: name a file with --optics ({CAPTURE_FILE} or optics.toml beside {} would do, too)",
        far.display()
    )
}

/// The file's text.
pub fn text(path: &Path) -> Result<String> {
    fs::read_to_string(path).with_context(|| format!("cannot read the optics file {}", path.display()))
}
