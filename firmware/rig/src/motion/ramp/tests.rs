//! The planner at its limits: any distance and limits, a stop at any time.

use std::vec::Vec;

use super::*;
use proptest::prelude::*;

const LIMITS: RampLimits =
    RampLimits { start_speed: 1_000, speed: 40_000, acceleration: 320_000, jerk: 10_240_000 };

#[derive(Clone, Copy, Debug)]
struct Played {
    end_s: f64,
    seconds: f64,
    pulses: u32,
    speed: f64,
}

/// Plays a ramp, optionally stops it, and checks each segment.
fn play(mut ramp: Ramp, limits: RampLimits, stop_after: Option<usize>) -> Vec<Played> {
    let (mut pulses, mut time, mut ended) = (0u32, 0.0, false);
    let mut played = Vec::new();
    for index in 0.. {
        if Some(index) == stop_after {
            let before = ramp.remaining();
            ramp.stop();
            assert!(ramp.remaining() <= before, "a stop never needs more than the way had");
        }
        let Some(segment) = ramp.next() else { break };
        assert!(!ended, "a segment after the last");
        ended = segment.last;
        assert!((1..=256).contains(&segment.pulses), "{segment:?}");
        let ticks = u32::from(segment.pulses) * u32::from(segment.period_ticks);
        assert!(ticks <= SEGMENT_MAX_TICKS, "{segment:?}");
        let speed = f64::from(STEP_TIMER_HZ) / f64::from(segment.period_ticks);
        assert!(speed <= f64::from(limits.speed) + 1e-6, "too fast: {segment:?}");
        pulses += u32::from(segment.pulses);
        let seconds = f64::from(ticks) / f64::from(STEP_TIMER_HZ);
        time += seconds;
        played.push(Played { end_s: time, seconds, pulses, speed });
    }
    assert!(played.is_empty() || ended, "the last segment says so");
    accelerations(&played, limits);
    played
}

/// Neighbouring segments' mean speeds are reached between their middles; whole ticks change a speed by up to v^2 /
/// timer clock. First and last segment have the start speed and the gain of their own length.
fn accelerations(played: &[Played], limits: RampLimits) {
    let rounding = |speed: f64| 1.0 + speed * speed / f64::from(STEP_TIMER_HZ);
    let most = f64::from(limits.acceleration);
    for pair in played.windows(2) {
        let between = 0.5 * (pair[0].seconds + pair[1].seconds);
        let allowed = most * between * 1.001 + rounding(pair[0].speed) + rounding(pair[1].speed);
        let change = (pair[1].speed - pair[0].speed).abs();
        assert!(change <= allowed, "{change} pulses/s, allowed {allowed}: {pair:?}");
    }
    for end in [played.first(), played.last()].into_iter().flatten() {
        let slow = f64::from(limits.start_speed) + 0.5 * most * end.seconds + rounding(end.speed);
        assert!(end.speed <= slow, "starts and ends at {} pulses/s, not at {slow}", end.speed);
    }
}

fn pulses(played: &[Played]) -> u32 {
    played.last().map_or(0, |last| last.pulses)
}

#[test]
fn the_whole_travel_takes_what_the_seven_phases_take() {
    let played = play(Ramp::new(83_200, LIMITS), LIMITS, None);
    assert_eq!(pulses(&played), 83_200);
    // Distance / top speed + top speed / acceleration + acceleration / jerk = 2.08 + 0.125 + 0.031 s; the
    // start speed saves up to 6 ms.
    let time = played.last().map_or(0.0, |last| last.end_s);
    assert!((time - 2.236).abs() < 0.008, "{time}");
}

#[test]
fn the_played_speed_keeps_the_jerk() {
    for way in [40, 900, 5_000, 83_200] {
        let played = play(Ramp::new(way, LIMITS), LIMITS, None);
        // Positions every 8 ms by interpolation, and their third differences.
        let position = |at: f64| {
            let index = played.iter().position(|segment| segment.end_s > at)?;
            let (segment, before) = (played[index], index.checked_sub(1).map_or(0, |i| played[i].pulses));
            let start = index.checked_sub(1).map_or(0.0, |i| played[i].end_s);
            Some(f64::from(before) + (at - start) * segment.speed).filter(|_| segment.pulses > 0)
        };
        let step = 8e-3;
        let samples: Vec<f64> = (0..).map_while(|i| position(f64::from(i) * step)).collect();
        for four in samples.windows(4) {
            let jerk = (four[3] - 3.0 * four[2] + 3.0 * four[1] - four[0]) / step.powi(3);
            // A tick of rounding at 40 kHz is 0.3 pulses in 8 ms, a pulse in a slow segment half of one.
            assert!(jerk.abs() <= f64::from(LIMITS.jerk) + 2.4 / step.powi(3), "{jerk} on a way of {way}");
        }
    }
}

#[test]
fn a_curve_is_smooth_and_its_distance_is_the_integral_of_its_speed() {
    let curve = Curve::fit(&LIMITS, 83_200);
    let (mut sum, mut before) = (0.0f64, curve.speed(0.0));
    let step = 1e-4f32;
    for i in 0..(curve.time / step) as usize {
        let time = i as f32 * step;
        let (now, next) = (curve.speed(time), curve.speed(time + step));
        let acceleration = (next - now) / step;
        assert!((0.0..=LIMITS.acceleration as f32 * 1.01 + 50.0).contains(&acceleration), "{acceleration}");
        let jerk = (next - 2.0 * now + before) / (step * step);
        assert!(i == 0 || jerk.abs() <= LIMITS.jerk as f32 * 1.05 + 1e6, "{jerk} at {time}"); // f32: 1e-2 / step^2
        assert!((f64::from(curve.distance(time)) - sum).abs() < 0.05, "at {time}");
        sum += f64::from(now + 4.0 * curve.speed(time + 0.5 * step) + next) / 6.0 * f64::from(step);
        before = now;
    }
}

fn limits() -> impl Strategy<Value = RampLimits> {
    (500u32..5_000, 1_000u32..60_000, 6_400u32..3_000_000, 60_000u32..600_000_000).prop_map(
        |(start_speed, speed, acceleration, jerk)| RampLimits { start_speed, speed, acceleration, jerk },
    )
}

fn effective(limits: RampLimits) -> RampLimits {
    let start_speed = limits.start_speed.max(1_000);
    RampLimits { start_speed, speed: limits.speed.max(start_speed), ..limits }
}

proptest! {
    #[test]
    fn any_way_has_its_pulses_and_keeps_its_limits(way in 0u32..100_000, limits in limits()) {
        let played = play(Ramp::new(way, limits), effective(limits), None);
        prop_assert_eq!(pulses(&played), way);
    }

    #[test]
    fn a_stop_at_any_moment_keeps_the_limits_and_ends_at_rest(
        way in 1u32..100_000, after in 0usize..2_500, limits in limits()) {
        let all = play(Ramp::new(way, limits), effective(limits), None);
        let played = play(Ramp::new(way, limits), effective(limits), Some(after % (all.len() + 1)));
        prop_assert!(pulses(&played) <= way);
        if after % (all.len() + 1) == 0 {
            prop_assert_eq!(pulses(&played), 0);
        }
    }

    #[test]
    fn a_stop_bends_down_from_the_curve_it_was_on(way in 100u32..100_000, after in 1usize..300) {
        let mut ramp = Ramp::new(way, LIMITS);
        for _ in 0..after {
            ramp.next();
        }
        let (before, rising) = (ramp.clone(), ramp.planned < ramp.rise);
        ramp.stop();
        if rising {
            let time = before.time;
            prop_assert!((ramp.curve.speed(time) - before.curve.speed(time)).abs() <= 0.05);
            prop_assert!((ramp.curve.distance(time) - before.curve.distance(time)).abs() <= 0.05);
            prop_assert!(ramp.curve.top <= before.curve.top * 1.0001);
        }
    }
}
