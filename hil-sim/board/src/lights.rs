//! Brightness of lamp and flash, from TIM12's register file; the emulator has no model of TIM12.

use rigless::{mcu::Operate, soc::Width, time::VirtualNanos};

use crate::board::{Chip, LIGHTS};

/// RM0090, section 2.3; registers: section 19.5.
const TIM12: u64 = 0x4000_1800;
const CR1: u64 = TIM12;
const CCER: u64 = TIM12 + 0x20;
const ARR: u64 = TIM12 + 0x2c;
const CCR: [u64; 2] = [TIM12 + 0x34, TIM12 + 0x38];
const ENABLED: [u64; 2] = [1, 1 << 4];
/// Alternate function of TIM12 on its pins (DS9405, table 12).
const FUNCTION: u8 = 9;

#[derive(Debug, Default)]
pub struct Lights {
    levels: [f64; 2],
    since_ns: u64,
    /// Brightness times nanoseconds until `since_ns`.
    sum_ns: [f64; 2],
    /// Sum at the start of the current exposure.
    begun_ns: [f64; 2],
    changes: Option<Vec<(u64, [f64; 2])>>,
}

impl Lights {
    pub fn watches(address: u64) -> bool {
        (TIM12..TIM12 + 0x400).contains(&address)
    }

    pub fn look(&mut self, chip: &mut Chip, at: VirtualNanos) {
        let mut read = |address| Operate::peek(chip, at, address, Width::W32).unwrap_or(0);
        let runs = read(CR1) & 1 != 0;
        let (enabled, period) = (read(CCER), (read(ARR) + 1) as f64);
        let duty = CCR.map(|address| (read(address) as f64 / period).min(1.0));
        let levels = [0, 1].map(|i| {
            let on = runs && enabled & ENABLED[i] != 0 && chip.function(LIGHTS[i]) == Some(FUNCTION);
            if on { duty[i] } else { 0.0 }
        });
        self.put(levels, at.0);
    }

    /// A reset lets the pins float; resistors hold them low.
    pub fn board_reset(&mut self, at_ns: u64) {
        self.put([0.0; 2], at_ns);
    }

    fn put(&mut self, levels: [f64; 2], at_ns: u64) {
        if levels == self.levels {
            return;
        }
        self.sum_ns = self.sum_at(at_ns);
        (self.since_ns, self.levels) = (at_ns, levels);
        if let Some(changes) = &mut self.changes {
            changes.push((at_ns, levels));
        }
    }

    fn sum_at(&self, at_ns: u64) -> [f64; 2] {
        let passed_ns = at_ns.saturating_sub(self.since_ns) as f64;
        [0, 1].map(|i| self.sum_ns[i] + self.levels[i] * passed_ns)
    }

    pub fn begin_exposure(&mut self, at_ns: u64) {
        self.begun_ns = self.sum_at(at_ns);
    }

    /// Mean brightness since the exposure began, `length_ns` ago.
    pub fn end_exposure(&self, at_ns: u64, length_ns: u64) -> [f64; 2] {
        let sum_ns = self.sum_at(at_ns);
        [0, 1].map(|i| (sum_ns[i] - self.begun_ns[i]) / length_ns.max(1) as f64)
    }

    pub fn levels(&self) -> [f64; 2] {
        self.levels
    }

    /// Virtual nanoseconds; the first call starts the recording.
    pub fn take_changes(&mut self) -> Vec<(u64, [f64; 2])> {
        self.changes.replace(Vec::new()).unwrap_or_default()
    }
}
