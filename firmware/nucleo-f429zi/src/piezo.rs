//! The piezo's DAC and the strain gauge's converter on SPI3.
//!
//! - DAC: TI DAC8830 (SLAS449): 16 bit, +-1 LSB, SPI mode 0 up to 50 MHz, 16-bit frame, updated when its select rises;
//!   starts at code 0, the relaxed piezo. Select PD0.
//! - Converter: Analog Devices AD7691 (18 bit, 250 kS/s, 0.75 LSB noise), three-wire CS mode with busy indicator. The
//!   rising edge of CNV (PD1) samples; CNV is high for at least 50 ns (the related AD7685 needs 10 ns) and low again
//!   before the shortest conversion (0.5 us) ends, which no interrupt may delay. After the longest (3.7 us at 3.3 V)
//!   the output, until then released and pulled up, is low; each clock gives a bit, two's complement, MSB first, SPI
//!   mode 0. After the last bit the output is released and meaningless. The leading 0 distinguishes a converter from a
//!   broken wire, as do codes at either end, which the rig rejects.
//!
//! A 16-bit word takes 1.5 us: rare polls leave the bus free (and are most of an emulated tick's cost).

use cortex_m::peripheral::DWT;
use embassy_stm32::{
    Peri,
    gpio::{Level, Output, Speed},
    mode::Blocking,
    pac,
    peripherals::{PC10, PC11, PC12, PD0, PD1, SPI3},
    spi::{self, MODE_0, Spi, mode::Master},
    time::Hertz,
};
use farnear_rig::{io::GAUGE_CODE_MAX, relax};

use crate::{clock, registers::retained};

/// APB1 / 4; the slowest device tolerates twice this rate.
const SPI_HZ: Hertz = Hertz(10_500_000);
/// Longest conversion of the AD7691 at VDD = 2.3 to 4.5 V, 3.7 us (2.2 us at 5 V), at 168 MHz.
const CONVERSION_CYCLES: u32 = 622;
/// CNV pulse: 60 ns, between the 50 ns required and the 500 ns of the shortest conversion.
const PULSE_CYCLES: u32 = 10;
/// Sixteen bits of sixteen cycles.
const WORD_CYCLES: u32 = 256;
/// Busy indicator, first of the 32 bits.
const BUSY_BIT: u32 = 1 << 31;
/// Clocks after indicator and 18 bits.
const TRAILING_BITS: u32 = 13;
/// Control ticks (5 ms) between repetitions of the DAC's code, which a loose contact or supply dip may have lost.
const AGAIN_TICKS: u8 = 25;
/// A tick's 200 us in steps of TIM5, which take 10.5 us on the internal oscillator: 16 MHz by 2 by 84.
const TICK_STEPS: u16 = 19;
/// Pin of the DAC's select at port D.
const DAC_SELECT: usize = 0;
/// Converts two's complement to 0 = most negative.
const SIGN_BIT: u32 = 1 << 17;

pub struct Piezo {
    _spi: Spi<'static, Blocking, Master>,
    dac_select: Output<'static>,
    convert: Output<'static>,
    code: Option<u16>,
    silent_ticks: u8,
    /// Sampling time, cycles.
    sampled: u32,
}

impl Piezo {
    pub fn new(
        spi: Peri<'static, SPI3>,
        clock: Peri<'static, PC10>,
        data_in: Peri<'static, PC11>,
        data_out: Peri<'static, PC12>,
        dac_select: Peri<'static, PD0>,
        convert: Peri<'static, PD1>,
    ) -> Self {
        let dac_select = Output::new(dac_select, Level::High, Speed::Medium);
        let convert = Output::new(convert, Level::Low, Speed::VeryHigh);
        let mut config = spi::Config::default();
        config.mode = MODE_0;
        config.frequency = SPI_HZ;
        config.miso_pull = embassy_stm32::gpio::Pull::Up;
        let mut spi = Spi::new_blocking(spi, clock, data_out, data_in, config);
        // Sends nothing, but switches to 16-bit words; cannot fail.
        let _ = spi.blocking_write::<u16>(&[]);
        Self { _spi: spi, dac_select, convert, code: None, silent_ticks: 0, sampled: 0 }
    }

    pub fn sample(&mut self) {
        // An interrupt in between would make the pulse longer than a conversion and lose the indicator.
        critical_section::with(|_| {
            self.convert.set_high();
            clock::wait_cycles(PULSE_CYCLES);
            self.convert.set_low();
        });
        self.sampled = DWT::cycle_count();
    }

    /// The last sample, 0 to [`GAUGE_CODE_MAX`]; `None` if the converter is silent. Takes 3.8 us.
    pub fn gauge(&mut self) -> Option<u32> {
        clock::wait_cycles_since(self.sampled, CONVERSION_CYCLES);
        let word = u32::from(exchange(0)) << 16 | u32::from(exchange(0));
        let code = (word >> TRAILING_BITS) & GAUGE_CODE_MAX;
        (word & BUSY_BIT == 0).then_some(code ^ SIGN_BIT)
    }

    /// Sets the DAC, once per tick; unchanged codes are repeated only occasionally.
    pub fn set(&mut self, code: u16) {
        self.silent_ticks += 1; // sent before it could overflow
        if self.code == Some(code) && self.silent_ticks < AGAIN_TICKS {
            return;
        }
        self.silent_ticks = 0;
        retained::keep_piezo_code(code);
        self.dac_select.set_low();
        exchange(code);
        self.dac_select.set_high();
        self.code = Some(code);
    }
}

// Inlined it would be there four times.
#[inline(never)]
fn exchange(word: u16) -> u16 {
    pac::SPI3.dr().write(|w| w.set_dr(word));
    clock::wait_cycles(WORD_CYCLES);
    while !pac::SPI3.sr().read().rxne() {}
    pac::SPI3.dr().read().dr()
}

/// From the interrupt of a lost clock, which never returns: lowers the piezo as a sinking supply does, because the
/// supply may end before the start after the reset reaches its first tick.
pub fn release() {
    // Before the set-up the interface is off or has words of 8 bits, and the last boot's code is still at the DAC.
    let interface = pac::SPI3.cr1().read();
    let is_ready = interface.spe() && interface.dff() == pac::spi::vals::Dff::BITS16;
    let (Some(from), true) = (retained::piezo_code(), is_ready) else { return };
    let select = pac::GPIOD.bsrr();
    let steps = || pac::TIM5.cnt().read() as u16;
    let begin = steps();
    for at in 1..=relax::FAST {
        while steps().wrapping_sub(begin) < at as u16 * TICK_STEPS {}
        // A word that the interrupt cut off is over by now; a rising select ends it.
        let _ = pac::SPI3.dr().read();
        select.write(|w| w.set_bs(DAC_SELECT, true));
        let code = relax::code(from, 0, at, relax::FAST);
        retained::keep_piezo_code(code);
        select.write(|w| w.set_br(DAC_SELECT, true));
        exchange(code);
        select.write(|w| w.set_bs(DAC_SELECT, true));
    }
}
