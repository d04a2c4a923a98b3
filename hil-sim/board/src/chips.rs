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

/// Longest conversion of the AD7691 (t_CONV, 2.2 us).
const CONVERSION_NS: u64 = 2_200;
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

/// AD7691 in three-wire CS mode: the select line is CNV. Its rising edge samples; while it is low, the result is
/// shifted out. Read before the conversion is over, the result is of no use; this model then gives zeros.
pub struct GaugeConverter {
    plant: SharedPlant,
    sampled_ns: u64,
    result: u32,
    /// What is still to be shifted out, most significant bit first, and ones after it (released output).
    shift: u64,
}

impl GaugeConverter {
    /// The chip, sampling the plant's gauge.
    pub fn new(plant: SharedPlant) -> Self {
        Self { plant, sampled_ns: 0, result: 0, shift: u64::MAX }
    }
}

impl Peer for GaugeConverter {
    fn transfer(&mut self, _mosi: u32, bits: u8, _context: &mut Timeline<'_, '_>) -> u32 {
        let out = (self.shift >> (64 - u32::from(bits))) as u32;
        self.shift = (self.shift << bits) | ((1 << bits) - 1);
        out
    }

    /// CNV falls: the output comes on.
    fn select(&mut self, context: &mut Timeline<'_, '_>) {
        let ready = context.now().0 >= self.sampled_ns + CONVERSION_NS;
        let result = if ready { self.result } else { 0 };
        self.shift = (u64::from(result) << (64 - RESULT_BITS)) | (u64::MAX >> RESULT_BITS);
    }

    /// CNV rises: sample.
    fn deselect(&mut self, context: &mut Timeline<'_, '_>) {
        self.sampled_ns = context.now().0;
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
