//! The piezo's DAC and its strain gauge's converter, both on SPI3.
//!
//! - DAC: TI DAC8830 (SLAS449): 16 bit, +-1 LSB, SPI mode 0 up to 50 MHz, 16-bit frame, takes the value when
//!   its select rises; starts at code 0, which leaves the piezo relaxed. Select PD0.
//! - Converter: Analog Devices AD7691 (18 bit, 250 kS/s, 0.75 LSB noise) in its three-wire CS mode with busy
//!   indicator: the rising edge of CNV (PD1) samples; CNV is low again before the shortest conversion (0.5 us)
//!   ends. When the longest (2.2 us) has ended, the output, released and pulled up till then, is low; each clock
//!   then gives a bit of the result, two's complement, most significant first, in SPI mode 0; after the last one
//!   the output is released again. The leading 0 and the trailing ones tell a converter from a broken wire.

use embassy_stm32::{
    Peri,
    gpio::{Level, Output, Speed},
    mode::Blocking,
    peripherals::{PC10, PC11, PC12, PD0, PD1, SPI3},
    spi::{self, MODE_0, Spi, mode::Master},
    time::Hertz,
};
use farnear_rig::io::GAUGE_CODE_MAX;

/// APB1 / 4; the slowest part stands twice this.
const SPI_HZ: Hertz = Hertz(10_500_000);
/// Longest conversion of the AD7691: 2.2 us of the 168 MHz clock.
const CONVERSION_CYCLES: u32 = 370;
/// The busy indicator, the first of the 24 bits that are read.
const BUSY_BIT: u32 = 1 << 23;
/// Clocks after the indicator and the 18 bits.
const TRAILING_BITS: u32 = 5;
const TRAILING_ONES: u32 = (1 << TRAILING_BITS) - 1;
/// Turns two's complement into 0 = most negative.
const SIGN_BIT: u32 = 1 << 17;

/// DAC and gauge of the fine axis.
pub struct Piezo {
    spi: Spi<'static, Blocking, Master>,
    dac_select: Output<'static>,
    convert: Output<'static>,
    code: Option<u16>,
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
        let convert = Output::new(convert, Level::Low, Speed::Medium);
        let mut config = spi::Config::default();
        config.mode = MODE_0;
        config.frequency = SPI_HZ;
        config.miso_pull = embassy_stm32::gpio::Pull::Up;
        Self {
            spi: Spi::new_blocking(spi, clock, data_out, data_in, config),
            dac_select,
            convert,
            code: None,
        }
    }

    /// Samples and reads the gauge: 0 to [`GAUGE_CODE_MAX`], `None` where no converter answers. Takes 5 us.
    pub fn gauge(&mut self) -> Option<u32> {
        self.convert.set_high();
        self.convert.set_low();
        cortex_m::asm::delay(CONVERSION_CYCLES);
        let mut bytes = [0u8; 3];
        self.spi.blocking_transfer_in_place(&mut bytes).ok()?;
        let word = u32::from_be_bytes([0, bytes[0], bytes[1], bytes[2]]);
        let code = (word >> TRAILING_BITS) & GAUGE_CODE_MAX;
        let whole = word & BUSY_BIT == 0 && word & TRAILING_ONES == TRAILING_ONES;
        whole.then_some(code ^ SIGN_BIT)
    }

    /// Sets the DAC; what it holds already is not sent again.
    pub fn set(&mut self, code: u16) {
        if self.code == Some(code) {
            return;
        }
        self.dac_select.set_low();
        let sent = self.spi.blocking_write(&code.to_be_bytes());
        self.dac_select.set_high();
        // An error is a programming mistake of this driver, and the next tick tries again.
        self.code = sent.is_ok().then_some(code);
    }
}
