//! Programs that need no library: linked with musl by the linker that comes with Rust, so that no cross compiler is needed.

use std::{path::PathBuf, process::Command};

use anyhow::Result;

use super::Release;
use crate::run::{ROOT, cargo, finish, has, has_target, step, target_folder};

/// What programs are built for.
pub struct Target {
    pub triple: &'static str,
    /// The processor, as archives name it.
    pub processor: &'static str,
    /// The same as Debian names it.
    pub debian: &'static str,
}

/// Laboratory computers; Raspberry Pi and Jetson.
pub const TARGETS: [Target; 2] = [
    Target { triple: "x86_64-unknown-linux-musl", processor: "x86_64", debian: "amd64" },
    Target { triple: "aarch64-unknown-linux-musl", processor: "aarch64", debian: "arm64" },
];

impl Target {
    /// Whether this machine runs its programs without help.
    pub fn runs_here(&self) -> bool {
        self.processor == std::env::consts::ARCH
    }

    /// The command with which this machine runs its programs, or the missing tool.
    pub fn runner(&self) -> Result<Option<String>, String> {
        if self.runs_here() {
            return Ok(None);
        }
        let names = [format!("qemu-{}", self.processor), format!("qemu-{}-static", self.processor)];
        names.iter().find(|name| has(name)).cloned().map(Some).ok_or_else(|| {
            format!("nothing here runs {} programs; Debian's package is qemu-user", self.processor)
        })
    }
}

/// Builds both programs; returns their folder, or the missing tool.
pub fn build(release: &Release, target: &Target) -> Result<Result<PathBuf, String>> {
    step(&format!("programs for {}", target.triple));
    if !(has_target(target.triple) || rustup_adds(target.triple)) {
        return Ok(Err(format!("the target is missing: rustup target add {}", target.triple)));
    }
    let variable = format!("CARGO_TARGET_{}_LINKER", target.triple.to_uppercase().replace('-', "_"));
    finish(
        cargo([
            "build",
            "--release",
            "--locked",
            "--package",
            "farnear",
            "--package",
            "farnear-sim",
            "--package",
            "farnear-campaign",
        ])
        .args(["--target", target.triple, "--config", "profile.release.strip=true"])
        .env(variable, "rust-lld")
        .env("SOURCE_DATE_EPOCH", &release.epoch)
        .env("CARGO_ENCODED_RUSTFLAGS", without_paths().join("\u{1f}")),
    )?;
    Ok(Ok(target_folder().join(target.triple).join("release")))
}

/// Compiler flags that keep this machine's folders out of programs.
pub fn without_paths() -> Vec<String> {
    let home = std::env::var_os("CARGO_HOME")
        .map(PathBuf::from)
        .or_else(|| std::env::home_dir().map(|home| home.join(".cargo")));
    let folders = [(Some(ROOT.clone()), "farnear"), (home, "cargo")];
    folders
        .into_iter()
        .filter_map(|(folder, name)| folder.map(|folder| (folder, name)))
        .map(|(folder, name)| format!("--remap-path-prefix={}={name}", folder.display()))
        .collect()
}

fn rustup_adds(triple: &str) -> bool {
    Command::new("rustup").args(["target", "add", triple]).status().is_ok_and(|status| status.success())
}
