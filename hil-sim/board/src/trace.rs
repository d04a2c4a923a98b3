//! File with the plant's true state: CSV for tables, VCD for waveform viewers and [`crate::replay`].

mod csv;
pub mod vcd;

use std::{
    fs::File,
    io::{self, Read},
    path::Path,
};

use self::{csv::Csv, vcd::Vcd};
use crate::{
    config::RigConfig,
    error::SimError,
    plant::Plant,
    wiring::{Shot, Wiring},
};

pub enum Trace {
    /// `time_us,event,coarse_um,lens_um,piezo_um,dac,step_edges,triggers`.
    Csv(Csv),
    /// Value change dump (IEEE 1364-2005, section 18).
    Vcd(Box<Vcd>),
}

/// First bytes of both kinds.
const BEGINNINGS: [&[u8]; 2] = [csv::HEADING.as_bytes(), vcd::BEGINNING.as_bytes()];

/// Whether a trace may be written there. Another file may be an input of this run, as its scenario or its scene.
fn is_free(path: &Path) -> io::Result<bool> {
    // A pipe or a device has nothing to lose.
    if !path.metadata().is_ok_and(|found| found.is_file()) {
        return Ok(true);
    }
    let longest = BEGINNINGS.iter().map(|beginning| beginning.len()).max().unwrap_or(0);
    let mut start = Vec::new();
    File::open(path)?.take(longest as u64).read_to_end(&mut start)?;
    Ok(start.is_empty() || BEGINNINGS.iter().any(|beginning| start.starts_with(beginning)))
}

impl Trace {
    pub fn create(path: &Path, config: &RigConfig, firmware: u64) -> Result<Self, SimError> {
        let wrong =
            |source| SimError::Io { what: format!("cannot write the trace {}", path.display()), source };
        if !is_free(path).map_err(wrong)? {
            return Err(SimError::NotATrace(path.into()));
        }
        let vcd = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("vcd"));
        if vcd {
            return Ok(Self::Vcd(Box::new(Vcd::create(path, config, firmware)?)));
        }
        Csv::create(path).map(Self::Csv)
    }

    pub fn look(&mut self, now_ns: u64, plant: &Plant, wiring: &mut Wiring, shots: &[Shot]) {
        match self {
            Self::Csv(csv) => {
                csv.tick(now_ns, plant, wiring);
                shots.iter().for_each(|shot| csv.shot(shot, plant, wiring));
            }
            Self::Vcd(vcd) => vcd.look(now_ns, plant, wiring, shots),
        }
    }

    /// The VCD trace; a CSV has no record of the inputs.
    pub fn vcd(&mut self) -> Option<&mut Vcd> {
        match self {
            Self::Csv(_) => None,
            Self::Vcd(vcd) => Some(vcd),
        }
    }

    pub fn finish(self) -> Result<(), SimError> {
        match self {
            Self::Csv(csv) => csv.finish(),
            Self::Vcd(vcd) => vcd.finish(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_trace_replaces_an_older_one_and_no_other_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let config = RigConfig::default();
        for (name, other) in [("run.vcd", "run.csv"), ("run.csv", "run.vcd")] {
            let path = folder.path().join(name);
            for _ in 0..2 {
                Trace::create(&path, &config, 7).and_then(Trace::finish).expect("writable");
            }
            fs::rename(&path, folder.path().join(other)).expect("renamed");
            Trace::create(&folder.path().join(other), &config, 7).expect("of the other kind");
        }
        let scenario = folder.path().join("scenario.toml");
        fs::write(&scenario, "seed = 3").expect("writable");
        let refused = Trace::create(&scenario, &config, 7).err().map(|error| error.to_string());
        assert!(refused.is_some_and(|text| text.contains("scenario.toml")), "it is replaced");
        assert_eq!(fs::read_to_string(&scenario).expect("readable"), "seed = 3");
    }
}
