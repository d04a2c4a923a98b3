//! Build and clothes of a person, and joint positions at a moment.

use super::moment::{Hand, Moment};
use farnear_silhouettes::silhouette::capsule::{Capsule, Point3};
use farnear_silhouettes::synthetic::body::{Build, Joints, joints};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Build and clothes; thickness relative to the average body.
#[derive(Clone, Copy, Debug)]
pub struct Person {
    pub build: Build,
    trunk: f64,
    arms: f64,
    legs: f64,
    head: f64,
    /// Arm length; trackers and short sleeves end at the wrist.
    reach: f64,
    /// Feet visible; trackers often have ankles only.
    feet: bool,
    /// Length of a skirt or coat as a share of the legs.
    skirt: f64,
    /// Radius of a backpack, mm.
    pack_mm: f64,
}

impl Person {
    /// A random person. Stature: mean 1.70 m, SD 0.10 m (NCD-RisC, eLife 5, 2016). Limbs vary by 4 to 6 %
    /// (Gordon et al., ANSUR, 1989), down to the shorter trunks and arms of joint trackers (0.48 and 0.67 of
    /// a leg; Winter: 0.59 and 0.79). Clothes are guessed.
    pub fn drawn(rng: &mut ChaCha8Rng) -> Self {
        let girth = rng.random_range(0.85..1.12);
        Self {
            build: Build {
                height_mm: rng.random_range(1500.0..1930.0),
                girth: 1.0,
                breadth: rng.random_range(0.7..1.05),
                leg: rng.random_range(0.92..1.12),
            },
            trunk: girth * rng.random_range(0.75..1.2),
            arms: girth * rng.random_range(0.75..1.3),
            legs: girth * rng.random_range(0.75..1.15),
            head: rng.random_range(0.95..1.4),
            reach: rng.random_range(0.82..1.03),
            feet: rng.random_bool(0.8),
            skirt: if rng.random_bool(0.15) { rng.random_range(0.2..0.8) } else { 0.0 },
            pack_mm: if rng.random_bool(0.07) { rng.random_range(90.0..170.0) } else { 0.0 },
        }
    }

    /// Joints at a moment, on the ground at the origin, facing along y.
    pub fn joints(&self, moment: &Moment) -> Joints {
        let mut found = joints(&self.build, &moment.pose);
        let pelvis = found.pelvis;
        let axis = unit(difference(found.neck, pelvis));
        for side in 0..2 {
            found.shoulders[side] =
                turned_about(found.shoulders[side], found.neck, axis, moment.twist_deg.to_radians());
        }
        let bend = moment.side_deg.to_radians();
        for point in [&mut found.neck, &mut found.head].into_iter().chain(found.shoulders.iter_mut()) {
            *point = turned_about(*point, pelvis, [0.0, 1.0, 0.0], bend);
        }
        for side in 0..2 {
            let (elbow, hand) = self.arm(found.shoulders[side], side, moment);
            (found.elbows[side], found.hands[side]) = (elbow, hand);
        }
        if moment.tilt_deg != 0.0 {
            let tilt = moment.tilt_deg.to_radians();
            found.each(|p| *p = turned_about(*p, [0.0; 3], [1.0, 0.0, 0.0], tilt));
        }
        // Tilted or sitting bodies still rest on the ground.
        let lowest = [found.pelvis, found.head].iter().fold(f64::INFINITY, |low, p| low.min(p[2]));
        let lift = (90.0 - lowest).max(0.0) + moment.lift * self.build.height_mm;
        found.each(|p| p[2] += lift);
        found
    }

    /// Elbow and hand by the law of cosines, with the requested elbow direction.
    fn arm(&self, shoulder: Point3, side: usize, moment: &Moment) -> (Point3, Point3) {
        let h = self.build.height_mm;
        let (upper, fore) = (0.186 * self.reach * h, 0.2 * self.reach * h);
        let Hand { out, ahead, up, elbow } = moment.hands[side];
        let sign = if side == 0 { -1.0 } else { 1.0 };
        let (s, c) = moment.twist_deg.to_radians().sin_cos();
        let turned = |p: Point3| [c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]];
        let way = turned([sign * out, ahead, up].map(|v| v * (upper + fore)));
        let (direction, length) = (unit(way), norm(way).clamp(0.22 * (upper + fore), 0.998 * (upper + fore)));
        let hint = turned([sign * (0.2 + 0.8 * elbow), -0.3 + 0.3 * elbow, -1.0 + elbow]);
        let along = dot(hint, direction);
        let across = unit(std::array::from_fn(|k| hint[k] - along * direction[k]));
        let cosine =
            ((upper * upper + length * length - fore * fore) / (2.0 * upper * length)).clamp(-1.0, 1.0);
        let sine = (1.0 - cosine * cosine).sqrt();
        let bent: Point3 =
            std::array::from_fn(|k| shoulder[k] + upper * (cosine * direction[k] + sine * across[k]));
        (bent, std::array::from_fn(|k| shoulder[k] + length * direction[k]))
    }

    pub fn dressed(&self, found: &Joints) -> Vec<Capsule> {
        let h = self.build.height_mm;
        let ball = |at: Point3, radius: f64| Capsule::new(at, at, radius);
        let (trunk, arms, legs) = (self.trunk * h, self.arms * h, self.legs * h);
        let crown: Point3 = std::array::from_fn(|k| found.head[k] + 0.12 * (found.head[k] - found.neck[k]));
        let mut body = vec![
            Capsule::new(found.head, crown, 0.048 * h * self.head),
            Capsule::new(found.neck, found.head, 0.033 * h),
            Capsule::new(found.pelvis, found.neck, 0.07 * trunk),
            Capsule::new(found.shoulders[0], found.shoulders[1], 0.04 * trunk),
            Capsule::new(found.hips[0], found.hips[1], 0.053 * trunk),
        ];
        for side in 0..2 {
            body.push(Capsule::new(found.hips[side], found.shoulders[side], 0.046 * trunk));
            body.push(Capsule::new(found.hips[side], found.knees[side], 0.044 * legs));
            body.push(Capsule::new(found.knees[side], found.ankles[side], 0.031 * legs));
            if self.feet {
                body.push(Capsule::new(found.ankles[side], found.toes[side], 0.021 * h));
            }
            body.push(Capsule::new(found.shoulders[side], found.elbows[side], 0.027 * arms));
            body.push(Capsule::new(found.elbows[side], found.hands[side], 0.023 * arms));
            body.push(ball(found.hands[side], 0.024 * h));
        }
        if self.skirt > 0.0 {
            let hem = |side: usize| -> Point3 {
                std::array::from_fn(|k| {
                    found.hips[side][k] + self.skirt * (found.knees[side][k] - found.hips[side][k])
                })
            };
            body.push(Capsule::new(hem(0), hem(1), 0.055 * legs));
            body.push(Capsule::new(found.pelvis, middle(hem(0), hem(1)), 0.07 * legs));
        }
        if self.pack_mm > 0.0 {
            let back = middle(found.neck, found.pelvis);
            let across = unit(difference(found.shoulders[1], found.shoulders[0]));
            let behind = cross(across, unit(difference(found.neck, found.pelvis)));
            let off = 0.07 * trunk + 0.3 * self.pack_mm;
            body.push(ball(std::array::from_fn(|k| back[k] + off * behind[k]), self.pack_mm));
        }
        body
    }
}

pub fn middle(a: Point3, b: Point3) -> Point3 {
    std::array::from_fn(|k| 0.5 * (a[k] + b[k]))
}

fn difference(a: Point3, b: Point3) -> Point3 {
    std::array::from_fn(|k| a[k] - b[k])
}

fn dot(a: Point3, b: Point3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn norm(a: Point3) -> f64 {
    dot(a, a).sqrt()
}

fn unit(a: Point3) -> Point3 {
    let length = norm(a).max(1e-9);
    a.map(|v| v / length)
}

fn cross(a: Point3, b: Point3) -> Point3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn turned_about(p: Point3, about: Point3, axis: Point3, angle: f64) -> Point3 {
    let (v, (s, c)) = (difference(p, about), angle.sin_cos());
    let (beside, along) = (cross(axis, v), dot(axis, v));
    std::array::from_fn(|k| about[k] + c * v[k] + s * beside[k] + (1.0 - c) * along * axis[k])
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn arms_keep_their_length_and_hands_reach_as_far_as_possible() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..50 {
            let person = Person::drawn(&mut rng);
            let h = person.build.height_mm;
            let hand = Hand::at(
                rng.random_range(-0.4..0.6),
                rng.random_range(-0.3..0.6),
                rng.random_range(-0.6..0.6),
            );
            let found = person.joints(&Moment::standing().both(hand));
            for side in 0..2 {
                let upper = norm(difference(found.elbows[side], found.shoulders[side]));
                let fore = norm(difference(found.hands[side], found.elbows[side]));
                assert!((upper - 0.186 * person.reach * h).abs() < 1e-6);
                assert!((fore - 0.2 * person.reach * h).abs() < 1e-6);
                let reach =
                    norm([hand.out, hand.ahead, hand.up]).clamp(0.22, 0.998) * 0.386 * person.reach * h;
                let found = norm(difference(found.hands[side], found.shoulders[side]));
                assert!((found - reach).abs() < 1e-6, "{found} {reach}");
            }
            // Left is negative x.
            assert!(found.shoulders[0][0] < found.shoulders[1][0]);
        }
    }

    #[test]
    fn turning_the_shoulders_to_the_left_brings_the_right_one_forward() {
        let person = Person::drawn(&mut ChaCha8Rng::seed_from_u64(2));
        let found = person.joints(&Moment::standing().twisted(30.0));
        assert!(found.shoulders[1][1] > found.shoulders[0][1] + 50.0, "{:?}", found.shoulders);
        let lying = person.joints(&Moment { tilt_deg: 88.0, ..Moment::standing() });
        assert!(lying.head[1] < -1000.0 && lying.head[2] < 400.0, "{:?}", lying.head);
    }
}
