//! The piezo's DAC and its strain gauge's converter, both on SPI3.
//!
//! - DAC: TI DAC8830 (SLAS449): 16 bit, +-1 LSB, SPI mode 0 up to 50 MHz, 16-bit frame, takes the value when
//!   its select rises; starts at code 0, which leaves the piezo relaxed. Select PD0.
//! - Converter: Analog Devices AD7691 (18 bit, 250 kS/s, 0.75 LSB noise) in its three-wire CS mode with busy
//!   indicator: the rising edge of CNV (PD1) samples; CNV stays high for at least 50 ns (10 ns are the minimum of the
//!   AD7685, a part of the same family) and is low again before the shortest conversion (0.5 us) ends, which no interrupt may delay. When the longest (3.7 us at a supply of 3.3 V) has ended, the output, released and
//!   pulled up till then, is low; each clock then gives a bit of the result, two's complement, most significant first, in SPI
//!   mode 0; after the last one the output is released again, and what is read there is as good as the pull-up is fast: it
//!   says nothing. The leading 0 tells a converter from a broken wire, as do codes at either end, which the rig refuses.
//!
//! Words of 16 bits, of which each takes 1.5 us: the processor looks for its end rarely instead of all the time, which
//! leaves the bus alone (and is most of what an emulated tick costs).

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
use farnear_rig::io::GAUGE_CODE_MAX;

use crate::{clock, registers::retained};

/// APB1 / 4; the slowest part stands twice this.
const SPI_HZ: Hertz = Hertz(10_500_000);
/// Longest conversion of the AD7691 at VDD = 2.3 to 4.5 V, 3.7 us (2.2 us at 5 V), of the 168 MHz clock.
const CONVERSION_CYCLES: u32 = 622;
/// CNV is high for this long: 60 ns, between the 50 ns that are wanted and the 500 ns of the shortest conversion.
const PULSE_CYCLES: u32 = 10;
/// Half of a word's 256 cycles.
const HALF_A_WORD_CYCLES: u32 = 128;
/// From one look for the word's end to the next.
const LOOK_CYCLES: u32 = 12;
/// The busy indicator, the first of the 32 bits that are read.
const BUSY_BIT: u32 = 1 << 31;
/// Clocks after the indicator and the 18 bits.
const TRAILING_BITS: u32 = 13;
/// Control ticks (5 ms) after which the DAC is told again what it should hold: it may have missed it, by a loose contact or a dip of
/// its supply, and a loop that stands at the end of its range would never say anything else.
const AGAIN_TICKS: u8 = 25;
/// Turns two's complement into 0 = most negative.
const SIGN_BIT: u32 = 1 << 17;

/// DAC and gauge of the fine axis.
pub struct Piezo {
    _spi: Spi<'static, Blocking, Master>,
    dac_select: Output<'static>,
    convert: Output<'static>,
    code: Option<u16>,
    /// Control ticks since the DAC was told.
    silent_ticks: u8,
    /// When the gauge was sampled, in cycles.
    sampled: u32,
}

impl Piezo {
    /// Sets SPI3 and the selects up; the piezo stays as it is.
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
        // Nothing is sent, but from now on words have 16 bits. An error has no cause where nothing is sent.
        let _ = spi.blocking_write::<u16>(&[]);
        Self { _spi: spi, dac_select, convert, code: None, silent_ticks: 0, sampled: 0 }
    }

    /// Sends a word and gives the one that comes meanwhile.
    fn exchange(&mut self, word: u16) -> u16 {
        pac::SPI3.dr().write(|w| w.set_dr(word));
        clock::wait_cycles(HALF_A_WORD_CYCLES);
        while !pac::SPI3.sr().read().rxne() {
            clock::wait_cycles(LOOK_CYCLES);
        }
        pac::SPI3.dr().read().dr()
    }

    pub fn sample(&mut self) {
        // An interrupt between the two would make the pulse longer than a conversion, and the result without its indicator.
        critical_section::with(|_| {
            self.convert.set_high();
            clock::wait_cycles(PULSE_CYCLES);
            self.convert.set_low();
        });
        self.sampled = DWT::cycle_count();
    }

    /// Reads the last sample when it is converted: 0 to [`GAUGE_CODE_MAX`], `None` where no converter answers. Takes 3.8 us.
    pub fn gauge(&mut self) -> Option<u32> {
        clock::wait_cycles_since(self.sampled, CONVERSION_CYCLES);
        let word = u32::from(self.exchange(0)) << 16 | u32::from(self.exchange(0));
        let code = (word >> TRAILING_BITS) & GAUGE_CODE_MAX;
        (word & BUSY_BIT == 0).then_some(code ^ SIGN_BIT)
    }

    /// Sets the DAC, once in a control tick; what it should hold already is sent again now and then only.
    pub fn set(&mut self, code: u16) {
        self.silent_ticks += 1; // sent before it could overflow
        if self.code == Some(code) && self.silent_ticks < AGAIN_TICKS {
            return;
        }
        self.silent_ticks = 0;
        retained::keep_piezo_code(code);
        self.dac_select.set_low();
        self.exchange(code);
        self.dac_select.set_high();
        self.code = Some(code);
    }
}
