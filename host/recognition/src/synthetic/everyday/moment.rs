//! Posture at one moment, and interpolation between postures.

use farnear_silhouettes::synthetic::body::{Leg, Pose};

/// Hand position from the shoulder in arm lengths, in an upright frame that turns with the shoulders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hand {
    /// Outwards; negative reaches across the body.
    pub out: f64,
    pub ahead: f64,
    pub up: f64,
    /// Elbow direction: 0 down and back, 1 outwards.
    pub elbow: f64,
}

impl Hand {
    pub const fn at(out: f64, ahead: f64, up: f64) -> Self {
        Self { out, ahead, up, elbow: 0.25 }
    }

    pub const fn elbow(self, elbow: f64) -> Self {
        Self { elbow, ..self }
    }

    /// Arm swung forward by `shoulder_deg` with the elbow bent by `elbow_deg`, in the vertical plane ahead.
    pub fn swung(shoulder_deg: f64, elbow_deg: f64, out: f64) -> Self {
        // Upper arm and forearm with hand: 0.186 and 0.2 of stature, as in the body.
        let (upper, fore) = (0.482, 0.518);
        let (a, b) = (shoulder_deg.to_radians(), (shoulder_deg + elbow_deg).to_radians());
        Self {
            out,
            ahead: upper * a.sin() + fore * b.sin(),
            up: -upper * a.cos() - fore * b.cos(),
            elbow: 0.15,
        }
    }

    /// Sideways arc: `angle_deg` above the horizontal, at `reach` arm lengths.
    pub fn sideways(angle_deg: f64, reach: f64, ahead: f64) -> Self {
        let (s, c) = angle_deg.to_radians().sin_cos();
        Self { out: reach * c, ahead, up: reach * s, elbow: 0.5 }
    }

    /// Interpolates between the straight line (`arc` 0) and the arc around the shoulder (1); real hands
    /// follow neither (Atkeson and Hollerbach, J. Neurosci. 5, 1985).
    fn on_the_way(self, to: Self, s: f64, arc: f64) -> Self {
        let straight = Self {
            out: mixed(self.out, to.out, s),
            ahead: mixed(self.ahead, to.ahead, s),
            up: mixed(self.up, to.up, s),
            elbow: mixed(self.elbow, to.elbow, s),
        };
        let (a, b) = (self.reach().max(1e-6), to.reach().max(1e-6));
        let cosine = (self.out * to.out + self.ahead * to.ahead + self.up * to.up) / (a * b);
        let angle = cosine.clamp(-1.0, 1.0).acos();
        let sine = angle.sin();
        // Equal directions are on a line; opposite ones have no shortest arc.
        if sine < 0.05 {
            return straight;
        }
        let length = mixed(a, b, s);
        let (p, q) =
            (length * ((1.0 - s) * angle).sin() / (sine * a), length * (s * angle).sin() / (sine * b));
        Self {
            out: mixed(straight.out, p * self.out + q * to.out, arc),
            ahead: mixed(straight.ahead, p * self.ahead + q * to.ahead, arc),
            up: mixed(straight.up, p * self.up + q * to.up, arc),
            ..straight
        }
    }

    fn reach(self) -> f64 {
        (self.out * self.out + self.ahead * self.ahead + self.up * self.up).sqrt()
    }

    pub fn moved(self, out: f64, ahead: f64, up: f64) -> Self {
        Self { out: self.out + out, ahead: self.ahead + ahead, up: self.up + up, ..self }
    }
}

/// State at a moment; pairs are `[left, right]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Trunk, head and legs; its arms are unused.
    pub pose: Pose,
    pub hands: [Hand; 2],
    /// Shoulder rotation against the hips, to the left.
    pub twist_deg: f64,
    /// Trunk bend to the right, degrees.
    pub side_deg: f64,
    /// Backward tilt of the body about the feet.
    pub tilt_deg: f64,
    /// Height off the ground / stature.
    pub lift: f64,
    /// Distance along the path / stature.
    pub ahead: f64,
    /// Heading to the left of the start.
    pub heading_deg: f64,
    /// Path of hands: 0 straight, 1 around the shoulder.
    pub arc: f64,
}

fn mixed(a: f64, b: f64, s: f64) -> f64 {
    a + (b - a) * s
}

impl Moment {
    pub fn standing() -> Self {
        Self {
            pose: Pose { lean_deg: 3.0, ..Pose::default() },
            hands: [Hand::at(0.12, 0.06, -0.96); 2],
            twist_deg: 0.0,
            side_deg: 0.0,
            tilt_deg: 0.0,
            lift: 0.0,
            ahead: 0.0,
            heading_deg: 0.0,
            arc: 0.0,
        }
    }

    /// Interpolation at `s` from 0 to 1.
    pub fn between(a: &Self, b: &Self, s: f64) -> Self {
        let leg = |side: usize| {
            let (p, q): (Leg, Leg) = (a.pose.legs[side], b.pose.legs[side]);
            Leg {
                hip_deg: mixed(p.hip_deg, q.hip_deg, s),
                knee_deg: mixed(p.knee_deg, q.knee_deg, s),
                spread_deg: mixed(p.spread_deg, q.spread_deg, s),
            }
        };
        let hand = |side: usize| {
            let (p, q) = (a.hands[side], b.hands[side]);
            p.on_the_way(q, s, b.arc)
        };
        Self {
            pose: Pose {
                lean_deg: mixed(a.pose.lean_deg, b.pose.lean_deg, s),
                nod_deg: mixed(a.pose.nod_deg, b.pose.nod_deg, s),
                legs: [leg(0), leg(1)],
                arms: a.pose.arms,
            },
            hands: [hand(0), hand(1)],
            twist_deg: mixed(a.twist_deg, b.twist_deg, s),
            side_deg: mixed(a.side_deg, b.side_deg, s),
            tilt_deg: mixed(a.tilt_deg, b.tilt_deg, s),
            lift: mixed(a.lift, b.lift, s),
            ahead: mixed(a.ahead, b.ahead, s),
            heading_deg: mixed(a.heading_deg, b.heading_deg, s),
            arc: b.arc,
        }
    }

    pub fn legs(mut self, hip_deg: f64, knee_deg: f64, spread_deg: f64) -> Self {
        self.pose.legs = [Leg { hip_deg, knee_deg, spread_deg }; 2];
        self
    }

    pub fn bent(mut self, lean_deg: f64, nod_deg: f64) -> Self {
        (self.pose.lean_deg, self.pose.nod_deg) = (lean_deg, nod_deg);
        self
    }

    pub fn hand(mut self, side: usize, hand: Hand) -> Self {
        self.hands[side] = hand;
        self
    }

    pub fn both(self, hand: Hand) -> Self {
        Self { hands: [hand; 2], ..self }
    }

    pub fn twisted(self, twist_deg: f64) -> Self {
        Self { twist_deg, ..self }
    }

    pub fn gone(self, ahead: f64) -> Self {
        Self { ahead, ..self }
    }
}

/// A motion: its duration, seconds, and the posture at its end.
pub type Keys = Vec<(f64, Moment)>;

pub fn duration(keys: &Keys) -> f64 {
    keys.iter().map(|(seconds, _)| seconds).sum()
}

/// State `t` seconds into a motion, with minimum jerk (Flash and Hogan, J. Neurosci. 5, 1985).
pub fn at(keys: &Keys, t: f64) -> Moment {
    let Some((_, first)) = keys.first() else { return Moment::standing() };
    let (mut from, mut gone) = (first, keys[0].0);
    for (seconds, to) in &keys[1..] {
        if t < gone + seconds {
            let s = ((t - gone) / seconds.max(1e-6)).clamp(0.0, 1.0);
            return Moment::between(from, to, s * s * s * (10.0 + s * (6.0 * s - 15.0)));
        }
        gone += seconds;
        from = to;
    }
    *from
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motions_pass_through_their_keys_and_rest_there() {
        let up = Moment::standing().both(Hand::at(0.1, 0.2, 0.9));
        let keys = vec![(0.0, Moment::standing()), (1.0, up), (0.5, Moment::standing())];
        assert_eq!(duration(&keys), 1.5);
        assert_eq!(at(&keys, 0.0), Moment::standing());
        assert_eq!(at(&keys, 1.0), up);
        assert_eq!(at(&keys, 9.0), Moment::standing());
        let half = at(&keys, 0.5).hands[0].up;
        assert!((half - 0.5 * (0.9 - 0.96)).abs() < 1e-9, "{half}");
        // Minimum jerk: little motion in the first tenth.
        assert!((at(&keys, 0.1).hands[0].up + 0.96).abs() < 0.02);
    }

    #[test]
    fn hands_on_an_arc_keep_their_reach_and_straight_ones_do_not() {
        let (low, ahead) = (Hand::at(0.1, 0.0, -0.9), Hand::at(0.1, 0.9, 0.0));
        let half = |arc: f64| low.on_the_way(ahead, 0.5, arc);
        assert!((half(1.0).reach() - low.reach()).abs() < 1e-9, "{:?}", half(1.0));
        // The chord of a right angle is shorter by sqrt(0.5), apart from the outward share.
        assert!((half(0.0).reach() - (0.405_f64 + 0.01).sqrt()).abs() < 1e-9, "{:?}", half(0.0));
        assert_eq!(low.on_the_way(ahead, 0.5, 0.0), Hand::at(0.1, 0.45, -0.45));
        // Opposite positions have no shortest arc: the line is used.
        let up = Hand::at(-0.1, 0.0, 0.9);
        assert!(low.on_the_way(up, 0.5, 1.0).reach() < 1e-9);
    }

    #[test]
    fn a_swung_arm_hangs_or_points_ahead() {
        let hanging = Hand::swung(0.0, 0.0, 0.1);
        assert!((hanging.up + 1.0).abs() < 1e-9 && hanging.ahead.abs() < 1e-9);
        let ahead = Hand::swung(90.0, 0.0, 0.1);
        assert!((ahead.ahead - 1.0).abs() < 1e-9 && ahead.up.abs() < 1e-9);
    }
}
