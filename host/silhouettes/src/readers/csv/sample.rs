//! A person for tests of tables.

use crate::readers::{
    self,
    recording::{Choices, Recording, RecordingError},
};

/// A person 170 pixels tall; the left wrist is further to the right in the picture, and the right arm raised.
pub const BODY: [(&str, [f64; 2]); 13] = [
    ("nose", [100.0, 30.0]),
    ("left_shoulder", [118.0, 50.0]),
    ("right_shoulder", [82.0, 50.0]),
    ("left_elbow", [124.0, 78.0]),
    ("right_elbow", [76.0, 25.0]),
    ("left_wrist", [126.0, 104.0]),
    ("right_wrist", [74.0, 2.0]),
    ("left_hip", [109.0, 100.0]),
    ("right_hip", [91.0, 100.0]),
    ("left_knee", [109.0, 142.0]),
    ("right_knee", [91.0, 142.0]),
    ("left_ankle", [109.0, 184.0]),
    ("right_ankle", [91.0, 184.0]),
];

/// Their numbers in COCO's order.
pub const COCO: [usize; 13] = [0, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16];

pub fn read(header: &str, rows: &[String], person: Option<usize>) -> Result<Recording, RecordingError> {
    let text = format!("{header}\n{}\n", rows.join("\n"));
    readers::read(text.as_bytes(), "csv", Choices { person, ..Choices::default() })
}
