//! File with the plant's true state: CSV for tables, VCD for waveform viewers and [`crate::replay`].

mod csv;
pub mod vcd;

use std::path::Path;

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

impl Trace {
    pub fn create(path: &Path, config: &RigConfig, firmware: u64) -> Result<Self, SimError> {
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
