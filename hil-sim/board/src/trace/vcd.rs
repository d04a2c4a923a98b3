//! A run as a value change dump of positions, pulses, exposures, bytes and faults; comments hold what a replay needs.
//! STEP pulses and exposures are exact; positions: each ms of motion; bytes, faults: at stops (every 0.1 ms or less).

use std::{
    fmt::Write as _,
    fs::File,
    io::{BufWriter, Write},
    path::Path,
};

use crate::{
    command::CameraOrder,
    config::{Pace, RigConfig},
    error::SimError,
    plant::{Plant, StageName},
    replay::Comparer,
    scenario::Scenario,
    wiring::{Shot, Wiring},
};

const PERIOD_NS: u64 = 1_000_000;
const SIGNALS: [(&str, u32, char, &str); 11] = [
    ("real", 64, 'c', "coarse_um"),
    ("real", 64, 'l', "lens_um"),
    ("real", 64, 'p', "piezo_um"),
    ("wire", 16, 'd', "dac"),
    ("event", 1, 'C', "step_coarse"),
    ("event", 1, 'L', "step_lens"),
    ("wire", 1, 'e', "exposing"),
    ("wire", 1, 'w', "powered"),
    ("event", 1, 'r', "reset"),
    ("string", 1, 'i', "to_board"),
    ("string", 1, 'o', "to_host"),
];
const HAPPENS: (&str, u32, char, &str) = ("string", 1, 'h', "happens");
pub const BEGINNING: &str = "$version farnear-sim ";
pub const END_OF_HEADING: &str = "$enddefinitions $end";
/// Prefixes of the heading's lines with the rig's configuration.
pub const MADE_OF: [&str; 4] =
    ["$comment firmware ", "$comment pace ", "$comment memory ", "$comment scenario "];

pub fn name_of(letter: char) -> &'static str {
    let all = SIGNALS.iter().chain(std::iter::once(&HAPPENS));
    all.copied().find(|signal| signal.2 == letter).map_or("?", |signal| signal.3)
}

enum Sink {
    File(BufWriter<File>),
    Compare(Comparer),
}

pub struct Vcd {
    sink: Sink,
    /// Changes since the last stop: time and line.
    changes: Vec<(u64, String)>,
    at_ns: Option<u64>,
    next_ns: u64,
    last: [String; 4],
    exposing: bool,
    failed: Option<std::io::Error>,
}

pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
        let _ = write!(text, "{byte:02x}"); // writing to a string cannot fail
        text
    })
}

pub fn unhex(text: &str) -> Option<Vec<u8>> {
    if !text.is_ascii() || text.len() % 2 == 1 {
        return None;
    }
    (0..text.len()).step_by(2).map(|at| u8::from_str_radix(&text[at..at + 2], 16).ok()).collect()
}

fn heading(config: &RigConfig, firmware: u64) -> Result<String, SimError> {
    let scenario = Scenario {
        seed: Some(config.seed),
        parts: toml::Table::try_from(&config.parts).unwrap_or_default(), // parsed from such a table
        ..config.scenario.clone()
    };
    let pace = if config.pace == Pace::Realtime { "paced" } else { "lockstep" };
    let kept = config.memory.as_deref().map(crate::memory_file::read).transpose()?.flatten();
    let memory = kept.map_or(String::new(), |memory| hex(memory.as_slice()));
    let [of_firmware, of_pace, of_memory, of_scenario] = MADE_OF;
    let mut text = format!(
        "{BEGINNING}{} $end\n{of_firmware}{firmware:016x} $end\n{of_pace}{pace} $end\n{of_memory}{memory} $end\n\
         {of_scenario}\n{}$end\n$timescale 1 ns $end\n$scope module rig $end\n",
        env!("CARGO_PKG_VERSION"),
        scenario.text()
    );
    for (kind, size, letter, name) in SIGNALS.iter().chain(std::iter::once(&HAPPENS)) {
        let _ = writeln!(text, "$var {kind} {size} {letter} {name} $end");
    }
    let _ = writeln!(text, "$upscope $end\n{END_OF_HEADING}");
    Ok(text)
}

impl Vcd {
    fn with(sink: Sink) -> Self {
        let mut vcd = Self {
            sink,
            changes: Vec::new(),
            at_ns: None,
            next_ns: 0,
            last: Default::default(),
            exposing: false,
            failed: None,
        };
        vcd.change(0, "1w".into());
        vcd.change(0, "0e".into());
        vcd
    }

    pub fn create(path: &Path, config: &RigConfig, firmware: u64) -> Result<Self, SimError> {
        let wrong =
            |source| SimError::Io { what: format!("cannot write the trace {}", path.display()), source };
        let heading = heading(config, firmware)?;
        let mut file = BufWriter::new(File::create(path).map_err(wrong)?);
        file.write_all(heading.as_bytes()).map_err(wrong)?;
        Ok(Self::with(Sink::File(file)))
    }

    pub fn compare(with: Comparer) -> Self {
        Self::with(Sink::Compare(with))
    }

    fn change(&mut self, at_ns: u64, line: String) {
        self.changes.push((at_ns, line));
    }

    pub fn sent(&mut self, at_ns: u64, bytes: &[u8]) {
        self.change(at_ns, format!("s{} i", hex(bytes)));
    }

    pub fn received(&mut self, at_ns: u64, bytes: &[u8]) {
        if !bytes.is_empty() {
            self.change(at_ns, format!("s{} o", hex(bytes)));
        }
    }

    pub fn happened(&mut self, at_ns: u64, what: &str, reverts: bool) {
        let back = if reverts { "/" } else { "" };
        self.change(at_ns, format!("s{back}{what} h"));
    }

    pub fn reset(&mut self, at_ns: u64, powered: Option<bool>) {
        self.change(at_ns, powered.map_or("1r".into(), |on| format!("{}w", u8::from(on))));
    }

    /// The stop follows the instruction that crosses `asked_ns`.
    pub fn looked(&mut self, at_ns: u64, asked_ns: u64) {
        self.change(at_ns, format!("$comment look {asked_ns} $end"));
    }

    pub fn healed(&mut self, at_ns: u64) {
        self.change(at_ns, "$comment heal $end".into());
    }

    pub fn ordered(&mut self, at_ns: u64, order: CameraOrder) {
        let line = match order {
            CameraOrder::Expose { exposure_us, id } => format!("$comment expose {exposure_us} {id} $end"),
            CameraOrder::FreeRun { period_us, exposure_us } => {
                format!("$comment free-run {period_us} {exposure_us} $end")
            }
        };
        self.change(at_ns, line);
    }

    /// Marks direct access to the rig, which a replay cannot repeat.
    pub fn touched(&mut self, at_ns: u64) {
        self.change(at_ns, "$comment touched $end".into());
    }

    pub fn look(&mut self, now_ns: u64, plant: &Plant, wiring: &mut Wiring, shots: &[Shot]) {
        wiring.record_steps_once();
        for (edges, letter) in wiring.take_steps().into_iter().zip(['C', 'L']) {
            self.changes.extend(edges.into_iter().map(|at_ns| (at_ns, format!("1{letter}"))));
        }
        for shot in shots {
            if !std::mem::take(&mut self.exposing) {
                self.change(shot.begin_ns, "1e".into());
            }
            self.change(shot.end_ns, "0e".into());
        }
        if let Some(begun_ns) = wiring.begun_ns().filter(|_| !self.exposing) {
            self.exposing = true;
            self.change(begun_ns, "1e".into());
        }
        if now_ns >= self.next_ns {
            self.next_ns = now_ns + PERIOD_NS;
            let values = [
                format!("r{:.4} c", plant.stage(StageName::Sensor).position_um()),
                format!("r{:.4} l", plant.stage(StageName::Lens).position_um()),
                format!("r{:.5} p", plant.piezo().position_um()),
                format!("b{:b} d", plant.piezo().dac()),
            ];
            for (value, last) in values.into_iter().zip(0..) {
                if self.last[last] != value {
                    self.last[last].clone_from(&value);
                    self.change(now_ns, value);
                }
            }
        }
        self.flush();
    }

    fn flush(&mut self) {
        let mut changes = std::mem::take(&mut self.changes);
        changes.sort_by_key(|(at_ns, _)| *at_ns);
        for (at_ns, line) in changes {
            let at_ns = at_ns.max(self.at_ns.unwrap_or(0));
            if self.at_ns != Some(at_ns) {
                self.at_ns = Some(at_ns);
                self.write(&format!("#{at_ns}"));
            }
            self.write(&line);
        }
    }

    fn write(&mut self, line: &str) {
        match &mut self.sink {
            Sink::File(file) if self.failed.is_none() => self.failed = writeln!(file, "{line}").err(),
            Sink::File(_) => {}
            Sink::Compare(comparer) => comparer.hold(line),
        }
    }

    pub fn departs(&self) -> bool {
        matches!(&self.sink, Sink::Compare(comparer) if comparer.departs())
    }

    pub fn finish(mut self) -> Result<(), SimError> {
        self.flush();
        let result = match (self.failed.take(), &mut self.sink) {
            (Some(error), _) => Err(error),
            (None, Sink::File(file)) => file.flush(),
            (None, Sink::Compare(comparer)) => {
                comparer.end();
                Ok(())
            }
        };
        result.map_err(|source| SimError::Io { what: "cannot write the trace".into(), source })
    }
}
