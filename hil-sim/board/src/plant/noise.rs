//! Seeded noise, identical on every machine.

use rand_chacha::{
    ChaCha8Rng,
    rand_core::{RngCore, SeedableRng},
};

#[derive(Clone, Debug)]
pub struct Noise(ChaCha8Rng);

impl Noise {
    /// Streams of different purposes are independent.
    pub fn new(seed: u64, purpose: &str) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        // FNV-1a of the purpose selects one of ChaCha's 2^64 streams.
        let hash = |sum: u64, byte: u8| (sum ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        rng.set_stream(purpose.bytes().fold(0xcbf2_9ce4_8422_2325, hash));
        Self(rng)
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Normal with mean 0 and standard deviation 1 (Box & Muller, 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.uniform()));
        radius * libm::cos(core::f64::consts::TAU * self.uniform())
    }

    pub fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_repeat_and_differ() {
        let take = |seed, purpose| {
            let mut noise = Noise::new(seed, purpose);
            [noise.bits(), noise.bits()]
        };
        assert_eq!(take(1, "gauge"), take(1, "gauge"));
        assert_ne!(take(1, "gauge"), take(2, "gauge"));
        assert_ne!(take(1, "gauge"), take(1, "jitter"));
    }

    #[test]
    fn normal_has_mean_zero_and_unit_variance() {
        let mut noise = Noise::new(3, "moments");
        let n = 100_000;
        let sample: Vec<f64> = (0..n).map(|_| noise.normal()).collect();
        let mean = sample.iter().sum::<f64>() / f64::from(n);
        let variance = sample.iter().map(|x| x * x).sum::<f64>() / f64::from(n);
        // Five standard errors: 1/sqrt(n) and sqrt(2/n).
        assert!(mean.abs() < 0.016 && (variance - 1.0).abs() < 0.023, "{mean} {variance}");
    }
}
