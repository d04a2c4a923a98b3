//! Gait from published joint angles, with spreads in amplitude, tempo and arms. Walking: Winter (The
//! Biomechanics and Motor Control of Human Gait, 1991); running: Novacheck (Gait and Posture 7, 1998).

use super::moment::{Hand, Moment};
use farnear_silhouettes::synthetic::body::Leg;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Angles at every tenth of the cycle, degrees.
type Cycle = [f64; 10];

const WALK_HIP: Cycle = [24.0, 21.0, 13.0, 4.0, -4.0, -10.0, -7.0, 9.0, 21.0, 25.0];
const WALK_KNEE: Cycle = [5.0, 15.0, 18.0, 11.0, 7.0, 11.0, 35.0, 61.0, 54.0, 17.0];
const RUN_HIP: Cycle = [35.0, 31.0, 16.0, 0.0, -9.0, 0.0, 22.0, 42.0, 53.0, 46.0];
const RUN_KNEE: Cycle = [18.0, 41.0, 36.0, 22.0, 28.0, 66.0, 98.0, 104.0, 78.0, 36.0];

#[derive(Clone, Copy, Debug)]
pub struct Gait {
    /// 0 walking to 1 running.
    run: f64,
    /// Scale of leg swings.
    stride: f64,
    stoop_deg: f64,
    lean_deg: f64,
    nod_deg: f64,
    swing_deg: f64,
    elbow_deg: f64,
    out: f64,
    pub strides_hz: f64,
    /// Hands with another task: `None` swings.
    held: [Option<Hand>; 2],
}

impl Gait {
    fn walk(rng: &mut ChaCha8Rng) -> Self {
        Self {
            run: 0.0,
            stride: rng.random_range(0.7..1.25),
            stoop_deg: rng.random_range(0.0..6.0),
            lean_deg: rng.random_range(0.0..9.0),
            nod_deg: rng.random_range(-4.0..14.0),
            swing_deg: rng.random_range(4.0..30.0),
            elbow_deg: rng.random_range(8.0..35.0),
            out: rng.random_range(0.05..0.22),
            strides_hz: rng.random_range(0.7..1.15),
            held: [None; 2],
        }
    }

    /// Jogging to running: 1.25 to 1.6 Hz.
    pub fn jog(rng: &mut ChaCha8Rng) -> Self {
        Self {
            run: rng.random_range(0.65..1.1),
            stride: rng.random_range(0.75..1.15),
            lean_deg: rng.random_range(3.0..16.0),
            swing_deg: rng.random_range(20.0..45.0),
            elbow_deg: rng.random_range(70.0..110.0),
            strides_hz: rng.random_range(1.2..1.6),
            ..Self::walk(rng)
        }
    }

    /// Slow, stooping, knees bent, arms before the body.
    pub fn sneak(rng: &mut ChaCha8Rng) -> Self {
        let mut hand = || {
            Some(Hand::at(
                rng.random_range(0.0..0.25),
                rng.random_range(0.25..0.6),
                rng.random_range(-0.5..-0.1),
            ))
        };
        let held = [hand(), hand()];
        Self {
            stoop_deg: rng.random_range(22.0..55.0),
            stride: rng.random_range(0.8..1.2),
            lean_deg: rng.random_range(18.0..50.0),
            nod_deg: rng.random_range(-40.0..-10.0),
            strides_hz: rng.random_range(0.3..0.65),
            held,
            ..Self::walk(rng)
        }
    }

    /// Carrying something in both hands, or hanging from one.
    pub fn carry(rng: &mut ChaCha8Rng) -> Self {
        let mut gait = Self::walk(rng);
        gait.lean_deg = rng.random_range(-6.0..8.0);
        let before = Hand::at(
            rng.random_range(-0.2..0.05),
            rng.random_range(0.35..0.75),
            rng.random_range(-0.55..-0.1),
        )
        .elbow(rng.random_range(0.0..0.4));
        gait.held = [Some(before); 2];
        gait
    }

    /// Walking, one in six with a bag, one in twelve with a phone.
    pub fn walking_about(rng: &mut ChaCha8Rng, main: usize) -> Self {
        match rng.random_range(0..12) {
            0 | 1 => Self::bag(rng, main),
            2 => Self::phone(rng, main),
            _ => Self::walk(rng),
        }
    }

    fn bag(rng: &mut ChaCha8Rng, main: usize) -> Self {
        let mut gait = Self::walk(rng);
        gait.held[main] = Some(Hand::at(rng.random_range(0.1..0.25), rng.random_range(-0.05..0.1), -0.97));
        gait
    }

    fn phone(rng: &mut ChaCha8Rng, main: usize) -> Self {
        let mut gait = Self::walk(rng);
        gait.held[main] = Some(super::gestures::ear(rng));
        gait
    }

    pub fn at(&self, phase: f64) -> Moment {
        let mut moment = Moment::standing().bent(self.lean_deg, self.nod_deg);
        for side in 0..2 {
            let phase = phase + 0.5 * side as f64;
            let mixed =
                |walk: &Cycle, run: &Cycle| (1.0 - self.run) * on(walk, phase) + self.run * on(run, phase);
            moment.pose.legs[side] = Leg {
                hip_deg: self.stride * mixed(&WALK_HIP, &RUN_HIP) + 0.6 * self.stoop_deg,
                knee_deg: (self.stride * mixed(&WALK_KNEE, &RUN_KNEE) + self.stoop_deg).max(0.0),
                spread_deg: 1.0,
            };
            // Arms swing against the legs: furthest back at heel contact of their side.
            let swing = -self.swing_deg * (std::f64::consts::TAU * phase).cos();
            let elbow = self.elbow_deg * (1.0 + 0.25 * swing / self.swing_deg.max(1.0));
            moment.hands[side] = self.held[side].unwrap_or(Hand::swung(swing, elbow, self.out));
        }
        moment.twist_deg = 5.0 * self.stride * (std::f64::consts::TAU * phase).cos();
        // Running bodies fly between steps.
        moment.lift = 0.02 * self.run * (0.5 + 0.5 * (2.0 * std::f64::consts::TAU * (phase - 0.4)).cos());
        moment
    }

    /// Stride length in statures: two steps, each the leg distance at contact.
    pub fn stride_statures(&self) -> f64 {
        let apart = |degrees: f64| (degrees * self.stride).to_radians().sin();
        let walk = 2.0 * 0.66 * (apart(24.0) + apart(10.0));
        walk * (1.0 + 0.9 * self.run)
    }
}

fn on(cycle: &Cycle, phase: f64) -> f64 {
    let x = phase.rem_euclid(1.0) * cycle.len() as f64;
    let (i, t) = (x.floor() as usize, x.fract());
    let p = |k: usize| cycle[(i + k + cycle.len() - 1) % cycle.len()];
    let (a, b, c, d) = (p(0), p(1), p(2), p(3));
    b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn cycles_repeat_and_sides_are_half_a_cycle_apart() {
        for (k, value) in WALK_KNEE.iter().enumerate() {
            assert!((on(&WALK_KNEE, k as f64 / 10.0) - value).abs() < 1e-9);
        }
        let gait = Gait::walk(&mut ChaCha8Rng::seed_from_u64(3));
        let (a, b) = (gait.at(0.2), gait.at(1.7));
        assert!((a.pose.legs[0].knee_deg - b.pose.legs[1].knee_deg).abs() < 1e-9);
        // A stride of 1.2 to 1.6 m in a person of average height at average amplitude (Winter: 1.5 m).
        let gait = Gait { stride: 1.0, ..gait };
        let stride_m = 1.7 * gait.stride_statures();
        assert!((0.9..1.6).contains(&stride_m), "{stride_m}");
    }
}
