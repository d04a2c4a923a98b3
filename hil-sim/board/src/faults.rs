//! Faults of line, port and rig, from a TOML file.
//!
//! ```toml
//! bit_error_rate = 1e-4      # of each bit, in both directions
//! garbage = [1, 255, 0, 66]  # the host hears this before anything else
//! unplug_after_ms = 500      # virtual time after power-on; the port goes away
//!
//! [[happens]]                # in any number
//! after_ms = 1500            # virtual time after power-on
//! what = "motor-stalls"      # see below
//! stage = "lens"             # or "sensor", which is the default; where a stage is concerned
//! ```
//!
//! `what` is one of emergency-stop, emergency-stop-released, reset-button, power-loss, power-return, brown-out,
//! supply-low, supply-normal, driver-fault, driver-fine, motor-stalls, motor-free, home-switch-dead, piezo-dead,
//! firmware-hangs, and memory-bit-flips (with `address` and `bit`). See [`crate::hands::What`].

use std::path::Path;

use serde::Deserialize;

use crate::{error::SimError, hands::Happening, plant::Noise};

/// What goes wrong.
#[derive(Clone, PartialEq, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Faults {
    /// Probability that a bit on the line is flipped, in each direction.
    pub bit_error_rate: f64,
    /// Bytes that the host receives before anything else.
    pub garbage: Vec<u8>,
    /// The port goes away after this much virtual time since the board's start, in milliseconds.
    pub unplug_after_ms: Option<u64>,
    /// What happens to the rig, in any order.
    pub happens: Vec<Happening>,
}

impl Faults {
    /// Reads the file.
    ///
    /// # Errors
    /// [`SimError::Faults`] where it cannot be read, is no such TOML, or a rate is no probability.
    pub fn read(path: &Path) -> Result<Self, SimError> {
        let wrong = |reason: String| SimError::Faults { path: path.into(), reason };
        let text = std::fs::read_to_string(path).map_err(|error| wrong(error.to_string()))?;
        let faults: Self = toml::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        if !(0.0..=1.0).contains(&faults.bit_error_rate) {
            return Err(wrong(format!("bit_error_rate = {} is not in 0..1", faults.bit_error_rate)));
        }
        Ok(faults)
    }
}

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
    use crate::{hands::What, plant::StageName};

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

    #[test]
    fn refuses_a_rate_that_is_none() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("faults.toml");
        std::fs::write(&path, "bit_error_rate = 2.0").expect("can write");
        let error = Faults::read(&path).expect_err("2 is no probability");
        assert!(error.to_string().contains("bit_error_rate = 2"), "{error}");
        std::fs::write(&path, "[[happens]]\nafter_ms = 7\nwhat = \"motor-stalls\"\nstage = \"lens\"")
            .expect("can write");
        let happens = Faults::read(&path).expect("a good file").happens;
        assert_eq!((happens[0].after_ms, happens[0].what), (7, What::MotorStalls));
        assert_eq!(happens[0].stage, StageName::Lens);
        std::fs::write(&path, "bit_eror_rate = 0.1").expect("can write");
        assert!(Faults::read(&path).expect_err("misspelt").to_string().contains("bit_eror_rate"));
    }
}
