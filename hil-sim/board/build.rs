//! Sets `pyserial` where Python has that package; elsewhere the Python client's test is skipped.

use std::process::Command;

fn main() {
    println!("cargo::rustc-check-cfg=cfg(pyserial)");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=PYTHONPATH");
    let imported = Command::new("python3").args(["-c", "import serial"]).output();
    if imported.is_ok_and(|run| run.status.success()) {
        println!("cargo::rustc-cfg=pyserial");
    }
}
