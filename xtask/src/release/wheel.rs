//! The Python wheel, built by maturin in a virtual environment.

use std::{fs, path::PathBuf, process::Command};

use anyhow::{Context, Result};

use super::{Release, programs::without_paths};
use crate::{
    python,
    run::{ROOT, finish, step, target_folder},
};

const NEEDS: [&str; 1] = ["maturin>=1.9,<2"];

/// Returns the path, or the missing tool.
pub fn write(release: &Release) -> Result<Result<PathBuf, String>> {
    let python = match python::environment(&target_folder().join("wheel"), &NEEDS) {
        Ok(python) => python,
        Err(missing) => return Ok(Err(missing)),
    };
    step("the Python package's wheel");
    finish(
        Command::new(python)
            .args(["-m", "maturin", "build", "--release", "--locked", "--strip", "--out"])
            .arg(&release.out)
            .current_dir(ROOT.join("python"))
            .env("SOURCE_DATE_EPOCH", &release.epoch)
            .env("CARGO_ENCODED_RUSTFLAGS", without_paths().join("\u{1f}")),
    )?;
    let wheel = fs::read_dir(&release.out)?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .find(|path| path.extension().is_some_and(|ending| ending == "whl"))
        .context("maturin built no wheel")?;
    Ok(Ok(wheel))
}
