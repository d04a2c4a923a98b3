//! Instruction costs: [`Metered`] wraps the emulator's processor and counts a real one's cycles, for timers and plant.
//!
//! - Average: [`ProcessorParts::cycles_per_instruction`], more while the flash accelerator is not fully on
//!   (watches FLASH_ACR). No run-time cost.
//! - By kind: Cortex-M4 manual (`kinds`), fetches with wait states and caches (`flash`), and bus cycles of
//!   peripheral registers. Single-steps: about 100 times slower.

mod cached;
mod flash;
mod kinds;
mod outer_clock;

use std::{ops::Range, sync::Arc};

use object::{Object, ObjectSegment};
use rigless::{
    emulator::{
        Access, AccessKind, BitAlias, Checked, CoreBus, DataModel, Error, Exit, HaltReason, HostCall,
        InterruptLine, Processor, Queued,
    },
    soc::{Endian, Width},
    time::VirtualNanos,
};

pub use self::outer_clock::OuterClock;
use self::{
    cached::Translated,
    flash::FlashInterface,
    kinds::{Instruction, bus_cycles},
};
use crate::parts::ProcessorParts;

/// Fraction bits of a cycle count.
const FRACTION: u32 = 16;
/// FLASH_ACR (RM0090, section 3.9.2): wait states, bits PRFTEN, ICEN and DCEN.
const FLASH_ACR: u64 = 0x4002_3c00;
const LATENCY: u64 = 0xf;
const ACCELERATOR: u64 = 0x700;
const FLASH: u64 = 0x0800_0000;
const FLASH_BYTES: u64 = 2 << 20;

#[derive(Clone, PartialEq, Debug)]
pub enum Costs {
    Average(ProcessorParts),
    ByKind(Vec<u8>),
}

impl Costs {
    /// `None` if the ELF has no flash segment.
    pub fn by_kind(elf: &[u8]) -> Option<Self> {
        let elf = object::File::parse(elf).ok()?;
        let mut program = Vec::new();
        for segment in elf.segments() {
            let (Some(from), Ok(bytes)) = (physical(&segment), segment.data()) else { continue };
            let end = from + bytes.len();
            if program.len() < end {
                program.resize(end, 0xff);
            }
            program[from..end].copy_from_slice(bytes);
        }
        (!program.is_empty()).then_some(Self::ByKind(program))
    }
}

fn physical(segment: &object::Segment<'_, '_>) -> Option<usize> {
    let from = segment.address().checked_sub(FLASH)?;
    (from + segment.size() <= FLASH_BYTES).then_some(usize::try_from(from).ok()?)
}

#[derive(Clone, Copy, Debug)]
struct Meter {
    /// Instructions included in `cycles`.
    counted: u64,
    /// Cycles with [`FRACTION`] fraction bits.
    cycles: u64,
    each: u64,
}

impl Meter {
    fn at(&self, instructions: u64) -> u64 {
        (self.cycles + instructions.saturating_sub(self.counted) * self.each) >> FRACTION
    }

    /// Adds `more` cycles and changes the cost of further instructions.
    fn note(&mut self, instructions: u64, more: u64, each: u64) {
        self.cycles += instructions.saturating_sub(self.counted) * self.each + (more << FRACTION);
        (self.counted, self.each) = (instructions, each);
    }

    /// Instructions that fit a cycle budget, at least one.
    fn fitting(&self, cycles: u32) -> u32 {
        let fitting = (u64::from(cycles) << FRACTION) / self.each.max(1);
        u32::try_from(fitting.max(1)).unwrap_or(u32::MAX)
    }
}

fn fixed(cycles: f64) -> u64 {
    libm::round(cycles * f64::from(1 << FRACTION)) as u64
}

#[derive(Debug)]
pub struct Metered {
    inner: Translated,
    meter: Meter,
    model: Model,
    clock: Arc<OuterClock>,
}

#[derive(Debug)]
enum Model {
    Average { parts: ProcessorParts, acr: u64 },
    ByKind { program: Vec<u8>, flash: FlashInterface, handlers: u32, bus: u64 },
}

impl Model {
    fn each(&self) -> u64 {
        match self {
            Self::Average { parts, acr } => {
                let slow = acr & LATENCY != 0 && acr & ACCELERATOR != ACCELERATOR;
                let factor = if slow { parts.without_accelerator } else { 1.0 };
                fixed(parts.cycles_per_instruction * factor)
            }
            Self::ByKind { .. } => fixed(1.0),
        }
    }

    fn set_acr(&mut self, value: u64) {
        match self {
            Self::Average { acr, .. } => *acr = value,
            Self::ByKind { flash, .. } => flash.set(value),
        }
    }
}

impl Metered {
    /// Wraps a new processor, or one left by an earlier rig with the same program.
    pub fn new(
        program: u64,
        make: impl Fn() -> Result<Box<dyn Processor>, Error>,
        costs: Costs,
        clock: Arc<OuterClock>,
    ) -> Result<Self, Error> {
        let inner = Translated::new(program, make)?;
        let model = match costs {
            Costs::Average(parts) => Model::Average { parts, acr: 0 },
            Costs::ByKind(program) => {
                Model::ByKind { program, flash: FlashInterface::default(), handlers: 0, bus: 0 }
            }
        };
        let meter =
            Meter { counted: inner.retired(), cycles: inner.retired() << FRACTION, each: model.each() };
        Ok(Self { inner, meter, model, clock })
    }

    fn step_by_step(&mut self, budget: u32, bus: &mut dyn CoreBus) -> Exit {
        let end = self.retired() + u64::from(budget);
        loop {
            let (pc, before) = (self.inner.pc(), self.inner.retired());
            let mut metered = MeteredBus {
                bus: &mut *bus,
                meter: &mut self.meter,
                model: &mut self.model,
                clock: &self.clock,
            };
            let (exit, _) = self.inner.run(1, &mut metered);
            let after = self.inner.retired();
            if after > before {
                let more = self.cost(pc, self.inner.pc()).saturating_sub(1);
                self.meter.note(after, more, fixed(1.0));
            }
            if exit != Exit::Budget || self.retired() >= end {
                return exit;
            }
        }
    }

    fn cost(&mut self, pc: u64, next: u64) -> u64 {
        let Model::ByKind { program, flash, handlers, bus } = &mut self.model else { return 1 };
        let waited = std::mem::take(bus);
        let code = pc.checked_sub(FLASH).and_then(|at| program.get(usize::try_from(at).ok()?..));
        let Some(instruction) = code.and_then(Instruction::decode) else { return 1 + waited };
        let mut cycles = instruction.cycles(next != pc + instruction.bytes());
        if !instruction.may_branch() && next != pc + instruction.bytes() {
            // An interrupt came first: the first instruction of its handler ran.
            *handlers += 1;
            cycles += kinds::EXCEPTION_ENTRY;
        } else if *handlers > 0 && instruction.may_return() && !(FLASH..FLASH + FLASH_BYTES).contains(&next) {
            *handlers -= 1;
            cycles += kinds::EXCEPTION_RETURN;
        }
        let data = instruction.literal(pc).into_iter().map(|at| flash.read(at)).sum::<u64>();
        cycles + flash.fetch(pc, instruction.bytes(), cycles) + data + waited
    }
}

/// Bus of the run, with requests in cycles.
struct MeteredBus<'a> {
    bus: &'a mut dyn CoreBus,
    meter: &'a mut Meter,
    model: &'a mut Model,
    clock: &'a OuterClock,
}

impl MeteredBus<'_> {
    fn in_cycles(&self, access: Access) -> Access {
        let mut access = access;
        access.instruction_count = self.meter.at(access.instruction_count);
        access
    }
}

impl CoreBus for MeteredBus<'_> {
    fn access(&mut self, access: Access, from_code: bool) -> Option<u64> {
        let instructions = access.instruction_count;
        let answer = self.bus.access(self.in_cycles(access), from_code);
        let answer = answer.map(|value| self.clock.seen(&access, value));
        if access.address == FLASH_ACR && access.kind == AccessKind::Write {
            self.model.set_acr(access.value);
            self.meter.note(instructions, 0, self.model.each());
        }
        if let Model::ByKind { bus, .. } = self.model {
            *bus += bus_cycles(access.address);
        }
        answer
    }

    fn time(&self, instructions: u64) -> VirtualNanos {
        self.bus.time(self.meter.at(instructions))
    }

    fn queued(&mut self) -> Vec<Queued> {
        self.bus.queued()
    }

    fn carry_on(&mut self, instructions: u64, event: Option<VirtualNanos>) -> Option<u32> {
        if matches!(self.model, Model::ByKind { .. }) {
            return None;
        }
        let cycles = self.bus.carry_on(self.meter.at(instructions), event)?;
        Some(self.meter.fitting(cycles))
    }

    fn acknowledge(&mut self, line: InterruptLine, instructions: u64) -> Option<u64> {
        self.bus.acknowledge(line, self.meter.at(instructions))
    }

    fn read_checked(&mut self, access: Access, report: bool) -> Option<Checked> {
        self.bus.read_checked(self.in_cycles(access), report)
    }

    fn write_checked(&mut self, access: Access) -> Option<bool> {
        self.bus.write_checked(self.in_cycles(access))
    }

    fn stops_before(&mut self, access: &Access) -> bool {
        let access = self.in_cycles(*access);
        self.bus.stops_before(&access)
    }

    fn send_trace(&mut self, bytes: &[u8]) {
        self.bus.send_trace(bytes);
    }
}

/// Everything but the count is forwarded.
impl Processor for Metered {
    fn run(&mut self, budget: u32, bus: &mut dyn CoreBus) -> (Exit, u64) {
        let before = self.retired();
        if self.clock.interrupt(&mut *self.inner, bus.time(before)) {
            // Until the reset 16 of 168 MHz; costs by kind do not know it.
            self.meter.note(self.inner.retired(), 0, self.model.each() * 21 / 2);
        }
        let exit = match &self.model {
            Model::ByKind { .. } => self.step_by_step(budget, bus),
            Model::Average { .. } => {
                let fitting = self.meter.fitting(budget);
                let mut bus =
                    MeteredBus { bus, meter: &mut self.meter, model: &mut self.model, clock: &self.clock };
                self.inner.run(fitting, &mut bus).0
            }
        };
        (exit, self.retired() - before)
    }

    fn retired(&self) -> u64 {
        self.meter.at(self.inner.retired())
    }

    fn ask(&mut self, queued: Queued) {
        self.inner.ask(queued);
    }

    fn maps(&self, start: u64, length: u64) -> bool {
        self.inner.maps(start, length)
    }

    fn page_size(&self) -> u64 {
        self.inner.page_size()
    }

    #[expect(unsafe_code, reason = "forwarded unchanged")]
    unsafe fn map(&mut self, start: u64, length: u64, host: *mut u8, writable: bool) {
        // SAFETY: the caller upholds this trait method's contract while this processor lives. A processor in
        // `cached` runs no instruction before the next run has mapped its own memory at the same addresses,
        // which all boards share.
        unsafe { self.inner.map(start, length, host, writable) };
    }

    fn boot(&mut self, table: u64, read: &dyn Fn(u64, Width) -> Option<u64>) {
        self.inner.boot(table, read);
    }

    fn reset(&mut self) {
        self.inner.reset();
        self.model.set_acr(0);
        self.meter.note(self.inner.retired(), 0, self.model.each());
    }

    fn take_reset_request(&mut self) -> bool {
        self.inner.take_reset_request()
    }

    fn next_event(&self) -> Option<VirtualNanos> {
        self.inner.next_event()
    }

    fn on_event(&mut self, now: VirtualNanos) {
        self.inner.on_event(now);
    }

    fn waiting(&self) -> bool {
        self.inner.waiting()
    }

    fn pc(&self) -> u64 {
        self.inner.pc()
    }

    fn add_breakpoint(&mut self, address: u64) -> bool {
        self.inner.altered().add_breakpoint(address)
    }

    fn remove_breakpoint(&mut self, address: u64) {
        self.inner.altered().remove_breakpoint(address);
    }

    fn pass_breakpoint(&mut self, address: u64) {
        self.inner.altered().pass_breakpoint(address);
    }

    fn attach_debugger(&mut self, attached: bool) {
        self.inner.altered().attach_debugger(attached);
    }

    fn hold_interrupts(&mut self, held: bool) {
        self.inner.altered().hold_interrupts(held);
    }

    fn gdb_register(&self, number: usize) -> Option<Vec<u8>> {
        self.inner.gdb_register(number)
    }

    fn set_gdb_register(&mut self, number: usize, bytes: &[u8]) -> bool {
        self.inner.set_gdb_register(number, bytes)
    }

    fn debugger_access(
        &mut self,
        write: Option<u64>,
        address: u64,
        width: Width,
        now: VirtualNanos,
    ) -> Option<u64> {
        self.inner.debugger_access(write, address, width, now)
    }

    fn take_debugger_trace(&mut self) -> Vec<u8> {
        self.inner.take_debugger_trace()
    }

    fn target_xml(&self) -> &'static str {
        self.inner.target_xml()
    }

    fn data_model(&self) -> DataModel {
        self.inner.data_model()
    }

    fn byte_order(&self, address: u64) -> Endian {
        self.inner.byte_order(address)
    }

    fn save(&self) -> Vec<u8> {
        self.inner.save()
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), Error> {
        // Cycles are not included: the board keeps no snapshots.
        let _ = bytes;
        Err(Error::State)
    }

    fn monitor_command(&mut self, command: &str) -> Option<String> {
        self.inner.monitor_command(command)
    }

    fn debugger_halted(&mut self, why: HaltReason) -> bool {
        self.inner.debugger_halted(why)
    }

    fn bit_alias(&self, address: u64, width: Width) -> Option<BitAlias> {
        self.inner.bit_alias(address, width)
    }

    fn own_ranges(&self) -> Vec<Range<u64>> {
        self.inner.own_ranges()
    }

    fn check_reads(&mut self, every: bool) {
        self.inner.altered().check_reads(every);
    }

    fn check_words(&mut self, words: &[u64]) {
        self.inner.altered().check_words(words);
    }

    fn host_call(&self, read: &mut dyn FnMut(u64, Width) -> Option<u64>) -> Option<HostCall> {
        self.inner.host_call(read)
    }

    fn answer_host_call(&mut self, answer: Option<u64>) {
        self.inner.answer_host_call(answer);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_cost_applies_to_later_instructions_only() {
        let mut meter = Meter { counted: 0, cycles: 0, each: fixed(1.0) };
        assert_eq!((meter.at(100), meter.fitting(50)), (100, 50));
        meter.note(100, 7, fixed(1.9));
        // 7 and 10 times 1.9, which in binary lies a little below: rounded down.
        assert_eq!((meter.at(100), meter.at(110)), (107, 125));
        assert_eq!((meter.fitting(19), meter.fitting(1)), (10, 1));
    }

    #[test]
    fn each_cleared_accelerator_bit_makes_instructions_slower() {
        let parts = ProcessorParts { cycles_per_instruction: 1.5, without_accelerator: 2.0 };
        let each = |acr| Model::Average { parts, acr }.each();
        assert_eq!(each(0), fixed(1.5), "without wait states there is nothing to accelerate");
        assert_eq!((each(0x705), each(0x605), each(0x005)), (fixed(1.5), fixed(3.0), fixed(3.0)));
    }
}
