//! How long the host waits, and for how much work.
//!
//! A real board answers within 50 ms. An emulated one answers after so many instructions, which take the
//! host as long as they take: there the times are generous, but still bounded, and the host asks nothing on
//! its own account while it waits (a question at a moment of the wall clock would make the run unrepeatable).

use std::time::Duration;

use farnear_protocol::{
    Nanometres,
    message::{Axis, Limits, Routine, Shot, Status, TriggerMode},
};

/// The slowest coarse speed a healthy rig has; a third of its usual 6.25 mm/s.
const SLOWEST_COARSE_NM_PER_S: u64 = 2_000_000;
/// Longest time a healthy position needs to settle, whatever moved.
const SETTLE: Duration = Duration::from_secs(2);
/// Homing approaches the switch a second time, slowly, over less than a millimetre.
const SLOW_APPROACH: Duration = Duration::from_secs(10);

/// How long the board waits for an exposure that it does not trigger, and more.
const FOREIGN_TRIGGER: Duration = Duration::from_secs(10);

/// Waiting times of a session.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Timing {
    /// Longest wait for the answer to a request, before it is sent again.
    pub reply: Duration,
    /// How often a request is sent again.
    pub retries: u32,
    /// Time without a word after which the board is asked whether an event got lost.
    pub poll: Duration,
    /// What the board's own time is multiplied by to become a wait of the host.
    pub work_factor: u32,
    /// What is added to every wait for work.
    pub work_slack: Duration,
    /// Keep-alive timeout: how long the board goes on with work of which the host has died, in the board's time. It asks
    /// after half of it, and the host answers as long as somebody holds the work.
    pub keep_alive: Duration,
}

impl Timing {
    /// For a real board.
    pub const REAL: Self = Self {
        reply: Duration::from_millis(50),
        retries: 3,
        poll: Duration::from_millis(500),
        work_factor: 1,
        work_slack: Duration::from_secs(1),
        keep_alive: Duration::from_secs(2),
    };

    /// For the emulated board, also on a crowded machine.
    pub const EMULATED: Self = Self {
        reply: Duration::from_secs(2),
        retries: 3,
        poll: Duration::from_secs(10),
        work_factor: 10,
        work_slack: Duration::from_secs(20),
        // Longer: its time may run faster than this computer's, which may be slow to answer.
        keep_alive: Duration::from_secs(10),
    };

    /// The host's wait for work that takes the board `work`.
    pub fn allowance(&self, work: Duration) -> Duration {
        work * self.work_factor + self.work_slack
    }
}

/// Longest time a healthy board takes to home an axis.
pub fn homing_time(axis: Axis, limits: &Limits) -> Duration {
    travel_time(travel(axis, limits)) + SLOW_APPROACH
}

/// Longest time a healthy board takes for a move from one position to another. The piezo's travel takes no time to speak
/// of.
pub fn move_time(axis: Axis, from: Nanometres, to: Nanometres) -> Duration {
    let distance_nm = match axis {
        Axis::SensorCoarse | Axis::Lens => from.0.abs_diff(to.0),
        Axis::SensorFine => 0,
    };
    // Twice for a backlash that is taken out: beyond the target and back.
    travel_time(u64::from(distance_nm)) + 2 * SETTLE
}

/// Longest time a healthy board takes for an exposure program.
pub fn program_time(shots: &[Shot], status: &Status) -> Duration {
    let mut stands = Axis::ALL.map(|axis| (axis, status.axis(axis).measured));
    shots
        .iter()
        .map(|shot| {
            let place = stands.iter_mut().find(|(axis, _)| *axis == shot.axis);
            let from = place.map_or(shot.target, |(_, at)| std::mem::replace(at, shot.target));
            let exposure = Duration::from_micros(u64::from(shot.exposure.0));
            let trigger = match shot.mode {
                TriggerMode::Hardware => Duration::ZERO,
                // The camera is given this long to begin by itself, or the host to trigger it.
                TriggerMode::Software | TriggerMode::FreeRunning => FOREIGN_TRIGGER,
            };
            // The camera reads a picture out before it can take the next one.
            let once = exposure + Duration::from_millis(100) + trigger;
            move_time(shot.axis, from, shot.target) + once * u32::from(shot.repeat)
        })
        .sum()
}

/// Longest time a healthy board takes for a calibration routine, homing included.
pub fn calibration_time(routine: Routine, limits: &Limits) -> Duration {
    match routine {
        Routine::Travel { axis } => {
            homing_time(axis, limits) + travel_time(4 * travel(axis, limits)) + SLOW_APPROACH
        }
        Routine::Backlash { axis } => homing_time(axis, limits) + 6 * SLOW_APPROACH,
        // A sweep up and down, and creep over a decade of time.
        Routine::Piezo => Duration::from_secs(60),
    }
}

fn travel(axis: Axis, limits: &Limits) -> u64 {
    let (min, max) = limits.of(axis);
    u64::from(max.0.abs_diff(min.0))
}

fn travel_time(distance_nm: u64) -> Duration {
    Duration::from_micros(distance_nm.saturating_mul(1_000_000) / SLOWEST_COARSE_NM_PER_S)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wait_grows_with_the_way() {
        let (near, far) = (Nanometres(0), Nanometres(13_000_000));
        assert_eq!(move_time(Axis::Lens, near, near), 2 * SETTLE);
        assert_eq!(move_time(Axis::SensorCoarse, far, near), 2 * SETTLE + Duration::from_millis(6_500));
        assert_eq!(move_time(Axis::SensorFine, near, far), 2 * SETTLE);
        assert!(Timing::EMULATED.allowance(SETTLE) > Timing::REAL.allowance(SETTLE));
    }
}
