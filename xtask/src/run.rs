//! Runs other programs, with the flags for cargo calls in this repository.

use std::{
    ffi::OsStr,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::LazyLock,
    time::Instant,
};

use anyhow::{Context, Result, bail};

pub static ROOT: LazyLock<PathBuf> = LazyLock::new(|| {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(1).unwrap_or(Path::new(".")).into()
});

/// Oldest compiler for the emulator's crates without `--ignore-rust-version` (rigless requires 1.98).
const EMULATOR_RUST_MINOR: u32 = 98;

pub fn target_folder() -> PathBuf {
    match std::env::var_os("CARGO_TARGET_DIR") {
        Some(folder) => ROOT.join(folder),
        None => ROOT.join("target"),
    }
}

/// Cargo in the root workspace; its flag lets older compilers build the emulator, which no configuration key can do.
pub fn cargo<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    let mut arguments = arguments.into_iter();
    if let Some(job) = arguments.next() {
        command.arg(&job);
        let compiles =
            ["build", "check", "run", "test", "clippy", "doc"].iter().any(|known| job.as_ref() == *known);
        if compiles && host_rust_minor().is_some_and(|minor| minor < EMULATOR_RUST_MINOR) {
            command.arg("--ignore-rust-version");
        }
    }
    command.args(arguments).current_dir(&*ROOT);
    command
}

fn host_rust_minor() -> Option<u32> {
    let output = Command::new("rustc").arg("--version").current_dir(&*ROOT).output().ok()?;
    // "rustc 1.95.0 (...)"
    let text = String::from_utf8(output.stdout).ok()?;
    text.split_whitespace().nth(1)?.split('.').nth(1)?.parse().ok()
}

pub fn step(what: &str) {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    let seconds = START.elapsed().as_secs();
    eprintln!("\n== {}:{:02} {what}", seconds / 60, seconds % 60);
}

/// Fails unless the program succeeds.
pub fn finish(command: &mut Command) -> Result<()> {
    let status = command.status().with_context(|| format!("cannot start {}", describe(command)))?;
    if !status.success() {
        bail!("failed ({status}): {}", describe(command));
    }
    Ok(())
}

pub fn output(command: &mut Command) -> Result<String> {
    command.stderr(Stdio::inherit());
    let output = command.output().with_context(|| format!("cannot start {}", describe(command)))?;
    if !output.status.success() {
        bail!("failed ({}): {}", output.status, describe(command));
    }
    String::from_utf8(output.stdout).with_context(|| format!("{} printed no text", describe(command)))
}

/// Whether a program succeeds; prints nothing.
pub fn succeeds(command: &mut Command) -> bool {
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

pub fn has(program: &str) -> bool {
    succeeds(Command::new(program).arg("--version"))
}

pub fn has_aravis() -> bool {
    succeeds(Command::new("pkg-config").args(["--exists", "aravis-0.8 >= 0.8.25"]))
}

/// Features of every cargo call, so that nothing is compiled twice: `genicam` where its library is installed.
pub fn features() -> &'static [&'static str] {
    if has_aravis() { &["--features", "farnear/genicam"] } else { &[] }
}

/// Whether the toolchain on the PATH has a target's libraries.
pub fn has_target(triple: &str) -> bool {
    let folder = Command::new("rustc").args(["--print", "target-libdir", "--target", triple]).output();
    folder.is_ok_and(|found| {
        found.status.success() && Path::new(String::from_utf8_lossy(&found.stdout).trim()).is_dir()
    })
}

/// Lets rustup add a target that is missing; fails with the command to type.
pub fn add_target(triple: &str) -> Result<(), String> {
    if has_target(triple) || succeeds(Command::new("rustup").args(["target", "add", triple])) {
        return Ok(());
    }
    Err(format!("the target is missing: rustup target add {triple}"))
}

pub fn cargo_home() -> Option<PathBuf> {
    let usual = || std::env::home_dir().map(|home| home.join(".cargo"));
    std::env::var_os("CARGO_HOME").map(PathBuf::from).or_else(usual)
}

pub fn describe(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words.map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ")
}
