//! Compiles the programs for Windows and macOS; runs the Windows ones under Wine where it is installed.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, bail};

use crate::{
    firmware, python,
    run::{ROOT, add_target, cargo, finish, has, output, step, succeeds, target_folder},
};

const WINDOWS: &str = "x86_64-pc-windows-gnu";
const TARGETS: [&str; 2] = [WINDOWS, "aarch64-apple-darwin"];
/// The linker for Windows.
const LINKER: &str = "x86_64-w64-mingw32-gcc";
/// `ProcessPrng`, which Rust's library imports, for a Wine that does not have it yet.
const RANDOM_NUMBERS: &str = "#include <windows.h>\n\
    BOOLEAN NTAPI SystemFunction036(PVOID, ULONG);\n\
    __declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE to, SIZE_T count) { return SystemFunction036(to, (ULONG)count); }\n";

pub fn run() -> Result<()> {
    for target in TARGETS {
        // Nothing is linked, so no foreign linker is needed.
        step(&format!("all programs for {target}"));
        add_target(target).map_err(anyhow::Error::msg)?;
        finish(cargo(["check", "--lib", "--bins", "--target", target]).args(python::OTHERS))?;
    }
    if has("wine") && has(LINKER) {
        return under_wine();
    }
    eprintln!("skipped: the Windows programs under Wine (wine or {LINKER} is missing)");
    Ok(())
}

/// A pair of the emulated rig and its depth must be the same files as on this system.
fn under_wine() -> Result<()> {
    step("the Windows programs under Wine");
    let elf = firmware::build()?;
    let packages = ["build", "--locked", "--package", "farnear", "--package", "farnear-sim"];
    finish(&mut cargo(packages))?;
    finish(cargo(packages).args(["--target", WINDOWS]))?;
    let native = target_folder().join("debug");
    let windows = target_folder().join(WINDOWS).join("debug");
    let name = elf.file_name().context("the firmware has no name")?;
    fs::copy(&elf, windows.join(name).with_extension("elf"))?;
    let folder = target_folder().join("wine");
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    fs::create_dir_all(&folder)?;
    let wine = |arguments: &[&str]| {
        let mut command = Command::new("wine");
        command.env("WINEPREFIX", folder.join("prefix")).env("WINEDEBUG", "-all").current_dir(&folder);
        command.arg(windows.join("farnear.exe")).args(arguments);
        command
    };
    if !succeeds(&mut wine(&["--version"])) {
        let source = folder.join("random.c");
        fs::write(&source, RANDOM_NUMBERS)?;
        let library = windows.join("bcryptprimitives.dll");
        finish(Command::new(LINKER).args(["-shared", "-o"]).arg(library).arg(source).arg("-ladvapi32"))?;
    }
    let linux = |arguments: &[&str]| {
        let mut command = Command::new(native.join("farnear"));
        command.current_dir(&folder).args(arguments);
        command
    };
    fs::copy(ROOT.join("examples/rig.toml"), folder.join("optics.toml"))?;
    for (system, farnear) in [("windows", &wine as &dyn Fn(&[&str]) -> Command), ("linux", &linux)] {
        let [far, near] = ["far", "near"].map(|name| format!("{system}/{name}.png"));
        let capture = ["rig", "capture", "--port", "sim", "--optics", "optics.toml", "--out", system];
        output(&mut farnear(&capture))?;
        output(&mut farnear(&["depth", &far, &near, "--optics", "optics.toml", "--uncertainty=estimated"]))?;
    }
    let files = same_files(&folder.join("linux"), &folder.join("windows"))?;
    eprintln!("{files} files of a capture and its depth are the same on both");
    Ok(())
}

/// Compares all files but the records in TOML, which name the system's paths and times. Returns how many there are.
fn same_files(one: &Path, other: &Path) -> Result<usize> {
    let mut compared = 0;
    for entry in fs::read_dir(one)? {
        let path: PathBuf = entry?.path();
        let name = path.file_name().unwrap_or_default();
        if path.extension().is_some_and(|ending| ending == "toml") {
            continue;
        }
        let twin = fs::read(other.join(name)).with_context(|| format!("{} is missing", name.display()))?;
        if fs::read(&path)? != twin {
            bail!("{} differs from {}", other.join(name).display(), path.display());
        }
        compared += 1;
    }
    Ok(compared)
}
