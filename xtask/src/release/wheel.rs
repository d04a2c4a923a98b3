//! The Python wheels, built by maturin in a virtual environment. Zig links them for an old C library and for both processors.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Result, ensure};

use super::{Release, copy, programs::without_paths};
use crate::{
    python,
    run::{ROOT, add_target, finish, step, target_folder},
};

const NEEDS: [&str; 1] = ["maturin[zig]>=1.9,<2"];
/// glibc 2.28: Debian 10, Ubuntu 18.10, RHEL 8 and later.
const COMPATIBILITY: &str = "manylinux_2_28";
const TARGETS: [&str; 2] = ["x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu"];

/// Returns the paths, or the missing tool.
pub fn write(release: &Release, notices: &Path) -> Result<Result<Vec<PathBuf>, String>> {
    let python = match python::environment(&target_folder().join("wheel"), &NEEDS) {
        Ok(python) => python,
        Err(missing) => return Ok(Err(missing)),
    };
    // maturin looks for the environment's Zig on the path.
    let programs = python.parent().map(Path::to_path_buf);
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths(programs.into_iter().chain(std::env::split_paths(&path)))?;
    // maturin takes licences from the package's folder only.
    copy(notices, &ROOT.join("python"))?;
    for target in TARGETS {
        step(&format!("the Python package's wheel for {target}"));
        if let Err(missing) = add_target(target) {
            return Ok(Err(missing));
        }
        finish(
            Command::new(&python)
                .args(["-m", "maturin", "build", "--release", "--locked", "--strip", "--zig"])
                .args(["--compatibility", COMPATIBILITY, "--target", target, "--out"])
                .arg(&release.out)
                .current_dir(ROOT.join("python"))
                .env("PATH", &path)
                .env("SOURCE_DATE_EPOCH", &release.epoch)
                .env("CARGO_ENCODED_RUSTFLAGS", without_paths().join("\u{1f}")),
        )?;
    }
    let files = fs::read_dir(&release.out)?.filter_map(|entry| Some(entry.ok()?.path()));
    let wheels: Vec<PathBuf> =
        files.filter(|path| path.extension().is_some_and(|ending| ending == "whl")).collect();
    ensure!(
        wheels.len() == TARGETS.len(),
        "maturin built {} wheels, expected {}",
        wheels.len(),
        TARGETS.len()
    );
    Ok(Ok(wheels))
}
