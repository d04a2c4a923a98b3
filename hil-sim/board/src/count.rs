//! Instruction counts by the firmware `farnear-count` at a cycle each: lower bounds, as a real board has wait states.

use std::path::Path;

use object::{Object, ObjectSymbol};
use rigless::{
    emulator::{self, Host, Memory, Settled, Start, Stop, run},
    image::Image,
    session::Session,
    soc::Width,
    time::VirtualNanos,
};

use crate::{
    board::RigBoard,
    chips::SharedPlant,
    error::SimError,
    firmware,
    parts::{Parts, ProcessorParts},
    plant::Plant,
    processor::Costs,
    serial::Line,
};

/// Symbols of the routine table and the counts.
const ROUTINES: &str = "FARNEAR_ROUTINES";
const COUNTS: &str = "FARNEAR_COUNTS";
const ROUTINE_BYTES: u64 = 24;
const COUNT_BYTES: u64 = 4;
/// Longer than all routines together.
const PATIENCE_NS: u64 = 10_000_000_000;
/// Polling interval.
const LOOK_NS: u64 = 1_000_000;

#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Count {
    pub routine: String,
    pub unit: String,
    pub units: u32,
    pub instructions: u32,
}

impl Count {
    pub fn per_unit(&self) -> f64 {
        f64::from(self.instructions) / f64::from(self.units.max(1))
    }
}

fn place(elf: &object::File<'_>, name: &str) -> Option<(u64, u64)> {
    let found = elf.symbols().find(|symbol| symbol.name() == Ok(name))?;
    Some((found.address(), found.size()))
}

struct Counting {
    routines: u64,
    counts: u64,
    number: u64,
    result: Option<Vec<Count>>,
}

fn word(host: &mut dyn Host, address: u64) -> u32 {
    Memory::read(host, address, Width::W32).map_or(0, |word| word as u32)
}

fn text(host: &mut dyn Host, at: u32, length: u32) -> String {
    let bytes = (0..u64::from(length.min(200)))
        .filter_map(|i| Memory::read(host, u64::from(at) + i, Width::W8).ok())
        .map(|byte| byte as u8);
    String::from_utf8_lossy(&bytes.collect::<Vec<u8>>()).into_owned()
}

impl Counting {
    fn read(&self, host: &mut dyn Host) -> Vec<Count> {
        (0..self.number)
            .map(|i| {
                let [name, name_length, unit, unit_length, units] = std::array::from_fn(|field| {
                    word(host, self.routines + i * ROUTINE_BYTES + 4 * field as u64)
                });
                Count {
                    routine: text(host, name, name_length),
                    unit: text(host, unit, unit_length),
                    units,
                    instructions: word(host, self.counts + i * COUNT_BYTES),
                }
            })
            .collect()
    }
}

impl emulator::Driver<RigBoard> for Counting {
    fn on_settled(&mut self, _session: &mut Session<RigBoard>, _host: &mut dyn Host, _settled: Settled) {}

    fn on_stop(
        &mut self,
        _session: &mut Session<RigBoard>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        if word(host, self.counts + (self.number - 1) * COUNT_BYTES) != 0 {
            self.result = Some(self.read(host));
            return None;
        }
        (stop.at.0 < PATIENCE_NS).then_some(VirtualNanos(stop.at.0 + LOOK_NS))
    }
}

/// Fails if the file is another program or does not end.
pub fn count(path: &Path) -> Result<Vec<Count>, SimError> {
    let unusable = |reason: String| SimError::Firmware { path: path.into(), reason };
    let bytes = std::fs::read(path).map_err(|error| unusable(error.to_string()))?;
    let elf = object::File::parse(&*bytes).map_err(|error| unusable(error.to_string()))?;
    let missing = |name: &str| unusable(format!("it has no {name}: is it farnear-count?"));
    let (routines, _) = place(&elf, ROUTINES).ok_or_else(|| missing(ROUTINES))?;
    let (counts, length) = place(&elf, COUNTS).ok_or_else(|| missing(COUNTS))?;
    let number = length / COUNT_BYTES;
    if number == 0 {
        return Err(missing(COUNTS));
    }
    let image = Image::read(path, None).map_err(|error| unusable(error.to_string()))?;
    // One cycle per instruction, so that the cycle counter counts instructions.
    let processor = ProcessorParts { cycles_per_instruction: 1.0, without_accelerator: 1.0 };
    let parts = Parts { processor, ..Parts::default() };
    let plant = SharedPlant::new(Plant::new(1, &parts, None).into());
    let emulator = |error: &dyn std::fmt::Display| SimError::Emulator(error.to_string());
    let costs = Costs::Average(parts.processor);
    let program = firmware::fingerprint(&bytes);
    let board = RigBoard::new(&plant, Line::default(), (1, program), &parts, costs)
        .map_err(|error| emulator(&error))?;
    let session = Session::new(Box::new(board), 0, VirtualNanos(0)).map_err(|error| emulator(&error))?;
    let counting = Counting { routines, counts, number, result: None };
    let finished = run(session, &Start::new(&[image]), counting).map_err(|error| emulator(&error))?;
    finished.driver.result.ok_or_else(|| unusable("it did not come to its end".into()))
}
