//! Timeouts, and durations of work. A real board answers within 50 ms. An emulated one needs generous timeouts, and
//! gets no requests at wall-clock times, which would make the run unrepeatable.

use std::time::Duration;

use farnear_protocol::{
    Nanometres,
    message::{Axis, Limits, Routine, SettingKey, Shot, Status, StepperKeys, TriggerMode},
};

/// Speed limit of homing, independent of the settings of moves.
const SEARCH_NM_PER_S: u64 = 4_000_000;
const LEAVE_NM_PER_S: u64 = 1_000_000;
/// The motor driver needs 0.14 s at power-on, plus a general margin.
const SLACK: Duration = Duration::from_millis(500);
/// Longest braking time: from 6.25 mm/s at the least acceleration and jerk that the settings allow, 6.4 s.
pub(crate) const BRAKING: Duration = Duration::from_secs(7);
/// Longest settling time of a healthy axis.
const SETTLE: Duration = Duration::from_secs(2);
/// Homing's slow second approach, over less than a millimetre.
const SLOW_APPROACH: Duration = Duration::from_secs(10);

/// The board looks for a switch over this distance, also where the limits are narrower.
const SEARCH_NM: u64 = 14_500_000;
/// Above the distances around a switch during homing, and any backlash.
const SWITCH_NM: u64 = 1_500_000;
const BACKLASH_NM: u64 = 200_000;

/// Above the board's timeout for an exposure that it does not trigger.
const FOREIGN_TRIGGER: Duration = Duration::from_secs(10);

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Timing {
    /// Timeout of an answer before the repeat.
    pub reply: Duration,
    pub retries: u32,
    /// Silence after which lost events are queried.
    pub poll: Duration,
    /// Factor from board time to the host's timeout.
    pub work_factor: u32,
    /// Margin of every timeout for work.
    pub work_slack: Duration,
    /// Keep-alive timeout, board time: how long work continues after the host has died. The host answers at half of it.
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

    /// For the emulated board, also on a busy machine: repeated requests would arrive at unrepeatable times.
    pub const EMULATED: Self = Self {
        reply: Duration::from_secs(5),
        retries: 2,
        // Homing takes more than 10 s with eleven programs on two cores.
        poll: Duration::from_secs(30),
        work_factor: 10,
        work_slack: Duration::from_secs(20),
        // Longer: board time may run faster than a slow computer answers.
        keep_alive: Duration::from_secs(10),
    };

    pub fn allowance(&self, work: Duration) -> Duration {
        work * self.work_factor + self.work_slack
    }
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Pace {
    speed_nm_per_s: u64,
    ramps: Duration,
}

impl Pace {
    /// Piezo: travel time is negligible.
    pub const AT_ONCE: Self = Self { speed_nm_per_s: u64::MAX, ramps: Duration::ZERO };

    pub fn of<E>(axis: Axis, mut setting: impl FnMut(SettingKey) -> Result<i32, E>) -> Result<Self, E> {
        let Some(StepperKeys { speed, acceleration, jerk, .. }) = StepperKeys::of(axis) else {
            return Ok(Self::AT_ONCE);
        };
        let mut positive = |key| Ok(f64::from(setting(key)?.max(1)));
        let (speed, acceleration, jerk) = (positive(speed)?, positive(acceleration)?, positive(jerk)?);
        // v / a + a / j is the time of a ramp; half of it exceeds the travel's own time.
        let ramp_s = speed / (1e3 * acceleration) + acceleration / jerk;
        Ok(Self { speed_nm_per_s: speed as u64, ramps: Duration::from_secs_f64(ramp_s) })
    }

    fn time(self, distance_nm: u64) -> Duration {
        let micros = u128::from(distance_nm) * 1_000_000 / u128::from(self.speed_nm_per_s.max(1));
        // An eighth more for its clock and for segments that round up.
        let way = Duration::from_micros(u64::try_from(micros + micros / 8).unwrap_or(u64::MAX));
        way + self.ramps
    }

    fn at_most(self, nm_per_s: u64) -> Self {
        Self { speed_nm_per_s: self.speed_nm_per_s.min(nm_per_s), ..self }
    }
}

/// Longest homing time of a healthy board.
pub fn homing_time(axis: Axis, limits: &Limits, pace: Pace) -> Duration {
    let way = travel(axis, limits);
    // The search; the way off the switch and, after the slow approach, back.
    pace.at_most(SEARCH_NM_PER_S).time(way) + 3 * pace.at_most(LEAVE_NM_PER_S).time(SWITCH_NM) + SLOW_APPROACH
}

/// Longest time of a move.
pub fn move_time(axis: Axis, from: Nanometres, to: Nanometres, pace: Pace) -> Duration {
    let distance_nm = match axis {
        Axis::SensorCoarse | Axis::Lens => from.0.abs_diff(to.0),
        Axis::SensorFine => 0,
    };
    // Twice for backlash compensation: beyond the target and back.
    pace.time(u64::from(distance_nm)) + pace.time(BACKLASH_NM) + 2 * SETTLE + SLACK
}

/// Longest time of an exposure program; `readout` is the camera's.
pub fn program_time(shots: &[Shot], status: &Status, paces: &[(Axis, Pace)], readout: Duration) -> Duration {
    let mut stands = Axis::ALL.map(|axis| (axis, status.axis(axis).measured));
    shots
        .iter()
        .map(|shot| {
            let place = stands.iter_mut().find(|(axis, _)| *axis == shot.axis);
            let from = place.map_or(shot.target, |(_, at)| std::mem::replace(at, shot.target));
            let exposure = Duration::from_micros(u64::from(shot.exposure.0));
            let trigger = match shot.mode {
                TriggerMode::Hardware => Duration::ZERO,
                // Time for the camera's own exposure or the host's trigger.
                TriggerMode::Software | TriggerMode::FreeRunning => FOREIGN_TRIGGER,
            };
            let once = exposure + readout + Duration::from_millis(100) + trigger;
            let pace =
                paces.iter().find(|(axis, _)| *axis == shot.axis).map_or(Pace::AT_ONCE, |(_, pace)| *pace);
            move_time(shot.axis, from, shot.target, pace) + once * u32::from(shot.repeat)
        })
        .sum()
}

/// Longest time of a calibration routine, with homing; `pace` is that of its axis.
pub fn calibration_time(routine: Routine, limits: &Limits, pace: Pace) -> Duration {
    match routine {
        Routine::Travel { axis } => {
            let there_and_back = 2 * pace.at_most(SEARCH_NM_PER_S).time(2 * travel(axis, limits));
            homing_time(axis, limits, pace) + there_and_back + SLOW_APPROACH
        }
        Routine::Backlash { axis } => homing_time(axis, limits, pace) + 6 * SLOW_APPROACH,
        // A sweep up and down, and creep over a decade of time.
        Routine::Piezo => Duration::from_secs(60),
        // Two homings and eight contacts with the switch.
        Routine::Gauge => 2 * homing_time(Axis::SensorCoarse, limits, pace) + 8 * SLOW_APPROACH,
    }
}

fn travel(axis: Axis, limits: &Limits) -> u64 {
    let (min, max) = limits.of(axis);
    u64::from(max.0.abs_diff(min.0)).max(SEARCH_NM)
}

#[cfg(test)]
mod tests {
    use farnear_protocol::{
        BoardMicros, Micros,
        message::{AxisStatus, LinkCounters, PositionState, ProgramState, ProgramStatus},
    };

    use super::*;
    use crate::sequence::ShotDefaults;

    #[test]
    fn a_program_may_take_as_long_as_its_camera_reads_out() {
        let axis = AxisStatus {
            state: PositionState::Homed,
            asked: Nanometres(0),
            measured: Nanometres(0),
            moving: false,
            request: None,
        };
        let status = Status {
            time: BoardMicros(0),
            coarse: axis,
            fine: axis,
            lens: axis,
            home_switch: false,
            far_switch: false,
            lens_home_switch: false,
            lens_far_switch: false,
            emergency_stop: false,
            supply_low: false,
            alarm: None,
            program: ProgramStatus { state: ProgramState::Armed, shots: 1, index: 0, exposures: 0 },
            next_event: 0,
            triggers: 0,
            steps: 0,
            link: LinkCounters::default(),
        };
        let defaults = ShotDefaults { exposure: Micros(5_000), repeat: 60, ..ShotDefaults::default() };
        let shots = [defaults.shot(Axis::SensorFine, Nanometres(10_000))];
        let time = |readout_ms| program_time(&shots, &status, &[], Duration::from_millis(readout_ms));
        assert_eq!(time(1_000) - time(0), Duration::from_secs(60));
    }

    fn pace(speed_nm_per_s: i32) -> Pace {
        pace_of(speed_nm_per_s, 50_000, 1_600_000)
    }

    fn pace_of(speed_nm_per_s: i32, acceleration_um_per_s2: i32, jerk_um_per_s3: i32) -> Pace {
        let setting = |key| {
            Ok::<_, ()>(match key {
                SettingKey::CoarseSpeedNmPerS => speed_nm_per_s,
                SettingKey::CoarseAccelerationUmPerS2 => acceleration_um_per_s2,
                SettingKey::CoarseJerkUmPerS3 => jerk_um_per_s3,
                _ => return Err(()),
            })
        };
        Pace::of(Axis::SensorCoarse, setting).expect("only these three are read")
    }

    #[test]
    fn timeouts_grow_with_distance_and_the_boards_speed() {
        let (near, far) = (Nanometres(0), Nanometres(6_500_000));
        let time = |speed| move_time(Axis::SensorCoarse, far, near, pace(speed)).as_secs_f64();
        // 6.5 mm at 6.25 mm/s, at the initial 0.5 mm/s of commissioning, and at the slowest setting.
        for speed in [6_250_000, 500_000, 160_000] {
            let needs = 6_500_000.0 / f64::from(speed);
            assert!((needs + 1.0..1.2 * needs + 10.0).contains(&time(speed)), "{speed}: {}", time(speed));
        }
        assert!(move_time(Axis::SensorFine, near, far, Pace::AT_ONCE) <= 3 * SETTLE);
        assert!(Timing::EMULATED.allowance(SETTLE) > Timing::REAL.allowance(SETTLE));
    }

    #[test]
    fn the_slowest_ramp_ends_within_the_braking_time() {
        assert!(pace_of(6_250_000, 1_000, 10_000).ramps < BRAKING);
    }

    #[test]
    fn the_search_for_a_switch_may_take_longer_than_the_way_between_the_limits() {
        let (coarse_min, coarse_max) = (Nanometres(5_000_000), Nanometres(7_000_000));
        let limits = Limits { coarse_min, coarse_max, ..crate::plan::tests::limits() };
        let axis = Axis::SensorCoarse;
        for speed in [500_000, 300_000, 160_000] {
            let search = Duration::from_secs_f64(14_500_000.0 / f64::from(speed));
            assert!(homing_time(axis, &limits, pace(speed)) > search + SLOW_APPROACH, "{speed} nm/s");
            let both_ways = calibration_time(Routine::Travel { axis }, &limits, pace(speed));
            assert!(both_ways > 3 * search + 2 * SLOW_APPROACH, "{speed} nm/s: {both_ways:?}");
        }
    }
}
