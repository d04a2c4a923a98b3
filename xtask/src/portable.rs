//! Compiles the programs for systems on which they cannot be run here: Windows and macOS.

use std::process::Command;

use anyhow::{Result, bail};

use crate::{
    python,
    run::{cargo, finish, has_target, step, succeeds},
};

const TARGETS: [&str; 2] = ["x86_64-pc-windows-gnu", "aarch64-apple-darwin"];
/// The emulator needs a pseudo-terminal, and a module for Python the target's own Python.
const EXCLUDED: [&str; 3] = ["farnear-sim", "farnear-campaign", python::PACKAGE];

/// Checks types and borrows of all other crates; nothing is linked, so no foreign linker is needed.
pub fn run() -> Result<()> {
    for target in TARGETS {
        step(&format!("all but the emulated board for {target}"));
        if !has_target(target) && !succeeds(Command::new("rustup").args(["target", "add", target])) {
            bail!("the target is missing: rustup target add {target}");
        }
        let excluded = EXCLUDED.map(|name| ["--exclude", name]);
        let mut check = cargo(["check", "--locked", "--workspace", "--lib", "--bins", "--target", target]);
        finish(check.args(excluded.as_flattened()))?;
    }
    Ok(())
}
