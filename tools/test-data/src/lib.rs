//! What tests share: damaged texts ([`damaged`]), and what some need and not every machine has: real data (photographs, motion capture, video), kept beside the
//! repository and not in it, and the emulated rig.
//!
//! A test that needs them is counted as skipped where they are missing. Its crate's build script calls [`declare`],
//! which sets the configuration `shared_data` where the data are; the test bears
//! `#[cfg_attr(not(shared_data), ignore = "needs the real data beside the repository")]` and finds its files by [`path`].

mod damage;

use std::path::{Path, PathBuf};

pub use damage::damaged;

/// The folder of the data, whether it is there or not.
fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data")
}

/// For build scripts: the configuration `shared_data` is set where the data are.
pub fn declare() {
    println!("cargo::rustc-check-cfg=cfg(shared_data)");
    println!("cargo::rerun-if-changed=build.rs");
    // A path that is missing counts as changed, so that data that come later are found.
    println!("cargo::rerun-if-changed={}", folder().display());
    if folder().is_dir() {
        println!("cargo::rustc-cfg=shared_data");
    }
}

/// For build scripts: the configuration `emulated_rig` is set where `FARNEAR_REQUIRE_SIM=1` says that `farnear-sim` and its
/// firmware have been built, as `cargo xtask test` does. A test that starts them bears
/// `#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]`.
pub fn declare_emulated_rig() {
    println!("cargo::rustc-check-cfg=cfg(emulated_rig)");
    println!("cargo::rerun-if-env-changed=FARNEAR_REQUIRE_SIM");
    if std::env::var_os("FARNEAR_REQUIRE_SIM").is_some_and(|value| value == "1") {
        println!("cargo::rustc-cfg=emulated_rig");
    }
}

/// For build scripts: the configuration `name` is set where the program is on the PATH. A test that starts it bears
/// `#[cfg_attr(not(NAME), ignore = "needs PROGRAM")]`.
pub fn declare_program(name: &str, program: &str) {
    println!("cargo::rustc-check-cfg=cfg({name})");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=PATH");
    let path = std::env::var_os("PATH").unwrap_or_default();
    let places: Vec<PathBuf> = std::env::split_paths(&path).map(|folder| folder.join(program)).collect();
    for place in &places {
        // A place that is missing counts as changed, so that a program that is installed later is found.
        println!("cargo::rerun-if-changed={}", place.display());
    }
    if places.iter().any(|place| place.is_file()) {
        println!("cargo::rustc-cfg={name}");
    }
}

/// A file or folder of the data, e.g. `breakfast/far.png`.
pub fn path(name: &str) -> PathBuf {
    folder().join(name)
}
