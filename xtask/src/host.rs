use std::path::PathBuf;

use anyhow::Result;

use crate::run::{cargo, features, finish, step, target_folder};

/// Programs for users; package and program have the same name.
pub const PROGRAMS: [&str; 3] = ["farnear", "farnear-sim", "farnear-campaign"];

const PACKAGES: [&str; 6] = ["--package", PROGRAMS[0], "--package", PROGRAMS[1], "--package", PROGRAMS[2]];

/// Builds [`PROGRAMS`] with the profile of tests and demo, to compile everything once; returns their folder.
pub fn build() -> Result<PathBuf> {
    step("host programs (the first build takes some minutes)");
    build_silently()
}

pub fn build_silently() -> Result<PathBuf> {
    finish(cargo(["build", "--locked"]).args(PACKAGES).args(features()))?;
    Ok(target_folder().join("debug"))
}

pub fn build_release() -> Result<PathBuf> {
    step("host programs, optimised (the first build takes some minutes)");
    finish(cargo(["build", "--release", "--locked"]).args(PACKAGES))?;
    Ok(target_folder().join("release"))
}
