use serde::{Serialize, Serializer};

use super::{Entries, Measured, Unit};
use crate::error::WorkflowError;

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ProfilePoint {
    pub unit: Unit,
    pub x: usize,
    pub y: usize,
    /// Distance from the start of the profile.
    pub at_px: f64,
    pub depth: Option<f64>,
    pub deviation: Option<f64>,
}

impl Serialize for ProfilePoint {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut to = Entries::new(to.serialize_map(None)?, self.unit);
        to.field("x", &self.x)?;
        to.field("y", &self.y)?;
        to.field("at_px", &self.at_px)?;
        to.length("depth", Some(self.depth))?;
        to.length("deviation", Some(self.deviation))?;
        to.end()
    }
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct ProfileFigures {
    pub unit: Unit,
    /// Points of the line, one pixel apart.
    pub points: Vec<ProfilePoint>,
}

/// Nearest depths along the line between two pixels inside the map.
pub fn profile(map: &Measured, from: [usize; 2], to: [usize; 2]) -> crate::Result<ProfileFigures> {
    let (height, width) = map.depth.dim();
    for [x, y] in [from, to] {
        if x >= width || y >= height {
            let expected = format!("expected a pixel of {width}x{height}");
            return Err(WorkflowError::parameter("profile", format!("({x}, {y})"), expected));
        }
    }
    let [dx, dy] = [0, 1].map(|axis| to[axis] as f64 - from[axis] as f64);
    let length = dx.hypot(dy);
    let steps = dx.abs().max(dy.abs()) as usize;
    let points = (0..=steps).map(|step| {
        let part = if steps == 0 { 0.0 } else { step as f64 / steps as f64 };
        let x = (from[0] as f64 + part * dx).round() as usize;
        let y = (from[1] as f64 + part * dy).round() as usize;
        let value = |value: f32| value.is_finite().then_some(f64::from(value));
        ProfilePoint {
            unit: map.unit,
            x,
            y,
            at_px: part * length,
            depth: value(map.depth[[y, x]]),
            deviation: map.deviation.as_ref().and_then(|deviation| value(deviation[[y, x]])),
        }
    });
    Ok(ProfileFigures { unit: map.unit, points: points.collect() })
}

#[cfg(test)]
mod tests {
    use farnear_files::mesh::{Lateral, Projection};
    use ndarray::Array2;

    use super::*;

    #[test]
    fn the_line_is_followed() {
        let mut depth_mm = Array2::from_shape_fn((10, 20), |(y, x)| (100 * y + x) as f32);
        depth_mm[[2, 4]] = f32::NAN;
        let projection = Projection { centre_mm: 50.0, distance_mm: 50.0, pixel_um: 7.4, axis_px: None };
        let lateral = Lateral::Lens(projection);
        let map = Measured { depth: depth_mm, deviation: None, unit: Unit::Mm, lateral, remarks: vec![] };
        let found = profile(&map, [0, 0], [8, 4]).unwrap().points;
        assert_eq!(found.len(), 9);
        assert_eq!((found[4].x, found[4].y, found[4].depth), (4, 2, None));
        assert_eq!(found[8].depth, Some(408.0));
        assert!((found[8].at_px - 80f64.sqrt()).abs() < 1e-12);
        assert_eq!(profile(&map, [3, 3], [3, 3]).unwrap().points.len(), 1);
        assert!(profile(&map, [0, 0], [20, 0]).unwrap_err().is_usage());
    }
}
