//! Baud rates of both ends. If they differ, each byte arrives as a fixed wrong one, so that runs repeat.

use std::ops::Range;

use farnear_protocol::message::LinkRate;

/// USART3's divider (RM0090: base 0x4000_4800, USART_BRR at 0x08) and its clock.
const BRR: Range<u64> = 0x4000_4808..0x4000_480c;
const APB1_HZ: u32 = 42_000_000;
/// A receiver tolerates 1/20 bit of drift per bit.
const TOLERANCE: u32 = 20;

#[derive(Debug)]
pub struct LinkRates {
    board: LinkRate,
    /// New rate of the board, valid once earlier bytes have left.
    next: Option<LinkRate>,
    host: Option<LinkRate>,
}

impl LinkRates {
    pub const fn new() -> Self {
        Self { board: LinkRate::START, next: None, host: None }
    }

    pub fn watches(address: u64) -> bool {
        BRR.contains(&address)
    }

    /// Takes effect in [`LinkRates::settle`].
    pub fn divide(&mut self, divider: u32) {
        let baud = APB1_HZ / divider.max(1);
        let near = |rate: &LinkRate| baud.abs_diff(rate.baud()) < rate.baud() / TOLERANCE;
        self.next = LinkRate::ALL.into_iter().find(near);
    }

    /// Earlier bytes have left the line.
    pub fn settle(&mut self) {
        self.board = self.next.take().unwrap_or(self.board);
    }

    pub fn reset(&mut self) {
        (self.board, self.next) = (LinkRate::START, None);
    }

    /// Ignores an unsupported rate: a program on a pseudo-terminal need not set one.
    pub fn set_host(&mut self, baud: u32) {
        self.host = LinkRate::of(baud);
    }

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
    fn bytes_pass_only_at_equal_rates() {
        let mut rates = LinkRates::new();
        let passes = |rates: &LinkRates| {
            let mut bytes = [1, 2, 0];
            rates.carry(&mut bytes);
            bytes == [1, 2, 0]
        };
        assert!(passes(&rates), "no rate set by the host");
        rates.set_host(921_600);
        assert!(!passes(&rates));
        rates.divide(APB1_HZ / 921_600);
        assert!(!passes(&rates), "earlier bytes are still on the line");
        rates.settle();
        assert!(passes(&rates));
        rates.reset();
        assert!(!passes(&rates));
        rates.set_host(38_400);
        assert!(passes(&rates), "an unsupported rate is ignored");
    }
}
