use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use farnear_workflows::doctor::{self, DoctorSettings, Finding, Health};

use crate::{report, terminal};

/// Check that this computer has everything farnear needs, and suggest remedies.
///
/// Processor, folders, emulated rig, serial ports and the right to open them, cameras, ffmpeg and, with --port, the board's firmware.
/// Nothing moves; no port is opened but the one that is named. Each line is ok, optional (only some need it) or missing; the exit code is 1
/// where something is missing.
#[derive(Args)]
#[command(after_help = "Example: farnear doctor --port /dev/ttyACM0")]
pub struct Arguments {
    /// Ask the board behind this serial port for its firmware's version.
    #[arg(long, value_name = "PORT")]
    port: Option<String>,
    /// Folders for results to check, besides the current one.
    #[arg(value_name = "DIR")]
    folders: Vec<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: Arguments) -> Result<()> {
    let settings = DoctorSettings { port: arguments.port, folders: arguments.folders };
    let figures = doctor::examine(&settings, &terminal::context()?)?;
    if arguments.json {
        report::print(&figures, true)?;
    } else {
        let lines: String = figures.findings.iter().map(line).collect();
        report::to_stdout(&lines)?;
    }
    match figures.missing() {
        0 => Ok(()),
        1 => bail!("one thing is missing; its line has the remedy"),
        several => bail!("{several} things are missing; their lines have the remedies"),
    }
}

fn line(finding: &Finding) -> String {
    let health = match finding.health {
        Health::Ok => "ok",
        Health::Optional => "optional",
        Health::Missing => "missing",
    };
    let Finding { what, found, remedy, .. } = finding;
    let remedy = if remedy.is_empty() { String::new() } else { format!("; {remedy}") };
    format!("{health:<9} {what}: {found}{remedy}\n")
}
