//! The camera's timing: from the trigger's edges to strobe, exposure and frame.
//!
//! A global-shutter camera in trigger-width mode: it collects light while the trigger is high, from 20 us after
//! its edge (with 2 us of jitter), and says so on the strobe; then it reads out for 10 ms and hears no trigger.

use std::collections::BTreeMap;

use crate::plant::Noise;

/// From the trigger's edge to the exposure's.
const LATENCY_NS: f64 = 20_000.0;
/// Standard deviation of the latency.
const JITTER_NS: f64 = 2_000.0;
/// Read-out of a frame.
const READOUT_NS: u64 = 10_000_000;

/// What happens to the sensor at a moment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Edge {
    /// It begins to collect light.
    Begin,
    /// It stops.
    End,
}

/// The camera.
#[derive(Debug)]
pub struct Camera {
    jitter: Noise,
    coming: BTreeMap<u64, Edge>,
    latency_ns: u64,
    armed: bool,
    busy_until_ns: u64,
    triggers: u32,
    missed: u32,
}

impl Camera {
    /// A camera whose jitter the seed draws.
    pub fn new(seed: u64) -> Self {
        Self {
            jitter: Noise::new(seed, "camera jitter"),
            coming: BTreeMap::new(),
            latency_ns: 0,
            armed: false,
            busy_until_ns: 0,
            triggers: 0,
            missed: 0,
        }
    }

    /// An edge of the trigger line.
    pub fn trigger(&mut self, now_ns: u64, rising: bool) {
        if rising {
            self.triggers += 1;
            if self.armed || !self.coming.is_empty() || now_ns < self.busy_until_ns {
                self.missed += 1;
                return;
            }
            self.armed = true;
            let latency_ns = LATENCY_NS + JITTER_NS * self.jitter.normal();
            self.latency_ns = libm::round(latency_ns.max(0.0)) as u64;
            self.coming.insert(now_ns + self.latency_ns, Edge::Begin);
        } else if self.armed {
            self.armed = false;
            // A pulse of no length would end where it began.
            let begin = self.coming.keys().next_back().copied().unwrap_or(0);
            let end = (now_ns + self.latency_ns).max(begin + 1);
            self.coming.insert(end, Edge::End);
            self.busy_until_ns = end + READOUT_NS;
        }
    }

    /// When the next edge comes.
    pub fn next_ns(&self) -> Option<u64> {
        self.coming.keys().next().copied()
    }

    /// The next edge that is due.
    pub fn due(&mut self, now_ns: u64) -> Option<(u64, Edge)> {
        let at_ns = self.next_ns().filter(|at_ns| *at_ns <= now_ns)?;
        self.coming.remove(&at_ns).map(|edge| (at_ns, edge))
    }

    /// Rising edges of the trigger since the board's reset.
    pub fn triggers(&self) -> u32 {
        self.triggers
    }

    /// Triggers that came while the camera was busy, since the start.
    pub fn missed(&self) -> u32 {
        self.missed
    }

    /// The board was reset: the triggers are counted anew.
    pub fn board_reset(&mut self) {
        self.triggers = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_is_as_long_as_the_pulse_and_readout_is_deaf() {
        let mut camera = Camera::new(1);
        camera.trigger(1_000_000, true);
        let (begin, edge) = camera.due(2_000_000).expect("begins");
        assert_eq!(edge, Edge::Begin);
        // 20 us with six standard deviations of jitter.
        assert!((1_008_000..1_032_000).contains(&begin), "{begin}");
        camera.trigger(6_000_000, false);
        assert_eq!(camera.due(6_005_000), None);
        assert_eq!(camera.due(7_000_000), Some((begin + 5_000_000, Edge::End)));
        camera.trigger(16_000_000, true);
        assert_eq!((camera.next_ns(), camera.triggers(), camera.missed()), (None, 2, 1));
        camera.trigger(16_001_000, false);
        camera.trigger(17_000_000, true);
        assert!(camera.next_ns().is_some());
    }
}
