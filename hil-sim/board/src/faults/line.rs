//! A serial line that flips bits.

use crate::plant::Noise;

/// One direction of a line that flips bits.
#[derive(Clone, Debug)]
pub struct NoisyLine {
    rate: f64,
    noise: Noise,
    /// Bits until the next one that is flipped.
    gap: u64,
    flipped: u64,
}

impl NoisyLine {
    /// A line with this rate; `direction` names its stream of random numbers.
    pub fn new(rate: f64, seed: u64, direction: &str) -> Self {
        let mut line = Self { rate, noise: Noise::new(seed, direction), gap: 0, flipped: 0 };
        line.gap = line.draw();
        line
    }

    /// Length of the run of good bits: geometric.
    fn draw(&mut self) -> u64 {
        if self.rate <= 0.0 {
            return u64::MAX;
        }
        let good = libm::log(1.0 - self.noise.uniform()) / libm::log1p(-self.rate);
        // A float too large for the integer saturates, which is what is meant.
        if good.is_finite() { good as u64 } else { 0 }
    }

    /// Carries bytes over the line.
    pub fn carry(&mut self, bytes: &mut [u8]) {
        for byte in bytes {
            for bit in 0..8 {
                if self.gap == 0 {
                    *byte ^= 1 << bit;
                    self.flipped += 1;
                    self.gap = self.draw();
                } else {
                    self.gap -= 1;
                }
            }
        }
    }

    /// Bits flipped so far.
    pub fn flipped(&self) -> u64 {
        self.flipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flips_its_share_of_bits() {
        let mut line = NoisyLine::new(1e-3, 1, "test");
        let mut bytes = vec![0u8; 1_000_000];
        line.carry(&mut bytes);
        let ones: u32 = bytes.iter().map(|byte| byte.count_ones()).sum();
        assert_eq!(u64::from(ones), line.flipped());
        // Poisson with mean 8000: five standard deviations.
        assert!((f64::from(ones) - 8000.0).abs() < 450.0, "{ones}");
        let mut clean = NoisyLine::new(0.0, 1, "test");
        let mut bytes = *b"unchanged";
        clean.carry(&mut bytes);
        assert_eq!(&bytes, b"unchanged");
    }
}
