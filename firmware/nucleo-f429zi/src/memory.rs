//! The memory without power: Cypress FM25V02 (document 001-84494), 32 KiB of FRAM on SPI4, mode 0. It writes at the
//! speed of the bus, with no pages and no busy time: 64 bytes take 26 us.

use embassy_stm32::{
    Peri,
    gpio::{Level, Output, Speed},
    mode::Blocking,
    peripherals::{PE2, PE4, PE5, PE6, SPI4},
    spi::{self, MODE_0, Spi, mode::Master},
    time::Hertz,
};
use farnear_rig::io::{MEMORY_BYTES, MemoryWrite};

/// APB2 / 4; the chip stands 40 MHz.
const SPI_HZ: Hertz = Hertz(21_000_000);
/// Opcodes (table 1).
const WRITE_ENABLE: u8 = 0x06;
const WRITE: u8 = 0x02;
const READ: u8 = 0x03;
const READ_ID: u8 = 0x9f;
/// Manufacturer, family and density (table 6), behind six bytes of a continuation code.
const ID: [u8; 9] = [0x7f, 0x7f, 0x7f, 0x7f, 0x7f, 0x7f, 0xc2, 0x22, 0x00];

/// The chip.
pub struct Memory {
    spi: Spi<'static, Blocking, Master>,
    select: Output<'static>,
}

impl Memory {
    /// Sets SPI4 and the select up.
    pub fn new(
        spi: Peri<'static, SPI4>,
        clock: Peri<'static, PE2>,
        data_in: Peri<'static, PE5>,
        data_out: Peri<'static, PE6>,
        select: Peri<'static, PE4>,
    ) -> Self {
        let select = Output::new(select, Level::High, Speed::Medium);
        let mut config = spi::Config::default();
        config.mode = MODE_0;
        config.frequency = SPI_HZ;
        // Without the chip all bytes read as ones.
        config.miso_pull = embassy_stm32::gpio::Pull::Up;
        Self { spi: Spi::new_blocking(spi, clock, data_out, data_in, config), select }
    }

    fn command(
        &mut self,
        head: &[u8],
        then: impl FnOnce(&mut Spi<'static, Blocking, Master>) -> bool,
    ) -> bool {
        self.select.set_low();
        let done = self.spi.blocking_write(head).is_ok() && then(&mut self.spi);
        self.select.set_high();
        done
    }

    /// Whether the chip answers with its name.
    pub fn is_there(&mut self) -> bool {
        let mut id = [0; ID.len()];
        self.command(&[READ_ID], |spi| spi.blocking_read(&mut id).is_ok()) && id == ID
    }

    /// Reads what the rig keeps, from address 0; `false` where the bus failed.
    pub fn read(&mut self, bytes: &mut [u8; MEMORY_BYTES]) -> bool {
        self.command(&[READ, 0, 0], |spi| spi.blocking_read(bytes).is_ok())
    }

    /// Writes; a failure shows at the next start, where each record is checked.
    pub fn write(&mut self, order: &MemoryWrite) {
        let [high, low] = order.address.to_be_bytes();
        let _ = self.command(&[WRITE_ENABLE], |_| true)
            && self.command(&[WRITE, high, low], |spi| spi.blocking_write(&order.bytes).is_ok());
    }
}
