//! Marker trajectories: the common form of C3D, TRC and CSV files, millimetres.

use crate::silhouette::capsule::Point3;
use std::collections::HashMap;

/// Named markers over time; `None` where a marker was hidden.
#[derive(Clone, Debug, PartialEq)]
pub struct Markers {
    /// Names in file order.
    pub names: Vec<String>,
    /// Frames per second, 0 if the file does not say.
    pub rate_hz: f64,
    /// `frames[f][m]`: marker m in frame f, millimetres.
    pub frames: Vec<Vec<Option<Point3>>>,
}

/// Why a marker file could not be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MarkerError {
    /// Not a file of this kind.
    #[error("not a {kind} file: {reason}")]
    Kind {
        /// Kind expected.
        kind: &'static str,
        /// What is wrong.
        reason: String,
    },
    /// The file ends early.
    #[error("the {kind} file ends within {what}: {needed} bytes are needed, {found} are there")]
    Truncated {
        /// Kind of file.
        kind: &'static str,
        /// What was being read.
        what: &'static str,
        /// Bytes needed.
        needed: usize,
        /// Bytes there.
        found: usize,
    },
    /// A line that cannot be read.
    #[error("line {line}: {reason}")]
    Line {
        /// Line number from 1.
        line: usize,
        /// What is wrong.
        reason: String,
    },
    /// An unknown unit.
    #[error("unknown unit of length `{0}`: expected mm, cm, m or in")]
    Unit(String),
}

impl Markers {
    /// Positions of a frame by marker name, hidden markers left out. Names are given without a subject's prefix (`Nick:LASI` is `LASI`)
    /// as well as whole.
    pub fn by_name(&self, frame: usize) -> HashMap<&str, Point3> {
        let mut found = HashMap::new();
        for (name, point) in self.names.iter().zip(self.frames.get(frame).into_iter().flatten()) {
            if let Some(point) = point {
                found.insert(name.as_str(), *point);
                if let Some((_, short)) = name.rsplit_once(':') {
                    found.entry(short).or_insert(*point);
                }
            }
        }
        found
    }
}

/// Millimetres per unit.
pub(super) fn unit_mm(unit: &str) -> Result<f64, MarkerError> {
    match unit.trim().trim_matches('\0').to_ascii_lowercase().as_str() {
        "mm" | "millimeters" | "millimetres" => Ok(1.0),
        "cm" => Ok(10.0),
        "m" | "meters" | "metres" => Ok(1000.0),
        "in" | "inches" => Ok(25.4),
        other => Err(MarkerError::Unit(other.to_owned())),
    }
}
