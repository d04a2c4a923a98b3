//! Tests of the Python package: builds the module next to its files and runs pytest in a virtual environment.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result};

use crate::{
    limited,
    run::{ROOT, cargo, features, finish, succeeds, target_folder},
    test_programs::{self, Total, written},
};

/// Compiled only if Python is available.
const PACKAGE: &str = "farnear-python";
/// All crates except the Python package, which is built with other environment variables.
pub const OTHERS: [&str; 4] = ["--workspace", "--exclude", PACKAGE, "--locked"];
const NEEDS: [&str; 13] = [
    "numpy>=1.23",
    "matplotlib>=3.6",
    "pytest>=7",
    "scikit-learn>=1.6",
    "useq-schema>=0.5",
    "mcap-ros2-support>=0.5",
    "foxglove-sdk>=0.20; python_version >= '3.10'",
    "websockets>=13",
    "mypy>=1.10",
    "pyright[nodejs]>=1.1.380",
    "snakemake>=9; python_version >= '3.11'",
    "trimesh>=4",
    "xarray>=2023.1",
];
/// Checks version and virtual environments.
const ABLE: &str = "import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 9))";

/// Counts the tests as skipped if tools are missing.
pub fn run(elf: &Path) -> Result<Total> {
    let tests = ROOT.join("python/tests");
    let folder = target_folder().join("python-tests");
    let python = match environment(&folder, &NEEDS) {
        Ok(python) => python,
        Err(missing) => {
            eprintln!("skipped: the Python package ({missing})");
            return Ok(Total { ignored: written(&tests, "def test_")?, well: true, ..Total::default() });
        }
    };
    let built = target_folder().join("debug");
    lay_out(&folder.join("package/farnear"), &built)?;
    let ended = limited::run(
        Command::new(python)
            .args(["-m", "pytest", "-q", "-p", "farnear.pytest_plugin", "-p", "no:cacheprovider"])
            // Report where a test hangs.
            .args(["-o", "faulthandler_timeout=300", "--rootdir"])
            .arg(&tests)
            .arg(&tests)
            // The repository's package folder has no module.
            .current_dir(&folder)
            .env("PYTHONPATH", folder.join("package"))
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .env("FARNEAR_SIM", built.join("farnear-sim"))
            .env("FARNEAR_FIRMWARE", elf),
    )?;
    let text = ended.text;
    Ok(Total {
        passed: count(&text, "passed"),
        failed: count(&text, "failed") + count(&text, "error") + count(&text, "errors"),
        ignored: count(&text, "skipped"),
        well: ended.well,
        ..Total::default()
    })
}

/// The Python of an environment with all packages, created if missing; else the reason.
pub fn environment(folder: &Path, needs: &[&str]) -> Result<PathBuf, String> {
    if !able() {
        return Err(
            "no python3 of at least 3.9 with venv; Debian's packages are python3 and python3-venv".into()
        );
    }
    let venv = folder.join("venv");
    let (python, whole) = (venv.join("bin/python"), folder.join("needs"));
    if fs::read_to_string(&whole).is_ok_and(|made| made == needs.join("\n"))
        && succeeds(Command::new(&python).arg("-V"))
    {
        return Ok(python);
    }
    if !succeeds(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&venv)) {
        return Err("python3 -m venv creates no environment; Debian's package is python3-venv".into());
    }
    eprintln!("fetching {}", needs.join(", "));
    let fetch = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--only-binary", ":all:"];
    // Of snakemake; pure Python, published as source only.
    let fetch = [&fetch[..], &["--no-binary", "connection-pool"]].concat();
    if !succeeds(Command::new(&python).args(fetch).args(needs)) {
        return Err(format!("pip cannot fetch {}", needs.join(", ")));
    }
    fs::write(&whole, needs.join("\n")).map_err(|error| format!("{}: {error}", whole.display()))?;
    Ok(python)
}

/// Builds the module and the tests' programs in one call, to compile shared crates once; nothing without Python.
pub fn build(elf: &Path) -> Result<()> {
    if !able() {
        return Ok(());
    }
    let packages = [PACKAGE, "farnear", "farnear-sim"].map(|name| ["--package", name]);
    let mut command = cargo(["build", "--locked"]);
    command.args(packages.as_flattened()).args(features());
    // An extension for every Python version is neither linked with Python nor asks one.
    command.env("PYO3_BUILD_EXTENSION_MODULE", "1").env("PYO3_NO_PYTHON", "1");
    finish(test_programs::environment(&mut command, elf))
}

fn able() -> bool {
    succeeds(Command::new("python3").args(["-c", ABLE]))
}

fn lay_out(package: &Path, built: &Path) -> Result<()> {
    fs::create_dir_all(package).with_context(|| format!("cannot make {}", package.display()))?;
    for entry in fs::read_dir(ROOT.join("python/farnear")).context("the package is not there")? {
        let entry = entry?;
        if entry.path().is_file() {
            fs::copy(entry.path(), package.join(entry.file_name()))?;
        }
    }
    let (prefix, suffix) = (std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    let module = built.join(format!("{prefix}_farnear{suffix}"));
    fs::copy(&module, package.join("_farnear.abi3.so"))
        .with_context(|| format!("no {}", module.display()))?;
    Ok(())
}

/// The number before a word in pytest's last line: "1 failed, 98 passed, 3 skipped in 8.34s".
fn count(text: &str, word: &str) -> u32 {
    let last = text.lines().rev().find(|line| line.contains(" in ")).unwrap_or_default();
    test_programs::count(last, word)
}

#[cfg(test)]
mod tests {
    use super::{ROOT, count, written};

    #[test]
    fn counts_are_read() {
        let text = "FAILED a in b\n1 failed, 98 passed, 3 skipped in 8.34s\n";
        let words = ["failed", "passed", "skipped", "error"];
        assert_eq!(words.map(|word| count(text, word)), [1, 98, 3, 0]);
        assert_eq!(words.map(|word| count("== 5 passed in 75.00s (0:01:15) ==\n", word)), [0, 5, 0, 0]);
        assert!(written(&ROOT.join("python/tests"), "def test_").is_ok_and(|tests| tests > 20));
    }
}
