//! Estimates the unit and up axis of a BVH file from the joints `head` (or `upperneck`) and `foot`, `ankle` or `toe`. Some writers keep
//! all bones along one axis, so that the rest pose folds head and feet to one side of the hips; then the frames give
//! the up axis. Lengths along bones are valid in every pose.

use super::super::{
    posture,
    recording::{Known, Source, Unit, Up},
};
use super::kinematics::{Kinematics, at_rest};
use super::parse::{Joint, Motion};
use crate::silhouette::capsule::Point3;

const STATURE_M: std::ops::RangeInclusive<f64> = 1.4..=2.1;
/// Geometric mean of the range.
const TYPICAL_M: f64 = 1.7;
/// Beyond these statures no usual unit is right.
const POSSIBLE_M: std::ops::RangeInclusive<f64> = 0.8..=2.6;
/// Share of the feet-to-head vector along an axis for a sure up axis.
const UPRIGHT: f64 = 0.8;
/// Height of the hips over the length of a leg, of a person who does not lie.
const STANDING: std::ops::RangeInclusive<f64> = 0.4..=1.4;
/// Frames sampled for the up axis.
const FRAMES_ASKED: usize = 100;

struct Body {
    /// Last joint on the way to the head and to all feet: the hips, also below a root at the origin of the world.
    hips: usize,
    head: usize,
    feet: Vec<usize>,
}

impl Body {
    /// Returns a text about missing joints as the error.
    fn of(joints: &[Joint]) -> Result<Self, &'static str> {
        let named = |keys: &[&str]| -> Vec<usize> {
            let holds = |joint: &Joint| {
                let name = joint.name.to_lowercase();
                keys.iter().any(|key| name.contains(key))
            };
            (0..joints.len()).filter(|&j| holds(&joints[j])).collect()
        };
        // The joint with the longest path up is the crown, or nearest to it.
        let longest = |among: Vec<usize>| {
            among.into_iter().max_by(|&a, &b| length(joints, a).total_cmp(&length(joints, b)))
        };
        let head = longest(named(&["head"])).or_else(|| longest(named(&["upperneck"])));
        let head = head.ok_or("no joint is named head")?;
        let feet = named(&["foot", "ankle", "toe"]);
        if feet.is_empty() {
            return Err("no joint is named foot, ankle or toe");
        }
        let leads_to = |hips: usize, foot: usize| above(joints, foot).any(|joint| joint == hips);
        let hips = above(joints, head).find(|&hips| feet.iter().all(|&foot| leads_to(hips, foot)));
        let hips = hips.ok_or("no joint is above both head and feet")?;
        Ok(Self { hips, head, feet })
    }

    fn upward(&self, places: &[Point3]) -> Point3 {
        let feet: Point3 = std::array::from_fn(|k| {
            self.feet.iter().map(|&foot| places[foot][k]).sum::<f64>() / self.feet.len() as f64
        });
        std::array::from_fn(|k| places[self.head][k] - feet[k])
    }

    /// Whether head and feet are on opposite sides of the hips.
    fn unfolded(&self, places: &[Point3]) -> bool {
        let hips = places[self.hips];
        let up = self.upward(places);
        let head: f64 = (0..3).map(|k| (places[self.head][k] - hips[k]) * up[k]).sum();
        let all: f64 = up.iter().map(|v| v * v).sum();
        0.0 < head && head < all
    }

    fn stature(&self, joints: &[Joint]) -> f64 {
        self.bones(joints, self.head) + self.leg(joints)
    }

    fn leg(&self, joints: &[Joint]) -> f64 {
        self.feet.iter().map(|&foot| self.bones(joints, foot)).fold(0.0, f64::max)
    }

    /// Path length from the hips.
    fn bones(&self, joints: &[Joint], joint: usize) -> f64 {
        length(joints, joint) - length(joints, self.hips)
    }
}

/// A joint and all above it, to the root.
fn above(joints: &[Joint], joint: usize) -> impl Iterator<Item = usize> + '_ {
    std::iter::successors(Some(joint), |&joint| joints[joint].parent)
}

/// Path length from a joint to its root; the root's own offset is a position, not a bone.
fn length(joints: &[Joint], joint: usize) -> f64 {
    above(joints, joint)
        .filter(|&joint| joints[joint].parent.is_some())
        .map(|joint| joints[joint].offset.iter().map(|v| v * v).sum::<f64>().sqrt())
        .sum()
}

pub fn unit(joints: &[Joint]) -> Known<Unit> {
    let (size, what, is_stature) = match Body::of(joints) {
        Ok(body) => (body.stature(joints), "from head to toe along the bones".to_owned(), true),
        Err(missing) => (extent(joints), format!("at its longest ({missing})"), false),
    };
    // A child is likelier than a giant.
    let far = |mm: f64| {
        let off = (size * mm / 1000.0 / TYPICAL_M).ln();
        if off > 0.0 { 1.5 * off } else { -off }
    };
    let mut value = Unit::MM;
    for (_, mm, _) in Unit::NAMED {
        if far(mm) < far(value.mm) {
            value = Unit { mm };
        }
    }
    let metres = size * value.mm / 1000.0;
    let sure = STATURE_M.contains(&metres);
    let (low, high) = (STATURE_M.start(), STATURE_M.end());
    let person = if sure { "as a person of" } else { "not a person of" };
    let measured = format!("{metres:.2} m ({person} {low} to {high} m)");
    let mm = 1000.0 * TYPICAL_M / size;
    let (value, makes) = if is_stature && mm.is_normal() && !POSSIBLE_M.contains(&metres) {
        (Unit::rounded(mm), format!("{TYPICAL_M} m; {value} would make {measured}"))
    } else {
        (value, measured)
    };
    // Of any unit, so by its digits.
    let size: f64 = format!("{size:.2e}").parse().unwrap_or(size);
    let reason = format!("for the skeleton is {size} long {what}, which makes {makes}");
    Known { value, source: Source::Guess { reason, sure } }
}

/// Largest extent of the rest pose along an axis: a body with arms out is as wide as tall.
fn extent(joints: &[Joint]) -> f64 {
    let places = at_rest(joints);
    (0..3).map(|axis| posture::extent(&places, axis)).fold(0.0, f64::max)
}

pub fn up(motion: &Motion, kinematics: &Kinematics) -> Known<Up> {
    let body = match Body::of(&motion.joints) {
        Ok(body) => body,
        Err(missing) => {
            let reason = format!("for BVH files mostly have it so ({missing})");
            return Known { value: Up::Y, source: Source::Guess { reason, sure: false } };
        }
    };
    let rest = at_rest(&motion.joints);
    let step = motion.frames.len().div_ceil(FRAMES_ASKED).max(1);
    let frames: Vec<Vec<Point3>> =
        motion.frames.iter().step_by(step).map(|frame| kinematics.places(frame)).collect();
    let of_frames: Point3 = std::array::from_fn(|k| frames.iter().map(|places| body.upward(places)[k]).sum());
    let of_rest = body.upward(&rest);
    // Some writers have the rest pose in other axes than the motion: bones along x, or y up and a motion with z up.
    let [rests, moves] = [of_rest, of_frames].map(Up::along);
    let leg = body.leg(&motion.joints);
    let stands = |up: Up| {
        let hips = frames.iter().map(|places| up.height(places[body.hips])).sum::<f64>();
        STANDING.contains(&(hips / frames.len().max(1) as f64 / leg))
    };
    let in_other_axes = !matches!(rests, Up::Y | Up::Z) || (stands(moves) && !stands(rests));
    let (upward, what) = if body.unfolded(&rest) && !in_other_axes {
        (of_rest, "in the rest pose")
    } else {
        (of_frames, "over the frames (the rest pose is folded up or in other axes)")
    };
    let length = upward.iter().map(|v| v * v).sum::<f64>().sqrt();
    let value = Up::along(upward);
    let along = value.height(upward);
    let part = if length > 0.0 { along / length } else { 0.0 };
    let reason =
        format!("for {:.0} % of the way from the feet to the head {what} lie along it", 100.0 * part);
    Known { value, source: Source::Guess { reason, sure: part >= UPRIGHT } }
}

#[cfg(test)]
mod tests {
    use super::super::parse::parse;
    use super::*;

    /// A body of 17 from toe to head at rest, times `scale`, with transformed axes.
    fn body(scale: f64, turned: fn(Point3) -> Point3, frame: &str) -> Motion {
        let at = |p: Point3| {
            let [x, y, z] = turned(p.map(|v| v * scale));
            format!("OFFSET {x} {y} {z}")
        };
        let joint = "CHANNELS 3 Zrotation Xrotation Yrotation";
        let (head, crown, leg, foot) =
            (at([0.0, 5.0, 0.0]), at([0.0, 3.0, 0.0]), at([0.0, -4.0, 0.0]), at([0.0, -5.0, 0.0]));
        parse(&format!(
            "HIERARCHY\nROOT Hips\n{{ OFFSET 0 0 0 {joint}\nJOINT Head\n{{ {head} {joint} End Site {{ {crown} }} }}\n\
             JOINT Leg\n{{ {leg} {joint}\nJOINT LeftFoot\n{{ {foot} {joint} }} }} }}\nMOTION\nFrames: 1\nFrame Time: 1\n{frame}\n"
        ))
        .expect("a BVH file")
    }

    const STILL: &str = "0 0 0 0 0 0 0 0 0 0 0 0";

    fn sure<T>(known: &Known<T>) -> bool {
        matches!(known.source, Source::Guess { sure: true, .. })
    }

    #[test]
    fn the_unit_makes_a_person_of_the_skeleton() {
        for (scale, mm) in [(0.1, 1000.0), (10.0, 10.0), (4.0, 25.4), (100.0, 1.0), (1.8, 25.4 / 0.45)] {
            let found = unit(&body(scale, |p| p, STILL).joints);
            assert!((found.value.mm - mm).abs() < 1e-9 && sure(&found), "{scale} {found:?}");
        }
        // 17 x 60 units: a metre in millimetres, the nearest possibility.
        let dwarf = unit(&body(60.0, |p| p, STILL).joints);
        assert!(!sure(&dwarf), "{dwarf:?}");
        // A child of 1.13 m in inches; in the CMU library's unit it would be 2.52 m.
        let child = unit(&body(44.66 / 17.0, |p| p, STILL).joints);
        assert!(child.value.mm == 25.4 && !sure(&child), "{child:?}");
    }

    #[test]
    fn a_skeleton_of_no_usual_unit_is_of_a_typical_height() {
        // 10.3 m in metres, and less than a millimetre.
        for (scale, size, usual) in
            [(10.3 / 17.0, "10.3", "0.58 m (not a person"), (1e-5, "0.00017", "0.00 m (not a person")]
        {
            let found = unit(&body(scale, |p| p, STILL).joints);
            assert!((17.0 * scale * found.value.mm - 1700.0).abs() < 0.1 && !sure(&found), "{found:?}");
            let reason = format!("{found:?}");
            assert!(reason.contains(usual) && reason.contains(&format!("is {size} long")), "{reason}");
        }
    }

    #[test]
    fn up_is_the_axis_that_the_head_lies_above_the_feet_along() {
        type Turn = fn(Point3) -> Point3;
        let turns: [(Turn, Up); 3] =
            [(|p| p, Up::Y), (|[x, y, z]| [x, -z, y], Up::Z), (|[x, y, z]| [y, z, x], Up::X)];
        for (turned, expected) in turns {
            let motion = body(1.0, turned, STILL);
            let found = up(&motion, &Kinematics::new(&motion));
            assert!(found.value == expected && sure(&found), "{found:?}");
        }
    }

    #[test]
    fn a_folded_rest_pose_is_not_asked() {
        // All bones along x; the hips' rotation by 90 deg about z points the head up, the leg's by 180 deg
        // the foot down.
        let motion = body(1.0, |[x, y, z]| [y.abs(), x, z], "90 0 0 0 0 0 180 0 0 0 0 0");
        let found = up(&motion, &Kinematics::new(&motion));
        // The leg's joint is 4 up; the foot hangs 5 below.
        assert_eq!(found.value, Up::Y);
        assert!(
            matches!(&found.source, Source::Guess { reason, .. } if reason.contains("over the frames")),
            "{found:?}"
        );
    }

    #[test]
    fn a_root_at_the_origin_of_the_world_is_not_a_bone() {
        // As in the public set of Bandai Namco: centimetres, bones along x, hips far from the root.
        let bone = |name: &str, x: f64, ends: &str| {
            format!("JOINT {name}\n{{ OFFSET {x} 0 0 CHANNELS 3 Zrotation Xrotation Yrotation\n{ends} }}\n")
        };
        let end = |x: f64| format!("End Site {{ OFFSET {x} 0 0 }}");
        let (head, foot) = (bone("Head", 60.0, &end(15.0)), bone("Foot_L", 45.0, &end(1.0)));
        let leg = bone("UpperLeg_L", 10.0, &bone("LowerLeg_L", 40.0, &foot));
        let hips = format!(
            "JOINT Hips\n{{ OFFSET -17 93 453 CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n{head}{leg} }}\n"
        );
        // The hips turn their x upwards, the leg turns it down again.
        let motion = parse(&format!(
            "HIERARCHY\nROOT joint_Root\n{{ OFFSET 0 0 0 CHANNELS 3 Xposition Yposition Zposition\n{hips} }}\nMOTION\nFrames: 1\nFrame Time: 1\n\
             0 0 0 -2 93 -1 90 0 0 0 0 0 180 0 0 0 0 0 0 0 0\n"
        ))
        .expect("a BVH file");
        let found = unit(&motion.joints);
        assert!(found.value.mm == 10.0 && sure(&found), "{found:?}");
        let found = up(&motion, &Kinematics::new(&motion));
        assert!(found.value == Up::Y && sure(&found), "{found:?}");
    }

    #[test]
    fn a_motion_in_other_axes_than_the_rest_pose_is_upright_and_who_lies_stays_lying() {
        // The skeleton has y up. Root 8 above the ground along z, turned by 90 deg about x: z is up.
        let text = |frame: &str| {
            let joint = "CHANNELS 3 Zrotation Xrotation Yrotation";
            format!(
                "HIERARCHY\nROOT Hips\n{{ OFFSET 0 0 0 CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n\
                 JOINT Head\n{{ OFFSET 0 5 0 {joint} End Site {{ OFFSET 0 3 0 }} }}\n\
                 JOINT Leg\n{{ OFFSET 0 -4 0 {joint}\nJOINT LeftFoot\n{{ OFFSET 0 -5 0 {joint} End Site {{ OFFSET 0 0 1 }} }} }} }}\n\
                 MOTION\nFrames: 1\nFrame Time: 1\n{frame} 0 0 0 0 0 0 0 0 0\n"
            )
        };
        for (frame, expected) in [
            ("2 0.3 8 0 90 0", Up::Z),
            ("2 8 30 0 0 0", Up::Y),
            // Lying on the ground with y up, the head towards z, somewhere in the room.
            ("2 1 40 0 90 0", Up::Y),
        ] {
            let motion = parse(&text(frame)).expect("a BVH file");
            let found = up(&motion, &Kinematics::new(&motion));
            assert_eq!(found.value, expected, "{frame}: {found:?}");
        }
    }

    #[test]
    fn without_names_the_guess_is_doubtful() {
        let text = "HIERARCHY ROOT a\n{ OFFSET 0 0 0 CHANNELS 1 Xrotation End Site { OFFSET 0 170 0 } } MOTION\nFrames: 1\nFrame Time: 1\n0\n";
        let motion = parse(text).expect("a BVH file");
        assert_eq!(unit(&motion.joints).value.mm, 10.0);
        let found = up(&motion, &Kinematics::new(&motion));
        assert!(found.value == Up::Y && !sure(&found), "{found:?}");
        // The missing joints are named.
        for (root, missing) in [
            ("a", "no joint is named head"),
            ("head", "no joint is named foot, ankle or toe"),
            ("upperneck", "no joint is named foot, ankle or toe"),
        ] {
            let motion = parse(&text.replace("ROOT a", &format!("ROOT {root}"))).expect("a BVH file");
            let found = [unit(&motion.joints).source, up(&motion, &Kinematics::new(&motion)).source];
            for source in found {
                assert!(
                    matches!(&source, Source::Guess { reason, .. } if reason.contains(missing)),
                    "{source:?}"
                );
            }
        }
    }
}
