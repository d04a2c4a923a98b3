//! Motions of the whole body: bending, sitting, lying, kicking, jumping, digging.

use super::gestures::both_or_one;
use super::moment::{Hand, Moment};
use super::motion::{Maker, Motion};
use rand::Rng;

fn down(maker: &mut Maker, hands: &[usize], deep: f64) -> Moment {
    // Share of the knees.
    let squat = maker.draw(0.0, 1.0);
    let lean = deep * (95.0 - 45.0 * squat) * maker.draw(0.8, 1.15);
    let knee = (deep * (15.0 + 110.0 * squat) * maker.draw(0.85, 1.15)).min(150.0);
    let mut moment =
        maker.rest.bent(lean, maker.draw(-35.0, 20.0)).legs(0.72 * knee, knee, maker.draw(1.0, 9.0));
    let step = if maker.chance(0.4) { maker.draw(4.0, 22.0) } else { 0.0 };
    moment.pose.legs[0].hip_deg += step;
    moment.pose.legs[1].hip_deg -= step;
    for &side in hands {
        moment.hands[side] = maker.near(Hand::at(-0.06, 0.15, -0.85), 0.22);
    }
    if hands.len() == 1 {
        let other = 1 - hands[0];
        moment.hands[other] = if maker.chance(0.4) {
            maker.near(Hand::at(0.05, 0.25, -0.5), 0.15)
        } else {
            maker.near(Hand::at(0.1, 0.05, -0.9), 0.1)
        };
    }
    moment
}

/// Distance from the object on the ground before and after, in statures: most make a step.
fn steps(maker: &mut Maker) -> (f64, f64) {
    if maker.chance(0.4) {
        return (0.0, 0.0);
    }
    (-maker.draw(0.0, 0.3), maker.draw(-0.25, 0.25))
}

fn held(maker: &mut Maker, hands: &[usize]) -> Moment {
    let mut moment = maker.rest;
    let place = maker.near(Hand::at(-0.1, 0.4, -0.5), 0.2);
    for &side in hands {
        moment.hands[side] = place;
    }
    moment
}

pub fn pick_up(maker: &mut Maker) -> Motion {
    let hands = both_or_one(maker, 0.5);
    let deep = maker.draw(0.85, 1.2);
    let (before, after) = steps(maker);
    let low = down(maker, &hands, deep);
    maker.rest = maker.rest.gone(before);
    let end = if maker.chance(0.5) { held(maker, &hands) } else { maker.rest };
    let end = end.gone(after);
    let parts = vec![(maker.seconds(1.0), low), (maker.seconds(0.25), low), (maker.seconds(1.0), end)];
    maker.once(parts)
}

pub fn put_down(maker: &mut Maker) -> Motion {
    let hands = both_or_one(maker, 0.5);
    let deep = maker.draw(0.85, 1.2);
    let (before, after) = steps(maker);
    let low = down(maker, &hands, deep);
    let (begin, end) = (held(maker, &hands).gone(before), maker.rest.gone(after));
    maker.rest = begin;
    let parts = vec![(maker.seconds(1.1), low), (maker.seconds(0.3), low), (maker.seconds(0.9), end)];
    maker.once(parts)
}

/// Bending down with straight legs and up again.
pub fn bend(maker: &mut Maker) -> Motion {
    let rest = maker.rest;
    let mut low = rest.bent(maker.draw(75.0, 125.0), maker.draw(-10.0, 35.0)).legs(
        maker.draw(-8.0, 10.0),
        maker.draw(0.0, 25.0),
        maker.draw(0.0, 8.0),
    );
    low = low.both(maker.near(Hand::at(0.0, 0.15, -0.95), 0.15));
    if maker.chance(0.3) {
        low.hands[1 - maker.main] = Hand::at(0.1, 0.0, -0.95);
    }
    let parts = vec![(maker.seconds(1.0), low), (maker.seconds(0.3), low), (maker.seconds(1.0), rest)];
    maker.once(parts)
}

/// Bowing: the trunk bends at the hip, arms along the body or hanging.
pub fn bow(maker: &mut Maker) -> Motion {
    let rest = maker.rest;
    let lean = maker.draw(35.0, 95.0);
    let mut low = rest.bent(lean, maker.draw(0.0, 25.0));
    if maker.chance(0.5) {
        // Along the body rather than hanging.
        low = low.both(Hand::swung(-0.8 * lean, 5.0, 0.1));
    }
    let mut parts = vec![(maker.seconds(0.9), low), (maker.seconds(0.5), low)];
    if maker.chance(0.5) {
        parts.push((maker.seconds(0.9), rest));
    }
    maker.once(parts)
}

/// Tying a lace, kneeling or bent over a foot.
pub fn tie_laces(maker: &mut Maker) -> Motion {
    let foot = maker.near(Hand::at(-0.06, 0.2, -0.85), 0.2);
    let deep = maker.draw(0.9, 1.2);
    let mut low = down(maker, &[0, 1], deep);
    let side = maker.main;
    match maker.rng.random_range(0..4) {
        // One foot ahead or raised.
        0 => {
            low.pose.legs[side].hip_deg += maker.draw(10.0, 35.0);
            low.pose.legs[1 - side].hip_deg -= maker.draw(5.0, 25.0);
        }
        // Kneeling.
        1 | 2 => {
            let knee = maker.draw(70.0, 115.0);
            low.pose.legs[side].hip_deg = knee + maker.draw(-5.0, 25.0);
            low.pose.legs[side].knee_deg = knee;
            low.pose.legs[1 - side].hip_deg = maker.draw(-30.0, 25.0);
            low.pose.legs[1 - side].knee_deg = maker.draw(50.0, 120.0);
            low.pose.lean_deg = maker.draw(30.0, 80.0);
        }
        _ => {}
    }
    let place = maker.near(foot, 0.1);
    low = low.both(place);
    let busy: Vec<Moment> =
        (0..2).map(|_| low.hand(0, maker.near(place, 0.09)).hand(1, maker.near(place, 0.09))).collect();
    let (go, beat) = (maker.seconds(1.0), maker.seconds(0.35));
    let times = maker.rng.random_range(2..6);
    if maker.chance(0.35) {
        return maker.repeated(vec![(go, busy[1])], &[(beat, busy[0]), (beat, busy[1])], times);
    }
    // From standing to the lace only.
    maker.once(vec![(go, busy[1]), (beat, busy[0]), (0.5 * beat, busy[1])])
}

pub fn crouch(maker: &mut Maker) -> Motion {
    let knee = maker.draw(95.0, 145.0);
    let mut low = maker.rest.bent(maker.draw(12.0, 55.0), maker.draw(-25.0, 15.0)).legs(
        0.76 * knee,
        knee,
        maker.draw(2.0, 14.0),
    );
    let place = if maker.chance(0.5) { Hand::at(-0.05, 0.55, -0.45) } else { Hand::at(-0.05, 0.35, -0.85) };
    low = low.both(maker.near(place, 0.15));
    let mut parts = vec![(maker.seconds(0.9), low), (maker.seconds(1.0), low)];
    if maker.chance(0.75) {
        parts.push((maker.seconds(0.9), maker.rest));
    }
    maker.once(parts)
}

fn seated(maker: &mut Maker) -> (Moment, Moment) {
    let knee = maker.draw(60.0, 112.0);
    let hip = knee + maker.draw(-20.0, 10.0);
    let lap = if maker.chance(0.6) { Hand::at(0.0, 0.45, -0.7) } else { Hand::at(0.12, 0.1, -0.9) };
    let seated = maker
        .rest
        .bent(maker.draw(-14.0, 12.0), maker.draw(-5.0, 20.0))
        .legs(hip, knee, maker.draw(1.0, 10.0))
        .both(maker.near(lap, 0.12));
    let share = maker.draw(0.4, 0.85);
    let mut between = Moment::between(&maker.rest, &seated, share);
    between.pose.lean_deg = maker.draw(20.0, 78.0);
    between = between.both(maker.near(Hand::at(0.12, 0.2, -0.7), 0.35));
    (seated, between)
}

pub fn sit_down(maker: &mut Maker) -> Motion {
    let (seated, between) = seated(maker);
    let mut parts = vec![(maker.seconds(0.7), between), (maker.seconds(0.6), seated)];
    if maker.chance(0.5) {
        parts.push((maker.seconds(0.5), seated));
    }
    maker.once(parts)
}

pub fn stand_up(maker: &mut Maker) -> Motion {
    let (seated, between) = seated(maker);
    let standing = maker.rest;
    let mut parts = vec![(maker.seconds(0.55), between), (maker.seconds(0.7), standing)];
    if maker.chance(0.5) {
        parts.insert(0, (maker.seconds(0.4), seated));
    }
    maker.rest = seated;
    maker.once(parts)
}

/// Lying down on the back: sitting on the ground, then lowering the trunk.
pub fn lie_down(maker: &mut Maker) -> Motion {
    let low = maker
        .rest
        .bent(maker.draw(20.0, 45.0), 0.0)
        .legs(maker.draw(85.0, 105.0), maker.draw(120.0, 145.0), 5.0)
        .both(Hand::at(0.2, -0.2, -0.8));
    let ground = Moment { tilt_deg: maker.draw(20.0, 45.0), ..low.legs(80.0, 80.0, 5.0) };
    let flat = Moment { tilt_deg: maker.draw(84.0, 92.0), ..maker.rest.bent(0.0, 8.0).legs(3.0, 6.0, 5.0) };
    let parts = vec![
        (maker.seconds(1.0), low),
        (maker.seconds(0.7), ground),
        (maker.seconds(1.0), flat),
        (maker.seconds(0.8), flat),
    ];
    maker.once(parts)
}

pub fn kick(maker: &mut Maker) -> Motion {
    let main = maker.main;
    let (high, back) = (maker.draw(35.0, 95.0), maker.draw(5.0, 30.0));
    let rest = maker.rest;
    let swung = |hip: f64, knee: f64, lean: f64| {
        let mut moment = rest.bent(lean, 5.0);
        moment.pose.legs[main].hip_deg = hip;
        moment.pose.legs[main].knee_deg = knee;
        moment.pose.legs[1 - main].knee_deg += 6.0;
        moment
    };
    let arms = maker.draw(0.0, 0.8);
    let spread = |moment: Moment| {
        moment
            .hand(1 - main, Hand::at(0.2 + 0.2 * arms, 0.6 * arms, -0.85 + 0.5 * arms))
            .hand(main, Hand::at(0.2 + 0.2 * arms, -0.4 * arms, -0.85 + 0.4 * arms))
    };
    let knee = maker.draw(35.0, 85.0);
    let wound = spread(swung(-back, knee, maker.draw(0.0, 12.0)));
    let straight = maker.draw(0.0, 25.0);
    let hit = spread(swung(high, straight, -0.15 * high + maker.draw(-6.0, 8.0)));
    let parts = vec![(maker.seconds(0.5), wound), (maker.seconds(0.25), hit), (maker.seconds(0.55), rest)];
    maker.once(parts)
}

pub fn jumping_jack(maker: &mut Maker) -> Motion {
    let reach = maker.draw(0.85, 0.99);
    let (low, high) = (maker.draw(-84.0, -55.0), maker.draw(40.0, 100.0));
    let (ahead, jump) = (maker.draw(-0.05, 0.2), maker.draw(0.0, 0.05));
    let knee = maker.draw(0.0, 18.0);
    let closed =
        maker.rest.legs(0.5 * knee, knee, maker.draw(0.0, 4.0)).both(Hand::sideways(low, reach, ahead));
    let open =
        maker.rest.legs(0.5 * knee, knee, maker.draw(13.0, 27.0)).both(Hand::sideways(high, reach, ahead));
    let mut flight =
        Moment::between(&closed, &open, 0.5).both(Hand::sideways(0.5 * (low + high), reach, ahead));
    flight.lift = jump;
    let beat = maker.seconds(0.22);
    let times = maker.rng.random_range(2..6);
    maker.repeated(Vec::new(), &[(beat, flight), (beat, open), (beat, flight), (beat, closed)], times)
}

pub fn dig(maker: &mut Maker) -> Motion {
    let main = maker.main;
    let (upright, deep) = (maker.draw(12.0, 35.0), maker.draw(40.0, 75.0));
    let stroke = |maker: &mut Maker, lean: f64, down: f64| {
        let mut moment = maker.rest.bent(lean, maker.draw(0.0, 15.0)).legs(14.0, 20.0 + 14.0 * down, 3.0);
        moment.pose.legs[main].hip_deg -= 18.0;
        moment.pose.legs[1 - main].hip_deg += 18.0;
        moment
            .hand(main, maker.near(Hand::at(-0.05, 0.3, -0.45 - 0.2 * down), 0.1))
            .hand(1 - main, maker.near(Hand::at(-0.1, 0.55, -0.7 - 0.15 * down), 0.1))
    };
    let (up, low) = (stroke(maker, upright, 0.0), stroke(maker, deep, 1.0));
    let mut lifted = stroke(maker, upright + 5.0, 0.2);
    lifted.twist_deg = maker.draw(-35.0, 35.0);
    let (go, beat) = (maker.seconds(0.6), maker.seconds(0.6));
    let times = maker.rng.random_range(2..5);
    maker.repeated(vec![(go, up)], &[(beat, low), (beat, lifted), (0.6 * beat, up)], times)
}

/// Peering over a wall on tiptoe, both hands on its edge.
pub fn peer(maker: &mut Maker) -> Motion {
    let edge = maker.near(Hand::at(0.05, 0.55, 0.65), 0.15);
    let mut up = maker.rest.bent(maker.draw(0.0, 12.0), maker.draw(-20.0, 0.0)).both(edge);
    up.lift = maker.draw(0.01, 0.05);
    let still = Moment { twist_deg: maker.draw(-12.0, 12.0), ..up };
    let parts = vec![(maker.seconds(0.9), up), (maker.seconds(1.2), still), (maker.seconds(0.8), maker.rest)];
    maker.once(parts)
}
