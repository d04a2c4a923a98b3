//! The trapezoid ramp: a distance in STEP pulses becomes segments of equal pulses.
//!
//! Between segments the speed follows `v^2 = v0^2 + 2 a s` from both ends of the way, capped at the top speed; a
//! segment of `n` pulses that goes from `v` to `v'` is played at their mean, which takes exactly the time that
//! constant acceleration would. Integers only: speeds in pulses/s, accelerations in pulses/s2. No table and no
//! error that adds up: the pulses are counted down, and the ramp ends with the last one.
//!
//! Cost: one integer square root and two divisions a segment, a few more where the segment must be shortened.

use crate::io::{SEGMENT_MAX_PULSES, SEGMENT_MAX_TICKS, STEP_TIMER_HZ, Segment};

/// How fast a ramp may be.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct RampLimits {
    /// Speed of the first and of the last pulse; at least one pulse a millisecond.
    pub(crate) start_speed: u32,
    /// Top speed; at least `start_speed`.
    pub(crate) speed: u32,
    /// Acceleration and deceleration.
    pub(crate) acceleration: u32,
}

/// A way that is being planned, segment by segment.
#[derive(Clone, Debug)]
pub(crate) struct Ramp {
    limits: RampLimits,
    remaining: u32,
    /// Speed at the end of what was planned.
    speed: u32,
    begun: bool,
}

impl Ramp {
    /// From rest over `pulses` to rest.
    pub(crate) fn new(pulses: u32, limits: RampLimits) -> Self {
        let start_speed = limits.start_speed.clamp(STEP_TIMER_HZ / SEGMENT_MAX_TICKS, MAX_SPEED);
        let speed = limits.speed.clamp(start_speed, MAX_SPEED);
        Self {
            limits: RampLimits { start_speed, speed, acceleration: limits.acceleration.max(1) },
            remaining: pulses,
            speed: start_speed,
            begun: false,
        }
    }

    /// Pulses not planned yet.
    pub(crate) const fn remaining(&self) -> u32 {
        self.remaining
    }

    /// Whether a segment was planned.
    pub(crate) const fn has_begun(&self) -> bool {
        self.begun
    }

    /// Cuts the way short: as few more pulses as the deceleration allows.
    pub(crate) fn stop(&mut self) {
        if self.begun {
            let excess = square(self.speed) - square(self.limits.start_speed);
            let braking = excess.div_ceil(2 * u64::from(self.limits.acceleration)).max(1);
            self.remaining = self.remaining.min(u32::try_from(braking).unwrap_or(u32::MAX));
        } else {
            self.remaining = 0;
        }
    }

    /// The next segment; `None` at the end of the way.
    pub(crate) fn next(&mut self) -> Option<Segment> {
        let longest = self.remaining.min(u32::from(SEGMENT_MAX_PULSES));
        if longest == 0 {
            return None;
        }
        let mut pulses = (self.speed / (STEP_TIMER_HZ / SEGMENT_MAX_TICKS)).clamp(1, longest);
        loop {
            let end = self.speed_after(pulses);
            let period = (2 * STEP_TIMER_HZ).div_ceil(self.speed + end); // rounded up: never too fast
            if pulses > 1 && pulses * period > SEGMENT_MAX_TICKS {
                pulses -= 1;
                continue;
            }
            self.remaining -= pulses;
            self.speed = end;
            self.begun = true;
            return Some(Segment {
                pulses: pulses as u16,       // at most SEGMENT_MAX_PULSES
                period_ticks: period as u16, // at most SEGMENT_MAX_TICKS
                last: self.remaining == 0,
            });
        }
    }

    /// The highest speed allowed after `pulses` more pulses.
    fn speed_after(&self, pulses: u32) -> u32 {
        let gain = |pulses: u32| 2 * u64::from(self.limits.acceleration) * u64::from(pulses);
        let accelerated = square(self.speed) + gain(pulses);
        let can_still_stop = square(self.limits.start_speed) + gain(self.remaining - pulses);
        let squared = accelerated.min(can_still_stop).min(square(self.limits.speed));
        (squared as u32).isqrt() // at most MAX_SPEED squared, which fits
    }
}

/// Above this the square of a speed would not fit 32 bits; 1.6 times the speed of the rig.
const MAX_SPEED: u32 = 65_535;

const fn square(speed: u32) -> u64 {
    speed as u64 * speed as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: RampLimits = RampLimits { start_speed: 1_000, speed: 40_000, acceleration: 320_000 };

    /// Plays a ramp and checks every segment; gives the pulses and the seconds.
    fn play(mut ramp: Ramp, stop_after: Option<usize>) -> (u32, f64) {
        let (mut pulses, mut time) = (0u32, 0.0);
        let mut before: Option<(f64, f64)> = None;
        // The first and the last pulse go between the start speed and what one pulse of acceleration adds.
        let start = f64::from(ramp.limits.start_speed);
        let slow = (start + start.hypot((2.0 * f64::from(ramp.limits.acceleration)).sqrt())) / 2.0;
        let mut ended = false;
        for index in 0.. {
            if Some(index) == stop_after {
                ramp.stop();
            }
            let Some(segment) = ramp.next() else { break };
            assert!(!ended, "a segment after the last");
            ended = segment.last;
            assert!((1..=256).contains(&segment.pulses), "{segment:?}");
            assert!(
                u32::from(segment.pulses) * u32::from(segment.period_ticks) <= SEGMENT_MAX_TICKS,
                "{segment:?}"
            );
            let speed = f64::from(STEP_TIMER_HZ) / f64::from(segment.period_ticks);
            let seconds = f64::from(segment.pulses) / speed;
            assert!(speed <= f64::from(ramp.limits.speed), "too fast: {segment:?}");
            match before {
                None => assert!(speed <= slow, "starts too fast: {segment:?}"),
                Some((old_speed, old_seconds)) => {
                    // Mean speeds of neighbours are reached in the time between their middles. Whole ticks and
                    // whole pulses per second shift a speed by up to 1 + v^2 / timer clock.
                    let rounding = 2.0 * (1.0 + speed.max(old_speed).powi(2) / f64::from(STEP_TIMER_HZ));
                    let allowed =
                        f64::from(ramp.limits.acceleration) * (seconds + old_seconds) / 2.0 + rounding;
                    assert!((speed - old_speed).abs() <= allowed, "{old_speed} to {speed} in {seconds} s");
                }
            }
            before = Some((speed, seconds));
            pulses += u32::from(segment.pulses);
            time += seconds;
        }
        if let Some((speed, _)) = before {
            assert!(ended && speed <= slow, "does not end at rest: {speed}");
        }
        (pulses, time)
    }

    #[test]
    fn the_whole_travel_takes_what_the_trapezoid_takes() {
        let (pulses, time) = play(Ramp::new(83_200, LIMITS), None);
        assert_eq!(pulses, 83_200);
        // Way / top speed + top speed / acceleration = 2.08 + 0.125 s; the start speed saves up to 6 ms.
        assert!((time - 2.205).abs() < 0.008, "{time}");
    }

    proptest! {
        #[test]
        fn any_way_has_its_pulses_and_keeps_its_limits(pulses in 0u32..100_000, speed in 1_000u32..60_000,
            acceleration in 1_000u32..2_000_000) {
            let limits = RampLimits { speed, acceleration, ..LIMITS };
            prop_assert_eq!(play(Ramp::new(pulses, limits), None).0, pulses);
        }

        #[test]
        fn a_stop_brakes_and_ends_at_rest(pulses in 1u32..100_000, after in 0usize..2_500) {
            let (played, _) = play(Ramp::new(pulses, LIMITS), Some(after));
            prop_assert!(played <= pulses);
            if after == 0 {
                prop_assert_eq!(played, 0);
            }
        }
    }
}
