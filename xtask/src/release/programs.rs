//! Static programs: linked with musl by Rust's own linker, without a cross compiler.

use std::path::PathBuf;

use anyhow::Result;

use super::Release;
use crate::run::{ROOT, add_target, cargo, cargo_home, finish, has, step, target_folder};

pub struct Target {
    pub triple: &'static str,
    /// As in archive names.
    pub processor: &'static str,
    /// Debian's name of the processor.
    pub debian: &'static str,
}

/// Laboratory computers; Raspberry Pi and Jetson.
pub const TARGETS: [Target; 2] = [
    Target { triple: "x86_64-unknown-linux-musl", processor: "x86_64", debian: "amd64" },
    Target { triple: "aarch64-unknown-linux-musl", processor: "aarch64", debian: "arm64" },
];

impl Target {
    pub fn runs_here(&self) -> bool {
        self.processor == std::env::consts::ARCH
    }

    /// Command that runs its programs here, or the missing tool.
    pub fn runner(&self) -> Result<Option<String>, String> {
        if self.runs_here() {
            return Ok(None);
        }
        let names = [format!("qemu-{}", self.processor), format!("qemu-{}-static", self.processor)];
        names.iter().find(|name| has(name)).cloned().map(Some).ok_or_else(|| {
            format!("this machine cannot run {} programs; Debian's package is qemu-user", self.processor)
        })
    }
}

/// Returns the programs' folder, or the missing tool.
pub fn build(release: &Release, target: &Target) -> Result<Result<PathBuf, String>> {
    step(&format!("programs for {}", target.triple));
    if let Err(missing) = add_target(target.triple) {
        return Ok(Err(missing));
    }
    let variable = format!("CARGO_TARGET_{}_LINKER", target.triple.to_uppercase().replace('-', "_"));
    finish(
        cargo(["build", "--release", "--locked"])
            .args(crate::host::packages(&crate::host::PROGRAMS))
            .args(["--target", target.triple, "--config", "profile.release.strip=true"])
            .env(variable, "rust-lld")
            .env("SOURCE_DATE_EPOCH", &release.epoch)
            .env("CARGO_ENCODED_RUSTFLAGS", without_paths().join("\u{1f}")),
    )?;
    Ok(Ok(target_folder().join(target.triple).join("release")))
}

/// Compiler flags that remove this machine's paths from programs.
pub fn without_paths() -> Vec<String> {
    let folders = [(Some(ROOT.clone()), "farnear"), (cargo_home(), "cargo")];
    folders
        .into_iter()
        .filter_map(|(folder, name)| folder.map(|folder| (folder, name)))
        .map(|(folder, name)| format!("--remap-path-prefix={}={name}", folder.display()))
        .collect()
}
