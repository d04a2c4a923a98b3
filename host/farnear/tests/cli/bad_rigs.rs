//! The emulated rig missing, incomplete, killed, or on a bad line.

use std::{
    fs,
    io::{BufRead, BufReader, Read},
    process::{Child, Command, Stdio},
};

use assert_cmd::Command as Assert;
use farnear_files::image_file::read_grey;
use serde_json::Value;

use crate::common::{Folder, SIM, built, fails, farnear, rig_optics, succeeds};

/// A copy of the program alone in a folder, with an empty PATH.
fn alone(folder: &Folder) -> Assert {
    let copy = folder.path("farnear");
    fs::copy(env!("CARGO_BIN_EXE_farnear"), &copy).expect("a copy");
    let mut command = Assert::new(copy);
    command.env("PATH", "").env_remove("FARNEAR_FIRMWARE");
    command.args(["rig", "capture", "--port", "sim", "--optics", rig_optics(), "--out", &folder.text("out")]);
    command
}

#[test]
fn a_missing_simulator_is_named_with_what_to_do() {
    let folder = Folder::new();
    fails(
        &mut alone(&folder),
        1,
        &["farnear-sim is neither next to this program nor on the PATH", "cargo xtask"],
    );
    assert_eq!(folder.listing(), ["farnear"]);
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn a_missing_or_broken_firmware_is_named_with_what_to_do() {
    let folder = Folder::new();
    fs::copy(built(SIM), folder.path(SIM)).expect("a copy");
    let mut command = alone(&folder);
    let elf = "farnear-nucleo-f429zi.elf";
    fails(&mut command, 1, &["no firmware at", elf, "cargo xtask firmware", "--firmware"]);
    assert_eq!(folder.listing(), ["farnear", SIM]);
    for (content, reason) in
        [("", "empty or cut short"), ("not a program", "not an ELF"), ("\x7fELF", "cannot be loaded")]
    {
        folder.file(elf, content);
        fails(&mut command, 1, &[elf, "cannot be loaded", reason]);
        assert_eq!(folder.listing(), ["farnear", elf, SIM]);
    }
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn errors_of_the_simulator_are_forwarded() {
    let folder = Folder::new();
    let typo = folder.file("faults.toml", "bit_eror_rate = 0.1");
    let messages = ["bit_eror_rate", "farnear-sim ended at once"];
    fails(farnear(&["rig", "info", "--port", "sim"]).args(["--faults", &typo]), 1, &messages);
    let messages = ["no firmware at", "none.elf", "farnear-sim ended at once"];
    fails(farnear(&["rig", "info", "--port", "sim"]).args(["--firmware", "none.elf"]), 1, &messages);
}

fn capture(folder: &Folder, faults: &str, out: &str) -> Assert {
    let mut command = farnear(&["rig", "capture", "--port", "sim", "--optics", rig_optics()]);
    let faults = format!("start_um = [60.0, 80.0]\n{faults}\n");
    command.args(["--out", &folder.text(out), "--faults", &folder.file("faults.toml", faults)]);
    command
}

fn wait_for(output: &mut impl BufRead, phrase: &str) -> String {
    let mut line = String::new();
    while !line.contains(phrase) {
        line.clear();
        assert!(output.read_line(&mut line).expect("text") > 0, "it ended without {phrase:?}");
    }
    line
}

struct Reaped(Child);

impl Drop for Reaped {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn a_simulator_that_is_killed_ends_the_capture_without_a_trace() {
    let folder = Folder::new();
    let mut command = Command::new(built(SIM));
    command.args(["run", "--optics", rig_optics()]).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut simulator = Reaped(command.spawn().expect("farnear-sim starts"));
    let output = simulator.0.stdout.take().expect("its output");
    let line = wait_for(&mut BufReader::new(output), "port");
    let address: Value = serde_json::from_str(&line).expect("one line of JSON");
    let text = |key: &str| address[key].as_str().expect("an address").to_string();

    let mut command = Command::new(env!("CARGO_BIN_EXE_farnear"));
    command.args(["rig", "capture", "--port", &text("port"), "--camera", &text("camera")]);
    command.args(["--optics", rig_optics(), "--out", &folder.text("out")]).stderr(Stdio::piped());
    let mut program = Reaped(command.spawn().expect("farnear starts"));
    let mut messages = BufReader::new(program.0.stderr.take().expect("its messages"));
    wait_for(&mut messages, "homing");
    simulator.0.kill().expect("it was running");
    let mut rest = String::new();
    messages.read_to_string(&mut rest).expect("text");
    let status = program.0.wait().expect("it ends");
    assert_eq!(status.code(), Some(1), "{rest}");
    assert!(rest.contains("went away while") && rest.contains(&text("port")), "{rest}");
    assert_eq!(folder.listing(), Vec::<String>::new());
}

#[test]
#[cfg_attr(not(emulated_rig), ignore = "needs farnear-sim: cargo xtask test")]
fn a_bad_line_changes_nothing_or_fails_cleanly() {
    let folder = Folder::new();
    succeeds(&mut capture(&folder, "", "clean"));
    let images = |name: &str| {
        ["far.png", "near.png"]
            .map(|file| fs::read(folder.path(&format!("{name}/{file}"))).expect("an image"))
    };
    // A foreign frame, half a frame, delimiters: as from a terminal that was left open.
    succeeds(&mut capture(&folder, "garbage = [3, 255, 0, 66, 17, 0, 0, 9]", "garbage"));
    assert!(images("clean") == images("garbage"));
    let record = |name: &str| fs::read(folder.path(&format!("{name}/capture.toml"))).expect("a record");
    assert!(record("clean") == record("garbage"));

    let before = folder.listing();
    let output = capture(&folder, "bit_error_rate = 1e-4", "noisy").output().expect("it starts");
    let messages = String::from_utf8_lossy(&output.stderr);
    match output.status.code() {
        Some(0) => {
            // Retries take time, in which the piezo drifts by some nanometres within its window.
            for file in ["far.png", "near.png"] {
                let picture =
                    |name: &str| read_grey(&folder.path(&format!("{name}/{file}"))).expect("an image").pixels;
                let difference = (picture("clean") - picture("noisy")).mapv(f32::abs);
                assert!(difference.mean() < Some(2.0), "{file}: {:?}", difference.mean());
            }
        }
        Some(1) => {
            assert!(messages.contains("farnear: "), "{messages}");
            assert_eq!(folder.listing(), before);
        }
        other => panic!("{other:?}: {messages}"),
    }
}
