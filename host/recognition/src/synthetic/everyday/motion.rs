//! A motion in seconds, and the part that is the activity.

use super::gait::Gait;
use super::moment::{Hand, Keys, Moment, at, duration};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

#[derive(Clone, Debug)]
pub enum Motion {
    Gait(Gait),
    /// Single action; times before and after (seconds) may be cut.
    Once {
        keys: Keys,
        from: f64,
        to: f64,
        /// Preparation complete; some clips start here.
        ready: f64,
    },
    /// Action repeated between `from` and `to`.
    Repeated {
        keys: Keys,
        from: f64,
        to: f64,
        /// Seconds per repetition.
        period: f64,
    },
}

/// Generates motions of one person with their stance, handedness and tempo.
pub struct Maker<'r> {
    pub rng: &'r mut ChaCha8Rng,
    /// Main hand: 0 left, 1 right.
    pub main: usize,
    pub rest: Moment,
    tempo: f64,
}

impl<'r> Maker<'r> {
    /// A person; nine in ten use the right hand.
    pub fn new(rng: &'r mut ChaCha8Rng) -> Self {
        let main = usize::from(rng.random_bool(0.85));
        let tempo = rng.random_range(0.55_f64.ln()..1.45_f64.ln()).exp();
        let mut rest = Moment::standing()
            .bent(rng.random_range(-2.0..9.0), rng.random_range(-6.0..18.0))
            .legs(rng.random_range(0.0..4.0), rng.random_range(0.0..8.0), rng.random_range(-1.0..6.0))
            .twisted(rng.random_range(-6.0..6.0));
        rest.arc = rng.random_range(0.0..1.0);
        let step = rng.random_range(-7.0..7.0);
        rest.pose.legs[0].hip_deg += step;
        rest.pose.legs[1].hip_deg -= step;
        for side in 0..2 {
            rest.hands[side] = Hand::swung(
                rng.random_range(-18.0..8.0),
                rng.random_range(3.0..26.0),
                rng.random_range(0.04..0.26),
            );
        }
        // One in ten rests a hand on the hip or before the body.
        if rng.random_bool(0.1) {
            let side = rng.random_range(0..2);
            rest.hands[side] = Hand::at(
                rng.random_range(-0.25..0.15),
                rng.random_range(0.1..0.35),
                rng.random_range(-0.75..-0.5),
            )
            .elbow(rng.random_range(0.3..1.0));
        }
        Self { rng, main, rest, tempo }
    }

    /// Uniform between two values.
    pub fn draw(&mut self, low: f64, high: f64) -> f64 {
        self.rng.random_range(low..high)
    }

    pub fn chance(&mut self, share: f64) -> bool {
        self.rng.random_bool(share)
    }

    /// Seconds around a typical time: the person's tempo, and a fifth either way.
    pub fn seconds(&mut self, usual: f64) -> f64 {
        usual * self.tempo * self.rng.random_range(0.8..1.25)
    }

    /// Random position near another.
    pub fn near(&mut self, hand: Hand, by: f64) -> Hand {
        let mut off = || self.rng.random_range(-by..by);
        let moved = hand.moved(off(), off(), off());
        Hand { elbow: hand.elbow + 0.6 * self.rng.random_range(-0.5..0.5), ..moved }
    }

    /// Rest, parts, rest; the activity excludes the rests.
    pub fn once(&mut self, parts: Keys) -> Motion {
        let length = duration(&parts);
        let (before, after) = (self.draw(0.2, 0.8 + length), self.draw(0.4, 1.2));
        let last = parts.last().map_or(self.rest, |(_, moment)| *moment);
        let mut keys = vec![(0.0, self.rest), (before, self.rest)];
        keys.extend(parts);
        keys.push((after, last));
        Motion::Once { keys, from: before, to: before + length, ready: before }
    }

    /// As [`Self::once`], for clips that may omit the approach.
    pub fn gesture(&mut self, parts: Keys) -> Motion {
        let way_in = parts.first().map_or(0.0, |(seconds, _)| *seconds);
        match self.once(parts) {
            Motion::Once { keys, from, to, .. } => Motion::Once { keys, from, to, ready: from + way_in },
            other => other,
        }
    }

    /// Approach, varied repetitions of `cycle`, then rest.
    pub fn repeated(&mut self, way_in: Keys, cycle: &[(f64, Moment)], times: usize) -> Motion {
        let before = self.draw(0.1, 1.5);
        let mut keys = vec![(0.0, self.rest), (before, self.rest)];
        keys.extend(way_in);
        let from = duration(&keys);
        let period: f64 = cycle.iter().map(|(seconds, _)| seconds).sum();
        for _ in 0..times.max(1) {
            let (slow, wide) = (self.draw(0.9, 1.12), self.draw(0.85, 1.1));
            keys.extend(
                cycle
                    .iter()
                    .map(|(seconds, moment)| (slow * seconds, Moment::between(&cycle[0].1, moment, wide))),
            );
        }
        let to = duration(&keys);
        let back = self.seconds(0.7);
        keys.push((back, self.rest));
        Motion::Repeated { keys, from, to, period }
    }
}

impl Motion {
    /// Moments of a clip at `rate_hz`, cut tightly or with margins, at any phase of a repetition.
    pub fn clip(&self, rng: &mut ChaCha8Rng, rate_hz: f64) -> Vec<Moment> {
        let (begin, end) = self.cut(rng);
        let length = (end - begin).max(0.1);
        let frames = ((length * rate_hz).round() as usize).clamp(LEAST_FRAMES, MOST_FRAMES);
        // Sway of a standing body, and steps.
        let sway = rng.random_range(0.0..2.5);
        let sway_hz = rng.random_range(0.2..0.7);
        let phase = rng.random_range(0.0..std::f64::consts::TAU);
        // One in three walkers turns.
        let turning = matches!(self, Self::Gait(_)) && rng.random_bool(0.33);
        let turn_deg_s = if turning { rng.random_range(-60.0..60.0) } else { 0.0 };
        (0..frames)
            .map(|frame| {
                let t = begin + length * frame as f64 / (frames - 1) as f64;
                let mut moment = match self {
                    Self::Gait(gait) => {
                        let turns = t * gait.strides_hz;
                        gait.at(turns).gone(turns * gait.stride_statures())
                    }
                    Self::Once { keys, .. } | Self::Repeated { keys, .. } => at(keys, t),
                };
                let s = (std::f64::consts::TAU * sway_hz * t + phase).sin();
                moment.heading_deg = turn_deg_s * (t - begin);
                moment.pose.lean_deg += 0.7 * sway * s;
                moment.side_deg += sway * s;
                moment
            })
            .collect()
    }
}

impl Motion {
    fn cut(&self, rng: &mut ChaCha8Rng) -> (f64, f64) {
        match self {
            Self::Gait(gait) => {
                let begin = rng.random_range(0.0..5.0);
                (begin, begin + rng.random_range(0.9..4.2) / gait.strides_hz)
            }
            Self::Once { keys, from, to, ready } => {
                // Half are cut tightly on either side, up to a tenth short; some start when prepared.
                let (core, all) = (to - from, duration(keys));
                let begin = match rng.random_range(0..20) {
                    0..6 => from + rng.random_range(-0.04..0.1) * core,
                    6..16 => ready - rng.random_range(0.0..0.3) * (ready - from),
                    _ => rng.random_range(0.0..1.0) * from,
                };
                let end = match rng.random_range(0..10) {
                    0..6 => to + rng.random_range(-0.1..0.04) * core,
                    _ => to + rng.random_range(0.0..1.0) * (all - to),
                };
                (begin.max(0.0), end.min(all))
            }
            Self::Repeated { keys, from, to, period } => {
                // From rest or mid-action, to rest or mid-action.
                let begin = if rng.random_bool(0.5) {
                    rng.random_range(0.0..1.0) * from
                } else {
                    rng.random_range(*from..*to)
                };
                let least = begin.max(*from) + rng.random_range(0.6..1.5) * period;
                let end = match rng.random_range(0..4) {
                    0 => duration(keys),
                    1 => *to,
                    // The hands have just arrived.
                    2 => begin.max(*from) + rng.random_range(0.3..1.2) * period,
                    _ => least + rng.random_range(0.0..3.0) * period,
                };
                let end = end.min(duration(keys));
                (begin.min(end - 0.9 * period).max(0.0), end)
            }
        }
    }
}

/// Fewest frames of a clip, and the most.
const LEAST_FRAMES: usize = 6;
const MOST_FRAMES: usize = 64;
