//! How long the host waits, and for how much work.
//!
//! A real board answers within 50 ms. An emulated one answers after so many instructions, which take the
//! host as long as they take: there the times are generous, but still bounded, and the host asks nothing on
//! its own account while it waits (a question at a moment of the wall clock would make the run unrepeatable).

use std::time::Duration;

use farnear_protocol::{
    Nanometres,
    message::{Axis, Limits, Routine, SettingKey, Shot, Status, StepperKeys, TriggerMode},
};

/// What homing searches a switch with at most, whatever moves are set to, and leaves it with.
const SEARCH_NM_PER_S: u64 = 4_000_000;
const LEAVE_NM_PER_S: u64 = 1_000_000;
/// The motor's driver wants to stand for 0.14 s when it is switched on; and everything is a little slower than it should be.
const SLACK: Duration = Duration::from_millis(500);
/// Longest time a healthy position needs to settle, whatever moved.
const SETTLE: Duration = Duration::from_secs(2);
/// Homing approaches the switch a second time, slowly, over less than a millimetre.
const SLOW_APPROACH: Duration = Duration::from_secs(10);

/// More than the ways about a switch at homing, and than any backlash.
const SWITCH_NM: u64 = 1_500_000;
const BACKLASH_NM: u64 = 200_000;

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
    pub const REAL: Self = Self {
        reply: Duration::from_millis(50),
        retries: 3,
        poll: Duration::from_millis(500),
        work_factor: 1,
        work_slack: Duration::from_secs(1),
        keep_alive: Duration::from_secs(2),
    };

    /// For the emulated board, also on a crowded machine: there a question that is asked again is heard twice, at moments that no
    /// other run repeats.
    pub const EMULATED: Self = Self {
        reply: Duration::from_secs(5),
        retries: 2,
        // Homing takes more than 10 s where eleven programs share two cores.
        poll: Duration::from_secs(30),
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

/// How fast an axis moves, as the board's own settings have it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Pace {
    speed_nm_per_s: u64,
    /// What its ramps take beyond the way at full speed.
    ramps: Duration,
}

impl Pace {
    /// Of the piezo, whose travel takes no time to speak of.
    pub const AT_ONCE: Self = Self { speed_nm_per_s: u64::MAX, ramps: Duration::ZERO };

    /// Of an axis; `setting` reads a setting of the board.
    ///
    /// # Errors
    /// Those of `setting`.
    pub fn of<E>(axis: Axis, mut setting: impl FnMut(SettingKey) -> Result<i32, E>) -> Result<Self, E> {
        let Some(StepperKeys { speed, acceleration, jerk, .. }) = StepperKeys::of(axis) else {
            return Ok(Self::AT_ONCE);
        };
        let mut positive = |key| Ok(f64::from(setting(key)?.max(1)));
        let (speed, acceleration, jerk) = (positive(speed)?, positive(acceleration)?, positive(jerk)?);
        // v / a and a / j: up or down from full speed takes the sum of both, half of it beyond the way's own time.
        let ramp_s = speed / (1e3 * acceleration) + acceleration / jerk;
        Ok(Self { speed_nm_per_s: speed as u64, ramps: Duration::from_secs_f64(ramp_s) })
    }

    /// Longest time for a way.
    fn time(self, distance_nm: u64) -> Duration {
        let micros = u128::from(distance_nm) * 1_000_000 / u128::from(self.speed_nm_per_s.max(1));
        // An eighth more for its clock and for segments that round up.
        let way = Duration::from_micros(u64::try_from(micros + micros / 8).unwrap_or(u64::MAX));
        way + self.ramps
    }

    /// The same, no faster than a speed.
    fn at_most(self, nm_per_s: u64) -> Self {
        Self { speed_nm_per_s: self.speed_nm_per_s.min(nm_per_s), ..self }
    }
}

/// Longest time a healthy board takes to home an axis.
pub fn homing_time(axis: Axis, limits: &Limits, pace: Pace) -> Duration {
    let way = travel(axis, limits);
    // The search; the way off the switch and, after the slow approach, back.
    pace.at_most(SEARCH_NM_PER_S).time(way) + 3 * pace.at_most(LEAVE_NM_PER_S).time(SWITCH_NM) + SLOW_APPROACH
}

/// Longest time a healthy board takes for a move from one position to another.
pub fn move_time(axis: Axis, from: Nanometres, to: Nanometres, pace: Pace) -> Duration {
    let distance_nm = match axis {
        Axis::SensorCoarse | Axis::Lens => from.0.abs_diff(to.0),
        Axis::SensorFine => 0,
    };
    // Twice for a backlash that is taken out: beyond the target and back.
    pace.time(u64::from(distance_nm)) + pace.time(BACKLASH_NM) + 2 * SETTLE + SLACK
}

/// Longest time a healthy board takes for an exposure program.
pub fn program_time(shots: &[Shot], status: &Status, paces: &[(Axis, Pace)]) -> Duration {
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
            let pace =
                paces.iter().find(|(axis, _)| *axis == shot.axis).map_or(Pace::AT_ONCE, |(_, pace)| *pace);
            move_time(shot.axis, from, shot.target, pace) + once * u32::from(shot.repeat)
        })
        .sum()
}

/// Longest time a healthy board takes for a calibration routine, homing included; `pace` is that of the axis it moves.
pub fn calibration_time(routine: Routine, limits: &Limits, pace: Pace) -> Duration {
    match routine {
        Routine::Travel { axis } => {
            let there_and_back = 2 * pace.at_most(SEARCH_NM_PER_S).time(2 * travel(axis, limits));
            homing_time(axis, limits, pace) + there_and_back + SLOW_APPROACH
        }
        Routine::Backlash { axis } => homing_time(axis, limits, pace) + 6 * SLOW_APPROACH,
        // A sweep up and down, and creep over a decade of time.
        Routine::Piezo => Duration::from_secs(60),
        // Homed twice, and eight meetings with the switch.
        Routine::Gauge => 2 * homing_time(Axis::SensorCoarse, limits, pace) + 8 * SLOW_APPROACH,
    }
}

fn travel(axis: Axis, limits: &Limits) -> u64 {
    let (min, max) = limits.of(axis);
    u64::from(max.0.abs_diff(min.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pace of an axis with this speed, the rest as usual.
    fn pace(speed_nm_per_s: i32) -> Pace {
        let setting = |key| {
            Ok::<_, ()>(match key {
                SettingKey::CoarseSpeedNmPerS => speed_nm_per_s,
                SettingKey::CoarseAccelerationUmPerS2 => 50_000,
                SettingKey::CoarseJerkUmPerS3 => 1_600_000,
                _ => return Err(()),
            })
        };
        Pace::of(Axis::SensorCoarse, setting).expect("these three are asked for")
    }

    #[test]
    fn the_wait_grows_with_the_way_and_is_as_long_as_the_boards_speed_needs() {
        let (near, far) = (Nanometres(0), Nanometres(6_500_000));
        let time = |speed| move_time(Axis::SensorCoarse, far, near, pace(speed)).as_secs_f64();
        // 6.5 mm at 6.25 mm/s, at the 0.5 mm/s that the bring-up begins with, and at the slowest there is.
        for speed in [6_250_000, 500_000, 160_000] {
            let needs = 6_500_000.0 / f64::from(speed);
            assert!((needs + 1.0..1.2 * needs + 10.0).contains(&time(speed)), "{speed}: {}", time(speed));
        }
        assert!(move_time(Axis::SensorFine, near, far, Pace::AT_ONCE) <= 3 * SETTLE);
        assert!(Timing::EMULATED.allowance(SETTLE) > Timing::REAL.allowance(SETTLE));
    }
}
