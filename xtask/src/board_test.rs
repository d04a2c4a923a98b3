//! Test of a real board without a rig, by the firmware `farnear-board-test`; without `--port` on the emulated board.
//!
//! embedded-test and defmt-test report through the probe only. This report comes by the serial port of the ST-LINK, so
//! that it also tests the link at each rate and runs on the emulated board.

use std::{
    fmt::Write as _,
    fs,
    io::{Read, Write},
    path::{Path, PathBuf},
    process::Command,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};

use crate::{
    firmware, host,
    run::{finish, output, step},
};

const CHIP: &str = "STM32F429ZITx";
const RATES: [u32; 2] = [2_000_000, 921_600];
/// A report at each rate takes 0.6 s; both resets 0.3 s.
const PATIENCE: Duration = Duration::from_secs(15);

/// Options of `cargo xtask board-test`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Serial port of the NUCLEO's ST-LINK, e.g. /dev/ttyACM0; default: the emulated board.
    #[arg(long)]
    port: Option<PathBuf>,
    /// Report file
    #[arg(long, default_value = "out/board-test.txt")]
    out: PathBuf,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    firmware::build()?;
    let elf = firmware::board_test()?;
    let text = match &arguments.port {
        None => {
            let programs = host::build()?;
            step("board test on the emulated board");
            output(Command::new(programs.join("farnear-sim")).arg("board-test").arg(&elf))?
        }
        Some(port) => on_real_board(port, &elf)?,
    };
    let report = summary(&text)?;
    if let Some(folder) = arguments.out.parent() {
        fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    }
    fs::write(&arguments.out, &report.text)
        .with_context(|| format!("cannot write {}", arguments.out.display()))?;
    print!("{}", report.text);
    println!("written to {}", arguments.out.display());
    if report.failed > 0 {
        bail!("{} checks failed: look at the wires of docs/bring-up.md, then send the report", report.failed);
    }
    Ok(())
}

fn on_real_board(port: &Path, elf: &Path) -> Result<String> {
    step("board test: flash");
    let probe = |arguments: &[&str]| {
        finish(Command::new("probe-rs").args(arguments).args(["--chip", CHIP]))
            .context("install probe-rs: https://probe.rs/docs/getting-started/installation")
    };
    probe(&["download", &elf.display().to_string()])?;
    probe(&["reset"])?;
    let mut text = String::new();
    for rate in RATES {
        step(&format!("board test: report at {rate} baud"));
        text += &listen(port, rate)?;
    }
    Ok(text)
}

/// Sends the pattern when the board listens; returns the report at this rate.
fn listen(port: &Path, rate: u32) -> Result<String> {
    let name = port.display();
    // A raw port without a crate: Linux only, as probe and udev rules of the documents.
    finish(Command::new("stty").arg("-F").arg(port).args([
        &rate.to_string(),
        "raw",
        "-echo",
        "min",
        "0",
        "time",
        "1",
    ]))?;
    let open = || fs::OpenOptions::new().read(true).write(true).open(port);
    let mut serial = open().with_context(|| format!("cannot open {name}: is it the ST-LINK's port?"))?;
    let (mut bytes, begin) = (Vec::new(), Instant::now());
    let (ready, end) = (format!("listen\t{rate}\n"), format!("end\t{rate}\n"));
    let mut sent = false;
    while begin.elapsed() < PATIENCE {
        let mut piece = [0; 256];
        let count = serial.read(&mut piece).with_context(|| format!("cannot read {name}"))?;
        bytes.extend(&piece[..count]);
        let text = String::from_utf8_lossy(&bytes);
        let Some(at) = text.find(&ready) else { continue };
        if !sent {
            sent = true;
            let pattern: Vec<u8> = (0..=255).collect();
            serial.write_all(&pattern).with_context(|| format!("cannot write to {name}"))?;
        }
        if text[at..].contains(&end) {
            return Ok(text[at..].to_string());
        }
    }
    bail!("no report at {rate} baud from {name} within {} s", PATIENCE.as_secs());
}

struct Report {
    text: String,
    failed: usize,
}

/// The checks of the last report, and the link's at each rate.
fn summary(text: &str) -> Result<Report> {
    let ended = |rate: &u32| text.lines().any(|line| line == format!("end\t{rate}"));
    if let Some(rate) = RATES.iter().find(|rate| !ended(rate)) {
        bail!("the report at {rate} baud is incomplete:\n{text}");
    }
    let mut lines: Vec<[&str; 3]> = Vec::new();
    for line in text.lines() {
        let mut fields = line.splitn(3, '\t');
        let (Some(name), Some(verdict), Some(what)) = (fields.next(), fields.next(), fields.next()) else {
            continue;
        };
        let check = [name, verdict, what];
        if !lines.contains(&check) {
            lines.push(check);
        }
    }
    let count = |wanted: &str| lines.iter().filter(|[_, verdict, _]| *verdict == wanted).count();
    let (passed, failed, skipped) = (count("pass"), count("fail"), count("skip"));
    let mut report = String::new();
    for [name, verdict, what] in &lines {
        // Writing to a string cannot fail.
        let _ = writeln!(report, "{verdict:<5} {name:<18} {what}");
    }
    let _ = writeln!(report, "{passed} passed, {failed} failed, {skipped} skipped");
    Ok(Report { text: report, failed })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_lists_each_check_once_and_counts_failures() {
        let checks = "board\tpass\treal\nsteps\tfail\t0 edges of 40\nFRAM\tskip\tnone\n";
        let text = format!(
            "listen\t2000000\n{checks}link\tpass\t2000000 baud\nend\t2000000\n\
             listen\t921600\n{checks}link\tfail\t921600 baud\nend\t921600\n"
        );
        let report = summary(&text).expect("complete");
        assert!(report.text.ends_with("2 passed, 2 failed, 1 skipped\n"), "{}", report.text);
        assert!(report.text.contains("fail  steps              0 edges of 40\n"), "{}", report.text);
        assert!(summary(checks).is_err(), "without its end");
    }
}
