//! Baud rates of both ends. If they differ, each byte arrives as a fixed wrong one, so that runs repeat.

use farnear_protocol::message::LinkRate;

/// USART3's divider and control register (RM0090: base 0x4000_4800, USART_BRR at 0x08, USART_CR1 at 0x0c), and its clock.
const BRR: u64 = 0x4000_4808;
const CR1: u64 = 0x4000_480c;
const APB1_HZ: u32 = 42_000_000;
/// USART_CR1: 8 instead of 16 samples per bit.
const OVER8: u32 = 1 << 15;
/// A receiver tolerates 1/20 bit of drift per bit.
const TOLERANCE: u32 = 20;

#[derive(Debug)]
pub struct LinkRates {
    /// `None` until the firmware writes it.
    divider: Option<u32>,
    over8: bool,
    board_baud: u32,
    /// New rate of the board, valid once earlier bytes have left.
    next_baud: Option<u32>,
    host: Option<LinkRate>,
}

impl LinkRates {
    pub const fn new() -> Self {
        let board_baud = LinkRate::START.baud();
        Self { divider: None, over8: false, board_baud, next_baud: None, host: None }
    }

    pub fn watches(address: u64) -> bool {
        address == BRR || address == CR1
    }

    /// A register write of the firmware; takes effect in [`LinkRates::settle`].
    pub fn write(&mut self, address: u64, value: u32) {
        match address {
            BRR => self.divider = Some(value & 0xffff),
            _ => self.over8 = value & OVER8 != 0,
        }
        self.next_baud = self.divider.map(|divider| baud(divider, self.over8));
    }

    /// Earlier bytes have left the line.
    pub fn settle(&mut self) {
        self.board_baud = self.next_baud.take().unwrap_or(self.board_baud);
    }

    pub fn reset(&mut self) {
        *self = Self { host: self.host, ..Self::new() };
    }

    /// Ignores an unsupported rate: a program on a pseudo-terminal need not set one.
    pub fn set_host(&mut self, baud: u32) {
        self.host = LinkRate::of(baud);
    }

    pub fn carry(&self, bytes: &mut [u8]) {
        let board_has = |rate: &LinkRate| self.board_baud.abs_diff(rate.baud()) < rate.baud() / TOLERANCE;
        // Without a rate of the host, any supported one of the board passes.
        let passes = self.host.map_or_else(|| LinkRate::ALL.iter().any(board_has), |host| board_has(&host));
        if !passes {
            for byte in bytes {
                *byte = byte.rotate_left(3) ^ 0x5a;
            }
        }
    }
}

/// Baud of a divider in sixteenths, or with `over8` in whole eighths and three bits of fraction (RM0090, section 30.3.4).
fn baud(divider: u32, over8: bool) -> u32 {
    let clocks = if over8 { (divider & 0xfff0) / 2 + (divider & 7) } else { divider };
    APB1_HZ / clocks.max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn passes(rates: &LinkRates) -> bool {
        let mut bytes = [1, 2, 0];
        rates.carry(&mut bytes);
        bytes == [1, 2, 0]
    }

    #[test]
    fn bytes_pass_only_at_equal_rates() {
        let mut rates = LinkRates::new();
        assert!(passes(&rates), "no rate set by the host");
        rates.set_host(921_600);
        assert!(!passes(&rates));
        rates.write(BRR, APB1_HZ / 921_600);
        assert!(!passes(&rates), "earlier bytes are still on the line");
        rates.settle();
        assert!(passes(&rates));
        rates.reset();
        assert!(!passes(&rates));
        rates.set_host(38_400);
        assert!(passes(&rates), "an unsupported rate is ignored");
    }

    #[test]
    fn a_divider_of_an_unsupported_rate_passes_nothing() {
        let board = |writes: &[(u64, u32)]| {
            let mut rates = LinkRates::new();
            writes.iter().for_each(|(address, value)| rates.write(*address, *value));
            rates.settle();
            let without_host = passes(&rates);
            rates.set_host(LinkRate::START.baud());
            (without_host, passes(&rates))
        };
        // What the firmware writes: 21 for 2,000,000 baud, 46 for 921,600.
        assert_eq!([21, 46].map(|divider| board(&[(BRR, divider)])), [(true, true), (true, false)]);
        // 115,200 baud, none, and 2,000,000 baud of another clock.
        for divider in [365, 0, 42] {
            assert_eq!(board(&[(BRR, divider)]), (false, false), "{divider}");
        }
        assert_eq!(board(&[(CR1, OVER8), (BRR, 0x25)]), (true, true), "21 clocks: 2 times 8 and 5");
        assert_eq!(board(&[(BRR, 21), (CR1, OVER8)]), (false, false), "13 clocks");
        assert_eq!(board(&[(CR1, 0)]), (true, true), "the divider is not written yet");
    }
}
