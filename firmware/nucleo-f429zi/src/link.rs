//! The serial link: USART3 on the ST-LINK's virtual COM port, 2 Mbaud, 8N1, both directions by DMA.
//!
//! At this speed a byte comes every 5 us: an interrupt for each, in both directions, would take half of the processor. The DMA
//! writes what comes into a ring, round and round, and takes what goes from a frame of its own; the control loop looks at
//! both once a tick. Received bytes wait in the ring until then.
//!
//! | stream of DMA1 | channel | (RM0090, table 42) |
//! |---|---|---|
//! | 1 | 4 | USART3_RX |
//! | 3 | 4 | USART3_TX |

use core::sync::atomic::{AtomicU8, Ordering, compiler_fence};

use embassy_stm32::{
    Peri,
    mode::Blocking,
    pac::{self, dma::vals},
    peripherals::{PD8, PD9, USART3},
    usart::{self, ConfigError, Uart},
};
use farnear_protocol::frame::{Encoded, FRAME_MAX};
use static_cell::StaticCell;

/// Speed of the link.
pub const BAUD: u32 = 2_000_000;
/// 10 ms of bytes, 50 control ticks.
const RING: usize = 2048;
/// The streams, and the channel of both.
const RECEIVE: usize = 1;
const SEND: usize = 3;
const CHANNEL: u8 = 4;
/// Bytes that may come between the reading of flags and place.
const MARGIN: usize = 16;
/// Streams whose flags share a register.
const PER_REGISTER: usize = 4;

/// Where the DMA puts what comes: it writes behind the compiler's back, as to an atomic any thread may.
static RECEIVED: [AtomicU8; RING] = [const { AtomicU8::new(0) }; RING];

/// The link on the board.
pub struct Link {
    _port: Uart<'static, Blocking>,
    /// Where in the ring the next byte to take lies.
    next: usize,
    /// The frame that the DMA sends.
    frame: &'static mut [u8; FRAME_MAX],
}

/// Sets the port up; from now on what comes is received.
pub fn open(
    port: Peri<'static, USART3>,
    tx: Peri<'static, PD8>,
    rx: Peri<'static, PD9>,
) -> Result<Link, ConfigError> {
    static FRAME: StaticCell<[u8; FRAME_MAX]> = StaticCell::new();
    let mut config = usart::Config::default();
    config.baudrate = BAUD;
    let port = Uart::new_blocking(port, rx, tx, config)?;
    pac::RCC.ahb1enr().modify(|w| w.set_dma1en(true));
    let link = Link { _port: port, next: 0, frame: FRAME.init([0; FRAME_MAX]) };
    set_up(RECEIVE, vals::Dir::PERIPHERAL_TO_MEMORY, RECEIVED.as_ptr() as u32);
    set_up(SEND, vals::Dir::MEMORY_TO_PERIPHERAL, link.frame.as_ptr() as u32);
    let ring = pac::DMA1.st(RECEIVE);
    ring.ndtr().write(|w| w.set_ndt(RING as u16));
    ring.cr().modify(|w| {
        w.set_circ(true);
        w.set_pl(vals::Pl::VERY_HIGH);
    });
    ring.cr().modify(|w| w.set_en(true));
    pac::USART3.cr3().modify(|w| {
        w.set_dmar(true);
        w.set_dmat(true);
    });
    Ok(link)
}

/// What is the same of every transfer: bytes between the port's data register and memory.
fn set_up(stream: usize, direction: vals::Dir, memory: u32) {
    let dma = pac::DMA1.st(stream);
    dma.par().write_value(pac::USART3.dr().as_ptr() as u32);
    dma.m0ar().write_value(memory);
    dma.cr().write(|w| {
        w.set_chsel(CHANNEL);
        w.set_dir(direction);
        w.set_minc(true);
    });
}

impl Link {
    /// Hands over what has come in; `true` where some may have been lost.
    pub fn drain(&mut self, mut take: impl FnMut(u8)) -> bool {
        // A noisy line sets flags that stay, and the overrun's stops the reception: reading status and data clears them.
        let status = pac::USART3.sr().read();
        if status.ore() || status.fe() || status.ne() {
            let _ = pac::USART3.dr().read();
        }
        let flags = pac::DMA1.isr(0).read();
        let (half, whole) = (flags.htif(RECEIVE), flags.tcif(RECEIVE));
        if half || whole {
            pac::DMA1.ifcr(0).write(|w| {
                w.set_htif(RECEIVE, half);
                w.set_tcif(RECEIVE, whole);
            });
        }
        // Counts down from the ring's length.
        let begin = self.next;
        let end = (RING - usize::from(pac::DMA1.st(RECEIVE).ndtr().read().ndt()).min(RING)) % RING;
        while self.next != end {
            take(RECEIVED[self.next].load(Ordering::Relaxed));
            self.next = (self.next + 1) % RING;
        }
        // A way shorter than half a round passes one mark at most. Where both were passed it was a round longer. (A mark that the
        // DMA passes between the two readings is seen in the next tick; the margin is for it.)
        let way = (end + RING - begin) % RING;
        half && whole && way < RING / 2 - MARGIN
    }

    /// Whether a frame can be sent.
    pub fn has_room(&self) -> bool {
        !pac::DMA1.st(SEND).cr().read().en()
    }

    /// Sends a frame. Only after [`Link::has_room`]; else it is dropped, and the host asks again.
    pub fn send(&mut self, frame: &Encoded) {
        let Some(place) = self.frame.get_mut(..frame.len()).filter(|_| !pac::DMA1.st(SEND).cr().read().en())
        else {
            return;
        };
        place.copy_from_slice(frame);
        // The DMA reads the frame, which the compiler does not know.
        compiler_fence(Ordering::SeqCst);
        pac::DMA1.ifcr(SEND / PER_REGISTER).write(|w| {
            w.set_tcif(SEND % PER_REGISTER, true);
            w.set_htif(SEND % PER_REGISTER, true);
            w.set_teif(SEND % PER_REGISTER, true);
            w.set_feif(SEND % PER_REGISTER, true);
        });
        // The DMA's write does not clear it, as the processor's would (RM0090, section 30.3.13).
        pac::USART3.sr().write(|w| {
            w.0 = u32::MAX;
            w.set_tc(false);
        });
        let dma = pac::DMA1.st(SEND);
        dma.ndtr().write(|w| w.set_ndt(frame.len() as u16)); // at most FRAME_MAX
        dma.cr().modify(|w| w.set_en(true));
    }

    /// Everything has left the board.
    pub fn is_idle(&self) -> bool {
        self.has_room() && pac::USART3.sr().read().tc()
    }
}
