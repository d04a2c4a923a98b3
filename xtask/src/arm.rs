//! Tests of the run time's vectors on 64-bit ARM (NEON) under qemu, if the tools are installed.

use std::{path::Path, process::Command};

use anyhow::Result;

use crate::{
    run::{ROOT, cargo, has, has_target},
    test_programs::{self, Total, written},
};

pub const TARGET: &str = "aarch64-unknown-linux-gnu";
/// Debian's cross compiler, which brings the C library.
const LINKER: &str = "aarch64-linux-gnu-gcc";
const SYSROOT: &str = "/usr/aarch64-linux-gnu";
pub const QEMU: &str = "qemu-aarch64";

/// Modules of host/depth whose tests use the vectors.
const MODULES: [&str; 4] = ["simd", "filter", "pipeline", "adaptive_window"];

/// Counts the tests as skipped if tools are missing.
pub fn run(total: &mut Total) -> Result<()> {
    if let Some(missing) = missing() {
        eprintln!("skipped: the vectors of 64-bit ARM ({missing})");
        for module in MODULES {
            total.ignored += tests_of(module)?;
        }
        return Ok(());
    }
    let mut command = cargo(["test", "--locked", "--package", "farnear-depth", "--lib", "--target", TARGET]);
    command.arg("--").args(MODULES.map(|module| format!("{module}::")));
    test_programs::watch(for_target(&mut command), total)?;
    Ok(())
}

/// The missing tool and how to install it.
pub fn missing() -> Option<&'static str> {
    if !has(QEMU) {
        Some("qemu-aarch64 is missing; Debian's package is qemu-user")
    } else if !links() {
        Some("nothing links for it; Debian's packages are gcc-aarch64-linux-gnu and libc6-dev-arm64-cross")
    } else if !has_target(TARGET) {
        Some("the target is missing; `rustup target add aarch64-unknown-linux-gnu`")
    } else {
        None
    }
}

pub fn for_target(command: &mut Command) -> &mut Command {
    command
        .env("CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER", LINKER)
        .env("CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER", emulator().join(" "))
}

pub fn emulator() -> [&'static str; 3] {
    [QEMU, "-L", SYSROOT]
}

/// Whether the cross compiler finds the C library's start files, which are in another package.
fn links() -> bool {
    let found = Command::new(LINKER).arg("-print-file-name=crti.o").output();
    found.is_ok_and(|found| Path::new(String::from_utf8_lossy(&found.stdout).trim()).is_absolute())
}

fn tests_of(module: &str) -> Result<u32> {
    let file = ROOT.join(format!("host/depth/src/{module}.rs"));
    let below = file.with_extension("");
    let count = |place: &Path| written(place, "#[test]");
    Ok(count(&file)? + if below.is_dir() { count(&below)? } else { 0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skipped_tests_are_those_in_the_files() {
        for module in MODULES {
            assert!(tests_of(module).is_ok_and(|count| count > 0), "{module}");
        }
    }
}
