//! Jerk-limited ramp: splits a distance in STEP pulses into segments of equal pulses.
//!
//! The speed rises from the start speed with limited jerk (bend), constant acceleration (straight), and a bend into the
//! top speed; the end mirrors this (seven-phase profile of L. Biagiotti and C. Melchiorri, "Trajectory Planning for
//! Automatic Machines and Robots", 2008, sec. 3.4). One [`Curve`] gives time over distance for both ends. A segment of
//! `n` pulses lasts exactly as long as the curve, so errors never accumulate. Short distances reduce top speed and
//! bend. A stop lowers the top speed: the new curve equals the old one so far, and never needs more pulses than remain.
//!
//! Single precision: 0.004 pulses; integer count. Cortex-M4F: 200 instructions a segment, 600 to plan (bisection).

use crate::io::{SEGMENT_MAX_PULSES, SEGMENT_MAX_TICKS, STEP_TIMER_HZ, Segment};

/// Slightly below the maximum, so that a rounded period still fits.
const SEGMENT_S: f32 = 0.95e-3;
/// With a pulse per segment.
const SLOWEST: u32 = STEP_TIMER_HZ / SEGMENT_MAX_TICKS;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct RampLimits {
    /// Speed of the first and last pulse, pulses/s; at least one pulse per millisecond.
    pub(crate) start_speed: u32,
    /// Pulses/s; at least `start_speed`.
    pub(crate) speed: u32,
    pub(crate) acceleration: u32,
    pub(crate) jerk: u32,
}

#[derive(Clone, Copy, PartialEq, Debug)]
struct Curve {
    start: f32,
    jerk: f32,
    /// Time of each bend.
    bend: f32,
    /// Time of constant acceleration.
    straight: f32,
    top: f32,
    /// Time and pulses until the top.
    time: f32,
    way: f32,
}

impl Curve {
    fn new(start: f32, jerk: f32, bend: f32, straight: f32) -> Self {
        let top = start + jerk * bend * (bend + straight);
        let time = 2.0 * bend + straight;
        Self { start, jerk, bend, straight, top, time, way: 0.5 * (start + top) * time }
    }

    /// Highest curve within the limits that fits twice into `pulses`.
    fn fit(limits: &RampLimits, pulses: u32) -> Self {
        let (start, speed) = (limits.start_speed as f32, limits.speed as f32);
        let (acceleration, jerk) = (limits.acceleration as f32, limits.jerk as f32);
        let half = 0.5 * pulses as f32;
        let fits = |curve: &Self| curve.top <= speed && curve.way <= half;
        let longest_bend = acceleration / jerk;
        let straight = Self::new(start, jerk, longest_bend, 0.0);
        let (mut low, mut high) =
            if fits(&straight) { (0.0, (speed - start) / acceleration) } else { (0.0, longest_bend) };
        let curve = |value: f32| {
            if fits(&straight) {
                Self::new(start, jerk, longest_bend, value)
            } else {
                Self::new(start, jerk, value, 0.0)
            }
        };
        for _ in 0..24 {
            let middle = 0.5 * (low + high);
            if fits(&curve(middle)) {
                low = middle;
            } else {
                high = middle;
            }
        }
        curve(low)
    }

    fn speed(&self, time: f32) -> f32 {
        let left = self.time - time;
        if time < self.bend {
            self.start + 0.5 * self.jerk * time * time
        } else if left > self.bend {
            self.start + self.jerk * self.bend * (time - 0.5 * self.bend)
        } else if left > 0.0 {
            self.top - 0.5 * self.jerk * left * left
        } else {
            self.top
        }
    }

    /// Pulses from rest; continues at top speed beyond the curve.
    fn distance(&self, time: f32) -> f32 {
        let left = self.time - time;
        if time < self.bend {
            (self.start + self.jerk * time * time * (1.0 / 6.0)) * time
        } else if left > self.bend {
            let bend = (self.start + self.jerk * self.bend * self.bend * (1.0 / 6.0)) * self.bend;
            let at_bend = self.start + 0.5 * self.jerk * self.bend * self.bend;
            let after = time - self.bend;
            bend + (at_bend + 0.5 * self.jerk * self.bend * after) * after
        } else if left > 0.0 {
            self.way - (self.top - self.jerk * left * left * (1.0 / 6.0)) * left
        } else {
            self.way - self.top * left
        }
    }

    /// Time at a distance, by Newton's method from a nearby time; the speed is never 0.
    fn time_at(&self, distance: f32, near: f32) -> f32 {
        let mut time = near;
        for _ in 0..3 {
            time = (time - (self.distance(time) - distance) / self.speed(time)).max(0.0);
        }
        time
    }

    /// Mean speed between two times: Simpson's rule, exact within a phase, without cancellation.
    fn mean_speed(&self, a: f32, b: f32) -> f32 {
        (self.speed(a) + 4.0 * self.speed(0.5 * (a + b)) + self.speed(b)) * (1.0 / 6.0)
    }
}

pub(crate) fn braking(limits: &RampLimits) -> u32 {
    ceil(Curve::fit(limits, u32::MAX).way)
}

#[derive(Clone, Debug)]
pub(crate) struct Ramp {
    curve: Curve,
    speed: u32,
    total: u32,
    planned: u32,
    rise: u32,
    fall: u32,
    /// Position on the curve: time from rest while rising, to rest while falling.
    time: f32,
    falling: bool,
}

impl Ramp {
    pub(crate) fn new(pulses: u32, limits: RampLimits) -> Self {
        let start_speed = limits.start_speed.max(SLOWEST);
        let limits = RampLimits {
            start_speed,
            speed: limits.speed.max(start_speed),
            acceleration: limits.acceleration.max(1),
            jerk: limits.jerk.max(1),
        };
        let curve = Curve::fit(&limits, pulses);
        let (rise, fall) = ends(&curve, pulses);
        Self { curve, speed: limits.speed, total: pulses, planned: 0, rise, fall, time: 0.0, falling: false }
    }

    pub(crate) const fn remaining(&self) -> u32 {
        self.total - self.planned
    }

    pub(crate) const fn has_begun(&self) -> bool {
        self.planned > 0
    }

    /// Stops as early as jerk and deceleration allow.
    pub(crate) fn stop(&mut self) {
        if self.planned == 0 {
            self.total = 0;
        } else if self.planned < self.rise {
            let Curve { start, jerk, bend, straight, .. } = self.curve;
            if self.time < bend {
                self.curve = Curve::new(start, jerk, self.time, 0.0);
            } else if self.time < bend + straight {
                self.curve = Curve::new(start, jerk, bend, self.time - bend);
            }
            let both = ceil(2.0 * self.curve.way).max(self.planned + 1);
            self.total = self.total.min(both);
            (self.rise, self.fall) = ends(&self.curve, self.total);
        } else if self.remaining() > self.fall {
            self.total = self.planned + self.fall;
        }
    }

    /// The next segment; `None` at the end.
    pub(crate) fn next(&mut self) -> Option<Segment> {
        let remaining = self.remaining();
        if remaining == 0 {
            return None;
        }
        let rising = self.planned < self.rise;
        if !rising && !self.falling && remaining <= self.fall {
            self.falling = true;
            self.time = self.curve.time_at(remaining as f32, self.curve.time);
        }
        let (until, speed) = if rising {
            (self.rise - self.planned, self.curve.speed(self.time))
        } else if self.falling {
            (remaining, self.curve.speed(self.time))
        } else {
            (remaining - self.fall, self.curve.top)
        };
        let mut pulses = ((speed * SEGMENT_S) as u32).clamp(1, until.min(u32::from(SEGMENT_MAX_PULSES)));
        if until > pulses && until < 2 * pulses {
            pulses = until.div_ceil(2); // rather two middling segments than a long and a short one
        }
        let fastest = STEP_TIMER_HZ.div_ceil(self.speed);
        loop {
            let (time, mean) = self.after(pulses, rising, speed);
            let period = ceil(STEP_TIMER_HZ as f32 / mean).clamp(fastest, SEGMENT_MAX_TICKS);
            if pulses > 1 && pulses * period > SEGMENT_MAX_TICKS {
                pulses -= 1;
                continue;
            }
            self.time = time;
            self.planned += pulses;
            return Some(Segment {
                pulses: pulses as u16,       // at most SEGMENT_MAX_PULSES
                period_ticks: period as u16, // at most SEGMENT_MAX_TICKS
                last: self.planned == self.total,
            });
        }
    }

    /// Time on the curve after more pulses, and the mean speed until then.
    fn after(&self, pulses: u32, rising: bool, speed: f32) -> (f32, f32) {
        let step = pulses as f32 / speed;
        if rising {
            let time = self.curve.time_at((self.planned + pulses) as f32, self.time + step);
            (time, self.curve.mean_speed(self.time, time))
        } else if self.falling {
            let left = self.remaining() - pulses;
            let time =
                if left == 0 { 0.0 } else { self.curve.time_at(left as f32, (self.time - step).max(0.0)) };
            (time, self.curve.mean_speed(time, self.time))
        } else {
            (self.time, speed)
        }
    }
}

/// Whole pulses of rise and fall, together at most the distance.
fn ends(curve: &Curve, pulses: u32) -> (u32, u32) {
    let way = ceil(curve.way);
    (way.min(pulses - pulses / 2), way.min(pulses / 2))
}

fn ceil(value: f32) -> u32 {
    let whole = value as u32;
    if (whole as f32) < value { whole.saturating_add(1) } else { whole }
}

#[cfg(test)]
mod tests;
