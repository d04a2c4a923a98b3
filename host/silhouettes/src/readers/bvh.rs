//! BVH motion capture: a skeleton and joint angles, converted to joint positions.
//! [`parse`] reads the text, [`kinematics`] computes positions, [`guess`] estimates the unit and the up axis, which BVH
//! files do not state. Each joint and end site becomes a named point. Linear in the file.

pub mod guess;
pub mod kinematics;
pub mod parse;

use super::reader::Reader;
use super::recording::{Found, RecordingError, text};
use crate::silhouette::capsule::Point3;
use kinematics::Kinematics;

pub const READER: Reader = Reader {
    name: "BVH",
    extensions: &["bvh"],
    about: "joints of a skeleton (CMU's library, Mixamo and many others); unit and up are guessed from the body",
    read: |bytes, _| read(bytes),
};

pub fn read(bytes: &[u8]) -> Result<Found, RecordingError> {
    let motion = parse::parse(&text(bytes)?)?;
    let kinematics = Kinematics::new(&motion);
    // Not 0, 0, 0, which is a missing marker.
    let joint = |place: Point3| Some(if place == [0.0; 3] { [f64::MIN_POSITIVE; 3] } else { place });
    let frames =
        motion.frames.iter().map(|frame| kinematics.places(frame).into_iter().map(joint).collect()).collect();
    let rate_hz = 1.0 / motion.frame_time_s;
    Ok(Found {
        others: Vec::new(),
        planar: false,
        unit: guess::unit(&motion.joints),
        up: guess::up(&motion, &kinematics),
        remarks: motion.remarks,
        names: motion.joints.iter().map(|joint| joint.name.clone()).collect(),
        rate_hz: if rate_hz.is_finite() { rate_hz } else { 0.0 },
        frames,
    })
}
