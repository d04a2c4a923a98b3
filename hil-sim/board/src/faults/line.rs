//! Serial line that flips bits, loses bytes and inserts bytes.

use crate::plant::Noise;

#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Rates {
    /// Per bit.
    pub flipped: f64,
    /// Per byte.
    pub lost: f64,
    /// Probability of an inserted byte in front of each byte.
    pub inserted: f64,
    pub cut: bool,
}

/// Bernoulli trials, drawn as gaps between hits.
#[derive(Clone, Debug)]
struct Chance {
    rate: f64,
    noise: Noise,
    gap: u64,
}

impl Chance {
    fn new(rate: f64, noise: Noise) -> Self {
        let mut chance = Self { rate, noise, gap: 0 };
        chance.gap = chance.draw();
        chance
    }

    fn set_rate(&mut self, rate: f64) {
        if rate != self.rate {
            self.rate = rate;
            self.gap = self.draw();
        }
    }

    fn draw(&mut self) -> u64 {
        if self.rate <= 0.0 {
            return u64::MAX;
        }
        let good = libm::log(1.0 - self.noise.uniform()) / libm::log1p(-self.rate);
        // Large floats saturate, as intended.
        if good.is_finite() { good as u64 } else { 0 }
    }

    fn strikes(&mut self) -> bool {
        if self.gap == 0 {
            self.gap = self.draw();
            return true;
        }
        self.gap -= 1;
        false
    }
}

#[derive(Clone, Debug)]
pub struct NoisyLine {
    rates: Rates,
    flip: Chance,
    lose: Chance,
    insert: Chance,
    flipped: u64,
}

impl NoisyLine {
    pub fn new(rate: f64, seed: u64, direction: &str) -> Self {
        let chance = |of: &str, rate| Chance::new(rate, Noise::new(seed, &format!("{direction}{of}")));
        Self {
            rates: Rates { flipped: rate, ..Rates::default() },
            flip: chance("", rate),
            lose: chance(", lost", 0.0),
            insert: chance(", inserted", 0.0),
            flipped: 0,
        }
    }

    pub fn set_rates(&mut self, change: impl FnOnce(&mut Rates)) {
        change(&mut self.rates);
        self.flip.set_rate(self.rates.flipped);
        self.lose.set_rate(self.rates.lost);
        self.insert.set_rate(self.rates.inserted);
    }

    pub fn carry(&mut self, bytes: &mut Vec<u8>) {
        if self.rates.cut {
            bytes.clear();
            return;
        }
        if self.rates.lost > 0.0 || self.rates.inserted > 0.0 {
            let mut carried = Vec::with_capacity(bytes.len());
            for byte in bytes.drain(..) {
                if self.insert.strikes() {
                    carried.push(self.insert.noise.bits() as u8);
                }
                if !self.lose.strikes() {
                    carried.push(byte);
                }
            }
            *bytes = carried;
        }
        for byte in bytes {
            for bit in 0..8 {
                if self.flip.strikes() {
                    *byte ^= 1 << bit;
                    self.flipped += 1;
                }
            }
        }
    }

    pub fn flipped(&self) -> u64 {
        self.flipped
    }
}

#[derive(Clone, Debug)]
pub struct Lines {
    pub to_board: NoisyLine,
    pub to_host: NoisyLine,
    /// Latency of the host's adapter, counted from the first byte.
    pub latency_ns: u64,
    /// The adapter reappears under another name.
    pub renamed: bool,
}

impl Lines {
    pub fn new(rate: f64, seed: u64) -> Self {
        Self {
            to_board: NoisyLine::new(rate, seed, "line to the board"),
            to_host: NoisyLine::new(rate, seed, "line to the host"),
            latency_ns: 0,
            renamed: false,
        }
    }

    pub fn each(&mut self, change: impl Fn(&mut NoisyLine)) {
        change(&mut self.to_board);
        change(&mut self.to_host);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flips_bits_at_the_given_rate() {
        let mut line = NoisyLine::new(1e-3, 1, "test");
        let mut bytes = vec![0u8; 1_000_000];
        line.carry(&mut bytes);
        let ones: u32 = bytes.iter().map(|byte| byte.count_ones()).sum();
        assert_eq!(u64::from(ones), line.flipped());
        // Poisson with mean 8000: five standard deviations.
        assert!((f64::from(ones) - 8000.0).abs() < 450.0, "{ones}");
        let mut clean = NoisyLine::new(0.0, 1, "test");
        let mut bytes = b"unchanged".to_vec();
        clean.carry(&mut bytes);
        assert_eq!(&bytes, b"unchanged");
    }

    #[test]
    fn loses_and_inserts_bytes_at_the_given_rate_until_repaired() {
        let carry = |change: fn(&mut Rates)| {
            let mut line = NoisyLine::new(0.0, 1, "test");
            line.set_rates(change);
            let mut bytes = vec![0u8; 100_000];
            line.carry(&mut bytes);
            bytes.len()
        };
        // Binomial with mean 1000: five standard deviations are 157.
        assert!((98_843..99_157).contains(&carry(|rates| rates.lost = 0.01)));
        assert!((100_843..101_157).contains(&carry(|rates| rates.inserted = 0.01)));
        // Binomial with standard deviation 158 and 95.
        assert!((149_210..150_790).contains(&carry(|rates| rates.inserted = 0.5)));
        assert!((189_525..190_475).contains(&carry(|rates| rates.inserted = 0.9)));
        assert_eq!(carry(|rates| rates.inserted = 1.0), 200_000);
        assert_eq!(carry(|rates| rates.cut = true), 0);
        assert_eq!(carry(|rates| rates.lost = 1.0), 0);
        let mut line = NoisyLine::new(0.0, 1, "test");
        line.set_rates(|rates| rates.lost = 0.5);
        line.set_rates(|rates| rates.lost = 0.0);
        let mut bytes = b"unchanged".to_vec();
        line.carry(&mut bytes);
        assert_eq!(&bytes, b"unchanged");
    }
}
