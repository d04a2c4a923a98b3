//! The serial link: USART3 on the ST-LINK's virtual COM port, 2 Mbaud, 8N1.
//!
//! Received bytes wait in the driver's buffer until the next control tick takes them; frames to send wait in
//! [`FRAMES`] for the sending task.

use core::sync::atomic::{AtomicBool, Ordering};

use defmt::warn;
use embassy_executor::task;
use embassy_stm32::{
    Peri, bind_interrupts,
    peripherals::{PD8, PD9, USART3},
    usart::{self, BufferedUart, BufferedUartRx, BufferedUartTx, ConfigError},
};
use embassy_sync::{blocking_mutex::raw::ThreadModeRawMutex, channel::Channel};
use embassy_time::{Duration, with_timeout};
use embedded_io::{Read, ReadReady};
use farnear_protocol::frame::{Encoded, FRAME_MAX};
use static_cell::StaticCell;

/// Speed of the link.
pub const BAUD: u32 = 2_000_000;
/// 5 ms of bytes, 25 control ticks.
const RECEIVE_BUFFER: usize = 1024;
/// A frame takes 1.3 ms on the wire; longer than this the hardware is stuck.
const SEND_TIMEOUT: Duration = Duration::from_millis(10);

/// Frames on their way out.
static FRAMES: Channel<ThreadModeRawMutex, Encoded, 4> = Channel::new();
/// The sending task has a frame in its hands.
static SENDING: AtomicBool = AtomicBool::new(false);

bind_interrupts!(struct Interrupts {
    USART3 => usart::BufferedInterruptHandler<USART3>;
});

/// The link's two ends on the board.
pub struct Link {
    receiver: BufferedUartRx<'static>,
}

/// Sets the port up; gives the receiving end, and the sending end for [`send`].
pub fn open(
    port: Peri<'static, USART3>,
    tx: Peri<'static, PD8>,
    rx: Peri<'static, PD9>,
) -> Result<(Link, BufferedUartTx<'static>), ConfigError> {
    static SEND: StaticCell<[u8; FRAME_MAX]> = StaticCell::new();
    static RECEIVE: StaticCell<[u8; RECEIVE_BUFFER]> = StaticCell::new();
    let mut config = usart::Config::default();
    config.baudrate = BAUD;
    let send = SEND.init([0; FRAME_MAX]);
    let receive = RECEIVE.init([0; RECEIVE_BUFFER]);
    let (sender, receiver) = BufferedUart::new(port, rx, tx, send, receive, Interrupts, config)?.split();
    Ok((Link { receiver }, sender))
}

impl Link {
    /// Hands over what has come in; `true` where the buffer was full, so that bytes may have been lost.
    pub fn drain(&mut self, mut take: impl FnMut(u8)) -> bool {
        let mut bytes = [0; 64];
        let mut taken = 0;
        // What comes meanwhile waits for the next tick: a sender without a pause must not hold this one up.
        while taken < RECEIVE_BUFFER
            && let Ok(true) = self.receiver.read_ready()
        {
            let Ok(count) = self.receiver.read(&mut bytes) else { break };
            bytes[..count].iter().for_each(|byte| take(*byte));
            taken += count;
        }
        // The ring keeps one place free to tell full from empty.
        taken >= RECEIVE_BUFFER - 1
    }

    /// Whether another frame can be queued.
    pub fn has_room(&self) -> bool {
        !FRAMES.is_full()
    }

    /// Queues a frame. Only after [`Link::has_room`]; else it is dropped, and the host asks again.
    pub fn send(&self, frame: Encoded) {
        if FRAMES.try_send(frame).is_err() {
            warn!("a frame was dropped: no room");
        }
    }

    /// Everything has left the board.
    pub fn is_idle(&self) -> bool {
        FRAMES.is_empty() && !SENDING.load(Ordering::Relaxed)
    }
}

/// Sends the queued frames, each to its last bit before the next: the driver's buffer holds just one, and its
/// writer does not wait for room.
#[task]
pub async fn send(mut port: BufferedUartTx<'static>) -> ! {
    use embedded_io_async::Write;
    loop {
        FRAMES.ready_to_receive().await;
        SENDING.store(true, Ordering::Relaxed);
        let frame = FRAMES.receive().await;
        let sent = with_timeout(SEND_TIMEOUT, async {
            port.write_all(&frame).await?;
            port.flush().await
        });
        if !matches!(sent.await, Ok(Ok(()))) {
            warn!("a frame was not sent");
        }
        SENDING.store(false, Ordering::Relaxed);
    }
}
