//! Firmware log: a defmt stream, decoded with the strings of the firmware's ELF file.

use std::{
    fs, io,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use defmt_decoder::{DecodeError, StreamDecoder, Table};
use farnear_capture::log_stream::LogPart;

use super::{Rig, RigAddress};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
};

const SLICE: Duration = Duration::from_millis(100);
/// Interval between requests if the board's time stops without them.
const NUDGE: Duration = Duration::from_millis(20);
const TEXTS: &str = "the texts of the firmware's log";

#[derive(Clone, PartialEq, Debug)]
pub struct LogSettings {
    pub rig: RigAddress,
    /// Firmware on the board; without it the log is passed on as bytes.
    pub elf: Option<PathBuf>,
    /// End after this time; without it, when cancelled.
    pub seconds: Option<f64>,
    pub reset: bool,
}

pub trait LogSink {
    fn line(&mut self, line: &str) -> io::Result<()>;
}

impl<F: FnMut(&str) -> io::Result<()>> LogSink for F {
    fn line(&mut self, line: &str) -> io::Result<()> {
        self(line)
    }
}

/// Ends when the time is up or when cancelled (not an error). Returns the number of lines.
pub fn follow(settings: &LogSettings, sink: &mut dyn LogSink, context: &Context<'_>) -> Result<usize> {
    let table = settings.elf.as_deref().map(read_table).transpose()?;
    if let Some(seconds) = settings.seconds.filter(|seconds| !(0.0..1e9).contains(seconds)) {
        return Err(WorkflowError::parameter("seconds", seconds, "expected a positive time"));
    }
    let mut rig = Rig::connect(&settings.rig, None, context)?;
    let logs = rig.client.logs()?;
    if settings.reset {
        rig.client.reboot()?;
    }
    let mut reader = Reader::new(table.as_ref(), sink, context);
    let emulated = rig.client.hello().emulated;
    let slice = if emulated { NUDGE } else { SLICE };
    let until = settings.seconds.map(|seconds| Instant::now() + Duration::from_secs_f64(seconds));
    let mut last_nudge = Instant::now();
    while until.is_none_or(|until| Instant::now() < until) && !context.cancel.is_cancelled() {
        if let Some(part) = logs.next_within(slice)? {
            reader.take(&part)?;
        } else if emulated && last_nudge.elapsed() >= NUDGE {
            // Virtual time advances only while a request is unanswered.
            rig.client.status()?;
            last_nudge = Instant::now();
        }
    }
    context.info(&format!("{} lines", reader.lines));
    Ok(reader.lines)
}

fn read_table(path: &Path) -> Result<Table> {
    let elf = fs::read(path).map_err(WorkflowError::read("the firmware", path))?;
    match Table::parse(&elf) {
        Ok(Some(table)) => Ok(table),
        Ok(None) => Err(WorkflowError::file(path, TEXTS)("it has none; is it the firmware's ELF file?")),
        Err(error) => {
            Err(WorkflowError::file(path, TEXTS)(format!("it is not the firmware's ELF file: {error}")))
        }
    }
}

struct Reader<'a> {
    table: Option<&'a Table>,
    decoder: Option<Box<dyn StreamDecoder + Send + Sync + 'a>>,
    sink: &'a mut dyn LogSink,
    context: &'a Context<'a>,
    lines: usize,
}

impl<'a> Reader<'a> {
    fn new(table: Option<&'a Table>, sink: &'a mut dyn LogSink, context: &'a Context<'a>) -> Self {
        Self { table, decoder: table.map(Table::new_stream_decoder), sink, context, lines: 0 }
    }

    fn take(&mut self, part: &LogPart) -> Result<()> {
        if part.missing > 0 {
            self.context.info(&format!("{} pieces of the log are missing", part.missing));
            // An incomplete frame is useless.
            self.decoder = self.table.map(Table::new_stream_decoder);
        }
        let Some(decoder) = &mut self.decoder else {
            let hex: String = part.bytes.iter().map(|byte| format!("{byte:02x}")).collect();
            return self.line(&hex);
        };
        decoder.received(&part.bytes);
        while let Some(decoder) = &mut self.decoder {
            let frame = decoder.decode().map(|frame| frame.display(false).to_string());
            match frame {
                Ok(line) => self.line(&line)?,
                Err(DecodeError::UnexpectedEof) => break,
                // Skip a damaged frame; the next one begins after it.
                Err(DecodeError::Malformed) => {
                    self.context.info("a piece of the log is damaged, or of another firmware");
                }
            }
        }
        Ok(())
    }

    fn line(&mut self, line: &str) -> Result<()> {
        self.lines += 1;
        self.sink.line(line).map_err(|source| WorkflowError::Sink { source })
    }
}
