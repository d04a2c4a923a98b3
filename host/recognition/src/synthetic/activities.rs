//! Synthetic people performing the ten activities of Li 2014, table 7.1, as capsules. Every subject has a build and
//! habits; performances vary around these. Positions, directions and counts follow the table: most activities begin and
//! end with walking, which makes them similar.

use crate::clip::{Clip, Track};
use crate::embedding::descriptor::Scaling;
use farnear_silhouettes::silhouette::{capsule::Capsule, view::views_round};
use farnear_silhouettes::synthetic::body::{Arm, Build, Joints, Pose, joints, walking};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Activities of table 7.1.
pub const ACTIVITIES: [&str; 10] =
    ["walk", "drop", "crouch", "peer", "mobile", "place", "bag", "shoot", "gun", "dig"];

#[derive(Clone, Copy, Debug)]
struct Person {
    build: Build,
    stride: f64,
    tempo: f64,
    depth: f64,
    left_handed: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Prop {
    None,
    Bag,
    Spade,
    ShortGun,
    LongGun,
}

#[derive(Clone, Copy, Debug)]
struct Stretch {
    seconds: f64,
    kind: Kind,
    prop: Prop,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Walk {
        phone: bool,
    },
    Circle {
        phone: bool,
    },
    /// Leaning forward and down with an arm: depth 0 to 1.
    Reach {
        depth: f64,
    },
    Crouch,
    /// On tiptoe with both arms over a wall.
    PeerOver,
    Aim,
    Dig,
    DropBag,
}

fn script(activity: usize, person: &Person, rng: &mut ChaCha8Rng) -> Vec<Stretch> {
    let mut vary = |seconds: f64| seconds * person.tempo * rng.random_range(0.85..1.18);
    let plain = Kind::Walk { phone: false };
    let mut parts: Vec<(f64, Kind, Prop)> = vec![];
    let mut add = |seconds: f64, kind: Kind, prop: Prop| parts.push((vary(seconds), kind, prop));
    match activity {
        0 => add(4.0, plain, Prop::None),
        1 => {
            add(1.6, plain, Prop::Bag);
            add(1.6, Kind::DropBag, Prop::Bag);
            add(1.6, plain, Prop::None);
        }
        2 => {
            add(1.4, plain, Prop::None);
            add(2.6, Kind::Crouch, Prop::None);
            add(1.4, plain, Prop::None);
        }
        3 => {
            add(1.2, plain, Prop::None);
            add(1.7, Kind::PeerOver, Prop::None);
            add(1.7, Kind::PeerOver, Prop::None);
            add(1.2, plain, Prop::None);
        }
        4 => {
            add(1.4, Kind::Walk { phone: true }, Prop::None);
            add(2.4, Kind::Circle { phone: true }, Prop::None);
            add(1.4, Kind::Walk { phone: true }, Prop::None);
        }
        5 => {
            add(1.0, plain, Prop::None);
            for _ in 0..6 {
                add(1.0, Kind::Reach { depth: 0.75 }, Prop::None);
                add(0.4, plain, Prop::None);
            }
            add(0.8, plain, Prop::None);
        }
        6 => add(4.0, plain, Prop::Bag),
        7 => {
            add(1.4, plain, Prop::ShortGun);
            add(2.6, Kind::Aim, Prop::ShortGun);
            add(1.4, plain, Prop::ShortGun);
        }
        8 => {
            add(1.4, plain, Prop::LongGun);
            add(2.4, Kind::Circle { phone: false }, Prop::LongGun);
            add(1.4, plain, Prop::LongGun);
        }
        _ => {
            add(1.2, plain, Prop::Spade);
            for _ in 0..4 {
                add(1.1, Kind::Dig, Prop::Spade);
            }
            add(1.2, plain, Prop::Spade);
        }
    }
    parts.into_iter().map(|(seconds, kind, prop)| Stretch { seconds, kind, prop }).collect()
}

/// Rises from 0 to 1, holds, and falls; `share` of the time on either side.
fn swell(t: f64, share: f64) -> f64 {
    let ease = |x: f64| {
        let x = x.clamp(0.0, 1.0);
        x * x * (3.0 - 2.0 * x)
    };
    ease(t / share) * ease((1.0 - t) / share)
}

fn pose(stretch: &Stretch, t: f64, phase: f64, person: &Person) -> Pose {
    let moving = matches!(stretch.kind, Kind::Walk { .. } | Kind::Circle { .. });
    let mut pose =
        if moving { walking(phase, person.stride) } else { Pose { lean_deg: 3.0, ..Pose::default() } };
    let hands = if person.left_handed { (0, 1) } else { (1, 0) };
    carry(&mut pose, stretch.prop, hands);
    match stretch.kind {
        Kind::Walk { phone: true } | Kind::Circle { phone: true } => {
            pose.arms[hands.0] = Arm { shoulder_deg: 35.0, spread_deg: 25.0, elbow_deg: 140.0 };
            pose.nod_deg = 6.0;
        }
        Kind::Walk { phone: false } | Kind::Circle { phone: false } => {}
        Kind::Reach { depth } => reach(&mut pose, swell(t, 0.45) * depth * person.depth, hands),
        Kind::Crouch => crouch(&mut pose, swell(t, 0.3) * person.depth, hands),
        Kind::PeerOver => peer_over(&mut pose, swell(t, 0.35)),
        Kind::Aim => aim(&mut pose, swell(t, 0.2), t, hands),
        Kind::Dig => dig(&mut pose, 0.5 - 0.5 * (std::f64::consts::TAU * t).cos(), person.depth, hands),
        Kind::DropBag => drop_bag(&mut pose, swell(t, 0.4), hands),
    }
    pose
}

type Hands = (usize, usize);

fn carry(pose: &mut Pose, prop: Prop, (main, other): Hands) {
    match prop {
        Prop::Bag => pose.arms[main] = Arm { shoulder_deg: 8.0, spread_deg: 14.0, elbow_deg: 12.0 },
        Prop::Spade => {
            pose.arms[main] = Arm { shoulder_deg: 15.0, spread_deg: 8.0, elbow_deg: 55.0 };
            pose.arms[other] = Arm { shoulder_deg: 25.0, spread_deg: 4.0, elbow_deg: 70.0 };
        }
        Prop::LongGun => {
            pose.arms[main] = Arm { shoulder_deg: 5.0, spread_deg: 12.0, elbow_deg: 85.0 };
            pose.arms[other] = Arm { shoulder_deg: 45.0, spread_deg: 2.0, elbow_deg: 45.0 };
        }
        Prop::ShortGun | Prop::None => {}
    }
}

fn reach(pose: &mut Pose, s: f64, (main, _): Hands) {
    pose.lean_deg += 85.0 * s;
    for leg in &mut pose.legs {
        leg.hip_deg = 25.0 * s;
        leg.knee_deg = 50.0 * s;
    }
    pose.arms[main].shoulder_deg += 90.0 * s;
}

fn crouch(pose: &mut Pose, s: f64, (main, other): Hands) {
    pose.lean_deg += 35.0 * s;
    for leg in &mut pose.legs {
        leg.hip_deg = 100.0 * s;
        leg.knee_deg = 135.0 * s;
        leg.spread_deg = 8.0 * s;
    }
    pose.arms[main] = Arm { shoulder_deg: 60.0 * s, spread_deg: 8.0, elbow_deg: 20.0 };
    pose.arms[other] = Arm { shoulder_deg: 45.0 * s, spread_deg: 8.0, elbow_deg: 30.0 };
}

fn peer_over(pose: &mut Pose, s: f64) {
    pose.lean_deg = 3.0 + 8.0 * s;
    pose.nod_deg = -10.0 * s;
    pose.arms = [Arm { shoulder_deg: 150.0 * s, spread_deg: 12.0, elbow_deg: 35.0 * s }; 2];
}

fn aim(pose: &mut Pose, s: f64, t: f64, (main, other): Hands) {
    // Three shots with recoil.
    let kick = if s > 0.9 { 8.0 * (18.0 * t).sin().max(0.0) } else { 0.0 };
    pose.arms[main] = Arm { shoulder_deg: 88.0 * s + kick, spread_deg: 4.0, elbow_deg: 6.0 };
    pose.arms[other] = Arm { shoulder_deg: 80.0 * s, spread_deg: -8.0, elbow_deg: 25.0 * s };
    for (side, leg) in pose.legs.iter_mut().enumerate() {
        leg.hip_deg = s * if side == main { -8.0 } else { 14.0 };
        leg.knee_deg = 10.0 * s;
    }
}

fn dig(pose: &mut Pose, s: f64, deep: f64, (main, other): Hands) {
    pose.lean_deg = 25.0 + 40.0 * s * deep;
    pose.legs[main].hip_deg = -15.0;
    pose.legs[other].hip_deg = 28.0;
    for leg in &mut pose.legs {
        leg.knee_deg = 18.0 + 14.0 * s;
    }
    pose.arms[main] = Arm { shoulder_deg: 55.0 - 15.0 * s, spread_deg: 8.0, elbow_deg: 45.0 - 20.0 * s };
    pose.arms[other] = Arm { shoulder_deg: 70.0 + 10.0 * s, spread_deg: 4.0, elbow_deg: 12.0 };
}

fn drop_bag(pose: &mut Pose, s: f64, (main, other): Hands) {
    pose.lean_deg += 12.0 * s;
    pose.arms[main] = Arm { shoulder_deg: 8.0 + 95.0 * s, spread_deg: 12.0, elbow_deg: 25.0 * s };
    pose.arms[other] = Arm { shoulder_deg: 60.0 * s, spread_deg: 8.0, elbow_deg: 35.0 * s };
}

/// Capsules of the prop; a dropped bag disappears on release.
fn prop(stretch: &Stretch, t: f64, body: &Joints, person: &Person) -> Vec<Capsule> {
    let main = usize::from(!person.left_handed);
    let (hand, other) = (body.hands[main], body.hands[1 - main]);
    let beyond = |from: [f64; 3], to: [f64; 3], length: f64| -> [f64; 3] {
        let d: [f64; 3] = std::array::from_fn(|k| to[k] - from[k]);
        let norm = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt().max(1.0);
        std::array::from_fn(|k| to[k] + d[k] / norm * length)
    };
    match stretch.prop {
        Prop::Bag if stretch.kind == Kind::DropBag && t > 0.5 => Vec::new(),
        Prop::Bag => {
            let top = [hand[0], hand[1], hand[2] - 120.0];
            vec![
                Capsule::new(hand, top, 15.0),
                Capsule::new(
                    [top[0], top[1] - 120.0, top[2] - 110.0],
                    [top[0], top[1] + 120.0, top[2] - 110.0],
                    120.0,
                ),
            ]
        }
        Prop::Spade => {
            let blade = beyond(hand, other, 450.0);
            vec![
                Capsule::new(beyond(other, hand, 250.0), blade, 16.0),
                Capsule::new(other, blade, 14.0),
                Capsule::new(blade, blade, 100.0),
            ]
        }
        Prop::ShortGun => vec![Capsule::new(hand, beyond(body.elbows[main], hand, 160.0), 24.0)],
        Prop::LongGun => vec![Capsule::new(beyond(other, hand, 250.0), beyond(hand, other, 420.0), 30.0)],
        Prop::None => Vec::new(),
    }
}

/// Bodies of one performance at `rate_hz` frames per second.
pub fn performance(subject: usize, activity: usize, repetition: usize, rate_hz: f64) -> Vec<Vec<Capsule>> {
    let mut habits = ChaCha8Rng::seed_from_u64(1000 + subject as u64);
    let person = Person {
        build: Build {
            height_mm: habits.random_range(1560.0..1920.0),
            girth: habits.random_range(0.85..1.25),
            breadth: habits.random_range(0.9..1.12),
            leg: habits.random_range(0.95..1.05),
        },
        stride: habits.random_range(0.75..1.2),
        tempo: habits.random_range(0.85..1.2),
        depth: habits.random_range(0.8..1.0),
        left_handed: habits.random_range(0..10) == 0,
    };
    let mut rng =
        ChaCha8Rng::seed_from_u64((subject as u64 * 100 + activity as u64) * 100 + repetition as u64);
    let (speed_mm_s, mut phase) = (1250.0 * person.stride / person.tempo, rng.random_range(0.0..1.0));
    let (mut heading, mut at) = (rng.random_range(-8.0..8.0_f64), [0.0_f64, -1500.0]);
    let mut bodies = Vec::new();
    for stretch in script(activity % ACTIVITIES.len(), &person, &mut rng) {
        let frames = (stretch.seconds * rate_hz).round().max(2.0);
        for frame in 0..frames as usize {
            let t = frame as f64 / frames;
            if matches!(stretch.kind, Kind::Walk { .. } | Kind::Circle { .. }) {
                if matches!(stretch.kind, Kind::Circle { .. }) {
                    heading += 360.0 / frames;
                }
                let (s, c) = heading.to_radians().sin_cos();
                at = [at[0] - s * speed_mm_s / rate_hz, at[1] + c * speed_mm_s / rate_hz];
                phase += 0.95 / person.tempo / rate_hz;
            }
            let mut posed = joints(&person.build, &pose(&stretch, t, phase, &person));
            let mut body = prop(&stretch, t, &posed, &person);
            for capsule in &mut body {
                for p in [&mut capsule.from, &mut capsule.to] {
                    let (s, c) = heading.to_radians().sin_cos();
                    *p = [c * p[0] - s * p[1] + at[0], s * p[0] + c * p[1] + at[1], p[2]];
                }
            }
            posed.place(heading, at);
            body.extend(posed.capsules(&person.build));
            bodies.push(body);
        }
    }
    bodies
}

/// Clips of `subjects` people at all ten activities from `views` views, at `rate_hz` frames per second.
pub fn clips(subjects: usize, views: usize, rate_hz: f64, scaling: Scaling) -> Vec<Clip> {
    (0..subjects * ACTIVITIES.len())
        .into_par_iter()
        .map(|index| {
            let (subject, activity) = (index / ACTIVITIES.len(), index % ACTIVITIES.len());
            let bodies = performance(subject, activity, 0, rate_hz);
            // Oblique start, so that no view looks along the path.
            let views = views_round(views, 0.0).into_iter().map(|mut view| {
                view.gamma_deg += 45.0;
                Track::from_bodies(&bodies, &view, scaling)
            });
            Clip {
                subject: format!("p{subject:02}"),
                activity: ACTIVITIES[activity].into(),
                views: views.collect(),
            }
        })
        .collect()
}
