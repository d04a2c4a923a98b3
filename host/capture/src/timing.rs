//! How long the host waits, and for how much work.
//!
//! A real board answers within 50 ms. An emulated one answers after so many instructions, which take the
//! host as long as they take: there the times are generous, but still bounded, and the host asks nothing on
//! its own account while it waits (a question at a moment of the wall clock would make the run unrepeatable).

use std::time::Duration;

use farnear_protocol::message::{Limits, Shot};

/// The slowest coarse speed a healthy rig has; a third of its usual 6.25 mm/s.
const SLOWEST_COARSE_NM_PER_S: u64 = 2_000_000;
/// Longest time a healthy position needs to settle, whatever moved.
const SETTLE: Duration = Duration::from_secs(2);
/// Homing approaches the switch a second time, slowly, over less than a millimetre.
const SLOW_APPROACH: Duration = Duration::from_secs(10);

/// Waiting times of a session.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Timing {
    /// Longest wait for the answer to a request, before it is sent again.
    pub reply: Duration,
    /// How often a request is sent again.
    pub retries: u32,
    /// Silence after which the board is asked whether an event got lost.
    pub poll: Duration,
    /// What the board's own time is multiplied by to become a wait of the host.
    pub work_factor: u32,
    /// What is added to every wait for work.
    pub work_slack: Duration,
}

impl Timing {
    /// For a board of flesh and blood.
    pub const REAL: Self = Self {
        reply: Duration::from_millis(50),
        retries: 3,
        poll: Duration::from_millis(500),
        work_factor: 1,
        work_slack: Duration::from_secs(1),
    };

    /// For the emulated board, also on a crowded machine.
    pub const EMULATED: Self = Self {
        reply: Duration::from_secs(2),
        retries: 3,
        poll: Duration::from_secs(10),
        work_factor: 10,
        work_slack: Duration::from_secs(20),
    };

    /// The host's wait for work that takes the board `work`.
    pub fn allowance(&self, work: Duration) -> Duration {
        work * self.work_factor + self.work_slack
    }
}

/// Longest time a healthy board takes to home the coarse axis.
pub fn homing_time(limits: &Limits) -> Duration {
    travel_time(u64::from(limits.coarse_max.0.abs_diff(limits.coarse_min.0))) + SLOW_APPROACH
}

/// Longest time a healthy board takes for a move over this many nanometres on the coarse axis; the piezo is
/// faster.
pub fn move_time(distance_nm: u64) -> Duration {
    travel_time(distance_nm) + SETTLE
}

/// Longest time a healthy board takes for an exposure program whose coarse moves add up to this distance.
pub fn program_time(shots: &[Shot], coarse_distance_nm: u64) -> Duration {
    let exposures: Duration = shots
        .iter()
        .map(|shot| {
            let exposure = Duration::from_micros(u64::from(shot.exposure.0));
            // The camera reads a picture out before it can take the next one.
            SETTLE + (exposure + Duration::from_millis(100)) * u32::from(shot.repeat)
        })
        .sum();
    exposures + travel_time(coarse_distance_nm)
}

fn travel_time(distance_nm: u64) -> Duration {
    Duration::from_micros(distance_nm.saturating_mul(1_000_000) / SLOWEST_COARSE_NM_PER_S)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wait_grows_with_the_way() {
        assert_eq!(move_time(0), SETTLE);
        assert_eq!(move_time(13_000_000), SETTLE + Duration::from_millis(6_500));
        assert!(Timing::EMULATED.allowance(SETTLE) > Timing::REAL.allowance(SETTLE));
    }
}
