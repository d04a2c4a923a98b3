//! The host programs.

use std::path::PathBuf;

use anyhow::Result;

use crate::run::{cargo, finish, step, target_folder};

/// What a user runs.
const PACKAGES: [&str; 4] = ["--package", "farnear", "--package", "farnear-sim"];

/// Builds `farnear` and `farnear-sim` as the tests use them; gives their folder. The demo takes the same, so that a newcomer
/// who runs both compiles everything once.
pub fn build() -> Result<PathBuf> {
    step("host programs (the first build takes some minutes)");
    build_silently()
}

/// The same without saying so.
pub fn build_silently() -> Result<PathBuf> {
    finish(cargo(["build", "--locked"]).args(PACKAGES))?;
    Ok(target_folder().join("debug"))
}

/// The same, as they are installed: fully optimised.
pub fn build_release() -> Result<PathBuf> {
    step("host programs, optimised (the first build takes some minutes)");
    finish(cargo(["build", "--release", "--locked"]).args(PACKAGES))?;
    Ok(target_folder().join("release"))
}
