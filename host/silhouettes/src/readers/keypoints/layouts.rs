//! Point orders of pose estimators: one table, a line per layout.

/// A layout, identified by its number of points, and by their places where two have one number.
#[derive(Debug, PartialEq)]
pub struct Layout {
    pub name: &'static str,
    /// Points of a person in the file; those after `points` (face, hands) are ignored.
    pub count: usize,
    /// Short names, see [`full_name`]; empty for points that are not drawn.
    pub points: &'static [&'static str],
}

pub const LAYOUTS: [Layout; 10] = [
    Layout { name: "OpenPose MPI", count: 15, points: &MPI_15 },
    Layout { name: "MPII", count: 16, points: &MPII_16 },
    Layout { name: "COCO", count: 17, points: &COCO_17 },
    Layout { name: "OpenPose COCO", count: 18, points: &OPENPOSE_18 },
    Layout { name: "COCO with feet", count: 23, points: &COCO_23 },
    Layout { name: "OpenPose BODY_25", count: 25, points: &BODY_25 },
    Layout { name: "HALPE", count: 26, points: &HALPE_26 },
    Layout { name: "MediaPipe", count: 33, points: &MEDIAPIPE_33 },
    Layout { name: "COCO whole body", count: 133, points: &COCO_23 },
    Layout { name: "HALPE whole body", count: 136, points: &HALPE_26 },
];

/// Points by name instead of number.
pub const NAMED: Layout = Layout { name: "named points", count: NAMES.len(), points: &NAMES };

/// Of OpenPose's experimental models.
pub const BODY_25B: Layout = Layout { name: "OpenPose BODY_25B", count: 25, points: &BODY_25B_POINTS };

/// Estimators of 3-D poses mostly use this order.
pub const HUMAN36M: Layout = Layout { name: "Human3.6M", count: 17, points: &HUMAN36M_17 };

const LEFT_ARM: [&str; 3] = ["ls", "le", "lw"];
const RIGHT_ARM: [&str; 3] = ["rs", "re", "rw"];
const ARMS: [&str; 6] = joined(&[&RIGHT_ARM, &LEFT_ARM]);
const LEGS: [&str; 6] = ["rh", "rk", "ra", "lh", "lk", "la"];
const IN_PAIRS: [&str; 12] = ["ls", "rs", "le", "re", "lw", "rw", "lh", "rh", "lk", "rk", "la", "ra"];
const EYES_AND_EARS: [&str; 4] = ["right eye", "left eye", "right ear", "left ear"];
const FEET: [&str; 6] =
    ["left big toe", "left small toe", "left heel", "right big toe", "right small toe", "right heel"];
const FEET_IN_PAIRS: [&str; 6] =
    ["left big toe", "right big toe", "left small toe", "right small toe", "left heel", "right heel"];

const HUMAN36M_17: [&str; 17] =
    joined(&[&["hip centre"], &LEGS, &["", "neck", "nose", "head top"], &LEFT_ARM, &RIGHT_ARM]);
const MPI_15: [&str; 15] = joined(&[&["head top", "neck"], &ARMS, &LEGS, &[""]]);
const MPII_16: [&str; 16] = joined(&[
    &["ra", "rk", "rh", "lh", "lk", "la"],
    &["hip centre", "", "neck", "head top"],
    &["rw", "re", "rs", "ls", "le", "lw"],
]);
const COCO_17: [&str; 17] = joined(&[&["nose", "left eye", "right eye", "left ear", "right ear"], &IN_PAIRS]);
const OPENPOSE_18: [&str; 18] = joined(&[&["nose", "neck"], &ARMS, &LEGS, &EYES_AND_EARS]);
const COCO_23: [&str; 23] = joined(&[&COCO_17, &FEET]);
const BODY_25: [&str; 25] =
    joined(&[&["nose", "neck"], &ARMS, &["hip centre"], &LEGS, &EYES_AND_EARS, &FEET]);
const BODY_25B_POINTS: [&str; 25] = joined(&[&COCO_17, &["neck", "head top"], &FEET]);
const HALPE_26: [&str; 26] = joined(&[&COCO_17, &["head top", "neck", "hip centre"], &FEET_IN_PAIRS]);
const MEDIAPIPE_33: [&str; 33] = joined(&[
    &["nose", "", "left eye", "", "", "right eye", "", "left ear", "right ear", "", ""],
    &["ls", "rs", "le", "re", "lw", "rw", "", "", "left hand", "right hand", "", ""],
    &["lh", "rh", "lk", "rk", "la", "ra", "left heel", "right heel", "left big toe", "right big toe"],
]);

/// Names of the template `keypoints`, in the readers' order.
pub const NAMES: [&str; 28] = joined(&[
    &["nose", "left eye", "right eye", "left ear", "right ear", "head top", "neck", "hip centre"],
    &["left shoulder", "right shoulder", "left elbow", "right elbow", "left wrist", "right wrist"],
    &["left hand", "right hand", "left hip", "right hip", "left knee", "right knee"],
    &["left ankle", "right ankle", "left heel", "right heel"],
    &["left big toe", "right big toe", "left small toe", "right small toe"],
]);

const fn joined<const COUNT: usize>(parts: &[&[&'static str]]) -> [&'static str; COUNT] {
    let mut points = [""; COUNT];
    let (mut at, mut part) = (0, 0);
    while part < parts.len() {
        let mut of_part = 0;
        while of_part < parts[part].len() {
            points[at] = parts[part][of_part];
            at += 1;
            of_part += 1;
        }
        part += 1;
    }
    assert!(at == COUNT);
    points
}

impl Layout {
    pub fn of(count: usize) -> Option<&'static Self> {
        LAYOUTS.iter().find(|layout| layout.count == count)
    }

    /// MediaPipe gives points of a picture a depth, and points in space about the hips.
    pub fn has_picture_depth(&self) -> bool {
        self.count == MEDIAPIPE_33.len()
    }

    pub fn places(&self) -> impl Iterator<Item = Option<usize>> {
        self.points.iter().map(|short| NAMES.iter().position(|name| *name == full_name(short)))
    }
}

/// `ls` is `left shoulder` and so on.
fn full_name(short: &str) -> String {
    let mut letters = short.chars();
    let (Some(side), Some(joint), None) = (letters.next(), letters.next(), letters.next()) else {
        return short.into();
    };
    let side = if side == 'l' { "left" } else { "right" };
    let joint = match joint {
        's' => "shoulder",
        'e' => "elbow",
        'w' => "wrist",
        'h' => "hip",
        'k' => "knee",
        _ => "ankle",
    };
    format!("{side} {joint}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_layout_has_the_limbs_of_both_sides_once() {
        for layout in LAYOUTS.iter().chain([&BODY_25B, &HUMAN36M]) {
            let places: Vec<usize> = layout.places().flatten().collect();
            let named = layout.points.iter().filter(|point| !point.is_empty()).count();
            assert_eq!(places.len(), named, "{}: an unknown name", layout.name);
            for limb in 8..14 {
                assert_eq!(
                    places.iter().filter(|place| **place == limb).count(),
                    1,
                    "{} {limb}",
                    layout.name
                );
            }
            assert!(layout.points.len() <= layout.count);
        }
    }
}
