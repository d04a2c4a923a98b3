//! The two chips on SPI3, as their data sheets say: TI DAC8830 and Analog Devices AD7691.

use std::sync::{Arc, Mutex, PoisonError};

use rigless::{
    chip::{Timeline, spi::Peer},
    snapshot::Store,
};

use crate::plant::Plant;

/// The plant, shared by the chips and by the wiring; all run on the emulator's thread.
pub type SharedPlant = Arc<Mutex<Plant>>;

/// Runs something on the shared plant. A panic elsewhere does not make its state wrong, so poison is ignored.
pub fn with_plant<T>(plant: &SharedPlant, work: impl FnOnce(&mut Plant) -> T) -> T {
    work(&mut plant.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Shortest and longest conversion of the AD7691 (t_CONV).
const CONVERSION_NS: (u64, u64) = (500, 2_200);
/// Bits of a conversion.
const RESULT_BITS: u32 = 18;
const SIGN_BIT: u32 = 1 << 17;

/// TI DAC8830: shifts 16 bits in while selected; when the select rises, exactly 16 bits are taken.
pub struct Dac {
    plant: SharedPlant,
    shift: u32,
    bits: u32,
}

impl Dac {
    /// The chip, driving the plant's piezo.
    pub fn new(plant: SharedPlant) -> Self {
        Self { plant, shift: 0, bits: 0 }
    }
}

impl Peer for Dac {
    fn transfer(&mut self, mosi: u32, bits: u8, _context: &mut Timeline<'_, '_>) -> u32 {
        self.shift = (self.shift << bits) | mosi;
        self.bits += u32::from(bits);
        // It has no data output; the bus' pull-up stays.
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

/// AD7691 in three-wire CS mode: the select line is CNV. Its rising edge samples. Where CNV is low again before
/// the shortest conversion ends, a 0 (busy indicator) comes before the result; until the longest has ended, the
/// output is released. A released output reads as ones, for the bus has a pull-up.
pub struct GaugeConverter {
    plant: SharedPlant,
    sampled_ns: u64,
    low_ns: u64,
    result: u32,
    /// What is still to be shifted out, most significant bit first, and ones after it; `None` until it is read.
    shift: Option<u64>,
}

impl GaugeConverter {
    /// The chip, sampling the plant's gauge.
    pub fn new(plant: SharedPlant) -> Self {
        Self { plant, sampled_ns: 0, low_ns: 0, result: 0, shift: None }
    }

    /// What comes out when the first bit is read at this moment.
    fn output(&self, now_ns: u64) -> u64 {
        if now_ns < self.sampled_ns + CONVERSION_NS.1 {
            return u64::MAX;
        }
        let indicates = self.low_ns < self.sampled_ns + CONVERSION_NS.0;
        let lead = if indicates { 1 } else { 0 };
        (u64::from(self.result) << (64 - RESULT_BITS - lead)) | (u64::MAX >> (RESULT_BITS + lead))
    }
}

impl Peer for GaugeConverter {
    fn transfer(&mut self, _mosi: u32, bits: u8, context: &mut Timeline<'_, '_>) -> u32 {
        let shift = self.shift.unwrap_or_else(|| self.output(context.now().0));
        self.shift = Some((shift << bits) | ((1 << bits) - 1));
        (shift >> (64 - u32::from(bits))) as u32
    }

    /// CNV falls.
    fn select(&mut self, context: &mut Timeline<'_, '_>) {
        self.low_ns = context.now().0;
    }

    /// CNV rises: sample.
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
