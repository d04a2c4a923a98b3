//! Everyday activities of synthetic people, as training data without recordings. Seeded.
//!
//! Bodies follow published anthropometry (`person`), gait published joint angles (`gait`), hands minimum-jerk paths
//! (`gestures`, `postures`). Amplitude, tempo and cut vary (`motion`), and so do view and masks (`camera`). Spreads of
//! clothes, damage and image borders were chosen after viewing public sets. Proportions, tracker errors, hand positions
//! and clip limits follow the joints of UTKinect and Florence.

pub(super) mod camera;
mod gait;
mod gestures;
mod moment;
mod motion;
mod person;
mod postures;

use crate::clip::Clip;
use crate::embedding::descriptor::Scaling;
use camera::Camera;
use farnear_silhouettes::silhouette::capsule::Capsule;
use farnear_silhouettes::synthetic::body::Joints;
use gait::Gait;
use moment::Moment;
use motion::{Maker, Motion};
use person::{Person, middle};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use rayon::prelude::*;

type Activity = (&'static str, fn(&mut Maker) -> Motion);

/// Names of the activities, and how their motions are made.
pub const ACTIVITIES: &[Activity] = &[
    ("walk", |maker| Motion::Gait(Gait::walking_about(maker.rng, maker.main))),
    ("jog", |maker| Motion::Gait(Gait::jog(maker.rng))),
    ("sneak", |maker| Motion::Gait(Gait::sneak(maker.rng))),
    ("carry", |maker| Motion::Gait(Gait::carry(maker.rng))),
    ("stand", gestures::stand),
    ("wave one hand", gestures::wave_one_hand),
    ("wave two hands", gestures::wave_two_hands),
    ("clap", gestures::clap),
    ("answer phone", gestures::answer_phone),
    ("drink", gestures::drink),
    ("read watch", gestures::read_watch),
    ("throw", gestures::throw),
    ("push", gestures::push),
    ("pull", gestures::pull),
    ("punch", gestures::punch),
    ("shoot", gestures::shoot),
    ("jumping jack", postures::jumping_jack),
    ("kick", postures::kick),
    ("bend", postures::bend),
    ("bow", postures::bow),
    ("pick up", postures::pick_up),
    ("put down", postures::put_down),
    ("tie laces", postures::tie_laces),
    ("crouch", postures::crouch),
    ("sit down", postures::sit_down),
    ("stand up", postures::stand_up),
    ("lie down", postures::lie_down),
    ("dig", postures::dig),
    ("peer", postures::peer),
];

struct Performance {
    person: Person,
    /// Of every frame, around the origin.
    joints: Vec<Joints>,
}

/// Generates the activity with this index in [`ACTIVITIES`].
fn performance(activity: usize, seed: u64) -> Performance {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let rng = &mut rng;
    let person = Person::drawn(rng);
    let (_, make) = ACTIVITIES[activity % ACTIVITIES.len()];
    let motion = make(&mut Maker::new(rng));
    let rate_hz = rng.random_range(5.0_f64.ln()..26.0_f64.ln()).exp();
    let moments = motion.clip(rng, rate_hz);
    let mut joints = placed(&person, &moments, matches!(motion, Motion::Gait(_)));
    tremble(&mut joints, rng);
    Performance { person, joints }
}

/// Joints of every moment; `going` follows the path, otherwise the feet's middle stays in place.
fn placed(person: &Person, moments: &[Moment], going: bool) -> Vec<Joints> {
    let h = person.build.height_mm;
    let (mut at, mut gone) = ([0.0_f64; 2], moments.first().map_or(0.0, |moment| moment.ahead));
    let mut joints: Vec<Joints> = Vec::with_capacity(moments.len());
    for moment in moments {
        let mut found = person.joints(moment);
        if !going && moment.tilt_deg <= 1.0 {
            let feet = middle(found.ankles[0], found.ankles[1]);
            found.place(0.0, [-feet[0], -feet[1]]);
        }
        let (s, c) = moment.heading_deg.to_radians().sin_cos();
        let step = (moment.ahead - gone) * h;
        gone = moment.ahead;
        at = [at[0] - s * step, at[1] + c * step];
        found.place(moment.heading_deg, at);
        joints.push(found);
    }
    let n = joints.len().max(1) as f64;
    let way: [f64; 2] = std::array::from_fn(|k| joints.iter().map(|found| found.pelvis[k]).sum::<f64>() / n);
    joints.iter_mut().for_each(|found| found.place(0.0, [-way[0], -way[1]]));
    joints
}

const COORDINATES: usize = 51;

/// Errors of joint trackers: none for half of the clips, else millimetres per frame and centimetres of drift.
fn tremble(joints: &mut [Joints], rng: &mut ChaCha8Rng) {
    if rng.random_bool(0.5) {
        return;
    }
    let (noise_mm, off_mm) =
        (rng.random_range(0.5_f64.ln()..15.0_f64.ln()).exp(), rng.random_range(0.0..30.0));
    let (Ok(noise), Ok(off)) = (Normal::new(0.0, noise_mm), Normal::new(0.0, off_mm)) else { return };
    let ends: Vec<[f64; 2]> = (0..COORDINATES).map(|_| [off.sample(rng), off.sample(rng)]).collect();
    let last = joints.len().saturating_sub(1).max(1) as f64;
    for (frame, found) in joints.iter_mut().enumerate() {
        let s = frame as f64 / last;
        let mut ends = ends.iter();
        found.each(|p| {
            for v in p {
                let [from, to] = ends.next().copied().unwrap_or_default();
                *v += noise.sample(rng) + from + (to - from) * s;
            }
        });
    }
}

/// Clips of `people` people at all activities, once each, from any view. Subjects count from `first`.
pub fn clips(first: usize, people: usize, scaling: Scaling) -> Vec<Clip> {
    let all: Vec<&str> = ACTIVITIES.iter().map(|(name, _)| *name).collect();
    clips_of(&all, first, people, scaling)
}

/// [`clips`] of the named activities only.
pub fn clips_of(names: &[&str], first: usize, people: usize, scaling: Scaling) -> Vec<Clip> {
    let named = |activity: &usize| names.contains(&ACTIVITIES[*activity].0);
    let activities: Vec<usize> = (0..ACTIVITIES.len()).filter(named).collect();
    debug_assert_eq!(activities.len(), names.len(), "{names:?}");
    let one =
        |index: usize| clip(first + index / activities.len(), activities[index % activities.len()], scaling);
    (0..people * activities.len()).into_par_iter().map(one).collect()
}

/// One clip; if a person is outside the image, the next camera is used.
fn clip(subject: usize, activity: usize, scaling: Scaling) -> Clip {
    let seed = (subject * ACTIVITIES.len() + activity) as u64;
    let Performance { person, joints } = performance(activity, seed);
    let bodies: Vec<Vec<Capsule>> = joints.iter().map(|found| person.dressed(found)).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(!seed);
    let mut track = None;
    for _ in 0..8 {
        let camera = Camera::drawn(&mut rng);
        let seen = camera.track(&bodies, person.build.height_mm, scaling, &mut rng);
        let enough = 2 * seen.frames() > bodies.len();
        track = Some(seen);
        if enough {
            break;
        }
    }
    Clip {
        subject: format!("p{subject:03}"),
        activity: ACTIVITIES[activity].0.into(),
        views: track.into_iter().collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_person_and_activity_is_on_the_ground_and_in_view() {
        let names: BTreeSet<_> = ACTIVITIES.iter().map(|(name, _)| name).collect();
        assert_eq!(names.len(), ACTIVITIES.len());
        for (activity, (name, _)) in ACTIVITIES.iter().enumerate() {
            for seed in 0..12 {
                let found = performance(activity, seed);
                let h = found.person.build.height_mm;
                for joints in &found.joints {
                    let low = joints.ankles.iter().fold(f64::INFINITY, |low, p| low.min(p[2]));
                    assert!((-0.1 * h..0.35 * h).contains(&low), "{name} {seed}: ankles at {low}");
                    assert!(joints.head.iter().all(|v| v.is_finite() && v.abs() < 12.0 * h), "{name} {seed}");
                }
                let clip = clip(seed as usize, activity, Scaling::default());
                assert!(clip.views[0].frames() >= 3, "{name} {seed}: {} frames", clip.views[0].frames());
            }
        }
    }

    #[test]
    fn the_same_seed_is_the_same_clip() {
        assert_eq!(clip(3, 5, Scaling::default()), clip(3, 5, Scaling::default()));
        assert_ne!(clip(3, 5, Scaling::default()), clip(4, 5, Scaling::default()));
    }
}
