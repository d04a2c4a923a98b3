//! Builds the firmware and lays its ELF beside the host programs, where `farnear-sim` looks for it.

use std::{fs, path::PathBuf};

use anyhow::{Context, Result, bail};

use crate::{
    run::{ROOT, finish, step, target_folder},
    thumb::{TARGET, Way},
};

/// Name of the firmware's package and program.
const PROGRAM: &str = "farnear-nucleo-f429zi";
/// The program that counts the instructions of the on-board routines, built alongside.
const COUNTER: &str = "farnear-count";

/// The firmware's own workspace.
pub fn folder() -> PathBuf {
    ROOT.join("firmware/nucleo-f429zi")
}

fn built(program: &str) -> Result<PathBuf> {
    let elf = folder().join("target").join(TARGET).join("release").join(program);
    if !elf.exists() {
        bail!("the build ended well but left no {}", elf.display());
    }
    Ok(elf)
}

/// The counting program's ELF, after a build.
pub fn counter() -> Result<PathBuf> {
    built(COUNTER)
}

/// Builds the firmware and the program that counts instructions; gives the path of the firmware's ELF.
pub fn build() -> Result<PathBuf> {
    step("firmware for the NUCLEO-F429ZI");
    build_with(Way::find()?, &[])
}

/// Builds the firmware alone, which is quicker.
pub fn build_program() -> Result<PathBuf> {
    step("firmware for the NUCLEO-F429ZI");
    build_with(Way::find()?, &["--bin", PROGRAM])
}

/// Builds, in a way that was found before, what `selection` names (all, where that is nothing).
pub fn build_with(way: Way, selection: &[&str]) -> Result<PathBuf> {
    finish(way.cargo(&folder(), "build").args(["--release", "--locked"]).args(selection))?;
    let elf = built(PROGRAM)?;
    for profile in ["debug", "release"] {
        let beside = target_folder().join(profile);
        let copy = beside.join(format!("{PROGRAM}.elf"));
        fs::create_dir_all(&beside)
            .and_then(|()| fs::copy(&elf, &copy))
            .with_context(|| format!("cannot write {}", copy.display()))?;
    }
    Ok(elf)
}
