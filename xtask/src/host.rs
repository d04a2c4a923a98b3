//! The host programs.

use std::path::PathBuf;

use anyhow::Result;

use crate::run::{cargo, finish, step, target_folder};

/// The programs that a user runs, each of the package of the same name.
pub const PROGRAMS: [&str; 3] = ["farnear", "farnear-sim", "farnear-campaign"];

const PACKAGES: [&str; 6] = ["--package", PROGRAMS[0], "--package", PROGRAMS[1], "--package", PROGRAMS[2]];

/// Builds [`PROGRAMS`] as the tests use them; gives their folder. The demo takes the same, so that a newcomer
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
