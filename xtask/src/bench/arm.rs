//! Instructions per pixel on 64-bit ARM and x86-64 by qemu, which shows whether the vectors are used, but no times.

use std::{
    fmt::Write as _,
    fs,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use anyhow::{Context, Result, bail};
use serde_json::Value;

use crate::{
    arm,
    run::{cargo, output, step},
};

const HEADING: &str = "## On 64-bit ARM\n";
/// Of the pair in `one_chain`.
const PIXELS: u64 = 96 * 128;
/// The first chain allocates its buffers; the figure is the difference to this many.
const TIMES: u64 = 2;

/// With `write`, replaces the section at the end of the page.
pub fn renew(write: bool) -> Result<()> {
    let section = count_all()?;
    println!("\n{section}");
    if write {
        let page = page()?;
        let before = page.find(HEADING).map_or(&page[..], |start| &page[..start]);
        super::write(&super::page_file(), &format!("{}\n\n{section}", before.trim_end()))?;
    }
    Ok(())
}

/// The page's present section; empty if missing.
pub fn kept() -> Result<String> {
    let page = page()?;
    Ok(page.find(HEADING).map_or(String::new(), |start| page[start..].to_owned()))
}

fn page() -> Result<String> {
    let file = super::page_file();
    fs::read_to_string(&file).with_context(|| format!("cannot read {}", file.display()))
}

fn count_all() -> Result<String> {
    if let Some(missing) = arm::missing() {
        bail!("instructions on 64-bit ARM cannot be counted: {missing}");
    }
    let mut text = format!(
        "{HEADING}\nInstructions per pixel of `chain_640x480`'s run time (one thread, a pair of 128x96 with its rims, so rather too many), counted by qemu's user mode, which \
         executes one at a time and writes each down (`cargo xtask bench --arm`): the difference between {TIMES} chains and one. Built as `cargo xtask demo` builds the programs. A NEON vector has 4 lanes, one of AVX2 8. No times: no such processor was available.\n\n\
         | processor | vector unit | instructions per pixel |\n|---|---|--:|\n"
    );
    for (processor, target, emulator, units) in [
        ("64-bit ARM", Some(arm::TARGET), arm::emulator(), ["neon", "portable"].as_slice()),
        ("x86-64", None, ["qemu-x86_64", "-cpu", "max"], ["avx2"].as_slice()),
    ] {
        let program = build(target)?;
        for unit in units {
            step(&format!("instructions: {processor}, {unit}"));
            let [one, more] =
                [1, TIMES].map(|times| count(&emulator, &program, &[(*unit).into(), times.to_string()]));
            let per_pixel = (more? - one?) as f64 / ((TIMES - 1) * PIXELS) as f64;
            // Writing to a string cannot fail.
            let _ = writeln!(text, "| {processor} | {unit} | {per_pixel:.0} |");
        }
    }
    Ok(text)
}

/// `None`: this machine.
fn build(target: Option<&str>) -> Result<PathBuf> {
    let mut command = cargo(["build", "--locked", "--package", "farnear-depth"]);
    command.args(["--bench", "one_chain", "--message-format", "json-render-diagnostics"]);
    if let Some(target) = target {
        command.args(["--target", target]);
    }
    let messages = output(arm::for_target(&mut command))?;
    messages
        .lines()
        .filter_map(|line| serde_json::from_str::<Value>(line).ok())
        .filter(|message| message["target"]["name"] == "one_chain")
        .find_map(|message| message["executable"].as_str().map(PathBuf::from))
        .context("cargo built no one_chain")
}

fn count(emulator: &[&str; 3], program: &Path, arguments: &[String]) -> Result<u64> {
    let [name, options @ ..] = emulator;
    let help = output(Command::new(name).arg("-help"))?;
    // Renamed in qemu 8.1.
    let each = if help.contains("-one-insn-per-tb") { "-one-insn-per-tb" } else { "-singlestep" };
    let mut child = Command::new(name)
        .args(options)
        .args([each, "-d", "exec,nochain"])
        .arg(program)
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .with_context(|| format!("cannot start {name}"))?;
    let log = child.stderr.take().context("qemu has no output")?;
    let (mut reader, mut line, mut count) = (BufReader::with_capacity(1 << 20, log), Vec::new(), 0);
    while reader.read_until(b'\n', &mut line).context("qemu's log cannot be read")? > 0 {
        count += u64::from(line.starts_with(b"Trace"));
        line.clear();
    }
    let status = child.wait().with_context(|| format!("{name} was lost"))?;
    if !status.success() || count == 0 {
        bail!("{name} {} {}: {status}, {count} instructions", program.display(), arguments.join(" "));
    }
    Ok(count)
}
