//! `farnear rig log`: what the firmware writes into its log.

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};
use clap::Args;
use defmt_decoder::{DecodeError, StreamDecoder, Table};
use farnear_capture::stream::LogPart;

use super::Target;
use crate::report;

/// Longest single wait, so that an interruption is seen soon.
const SLICE: Duration = Duration::from_millis(100);
/// From one question to the next where the board's time stands still unless it is asked something.
const NUDGE: Duration = Duration::from_millis(20);

/// Follow the firmware's log. With the firmware's ELF file it is decoded, without it is printed as bytes.
#[derive(Args)]
#[command(
    after_help = "Example: farnear rig log --port /dev/ttyACM0 --elf farnear-nucleo-f429zi.elf --reset"
)]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    /// The firmware that runs on the board, for the texts that the log only numbers.
    #[arg(long, value_name = "FILE")]
    elf: Option<PathBuf>,
    /// End after this time [default: when interrupted].
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Reset the board first, to see how it starts.
    #[arg(long)]
    reset: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let table = arguments.elf.as_deref().map(read_table).transpose()?;
    let mut printer = Printer { decoder: table.as_ref().map(Table::new_stream_decoder), lines: 0 };
    if arguments.seconds.is_some_and(|seconds| !(0.0..1e9).contains(&seconds)) {
        bail!(report::Usage("--seconds must be a positive time".into()));
    }
    let mut rig = arguments.target.connect(None)?;
    let logs = rig.client.logs()?;
    if arguments.reset {
        rig.client.reboot()?;
    }
    let until = arguments.seconds.map(|seconds| Instant::now() + Duration::from_secs_f64(seconds));
    let mut last_nudge = Instant::now();
    while until.is_none_or(|until| Instant::now() < until) && !rig.client.interrupted() {
        let slice = if rig.client.hello().emulated { NUDGE } else { SLICE };
        if let Some(part) = logs.next_within(slice)? {
            printer.print(&part, table.as_ref())?;
        } else if rig.client.hello().emulated && last_nudge.elapsed() >= NUDGE {
            // Virtual time passes while a question is unanswered only.
            rig.client.status()?;
            last_nudge = Instant::now();
        }
    }
    eprintln!("{} lines", printer.lines);
    Ok(())
}

fn read_table(path: &Path) -> Result<Table> {
    let elf = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    match Table::parse(&elf) {
        Ok(Some(table)) => Ok(table),
        Ok(None) => bail!("{} has no texts of a log in it: is it the firmware's ELF file?", path.display()),
        Err(error) => bail!("{} is not the firmware's ELF file: {error}", path.display()),
    }
}

struct Printer<'a> {
    decoder: Option<Box<dyn StreamDecoder + Send + Sync + 'a>>,
    lines: usize,
}

impl<'a> Printer<'a> {
    fn print(&mut self, part: &LogPart, table: Option<&'a Table>) -> Result<()> {
        if part.missing > 0 {
            eprintln!("{} pieces of the log are missing", part.missing);
            // What has come of a frame is of no use without its rest.
            self.decoder = table.map(Table::new_stream_decoder);
        }
        let Some(decoder) = &mut self.decoder else {
            self.lines += 1;
            let hex: String = part.bytes.iter().map(|byte| format!("{byte:02x}")).collect();
            return report::to_stdout(format!("{hex}\n").as_bytes());
        };
        decoder.received(&part.bytes);
        let mut text = Vec::new();
        loop {
            match decoder.decode() {
                Ok(frame) => {
                    self.lines += 1;
                    writeln!(text, "{}", frame.display(false))?;
                }
                Err(DecodeError::UnexpectedEof) => break,
                // A damaged frame is passed over; the next one begins behind it.
                Err(DecodeError::Malformed) => {
                    eprintln!("a piece of the log is damaged, or of another firmware")
                }
            }
        }
        report::to_stdout(&text)
    }
}
