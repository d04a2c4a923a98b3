//! Gestures of arms and hands of a standing person. Positions are in arm lengths from the shoulder: mouth 0.3
//! inwards and 0.3 up, ear 0.1 inwards and 0.35 up (Winter's proportions).

use super::moment::{Hand, Moment};
use super::motion::{Maker, Motion};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

pub fn ear(rng: &mut ChaCha8Rng) -> Hand {
    Hand::at(rng.random_range(-0.14..0.06), rng.random_range(0.06..0.28), rng.random_range(0.1..0.4))
        .elbow(rng.random_range(0.0..0.4))
}

fn wave_ends(maker: &mut Maker) -> (Hand, Hand) {
    let ahead = maker.draw(0.0, 0.55);
    if maker.chance(0.5) {
        let (out, up, wide) = (maker.draw(-0.1, 0.6), maker.draw(0.2, 0.85), maker.draw(0.12, 0.35));
        let elbow = maker.draw(0.2, 1.0);
        let at = |off: f64| Hand::at(out + off, ahead, up - 0.3 * off.abs()).elbow(elbow);
        (at(-wide), at(wide))
    } else {
        let (low, high) = (maker.draw(-30.0, 55.0), maker.draw(65.0, 115.0));
        let reach = maker.draw(0.72, 0.98);
        (Hand::sideways(low, reach, ahead), Hand::sideways(high, reach, ahead))
    }
}

fn wave(maker: &mut Maker, hands: &[usize]) -> Motion {
    let (low, high) = wave_ends(maker);
    let (a, b) = (with(maker.rest, hands, low), with(maker.rest, hands, high));
    let (rise, swing) = (maker.seconds(0.7), maker.seconds(0.4));
    let times = maker.rng.random_range(1..6);
    // Most raise a stretched arm at the side, others bring the hand up before the body.
    let mut way_in = vec![(rise, a)];
    if maker.chance(0.6) {
        let side = Hand::sideways(maker.draw(-45.0, 35.0), maker.draw(0.75, 0.98), maker.draw(0.0, 0.35));
        way_in = vec![(0.7 * rise, with(maker.rest, hands, side)), (0.5 * rise, a)];
    }
    maker.repeated(way_in, &[(swing, b), (swing, a)], times)
}

pub fn wave_one_hand(maker: &mut Maker) -> Motion {
    let main = maker.main;
    wave(maker, &[main])
}

pub fn wave_two_hands(maker: &mut Maker) -> Motion {
    wave(maker, &[0, 1])
}

pub fn clap(maker: &mut Maker) -> Motion {
    let place = Hand::at(-0.28, 0.57, -0.12);
    let middle = Hand { out: -0.29, ..maker.near(place, 0.22) };
    let wide = maker.draw(0.12, 0.85);
    let (together, apart) = (maker.rest.both(middle), maker.rest.both(middle.moved(wide, -0.3 * wide, 0.0)));
    let (rise, beat) = (maker.seconds(0.6), maker.seconds(0.22));
    let times = maker.rng.random_range(2..9);
    maker.repeated(vec![(rise, apart)], &[(beat, together), (beat, apart)], times)
}

/// A hand moves near head or chest, stays and returns; the head follows.
fn bring(maker: &mut Maker, hand: Hand, nod_deg: f64, hold: f64, back: bool) -> Motion {
    let main = maker.main;
    let there = maker.rest.hand(main, hand).bent(maker.rest.pose.lean_deg, nod_deg);
    let still = there.hand(main, maker.near(hand, 0.03));
    let mut parts = vec![(maker.seconds(0.9), there), (maker.seconds(hold), still)];
    if back {
        parts.push((maker.seconds(0.9), maker.rest));
    }
    // Most clips include the approach.
    if maker.chance(0.8) { maker.once(parts) } else { maker.gesture(parts) }
}

fn hold(maker: &mut Maker) -> f64 {
    maker.draw(0.1_f64.ln(), 2.2_f64.ln()).exp()
}

pub fn answer_phone(maker: &mut Maker) -> Motion {
    let hand = ear(maker.rng);
    let (hold, back, nod) = (hold(maker), maker.chance(0.25), maker.draw(-5.0, 20.0));
    bring(maker, hand, nod, hold, back)
}

/// Drinking: the hand at the mouth, the head back.
pub fn drink(maker: &mut Maker) -> Motion {
    // A tilted cup is above the mouth; some hold it from the start.
    let mouth = Hand::at(-0.06, 0.28, 0.46).elbow(0.35);
    let hand = maker.near(mouth, 0.15);
    if maker.chance(0.3) {
        let main = maker.main;
        maker.rest.hands[main] = maker.near(Hand::at(0.08, 0.35, -0.7), 0.2);
    }
    let (hold, back, nod) = (hold(maker), maker.chance(0.3), maker.draw(-25.0, 5.0));
    bring(maker, hand, nod, hold, back)
}

/// Reading a watch: forearm before the chest, head bent.
pub fn read_watch(maker: &mut Maker) -> Motion {
    // The watch is on the other arm.
    maker.main = 1 - maker.main;
    let chest = Hand::at(-0.27, 0.48, 0.0).elbow(0.8);
    let hand = maker.near(chest, 0.17);
    let (hold, back, nod) = (hold(maker), maker.chance(0.3), maker.draw(10.0, 40.0));
    bring(maker, hand, nod, hold, back)
}

/// Throwing over the shoulder or from below.
pub fn throw(maker: &mut Maker) -> Motion {
    let main = maker.main;
    let sign = if main == 1 { 1.0 } else { -1.0 };
    let under = maker.chance(0.12);
    let (back, front, end) = if under {
        (Hand::swung(-50.0, 10.0, 0.15), Hand::swung(85.0, 8.0, 0.0), Hand::swung(120.0, 20.0, 0.0))
    } else {
        // The hand winds up behind the shoulder, or is ready before it.
        let behind = maker.draw(-0.15, 0.75);
        (
            Hand::at(maker.draw(0.0, 0.3), behind, maker.draw(0.2, 0.55)).elbow(0.35),
            Hand::at(maker.draw(0.0, 0.5), maker.draw(0.55, 0.95), maker.draw(-0.1, 0.5)),
            Hand::at(maker.draw(-0.3, 0.45), maker.draw(0.15, 0.8), maker.draw(-0.9, -0.2)),
        )
    };
    let (back, front, end) = (maker.near(back, 0.16), maker.near(front, 0.16), maker.near(end, 0.2));
    let turn = sign * maker.draw(5.0, 38.0);
    let (lean, step) = (maker.draw(0.0, 16.0), if maker.chance(0.4) { maker.draw(0.05, 0.3) } else { 0.0 });
    // The other hand hangs, balances, or has held the object.
    let other = Hand::at(maker.draw(-0.3, 0.25), maker.draw(0.0, 0.5), maker.draw(-0.95, -0.25));
    let stride = |mut moment: Moment, s: f64| {
        moment.pose.legs[1 - main].hip_deg += 60.0 * step * s;
        moment.pose.legs[main].hip_deg -= 60.0 * step * s;
        moment.gone(0.5 * step * s)
    };
    let rest = maker.rest;
    let wound =
        stride(rest.hand(main, back).hand(1 - main, other).bent(-0.4 * lean, 0.0).twisted(-turn), 0.3);
    let thrown = stride(rest.hand(main, front).bent(0.7 * lean, 0.0).twisted(0.6 * turn), 1.0);
    let through = stride(rest.hand(main, end).bent(lean, 5.0).twisted(turn), 1.0);
    let mut parts =
        vec![(maker.seconds(0.7), wound), (maker.seconds(0.25), thrown), (maker.seconds(0.2), through)];
    if maker.chance(0.5) {
        parts.push((maker.seconds(0.7), rest.gone(0.5 * step)));
    }
    maker.gesture(parts)
}

pub fn both_or_one(maker: &mut Maker, both: f64) -> Vec<usize> {
    if maker.chance(both) { vec![0, 1] } else { vec![maker.main] }
}

/// Near (chest, waist) and far (ahead) hand positions, and a single hand's shoulder turn, where ahead is outwards.
fn near_and_far(maker: &mut Maker, single: bool) -> (Hand, Hand, f64) {
    let up = maker.draw(-0.35, 0.25);
    let turn = if single { maker.draw(0.0, 40.0) } else { 0.0 };
    let (reach, across) = (maker.draw(0.75, 0.99), maker.draw(-0.22, 0.15));
    let (s, c) = (turn + maker.draw(-5.0, 15.0)).to_radians().sin_cos();
    let near = Hand::at(maker.draw(-0.1, 0.16), maker.draw(0.1, 0.5), up + maker.draw(-0.25, 0.3));
    let far = Hand::at(across + reach * s, reach * c, up);
    let turn = if maker.main == 1 { turn } else { -turn };
    (near.elbow(maker.draw(0.0, 0.5)), far.elbow(maker.draw(0.0, 0.5)), turn)
}

fn with(rest: Moment, hands: &[usize], hand: Hand) -> Moment {
    let mut moment = rest;
    for &side in hands {
        moment.hands[side] = hand;
    }
    moment
}

pub fn push(maker: &mut Maker) -> Motion {
    let hands = both_or_one(maker, 0.2);
    let (near, far, turn) = near_and_far(maker, hands.len() == 1);
    let (lean, step) = (maker.draw(0.0, 16.0), maker.draw(0.0, 0.08));
    let rest = maker.rest;
    let ready = with(rest, &hands, near).bent(-0.2 * lean, 5.0);
    let pushed = with(rest, &hands, far).bent(rest.pose.lean_deg + lean, 5.0).gone(step).twisted(turn);
    let mut parts =
        vec![(maker.seconds(0.5), ready), (maker.seconds(0.45), pushed), (maker.seconds(0.2), pushed)];
    if maker.chance(0.35) {
        if maker.chance(0.4) {
            parts.push((maker.seconds(0.5), ready));
        }
        parts.push((maker.seconds(0.6), rest));
    }
    maker.gesture(parts)
}

pub fn pull(maker: &mut Maker) -> Motion {
    let hands = both_or_one(maker, 0.2);
    let (near, far, turn) = near_and_far(maker, hands.len() == 1);
    let (lean, step) = (maker.draw(0.0, 14.0), maker.draw(0.0, 0.08));
    let rest = maker.rest;
    // A single arm often reaches sideways.
    let far = if hands.len() == 1 { far.moved(maker.draw(0.0, 0.45), 0.0, 0.0) } else { far };
    let reached = with(rest, &hands, far).bent(rest.pose.lean_deg + 0.6 * lean, 5.0).twisted(turn);
    let pulled = with(rest, &hands, near.moved(0.0, -0.1, maker.draw(-0.2, 0.15)))
        .bent(rest.pose.lean_deg - lean, 5.0)
        .gone(-step);
    let mut parts =
        vec![(maker.seconds(0.7), reached), (maker.seconds(0.2), reached), (maker.seconds(0.45), pulled)];
    if maker.chance(0.35) {
        parts.push((maker.seconds(0.6), rest));
    }
    maker.gesture(parts)
}

/// Punching from a guard.
pub fn punch(maker: &mut Maker) -> Motion {
    let guard_place = maker.near(Hand::at(-0.15, 0.35, 0.08), 0.12);
    let main = maker.main;
    let (turn, lean) = (maker.draw(5.0, 35.0), maker.draw(0.0, 14.0));
    let sign = if main == 1 { 1.0 } else { -1.0 };
    let mut guard =
        if maker.chance(0.7) { maker.rest.both(guard_place) } else { maker.rest.hand(main, guard_place) };
    let (step, bend) = (maker.draw(0.0, 16.0), maker.draw(0.0, 20.0));
    guard.pose.legs[1 - main].hip_deg += step + 0.5 * bend;
    guard.pose.legs[main].hip_deg += 0.5 * bend - step;
    guard.pose.legs[0].knee_deg += bend;
    guard.pose.legs[1].knee_deg += bend;
    let fist = maker.near(Hand::at(-0.12, 0.95, 0.08), 0.12);
    let fist = fist.moved(turn.to_radians().sin() * maker.draw(0.0, 1.0), 0.0, 0.0);
    let hit = guard.hand(main, fist).twisted(sign * turn).bent(guard.pose.lean_deg + lean, 0.0);
    let (raise, out, back) = (maker.seconds(0.5), maker.seconds(0.2), maker.seconds(0.3));
    let other = guard.hand(1 - main, fist).twisted(-sign * turn).bent(guard.pose.lean_deg + lean, 0.0);
    let alternate = maker.chance(0.4);
    let cycle = if alternate {
        vec![(out, hit), (back, guard), (out, other), (back, guard)]
    } else {
        vec![(out, hit), (back, guard)]
    };
    let times = maker.rng.random_range(1..4);
    maker.repeated(vec![(raise, guard)], &cycle, times)
}

pub fn shoot(maker: &mut Maker) -> Motion {
    let both = maker.chance(0.65);
    let main = maker.main;
    let place = Hand::at(if both { -0.28 } else { 0.0 }, 0.9, 0.08);
    let aim = maker.near(place, 0.07);
    let mut there = if both { maker.rest.both(aim) } else { maker.rest.hand(main, aim) };
    let step = maker.draw(0.0, 14.0);
    there.pose.legs[main].hip_deg -= step;
    there.pose.legs[1 - main].hip_deg += step;
    let kick = maker.draw(0.0, 0.12);
    let kicked = if both {
        there.both(aim.moved(0.0, -0.05, kick))
    } else {
        there.hand(main, aim.moved(0.0, -0.05, kick))
    };
    let mut parts = vec![(maker.seconds(0.6), there)];
    for _ in 0..maker.rng.random_range(1..4) {
        parts.extend([(maker.seconds(0.5), there), (0.08, kicked), (0.15, there)]);
    }
    parts.push((maker.seconds(0.7), maker.rest));
    maker.gesture(parts)
}

/// Standing, possibly looking around or shifting a hand.
pub fn stand(maker: &mut Maker) -> Motion {
    let shift = maker.draw(0.0, 0.12);
    let side = maker.main;
    let hand = maker.near(maker.rest.hands[side], shift.max(0.01));
    let turned = maker.rest.hand(side, hand).twisted(maker.rest.twist_deg + maker.draw(-8.0, 8.0));
    let parts =
        vec![(maker.seconds(1.0), turned), (maker.seconds(1.0), maker.rest), (maker.seconds(0.8), turned)];
    maker.once(parts)
}
