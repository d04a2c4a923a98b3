//! FRAM: Cypress FM25V02 (001-84494) or FM25V02A (001-90865), 32 KiB on SPI4, mode 0; no pages, 64 bytes take 26 us.
//! Reads repeat until two agree: a bit flipped while plugs bounce must not lose a record or, in the name, the memory.

use embassy_stm32::{
    Peri,
    gpio::{Level, Output, Speed},
    mode::Blocking,
    pac,
    peripherals::{PE2, PE4, PE5, PE6, SPI4},
    spi::{self, MODE_0, Spi, mode::Master},
    time::Hertz,
};
use farnear_rig::io::{MEMORY_BYTES, MemoryWrite};

/// APB2 / 4; the chip permits 40 MHz.
const SPI_HZ: Hertz = Hertz(21_000_000);
const WRITE_ENABLE: u8 = 0x06;
const WRITE: u8 = 0x02;
const READ: u8 = 0x03;
const READ_ID: u8 = 0x9f;
const READ_STATUS: u8 = 0x05;
/// Status bits that read 0, except the second, write enabled (table 4); all read 1 without the chip.
const STATUS_MASK: u8 = 0b0011_0011;
const WRITE_ENABLED: u8 = 0b0000_0010;
/// Manufacturer, family and density (table 6), after six continuation bytes; then the revision (08: FM25V02A).
const ID: [u8; 8] = [0x7f, 0x7f, 0x7f, 0x7f, 0x7f, 0x7f, 0xc2, 0x22];
/// Attempts to read the name, or a piece equal twice in a row.
const ATTEMPTS: usize = 4;
const PIECE: usize = 256;

pub struct Memory {
    spi: Spi<'static, Blocking, Master>,
    select: Output<'static>,
    failed: bool,
}

impl Memory {
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
        Self { spi: Spi::new_blocking(spi, clock, data_out, data_in, config), select, failed: false }
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

    pub fn is_there(&mut self) -> bool {
        (0..ATTEMPTS).any(|_| {
            let mut id = [0; ID.len()];
            self.command(&[READ_ID], |spi| spi.blocking_read(&mut id).is_ok()) && id == ID
        })
    }

    /// Reads the records from address 0; `false` on a bus error.
    pub fn read(&mut self, bytes: &mut [u8; MEMORY_BYTES]) -> bool {
        let pieces = bytes.chunks_exact_mut(PIECE).zip((0..).step_by(PIECE));
        for (piece, address) in pieces {
            if !self.read_piece(address, piece) {
                return false;
            }
        }
        true
    }

    /// Reads a piece until two agree; otherwise the records' checksums decide.
    fn read_piece(&mut self, address: u16, piece: &mut [u8]) -> bool {
        let mut again = [0; PIECE];
        let [high, low] = address.to_be_bytes();
        let mut read =
            |bytes: &mut [u8]| self.command(&[READ, high, low], |spi| spi.blocking_read(bytes).is_ok());
        for _ in 0..ATTEMPTS {
            if !(read(piece) && read(&mut again)) {
                return false;
            }
            if piece == again {
                break;
            }
        }
        true
    }

    /// Whether the chip did not confirm a write since the last call.
    pub const fn take_failure(&mut self) -> bool {
        core::mem::replace(&mut self.failed, false)
    }

    /// Whether the chip confirms that it accepts a write. Takes 1.5 us.
    fn enable_write(&mut self) -> bool {
        self.send(&[WRITE_ENABLE], &[]);
        let mut status = [0];
        let answered = self.command(&[READ_STATUS], |spi| spi.blocking_read(&mut status).is_ok());
        answered && status[0] & STATUS_MASK == WRITE_ENABLED
    }

    /// Write errors are detected at the next start by the checksums.
    pub fn write(&mut self, order: &MemoryWrite) {
        let [high, low] = order.address.to_be_bytes();
        self.failed |= !(0..ATTEMPTS).any(|_| self.enable_write());
        self.send(&[WRITE, high, low], &order.bytes);
    }

    /// Sends without gaps; the HAL waits for each received byte, which takes twice as long.
    fn send(&mut self, head: &[u8], bytes: &[u8]) {
        let spi = pac::SPI4;
        self.select.set_low();
        for byte in head.iter().chain(bytes) {
            while !spi.sr().read().txe() {}
            spi.dr().write(|w| w.set_dr(u16::from(*byte)));
        }
        while !spi.sr().read().txe() {}
        while spi.sr().read().bsy() {}
        self.select.set_high();
        // Reading data and status clears the overrun.
        let _ = spi.dr().read();
        let _ = spi.sr().read();
    }
}
