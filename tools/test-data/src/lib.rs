//! Shared by tests: damaged texts ([`damaged`]), numbers of cases ([`cases`]), and optional resources: real data,
//! programs, and the emulated rig. Tests without their resource count as skipped. The crate's build script calls [`declare`], which sets the
//! configuration `shared_data`; the test has `#[cfg_attr(not(shared_data), ignore = "needs the real data beside
//! the repository")]` and uses [`path`]. Build scripts watch only files that exist: cargo treats missing ones as
//! changed and would rebuild the crate each time. `cargo xtask test` reruns them when [`at_hand`] changes.

mod damage;

use std::path::{Path, PathBuf};

pub use damage::damaged;

/// Programs started by tests: configuration and file name.
const PROGRAMS: [(&str, &str); 3] =
    [("ffmpeg", "ffmpeg"), ("fake_gige_camera", "arv-fake-gv-camera-0.8"), ("typos", "typos")];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data")
}

/// For build scripts: sets `shared_data` if the data exist.
pub fn declare() {
    println!("cargo::rustc-check-cfg=cfg(shared_data)");
    found("shared_data", data());
}

/// For build scripts: sets `emulated_rig` if `FARNEAR_REQUIRE_SIM=1`, which `cargo xtask test` sets after
/// building `farnear-sim` and its firmware. Tests use `#[cfg_attr(not(emulated_rig), ignore = "needs
/// farnear-sim: cargo xtask test")]`.
pub fn declare_emulated_rig() {
    println!("cargo::rustc-check-cfg=cfg(emulated_rig)");
    println!("cargo::rerun-if-env-changed=FARNEAR_REQUIRE_SIM");
    if std::env::var_os("FARNEAR_REQUIRE_SIM").is_some_and(|value| value == "1") {
        println!("cargo::rustc-cfg=emulated_rig");
    }
}

/// For build scripts: sets a configuration per program on the PATH. Tests use
/// `#[cfg_attr(not(NAME), ignore = "needs PROGRAM")]`.
pub fn declare_programs() {
    println!("cargo::rerun-if-env-changed=PATH");
    for (name, program) in PROGRAMS {
        println!("cargo::rustc-check-cfg=cfg({name})");
        found(name, on_the_path(program));
    }
}

/// Locations of data and programs, as a text that changes with them.
pub fn at_hand() -> String {
    format!("{:?} {:?}\n", data(), PROGRAMS.map(|(_, program)| on_the_path(program)))
}

fn found(name: &str, place: Option<PathBuf>) {
    println!("cargo::rerun-if-changed=build.rs");
    if let Some(place) = place {
        println!("cargo::rerun-if-changed={}", place.display());
        println!("cargo::rustc-cfg={name}");
    }
}

fn data() -> Option<PathBuf> {
    Some(folder()).filter(|folder| folder.is_dir())
}

fn on_the_path(program: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path).map(|folder| folder.join(program)).find(|place| place.is_file())
}

/// Cases of a property: `PROPTEST_CASES` when fuzzing, else `usual`.
pub fn cases(usual: u32) -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

/// A file or folder of the data, e.g. `breakfast/far.png`.
pub fn path(name: &str) -> PathBuf {
    folder().join(name)
}
