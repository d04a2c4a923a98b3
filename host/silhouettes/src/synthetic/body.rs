//! Synthetic person: a jointed body of capsules posed by angles (proportions: Winter, Biomechanics and Motor
//! Control of Human Movement, fig. 4.1). x right, y forward, z up, mm, origin on the ground between the feet.

use crate::silhouette::capsule::{Capsule, Point3};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Build {
    pub height_mm: f64,
    pub girth: f64,
    /// Shoulder and hip width relative to the average (1.0).
    pub breadth: f64,
    /// Relative to the average (1.0); the trunk compensates.
    pub leg: f64,
}

impl Default for Build {
    fn default() -> Self {
        Self { height_mm: 1750.0, girth: 1.0, breadth: 1.0, leg: 1.0 }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Leg {
    /// Thigh forward of the vertical.
    pub hip_deg: f64,
    pub knee_deg: f64,
    pub spread_deg: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Arm {
    /// Upper arm forward of the trunk's axis (hanging = 0, straight ahead = 90, up = 180).
    pub shoulder_deg: f64,
    pub spread_deg: f64,
    pub elbow_deg: f64,
}

/// `[left, right]` for pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Trunk forward of the vertical.
    pub lean_deg: f64,
    /// Head forward of the trunk.
    pub nod_deg: f64,
    pub legs: [Leg; 2],
    pub arms: [Arm; 2],
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joints {
    pub pelvis: Point3,
    pub neck: Point3,
    pub head: Point3,
    pub hips: [Point3; 2],
    pub knees: [Point3; 2],
    pub ankles: [Point3; 2],
    pub toes: [Point3; 2],
    pub shoulders: [Point3; 2],
    pub elbows: [Point3; 2],
    pub hands: [Point3; 2],
}

fn add(a: Point3, b: Point3) -> Point3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Vector of a hanging limb after swinging forward and out (to +x).
fn limb(length: f64, forward_deg: f64, out_deg: f64) -> Point3 {
    let (sf, cf) = forward_deg.to_radians().sin_cos();
    let (so, co) = out_deg.to_radians().sin_cos();
    [length * so, length * sf * co, -length * cf * co]
}

/// The lowest foot is on the ground, the pelvis above the origin.
pub fn joints(build: &Build, pose: &Pose) -> Joints {
    let h = build.height_mm;
    let (thigh, shank) = (0.245 * h * build.leg, 0.246 * h * build.leg);
    let ankle_height = 0.039 * h;
    let trunk = 0.818 * h - (thigh + shank + ankle_height);
    let (hip_half, shoulder_half) = (0.055 * h * build.breadth, 0.115 * h * build.breadth);
    let mut found = Joints {
        pelvis: [0.0; 3],
        neck: [0.0; 3],
        head: [0.0; 3],
        hips: [[0.0; 3]; 2],
        knees: [[0.0; 3]; 2],
        ankles: [[0.0; 3]; 2],
        toes: [[0.0; 3]; 2],
        shoulders: [[0.0; 3]; 2],
        elbows: [[0.0; 3]; 2],
        hands: [[0.0; 3]; 2],
    };
    let (sl, cl) = pose.lean_deg.to_radians().sin_cos();
    found.neck = [0.0, trunk * sl, trunk * cl];
    let (sn, cn) = (pose.lean_deg + pose.nod_deg).to_radians().sin_cos();
    found.head = add(found.neck, [0.0, 0.112 * h * sn, 0.112 * h * cn]);
    for (side, sign) in [(0, -1.0), (1, 1.0)] {
        let (leg, arm) = (pose.legs[side], pose.arms[side]);
        found.hips[side] = [sign * hip_half, 0.0, 0.0];
        found.knees[side] = add(found.hips[side], limb(thigh, leg.hip_deg, sign * leg.spread_deg));
        let shank_deg = leg.hip_deg - leg.knee_deg;
        found.ankles[side] = add(found.knees[side], limb(shank, shank_deg, sign * leg.spread_deg));
        // The foot is perpendicular to the shank, tilted half-way to the ground.
        let (sf, cf) = (0.5 * shank_deg).to_radians().sin_cos();
        found.toes[side] = add(found.ankles[side], [0.0, 0.13 * h * cf, 0.13 * h * sf - 0.6 * ankle_height]);
        found.shoulders[side] = add(found.neck, [sign * shoulder_half, -0.01 * h * sl, -0.01 * h * cl]);
        let upper = arm.shoulder_deg - pose.lean_deg;
        found.elbows[side] = add(found.shoulders[side], limb(0.186 * h, upper, sign * arm.spread_deg));
        let fore = limb(0.2 * h, upper + arm.elbow_deg, sign * arm.spread_deg * 0.6);
        found.hands[side] = add(found.elbows[side], fore);
    }
    let lowest = found.ankles.iter().chain(&found.knees).fold(f64::INFINITY, |low, p| low.min(p[2]));
    found.each(|p| p[2] += ankle_height - lowest);
    found
}

impl Joints {
    pub fn each(&mut self, mut change: impl FnMut(&mut Point3)) {
        change(&mut self.pelvis);
        change(&mut self.neck);
        change(&mut self.head);
        for group in [
            &mut self.hips,
            &mut self.knees,
            &mut self.ankles,
            &mut self.toes,
            &mut self.shoulders,
            &mut self.elbows,
            &mut self.hands,
        ] {
            group.iter_mut().for_each(&mut change);
        }
    }

    /// Rotates by `heading_deg` anticlockwise about the vertical, then moves by (x, y).
    pub fn place(&mut self, heading_deg: f64, at_mm: [f64; 2]) {
        let (s, c) = heading_deg.to_radians().sin_cos();
        self.each(|p| *p = [c * p[0] - s * p[1] + at_mm[0], s * p[0] + c * p[1] + at_mm[1], p[2]]);
    }

    pub fn capsules(&self, build: &Build) -> Vec<Capsule> {
        let unit = build.height_mm * build.girth;
        // A head is 0.124 of stature high and 0.097 wide: a capsule along the neck's axis.
        let tilt =
            |sign: f64| std::array::from_fn(|k| self.head[k] + sign * 0.12 * (self.head[k] - self.neck[k]));
        let mut body = vec![
            Capsule::new(tilt(-1.0), tilt(1.0), 0.0486 * build.height_mm),
            Capsule::new(self.neck, self.head, 0.032 * unit),
            Capsule::new(self.pelvis, self.neck, 0.075 * unit),
            Capsule::new(self.shoulders[0], self.shoulders[1], 0.04 * unit),
            Capsule::new(self.hips[0], self.hips[1], 0.055 * unit),
        ];
        for side in 0..2 {
            body.push(Capsule::new(self.pelvis, self.shoulders[side], 0.055 * unit));
            body.push(Capsule::new(self.hips[side], self.knees[side], 0.046 * unit));
            body.push(Capsule::new(self.knees[side], self.ankles[side], 0.031 * unit));
            body.push(Capsule::new(self.ankles[side], self.toes[side], 0.02 * unit));
            body.push(Capsule::new(self.shoulders[side], self.elbows[side], 0.027 * unit));
            body.push(Capsule::new(self.elbows[side], self.hands[side], 0.023 * unit));
        }
        body
    }
}

/// Pose in a walk; `phase` in strides (0 to 1), `stride` scales all swings (1 = average).
pub fn walking(phase: f64, stride: f64) -> Pose {
    let mut pose = Pose { lean_deg: 4.0, ..Pose::default() };
    for side in 0..2 {
        let angle = std::f64::consts::TAU * (phase + 0.5 * side as f64);
        // Knees bend most during the forward swing, a quarter of a stride after the thigh's backmost point.
        let swing = (angle + 0.35 * std::f64::consts::PI).sin().max(0.0);
        pose.legs[side] = Leg {
            hip_deg: stride * (24.0 * -angle.cos() + 5.0),
            knee_deg: 6.0 + stride * 52.0 * swing * swing,
            spread_deg: 1.0,
        };
        pose.arms[side] = Arm { shoulder_deg: stride * 22.0 * angle.cos(), spread_deg: 5.0, elbow_deg: 14.0 };
    }
    pose
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_standing_person_has_the_requested_height_on_the_ground() {
        let build = Build { height_mm: 1800.0, ..Build::default() };
        let posed = joints(&build, &Pose::default());
        let top = posed.head[2] + 0.062 * build.height_mm;
        assert!((top - 1800.0).abs() < 25.0, "{top}");
        assert!(posed.ankles.iter().all(|p| (p[2] - 0.039 * 1800.0).abs() < 1e-9));
    }

    #[test]
    fn walking_moves_left_and_right_in_turn_and_repeats() {
        let (a, b) = (walking(0.1, 1.0), walking(0.6, 1.0));
        assert!((a.legs[0].hip_deg - b.legs[1].hip_deg).abs() < 1e-9);
        assert!((walking(1.1, 1.0).legs[0].knee_deg - a.legs[0].knee_deg).abs() < 1e-9);
    }
}
