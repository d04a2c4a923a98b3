//! A toolchain for `thumbv7em-none-eabihf`: the first of an installed target, `rustup target add`, and
//! Debian's Rust with the sources of `core` (for networks that reach a Debian mirror but not Rust's servers).

use std::{
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::Duration,
};

use anyhow::{Result, bail};

use crate::{
    limited,
    run::{finish, has, has_target, output, step},
};

pub const TARGET: &str = "thumbv7em-none-eabihf";

/// Compiler, cargo, sources of `core`, clippy.
const DEBIAN_PACKAGES: [&str; 4] = ["rustc-web", "cargo-web", "rust-web-src", "rust-web-clippy"];
const DEBIAN_CARGO: &str = "/usr/bin/cargo";
const DEBIAN_RUSTC: &str = "/usr/bin/rustc";

#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// The toolchain of the host programs, with the target.
    Installed,
    /// Debian's toolchain, which builds `core` from its sources.
    Debian,
}

impl Way {
    /// Installs missing parts if possible.
    pub fn find() -> Result<Self> {
        if has_target(TARGET) || rustup_adds_target() {
            eprintln!("{TARGET}: the Rust toolchain on the PATH, which has the target");
            return Ok(Self::Installed);
        }
        if debian_ready() || (apt_installs() && debian_ready()) {
            eprintln!("{TARGET}: Debian's rustc-web, cargo-web and rust-web-src, building core from source");
            return Ok(Self::Debian);
        }
        bail!(
            "the firmware's target {TARGET} is missing, and cannot be installed automatically. Do one of these:\n  \
             rustup target add {TARGET}\n  \
             sudo apt-get update && sudo apt-get install {}\nand run the command again.",
            DEBIAN_PACKAGES.join(" ")
        );
    }

    pub fn cargo(self, folder: &Path, job: &str) -> Command {
        let mut command = match self {
            Self::Installed => Command::new("cargo"),
            Self::Debian => Command::new(DEBIAN_CARGO),
        };
        command.arg(job).args(["--target", TARGET]).current_dir(folder);
        // Cargo's variables for this program do not suit another toolchain.
        for name in ["CARGO", "RUSTC", "RUSTFLAGS", "CARGO_TARGET_DIR", "CARGO_ENCODED_RUSTFLAGS"] {
            command.env_remove(name);
        }
        if self == Self::Debian {
            command.args(["-Z", "build-std=core"]);
            command
                .env("RUSTC_BOOTSTRAP", "1")
                .env("RUSTC", DEBIAN_RUSTC)
                .env("PATH", path_with_debian_first());
            for name in ["RUSTUP_TOOLCHAIN", "LD_LIBRARY_PATH"] {
                command.env_remove(name);
            }
            if let Some(linker) = linker() {
                command.env("CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER", linker);
            }
        }
        command
    }

    pub fn has_clippy(self) -> bool {
        match self {
            Self::Installed => true,
            Self::Debian => Path::new("/usr/bin/cargo-clippy").exists(),
        }
    }
}

/// Gives up after two minutes: a closed network may hang.
fn rustup_adds_target() -> bool {
    if !has("rustup") {
        return false;
    }
    step(&format!("rustup target add {TARGET}"));
    let mut add = Command::new("rustup");
    add.args(["target", "add", TARGET]);
    if limited::run_for(&mut add, Duration::from_secs(120)).is_ok_and(|ended| ended.well) {
        return has_target(TARGET);
    }
    eprintln!("rustup cannot fetch the target here; trying Debian's packages");
    false
}

fn debian_ready() -> bool {
    let Ok(sysroot) =
        output(Command::new(DEBIAN_RUSTC).args(["--print", "sysroot"]).env_remove("LD_LIBRARY_PATH"))
    else {
        return false;
    };
    let sources = Path::new(sysroot.trim()).join("lib/rustlib/src/rust/library/core");
    Path::new(DEBIAN_CARGO).exists() && sources.exists() && linker().is_some()
}

/// As root, or with a sudo that asks nothing.
fn apt_installs() -> bool {
    if !has("apt-get") {
        return false;
    }
    let root = output(Command::new("id").arg("-u")).is_ok_and(|id| id.trim() == "0");
    let apt = |arguments: &[&str]| {
        let mut command = if root {
            Command::new("apt-get")
        } else {
            let mut sudo = Command::new("sudo");
            sudo.args(["-n", "apt-get"]);
            sudo
        };
        finish(command.args(arguments).env("DEBIAN_FRONTEND", "noninteractive").stdout(Stdio::null()))
    };
    step(&format!("apt-get install {}", DEBIAN_PACKAGES.join(" ")));
    let install: Vec<&str> =
        ["install", "--yes", "--no-install-recommends"].into_iter().chain(DEBIAN_PACKAGES).collect();
    // An old package list may suffice, so a failing update is no error.
    if let Err(error) = apt(&["update", "--quiet"]) {
        eprintln!("{error:#}");
    }
    apt(&install).inspect_err(|error| eprintln!("{error:#}")).is_ok()
}

/// An ELF linker: inside the host toolchain, or LLVM's on the PATH.
fn linker() -> Option<PathBuf> {
    let libdir = output(Command::new("rustc").args(["--print", "target-libdir"])).ok()?;
    let bundled = Path::new(libdir.trim()).parent()?.join("bin/rust-lld");
    if bundled.exists() {
        return Some(bundled);
    }
    ["rust-lld", "ld.lld"].into_iter().find(|lld| has(lld)).map(PathBuf::from)
}

fn path_with_debian_first() -> std::ffi::OsString {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::iter::once(PathBuf::from("/usr/bin")).chain(std::env::split_paths(&path));
    std::env::join_paths(folders).unwrap_or(path)
}
