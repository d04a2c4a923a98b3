//! What tests share: damaged texts ([`damaged`]), and what some need and not every machine has: real data (photographs, motion capture,
//! video), kept beside the repository and not in it, programs, and the emulated rig.
//!
//! A test that needs them is counted as skipped where they are missing. Its crate's build script calls [`declare`],
//! which sets the configuration `shared_data` where the data are; the test bears
//! `#[cfg_attr(not(shared_data), ignore = "needs the real data beside the repository")]` and finds its files by [`path`].
//!
//! Build scripts watch what they have found, and nothing that was missing: cargo takes that for changed, so that every build would
//! compile the crate anew, and all that use it. `cargo xtask test` has them look again where [`at_hand`] says something else than
//! before.

mod damage;

use std::path::{Path, PathBuf};

pub use damage::damaged;

/// Programs that tests start: the configuration, the file.
const PROGRAMS: [(&str, &str); 2] = [("ffmpeg", "ffmpeg"), ("fake_gige_camera", "arv-fake-gv-camera-0.8")];

/// The folder of the data, whether it is there or not.
fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data")
}

/// For build scripts: the configuration `shared_data` is set where the data are.
pub fn declare() {
    println!("cargo::rustc-check-cfg=cfg(shared_data)");
    found("shared_data", data());
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

/// For build scripts: a configuration is set for each of the programs that tests start, where it is on the PATH. A test that starts
/// it bears `#[cfg_attr(not(NAME), ignore = "needs PROGRAM")]`.
pub fn declare_programs() {
    println!("cargo::rerun-if-env-changed=PATH");
    for (name, program) in PROGRAMS {
        println!("cargo::rustc-check-cfg=cfg({name})");
        found(name, on_the_path(program));
    }
}

/// Where the data and the programs lie that tests may need, as a text that changes with that.
pub fn at_hand() -> String {
    format!("{:?} {:?}\n", data(), PROGRAMS.map(|(_, program)| on_the_path(program)))
}

/// Sets a configuration where something is there.
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

/// A file or folder of the data, e.g. `breakfast/far.png`.
pub fn path(name: &str) -> PathBuf {
    folder().join(name)
}
