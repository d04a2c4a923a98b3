use std::path::PathBuf;

use anyhow::Result;

use crate::run::{cargo, features, finish, step, target_folder};

/// Programs for users; package and program have the same name.
pub const PROGRAMS: [&str; 3] = ["farnear", "farnear-sim", "farnear-campaign"];

/// Builds [`PROGRAMS`] with the profile of tests and demo, to compile everything once; returns their folder.
pub fn build() -> Result<PathBuf> {
    step("host programs (the first build takes some minutes)");
    build_silently(&PROGRAMS)
}

pub fn build_silently(programs: &[&str]) -> Result<PathBuf> {
    finish(cargo(["build", "--locked"]).args(packages(programs)).args(features()))?;
    Ok(target_folder().join("debug"))
}

pub fn build_release() -> Result<PathBuf> {
    step("host programs, optimised (the first build takes some minutes)");
    finish(cargo(["build", "--release", "--locked"]).args(packages(&PROGRAMS)))?;
    Ok(target_folder().join("release"))
}

pub fn packages<'a>(programs: &'a [&str]) -> impl Iterator<Item = &'a str> {
    programs.iter().flat_map(|program| ["--package", program])
}
