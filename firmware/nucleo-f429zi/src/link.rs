//! Serial link: USART3 on the ST-LINK's virtual COM port, 8N1, 2 Mbaud or as requested, by DMA without interrupts. A
//! circular transfer fills a ring that each tick empties; a second ring is sent piece by piece. The HAL's port damages
//! one in 2,000 frames: writing back the status register clears RXNE of a byte received in between (RM0090, USART_SR).

use core::sync::atomic::{AtomicU8, Ordering, fence};

use defmt::warn;
use embassy_stm32::{
    Peri,
    mode::Blocking,
    pac::{
        self,
        dma::{
            regs::Cr,
            vals::{Dir, Pl},
        },
    },
    peripherals::{PD8, PD9, USART3},
    usart::{self, ConfigError, Uart},
};
use farnear_protocol::{frame::FRAME_MAX, message::LinkRate};
use farnear_rig::ring::{self, Lap};

use crate::clock::APB1_TIMER_HZ;

const APB1_HZ: u32 = APB1_TIMER_HZ / 2;
/// 20 ms of bytes: as many requests as may be outstanding, sent at once while a correction is solved (up to 8 ms).
const RECEIVE_RING: usize = 4096;
/// Three of the longest frames with delimiters, and a power of two, so that wrapping needs no division.
const SEND_RING: usize = 4 * FRAME_MAX;

/// Streams and channel of USART3 on DMA1 (RM0090, table 42).
const RECEIVE_STREAM: usize = 1;
const SEND_STREAM: usize = 3;
const CHANNEL: u8 = 4;

// Atomic, because the DMA accesses them.
static RECEIVED: [AtomicU8; RECEIVE_RING] = [const { AtomicU8::new(0) }; RECEIVE_RING];
static TO_SEND: [AtomicU8; SEND_RING] = [const { AtomicU8::new(0) }; SEND_RING];

pub struct Link {
    _port: Uart<'static, Blocking>,
    taken: usize,
    /// Start of the data in [`TO_SEND`].
    sent: usize,
    /// End of the current transfer in [`TO_SEND`].
    handed_over: usize,
    /// End of the written frames in [`TO_SEND`].
    written: usize,
}

impl Link {
    /// Sets up the port and starts receiving.
    pub fn open(
        port: Peri<'static, USART3>,
        tx: Peri<'static, PD8>,
        rx: Peri<'static, PD9>,
    ) -> Result<Self, ConfigError> {
        let mut config = usart::Config::default();
        config.baudrate = LinkRate::START.baud();
        let port = Uart::new_blocking(port, rx, tx, config)?;
        pac::RCC.ahb1enr().modify(|w| w.set_dma1en(true));
        pac::USART3.cr3().modify(|w| {
            w.set_dmar(true);
            w.set_dmat(true);
        });
        start(RECEIVE_STREAM, &RECEIVED, |cr| {
            cr.set_dir(Dir::PERIPHERAL_TO_MEMORY);
            cr.set_circ(true);
            // A received byte is lost after 5 us, a sent one can wait.
            cr.set_pl(Pl::VERY_HIGH);
        });
        Ok(Self { _port: port, taken: 0, sent: 0, handed_over: 0, written: 0 })
    }

    /// Passes received bytes; `true` if some were lost in a full ring. Call once per tick, also to continue sending.
    pub fn drain(&mut self, mut take: impl FnMut(u8)) -> bool {
        self.hand_over();
        // The order matters: flag, place, bytes, clearing.
        let flag = pac::DMA1.isr(RECEIVE_STREAM / 4).read().tcif(RECEIVE_STREAM % 4);
        let end = received();
        let lap = ring::lap(flag, self.taken, end);
        if lap == Lap::Lost {
            self.taken = end;
        }
        while self.taken != end {
            take(RECEIVED[self.taken].load(Ordering::Relaxed));
            self.taken = (self.taken + 1) % RECEIVE_RING;
        }
        if lap != Lap::Unfinished {
            clear(RECEIVE_STREAM);
        }
        lap == Lap::Lost
    }

    pub const fn has_room(&self) -> bool {
        // One place stays free to distinguish full from empty.
        (self.sent + SEND_RING - self.written - 1) % SEND_RING > FRAME_MAX
    }

    /// Queues a frame; drops it without [`Link::has_room`], because the host repeats its request.
    pub fn send(&mut self, bytes: &[u8]) {
        if !self.has_room() {
            warn!("a frame was dropped: no room");
            return;
        }
        for byte in bytes {
            TO_SEND[self.written].store(*byte, Ordering::Relaxed);
            self.written = (self.written + 1) % SEND_RING;
        }
        self.hand_over();
    }

    /// Call while nothing is sent. Exact at 2,000,000 baud; 921,600 gives 913,043: 0.9 % off, 3 % permitted (RM0090).
    pub fn set_rate(&mut self, rate: LinkRate) {
        let baud = rate.baud();
        // Sixteen samples per bit: the register counts sixteenths of the divider.
        pac::USART3.brr().write(|w| w.0 = (APB1_HZ + baud / 2) / baud);
    }

    pub fn is_idle(&self) -> bool {
        self.handed_over == self.written && !is_running(SEND_STREAM) && pac::USART3.sr().read().tc()
    }

    /// Starts an idle DMA with the written bytes up to the ring's end.
    fn hand_over(&mut self) {
        if is_running(SEND_STREAM) {
            return;
        }
        self.sent = self.handed_over;
        if self.sent == self.written {
            return;
        }
        let end = if self.written > self.sent { self.written } else { SEND_RING };
        // TC is cleared by a zero; ones in the other bits have no effect.
        pac::USART3.sr().write(|w| {
            w.0 = 0x3ff;
            w.set_tc(false);
        });
        start(SEND_STREAM, &TO_SEND[self.sent..end], |cr| cr.set_dir(Dir::MEMORY_TO_PERIPHERAL));
        self.handed_over = end % SEND_RING;
    }
}

fn start(stream: usize, bytes: &'static [AtomicU8], set: impl FnOnce(&mut Cr)) {
    clear(stream);
    let registers = pac::DMA1.st(stream);
    registers.par().write_value(pac::USART3.dr().as_ptr() as u32);
    registers.m0ar().write_value(bytes.as_ptr() as u32);
    // The rings are shorter than the counter's 65,535.
    registers.ndtr().write(|w| w.set_ndt(bytes.len() as u16));
    // Earlier writes are in memory when the transfer reads it.
    fence(Ordering::Release);
    registers.cr().write(|w| {
        w.set_chsel(CHANNEL);
        w.set_minc(true);
        set(w);
        w.set_en(true);
    });
}

/// Clears the stream's flags, required before a start.
fn clear(stream: usize) {
    pac::DMA1.ifcr(stream / 4).write(|w| {
        w.set_tcif(stream % 4, true);
        w.set_htif(stream % 4, true);
        w.set_teif(stream % 4, true);
        w.set_dmeif(stream % 4, true);
        w.set_feif(stream % 4, true);
    });
}

/// The hardware stops a stream at its end.
fn is_running(stream: usize) -> bool {
    pac::DMA1.st(stream).cr().read().en()
}

/// End of the received bytes.
fn received() -> usize {
    let left = usize::from(pac::DMA1.st(RECEIVE_STREAM).ndtr().read().ndt());
    // An error flag is cleared by reading it, then the data. The DMA does that with the next byte, which may not
    // come after an overrun. The byte taken here belongs to a frame that is lost already.
    if pac::USART3.sr().read().ore() {
        let _ = pac::USART3.dr().read();
    }
    fence(Ordering::Acquire);
    (RECEIVE_RING - left) % RECEIVE_RING
}
