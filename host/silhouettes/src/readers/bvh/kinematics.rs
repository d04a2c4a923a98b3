//! Forward kinematics: joint positions from a frame's values. A joint's rotation is the product of its rotation
//! channels in file order, intrinsic: `Zrotation Yrotation Xrotation` is `Rz Ry Rx` before a column vector. A joint is
//! at its parent's position plus the parent's total rotation times its own translation. O(joints) per frame.

use super::parse::{Channel, Joint, Motion};
use crate::silhouette::{capsule::Point3, view::product};

type Matrix = [[f64; 3]; 3];

const STRAIGHT: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Rest pose: all rotations 0, every joint at its offset; file units and axes.
pub fn at_rest(joints: &[Joint]) -> Vec<Point3> {
    let mut places: Vec<Point3> = Vec::with_capacity(joints.len());
    for joint in joints {
        let from = joint.parent.map_or([0.0; 3], |parent| places[parent]);
        places.push(std::array::from_fn(|k| from[k] + joint.offset[k]));
    }
    places
}

/// What the position channels of a joint mean.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Positions {
    /// Added to the offset, as Biovision did.
    Added,
    /// The translation from the parent, instead of the offset, as most current writers have it.
    Translation,
    /// The place in the world, independent of the parent (pelvis, thorax and head of some files).
    World,
}

#[derive(Clone, Debug)]
pub struct Kinematics<'a> {
    joints: &'a [Joint],
    positions: Vec<Positions>,
}

impl<'a> Kinematics<'a> {
    /// The first frame decides what position channels mean. They are the translation from the parent instead of offset o if they are
    /// nearer to o than to 0; and the place in the world if the bone would be three times o, and then has about the length of o.
    pub fn new(motion: &'a Motion) -> Self {
        let first = motion.frames.first().map(Vec::as_slice).unwrap_or_default();
        let mut found = Self { joints: &motion.joints, positions: Vec::with_capacity(motion.joints.len()) };
        let mut from = 0;
        for joint in &motion.joints {
            let values = first.get(from..).unwrap_or_default();
            let channels = || joint.channels.iter().zip(values);
            let along: f64 = channels()
                .map(|(channel, value)| match *channel {
                    Channel::Position(axis) => value * joint.offset[axis],
                    Channel::Rotation(_) => 0.0,
                })
                .sum();
            let offset = length(joint.offset);
            found.positions.push(if 2.0 * along > offset * offset {
                Positions::Translation
            } else {
                Positions::Added
            });
            let moves = channels().filter(|(channel, _)| matches!(channel, Channel::Position(_))).count();
            if let Some(parent) = joint.parent.filter(|_| moves == 3 && offset > 0.0) {
                let bone = |places: &[Point3]| {
                    let end = places.last().copied().unwrap_or_default();
                    length(std::array::from_fn(|k| end[k] - places[parent][k]))
                };
                let meant = found.positions.len() - 1;
                let far = bone(&found.places(first)) > 3.0 * offset;
                let before = std::mem::replace(&mut found.positions[meant], Positions::World);
                if !far || !(0.5..2.0).contains(&(bone(&found.places(first)) / offset)) {
                    found.positions[meant] = before;
                }
            }
            from += joint.channels.len();
        }
        found
    }

    /// File units and axes.
    pub fn places(&self, frame: &[f64]) -> Vec<Point3> {
        let mut values = frame.iter().copied();
        let mut places: Vec<Point3> = Vec::with_capacity(self.joints.len());
        let mut turns: Vec<Matrix> = Vec::with_capacity(self.joints.len());
        for (joint, positions) in self.joints.iter().zip(&self.positions) {
            let (from, turn) = joint.parent.map_or(([0.0; 3], STRAIGHT), |p| (places[p], turns[p]));
            let (mut translation, mut rotation) = (joint.offset, STRAIGHT);
            for (channel, value) in joint.channels.iter().zip(values.by_ref()) {
                match *channel {
                    Channel::Position(axis) if *positions == Positions::Added => translation[axis] += value,
                    Channel::Position(axis) => translation[axis] = value,
                    Channel::Rotation(axis) => rotation = product(&rotation, &about(axis, value)),
                }
            }
            places.push(match positions {
                Positions::World => translation,
                Positions::Added | Positions::Translation => std::array::from_fn(|i| {
                    from[i] + (0..3).map(|k| turn[i][k] * translation[k]).sum::<f64>()
                }),
            });
            turns.push(product(&turn, &rotation));
        }
        places
    }
}

fn length(v: Point3) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Rotation about a coordinate axis, anticlockwise seen from its tip.
fn about(axis: usize, angle_deg: f64) -> Matrix {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut matrix = STRAIGHT;
    (matrix[j][j], matrix[j][k], matrix[k][j], matrix[k][k]) = (cos, -sin, sin, cos);
    matrix
}

#[cfg(test)]
mod tests {
    use super::super::parse::parse;
    use super::*;

    /// Root with an arm up by 2 and out by 1, whose hand is 3 along z; `order` of both rotations.
    fn places(order: &str, frame: &str) -> Vec<Point3> {
        let text = format!(
            "HIERARCHY\nROOT root\n{{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition {order}\nJOINT arm\n{{\n\
             OFFSET 1 2 0\nCHANNELS 3 {order}\nEnd Site\n{{\nOFFSET 0 0 3\n}}\n}}\n}}\nMOTION\nFrames: 1\nFrame Time: 1\n{frame}\n"
        );
        let motion = parse(&text).expect("a BVH file");
        Kinematics::new(&motion).places(&motion.frames[0])
    }

    #[track_caller]
    fn are(found: &[Point3], expected: &[Point3]) {
        for (found, expected) in found.iter().zip(expected) {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {expected:?}");
        }
    }

    /// Quarter turns: Rx(90) takes (x, y, z) to (x, -z, y), Ry(90) to (z, y, -x), Rz(90) to (-y, x, z).
    /// Z = 90, X = 90, Y = 0, root at (10, 20, 30): the root's rotation is Rz Rx.
    /// Arm: Rx (1, 2, 0) = (1, 0, 2); Rz of that = (0, 1, 2); the arm is at (10, 21, 32).
    /// Hand (Y = 90): Ry (0, 0, 3) = (3, 0, 0); Rx = (3, 0, 0); Rz = (0, 3, 0); it is at (10, 24, 32).
    #[test]
    fn zxy_as_worked_out_by_hand() {
        let found = places("Zrotation Xrotation Yrotation", "10 20 30 90 90 0 0 0 90");
        are(&found, &[[10.0, 20.0, 30.0], [10.0, 21.0, 32.0], [10.0, 24.0, 32.0]]);
    }

    /// The same angles in the order X, Y, Z: the root's rotation is Rx Rz (Y = 0).
    /// Arm: Rz (1, 2, 0) = (-2, 1, 0); Rx of that = (-2, 0, 1); the arm is at (8, 20, 31).
    /// Hand (Y = 90): Ry (0, 0, 3) = (3, 0, 0); Rz = (0, 3, 0); Rx = (0, 0, 3); it is at (8, 20, 34).
    #[test]
    fn xyz_as_worked_out_by_hand() {
        let found = places("Xrotation Yrotation Zrotation", "10 20 30 90 0 90 0 90 0");
        are(&found, &[[10.0, 20.0, 30.0], [8.0, 20.0, 31.0], [8.0, 20.0, 34.0]]);
    }

    /// Root Z = 30 deg, arm Z = 60, Y = 30. Rotations about z add: the hand's offset (0, 0, 3) is rotated by
    /// Ry(30) to (1.5, 0, 3 cos 30), then by Rz(90) to (0, 1.5, 3 cos 30).
    /// Arm: Rz(30) (1, 2, 0) = (cos 30 - 1, 0.5 + 2 cos 30, 0).
    #[test]
    fn zyx_as_worked_out_by_hand() {
        let found = places("Zrotation Yrotation Xrotation", "0 0 0 30 0 0 60 30 0");
        let c = 0.75_f64.sqrt();
        let arm = [c - 1.0, 0.5 + 2.0 * c, 0.0];
        are(&found, &[[0.0; 3], arm, [arm[0], arm[1] + 1.5, 3.0 * c]]);
    }

    #[test]
    fn positions_replace_an_offset_that_they_repeat_and_are_added_to_one_that_they_do_not() {
        let root_at = |frame: &str| {
            let text = format!(
                "HIERARCHY ROOT a\n{{ OFFSET 0 90 0 CHANNELS 3 Xposition Yposition Zposition }} MOTION\nFrames: 1\nFrame Time: 1\n{frame}"
            );
            let motion = parse(&text).expect("a BVH file");
            Kinematics::new(&motion).places(&motion.frames[0])[0]
        };
        assert_eq!(root_at("5 92 1"), [5.0, 92.0, 1.0]);
        assert_eq!(root_at("5 2 1"), [5.0, 92.0, 1.0]);
    }

    #[test]
    fn positions_far_from_the_parent_are_places_in_the_world() {
        let text = "HIERARCHY ROOT pelvis\n{ OFFSET 0 0 0 CHANNELS 6 Xposition Yposition Zposition Xrotation Yrotation Zrotation \
             JOINT thorax\n{ OFFSET 0 0 6 CHANNELS 6 Xposition Yposition Zposition Xrotation Yrotation Zrotation \
             JOINT head\n{ OFFSET 0 0 18 CHANNELS 3 Xrotation Yrotation Zrotation } } } \
             MOTION\nFrames: 2\nFrame Time: 1\n-46 -6 36 90 0 0 -49 -6 42 0 90 0 0 0 0\n10 0 36 90 0 0 10 -6 36 0 90 0 0 0 0\n";
        let motion = parse(text).expect("a BVH file");
        let kinematics = Kinematics::new(&motion);
        // The thorax turns with the pelvis: Rx(90) Ry(90) (0, 0, 18) = (18, 0, 0).
        are(&kinematics.places(&motion.frames[0])[1..], &[[-49.0, -6.0, 42.0], [-31.0, -6.0, 42.0]]);
        are(&kinematics.places(&motion.frames[1])[1..], &[[10.0, -6.0, 36.0], [28.0, -6.0, 36.0]]);
    }

    #[test]
    fn rest_is_the_sum_of_offsets() {
        let text = "HIERARCHY ROOT a\n{ OFFSET 1 2 3 CHANNELS 1 Xrotation JOINT b\n{ OFFSET 1 0 0 End Site { OFFSET 0 1 0 } } } MOTION\nFrames: 0\nFrame Time: 1\n";
        let motion = parse(text).expect("a BVH file");
        assert_eq!(at_rest(&motion.joints), [[1.0, 2.0, 3.0], [2.0, 2.0, 3.0], [2.0, 3.0, 3.0]]);
    }
}
