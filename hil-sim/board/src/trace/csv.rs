//! The plant's true state as CSV: a `tick` row per millisecond with motion, a `shot` row per exposure.

use std::{
    fs::File,
    io::{BufWriter, Write},
    path::Path,
};

use crate::{
    error::SimError,
    plant::{Plant, StageName},
    wiring::Wiring,
};

const PERIOD_NS: u64 = 1_000_000;
pub const HEADING: &str = "time_us,event,coarse_um,lens_um,piezo_um,dac,step_edges,triggers";

pub struct Csv {
    file: BufWriter<File>,
    next_ns: u64,
    last: String,
    failed: Option<std::io::Error>,
}

impl Csv {
    pub fn create(path: &Path) -> Result<Self, SimError> {
        let wrong =
            |source| SimError::Io { what: format!("cannot write the trace {}", path.display()), source };
        let mut file = BufWriter::new(File::create(path).map_err(wrong)?);
        writeln!(file, "{HEADING}").map_err(wrong)?;
        Ok(Self { file, next_ns: 0, last: String::new(), failed: None })
    }

    /// Writes a row if one is due and something has moved.
    pub fn tick(&mut self, now_ns: u64, plant: &Plant, wiring: &Wiring) {
        if now_ns < self.next_ns {
            return;
        }
        self.next_ns = now_ns + PERIOD_NS;
        let row = format!(
            "{:.3},{:.3},{:.4},{},{},{}",
            plant.stage(StageName::Sensor).position_um(),
            plant.stage(StageName::Lens).position_um(),
            plant.piezo().position_um(),
            plant.piezo().dac(),
            step_edges(wiring),
            wiring.camera().triggers()
        );
        if row != self.last {
            self.write(&format!("{},tick,{row}", now_ns / 1000));
            self.last = row;
        }
    }

    pub fn shot(&mut self, shot: &crate::wiring::Shot, plant: &Plant, wiring: &Wiring) {
        self.write(&format!(
            "{},shot,{:.3},{:.3},{:.4},{},{},{}",
            shot.begin_ns / 1000,
            shot.truth.coarse_um,
            shot.truth.lens_um,
            shot.truth.piezo_um,
            plant.piezo().dac(),
            step_edges(wiring),
            wiring.camera().triggers()
        ));
    }

    fn write(&mut self, row: &str) {
        if self.failed.is_none() {
            self.failed = writeln!(self.file, "{row}").err();
        }
    }

    pub fn finish(mut self) -> Result<(), SimError> {
        let result = self.failed.take().map_or_else(|| self.file.flush(), Err);
        result.map_err(|source| SimError::Io { what: "cannot write the trace".into(), source })
    }
}

fn step_edges(wiring: &Wiring) -> u64 {
    wiring.step_edges(StageName::Sensor) + wiring.step_edges(StageName::Lens)
}
