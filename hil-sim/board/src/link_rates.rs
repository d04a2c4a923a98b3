//! Whether both ends of the line have the same rate.
//!
//! An end that is slower or faster than the other reads other bytes. Which ones depends on where its samples fall; here each byte
//! becomes another one, always the same, so that runs repeat. Bytes take the time that they take at the board's rate.

use std::ops::Range;

use farnear_protocol::message::LinkRate;

/// Divider of USART3's rate (RM0090: base 0x4000_4800, USART_BRR at 0x08), and what it divides.
const BRR: Range<u64> = 0x4000_4808..0x4000_480c;
const APB1_HZ: u32 = 42_000_000;
/// A receiver bears a twentieth of a bit per bit at most; beyond that it reads something else.
const TOLERANCE: u32 = 20;

#[derive(Debug)]
pub struct LinkRates {
    board: LinkRate,
    /// What the board has set, once what it sent before is taken from the line.
    next: Option<LinkRate>,
    host: Option<LinkRate>,
}

impl LinkRates {
    /// Of a board that was just reset, and a host that has set no rate.
    pub const fn new() -> Self {
        Self { board: LinkRate::START, next: None, host: None }
    }

    /// Whether the board changes its rate by writing to this address.
    pub fn watches(address: u64) -> bool {
        BRR.contains(&address)
    }

    /// The board has written its divider: what it sends from now on has another rate, see [`LinkRates::settle`].
    pub fn divide(&mut self, divider: u32) {
        let baud = APB1_HZ / divider.max(1);
        let near = |rate: &LinkRate| baud.abs_diff(rate.baud()) < rate.baud() / TOLERANCE;
        self.next = LinkRate::ALL.into_iter().find(near);
    }

    /// What was sent has been taken from the line.
    pub fn settle(&mut self) {
        self.board = self.next.take().unwrap_or(self.board);
    }

    pub fn reset(&mut self) {
        (self.board, self.next) = (LinkRate::START, None);
    }

    /// The host's end has another rate. One that this link does not have is that of a program that does not care, as a
    /// pseudo-terminal does not either.
    pub fn set_host(&mut self, baud: u32) {
        self.host = LinkRate::of(baud);
    }

    /// What becomes of bytes on their way, in either direction.
    pub fn carry(&self, bytes: &mut [u8]) {
        if self.host.is_some_and(|host| host != self.board) {
            for byte in bytes {
                *byte = byte.rotate_left(3) ^ 0x5a;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_pass_between_ends_of_one_rate_only() {
        let mut rates = LinkRates::new();
        let passes = |rates: &LinkRates| {
            let mut bytes = [1, 2, 0];
            rates.carry(&mut bytes);
            bytes == [1, 2, 0]
        };
        assert!(passes(&rates), "a host that has set none");
        rates.set_host(921_600);
        assert!(!passes(&rates));
        rates.divide(APB1_HZ / 921_600);
        assert!(!passes(&rates), "what it sent before is still on the line");
        rates.settle();
        assert!(passes(&rates));
        rates.reset();
        assert!(!passes(&rates));
        rates.set_host(38_400);
        assert!(passes(&rates), "a program that does not care");
    }
}
