//! The chips on SPI3 according to their data sheets: TI DAC8830 and Analog Devices AD7691.

use std::sync::{Arc, Mutex, PoisonError};

use rigless::{
    chip::{Timeline, spi::Peer},
    snapshot::Store,
};

use crate::{parts::ConverterParts, plant::Plant};

pub type SharedPlant = Arc<Mutex<Plant>>;

/// Runs `work` on the plant. Poison is ignored: a panic elsewhere does not invalidate the state.
pub fn with_plant<T>(plant: &SharedPlant, work: impl FnOnce(&mut Plant) -> T) -> T {
    work(&mut plant.lock().unwrap_or_else(PoisonError::into_inner))
}

const RESULT_BITS: u32 = 18;
const SIGN_BIT: u32 = 1 << 17;
/// SPI3 clock of the firmware: 10.5 MHz.
const BIT_NS: f64 = 1e9 / 10.5e6;

/// TI DAC8830: shifts 16 bits while selected and accepts exactly 16 when the select line rises.
pub struct Dac {
    plant: SharedPlant,
    shift: u32,
    bits: u32,
}

impl Dac {
    pub fn new(plant: SharedPlant) -> Self {
        Self { plant, shift: 0, bits: 0 }
    }
}

impl Peer for Dac {
    fn transfer(&mut self, mosi: u32, bits: u8, _context: &mut Timeline<'_, '_>) -> u32 {
        self.shift = (self.shift << bits) | mosi;
        self.bits += u32::from(bits);
        // No data output; the pull-up holds the bus high.
        (1 << bits) - 1
    }

    fn select(&mut self, _context: &mut Timeline<'_, '_>) {
        self.shift = 0;
        self.bits = 0;
    }

    fn deselect(&mut self, context: &mut Timeline<'_, '_>) {
        if self.bits == 16 {
            let code = self.shift as u16;
            with_plant(&self.plant, |plant| plant.set_dac(context.now().0, code));
        }
    }
}

impl Store for Dac {}

impl std::fmt::Debug for Dac {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("DAC8830")
    }
}

/// AD7691 in three-wire CS mode: the rising edge of CNV samples. If CNV is low again before the shortest conversion
/// ends, a 0 (busy indicator) precedes the result. The output is released until the longest conversion ends and from
/// half a clock after the last bit. The pull-up then needs time to charge a line that was low.
pub struct GaugeConverter {
    plant: SharedPlant,
    parts: ConverterParts,
    sampled_ns: u64,
    low_ns: u64,
    result: u32,
    /// Bits to shift out, MSB first, then ones; `None` until read.
    shift: Option<u64>,
    without_indicator: u64,
    short_pulses: u64,
    cut: bool,
}

impl GaugeConverter {
    pub fn new(plant: SharedPlant, parts: ConverterParts) -> Self {
        Self {
            plant,
            parts,
            sampled_ns: 0,
            low_ns: 0,
            result: 0,
            shift: None,
            without_indicator: 0,
            short_pulses: 0,
            cut: false,
        }
    }

    /// Conversions without a busy indicator, because CNV stayed high too long.
    pub fn without_indicator(&self) -> u64 {
        self.without_indicator
    }

    pub fn short_pulses(&self) -> u64 {
        self.short_pulses
    }

    /// The pull-up holds a cut line high.
    pub const fn cut(&mut self, cut: bool) {
        self.cut = cut;
    }

    /// Output word when the first bit is read at `now_ns`.
    fn output(&mut self, now_ns: u64) -> u64 {
        if now_ns < self.sampled_ns + self.parts.conversion_max_ns {
            return u64::MAX;
        }
        let indicates = self.low_ns < self.sampled_ns + self.parts.conversion_min_ns;
        self.without_indicator += u64::from(!indicates);
        let bits = RESULT_BITS + u32::from(indicates);
        let driven = u64::from(self.result) << (64 - bits);
        // The released line is sampled in the middle of each bit.
        let low = if self.result & 1 == 0 { libm::ceil(self.parts.rise_ns() / BIT_NS - 0.5) } else { 0.0 };
        let charged = (u64::MAX >> bits).checked_shr(low.clamp(0.0, 64.0) as u32).unwrap_or(0);
        driven | charged
    }
}

impl Peer for GaugeConverter {
    fn transfer(&mut self, _mosi: u32, bits: u8, context: &mut Timeline<'_, '_>) -> u32 {
        if self.cut {
            return u32::MAX >> (32 - u32::from(bits));
        }
        let shift = match self.shift {
            Some(shift) => shift,
            None => self.output(context.now().0),
        };
        self.shift = Some((shift << bits) | ((1 << bits) - 1));
        (shift >> (64 - u32::from(bits))) as u32
    }

    fn select(&mut self, context: &mut Timeline<'_, '_>) {
        self.low_ns = context.now().0;
        let high_ns = self.low_ns.saturating_sub(self.sampled_ns);
        self.short_pulses += u64::from(self.sampled_ns > 0 && high_ns < self.parts.pulse_min_ns);
    }

    fn deselect(&mut self, context: &mut Timeline<'_, '_>) {
        self.sampled_ns = context.now().0;
        self.shift = None;
        // Straight codes to two's complement.
        self.result = with_plant(&self.plant, |plant| plant.sample_gauge(self.sampled_ns)) ^ SIGN_BIT;
    }
}

impl Store for GaugeConverter {}

impl std::fmt::Debug for GaugeConverter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("AD7691")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parts::Parts;

    fn read(result: u32, (low_ns, read_ns): (u64, u64)) -> u32 {
        let parts = Parts::default();
        let plant = SharedPlant::new(Plant::new(1, &parts, None).into());
        let mut chip = GaugeConverter::new(plant, parts.gauge_converter);
        (chip.result, chip.low_ns) = (result, low_ns);
        (chip.output(read_ns) >> 32) as u32
    }

    #[test]
    fn the_released_line_stays_low_for_a_while_after_a_zero() {
        // 0.22 us is 2.4 bits. The first bit is sampled at its middle, so two bits read low.
        assert_eq!(read(0x2_0001, (100, 4_000)), 0x2_0001 << 13 | 0x1fff);
        assert_eq!(read(0x2_0000, (100, 4_000)), 0x2_0000 << 13 | 0x07ff);
    }

    #[test]
    fn a_long_pulse_suppresses_the_busy_indicator_and_an_early_read_returns_ones() {
        assert_eq!(read(0x3_ffff, (501, 4_000)), u32::MAX, "shifted by a bit");
        assert_eq!(read(0x1_0001, (501, 4_000)) >> 14, 0x1_0001);
        assert_eq!(read(0x1_0001, (100, 3_600)), u32::MAX);
    }
}
