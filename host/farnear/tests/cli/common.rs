//! Runs the program and checks its output.

use std::{
    fs,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{self, Child, Stdio},
    sync::LazyLock,
};

use assert_cmd::Command;
use serde_json::Value;

/// The program, with its own cache instead of the user's.
pub fn farnear(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_farnear"));
    command.env("XDG_CACHE_HOME", concat!(env!("CARGO_TARGET_TMPDIR"), "/cache")).args(arguments);
    command
}

/// A command of an emulated rig that is started for it, with the stages near their home switches.
pub fn on_the_rig(arguments: &[&str]) -> Command {
    let mut command = farnear(&["rig"]);
    command.args(arguments).args(["--port", "sim", "--faults", NEAR_HOME]);
    command
}

/// A file of `--faults`: homing takes less time.
pub const NEAR_HOME: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/cli/near-home.toml");

/// An emulated rig for several commands, because each start of one translates the firmware again.
pub struct SharedRig {
    child: Child,
    pub port: String,
    pub camera: String,
}

impl SharedRig {
    /// `faults` is a file of `--faults`.
    pub fn start(faults: &str) -> Self {
        let mut child = process::Command::new(built(SIM))
            .args(["run", "--tcp", "--faults", faults])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("farnear-sim starts");
        let mut line = String::new();
        let output = child.stdout.take().expect("its output");
        BufReader::new(output).read_line(&mut line).expect("text");
        let address: Value = serde_json::from_str(&line).expect("one line of JSON");
        let text = |key: &str| address[key].as_str().expect("an address").to_owned();
        Self { child, port: text("port"), camera: text("camera") }
    }

    /// A command that takes no picture.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = farnear(&["rig"]);
        command.args(arguments).args(["--port", &self.port]);
        command
    }

    pub fn with_camera(&self, arguments: &[&str]) -> Command {
        let mut command = self.command(arguments);
        command.args(["--camera", &self.camera]);
        command
    }
}

impl Drop for SharedRig {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// True depths of the emulated rig's usual scene with [`rig_optics`], rendered once.
pub fn true_staircase() -> &'static str {
    static TRUTH: LazyLock<String> = LazyLock::new(|| {
        let out = concat!(env!("CARGO_TARGET_TMPDIR"), "/staircase");
        let _ = fs::remove_dir_all(out); // of an earlier run
        succeeds(&mut farnear(&["render", "--optics", rig_optics(), "--out", out]));
        format!("{out}/truth.npy")
    });
    &TRUTH
}

/// The optics of the rig in docs/: 933 to 886.81 mm, Gaussian.
pub fn rig_optics() -> &'static str {
    concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/rig.toml")
}

pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn text(&self, name: &str) -> String {
        self.path(name).to_str().expect("temporary folders have plain names").into()
    }

    /// Writes a file and returns its path as an argument.
    pub fn file(&self, name: &str, content: impl AsRef<[u8]>) -> String {
        fs::write(self.path(name), content).expect("a writable folder");
        self.text(name)
    }

    /// Everything below the folder, hidden files too.
    pub fn listing(&self) -> Vec<String> {
        let mut names = Vec::new();
        list(self.0.path(), "", &mut names);
        names.sort();
        names
    }
}

fn list(folder: &Path, before: &str, names: &mut Vec<String>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let entry = entry.expect("an entry");
        let name = format!("{before}{}", entry.file_name().to_string_lossy());
        if entry.path().is_dir() {
            list(&entry.path(), &format!("{name}/"), names);
        }
        names.push(name);
    }
}

/// Returns the few lines on stderr, with `phrases`, of a program with this exit code and an empty stdout.
#[track_caller]
pub fn fails(command: &mut Command, code: i32, phrases: &[&str]) -> String {
    let output = command.output().expect("the program starts");
    let stderr = String::from_utf8(output.stderr).expect("messages are UTF-8");
    assert_eq!(output.status.code(), Some(code), "{stderr}");
    for phrase in phrases {
        assert!(stderr.contains(phrase), "{phrase:?} is not in: {stderr}");
    }
    assert!(!stderr.contains("panicked") && !stderr.contains("backtrace"), "{stderr}");
    assert_eq!(String::from_utf8_lossy(&output.stdout), "", "figures of a failure");
    stderr
}

/// Runs a program that succeeds; returns its stdout and stderr.
#[track_caller]
pub fn succeeds(command: &mut Command) -> (String, String) {
    let output = command.output().expect("the program starts");
    let [stdout, stderr] =
        [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).expect("UTF-8"));
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    (stdout, stderr)
}

/// Runs a program whose stdout is exactly one JSON object.
#[track_caller]
pub fn figures(command: &mut Command) -> Value {
    let (stdout, _) = succeeds(command);
    let value: Value = serde_json::from_str(&stdout).unwrap_or_else(|error| panic!("{error}: {stdout}"));
    assert!(value.is_object() && stdout.lines().count() == 1, "{stdout}");
    value
}

#[track_caller]
pub fn number(figures: &Value, key: &str) -> f64 {
    figures[key].as_f64().unwrap_or_else(|| panic!("no number {key} in {figures}"))
}

/// Renders a noisy 8-bit pair of 320 x 240 pixels into `name`: small, because it is rendered often.
#[track_caller]
pub fn render(folder: &Folder, scene: &str, name: &str) {
    let out = folder.text(name);
    let size = ["--width", "320", "--height", "240"];
    succeeds(farnear(&["render", "--scene", scene, "--optics", rig_optics(), "--out", &out]).args(size));
}

pub const SIM: &str = "farnear-sim";

/// A file in the folder of the built programs.
pub fn built(name: &str) -> PathBuf {
    Path::new(env!("CARGO_BIN_EXE_farnear")).with_file_name(name)
}
