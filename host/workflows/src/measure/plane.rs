//! Least-squares plane along the optical axis: z = z0 + a x + b y.

use farnear_files::mesh::Lateral;
use serde::{Serialize, Serializer};

use super::{Entries, Measured, Unit};

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Plane {
    /// At the centroid of the points.
    pub z_mm: f64,
    /// mm per mm to the right.
    pub slope_x: f64,
    pub slope_y: f64,
    /// Angle to the sensor plane.
    pub tilt_deg: f64,
    /// Of the residuals along the axis.
    pub rms_mm: f64,
    /// Largest minus smallest residual: the flatness.
    pub peak_to_valley_mm: f64,
}

/// A plane in a map of any unit. Without a pixel size, slopes are per pixel and there is no tilt.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PlaneFigures {
    pub unit: Unit,
    pub per_pixel: bool,
    pub plane: Plane,
}

impl PlaneFigures {
    pub(super) fn of(points: &[[f64; 3]], map: &Measured) -> Option<Self> {
        let per_pixel = map.lateral == Lateral::Unknown;
        fit(points).map(|plane| Self { unit: map.unit, per_pixel, plane })
    }
}

impl Serialize for PlaneFigures {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let Plane { z_mm, slope_x, slope_y, tilt_deg, rms_mm, peak_to_valley_mm } = self.plane;
        let mut to = Entries::new(to.serialize_map(None)?, self.unit);
        to.length("z", Some(z_mm))?;
        if self.per_pixel {
            to.per_pixel("slope_x", Some(slope_x))?;
            to.per_pixel("slope_y", Some(slope_y))?;
        } else {
            to.field("slope_x", &slope_x)?;
            to.field("slope_y", &slope_y)?;
            to.field("tilt_deg", &tilt_deg)?;
        }
        to.length("rms", Some(rms_mm))?;
        to.length("peak_to_valley", Some(peak_to_valley_mm))?;
        to.end()
    }
}

/// Fits a plane in three passes; `None` for fewer than three points or collinear ones.
pub fn fit(points_mm: &[[f64; 3]]) -> Option<Plane> {
    let count = points_mm.len();
    if count < 3 {
        return None;
    }
    let mean = |axis: usize| points_mm.iter().map(|point| point[axis]).sum::<f64>() / count as f64;
    let [mx, my, mz] = [mean(0), mean(1), mean(2)];
    let [mut xx, mut xy, mut yy, mut xz, mut yz] = [0.0; 5];
    for [x, y, z] in points_mm {
        let (x, y, z) = (x - mx, y - my, z - mz);
        xx += x * x;
        xy += x * y;
        yy += y * y;
        xz += x * z;
        yz += y * z;
    }
    let determinant = xx * yy - xy * xy;
    // Relative to points that spread in both directions.
    if determinant <= 1e-9 * (xx * yy) || determinant.is_nan() {
        return None;
    }
    let (a, b) = ((xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant);
    let off = |[x, y, z]: &[f64; 3]| z - mz - a * (x - mx) - b * (y - my);
    let (mut squares, mut low, mut high) = (0.0, f64::MAX, f64::MIN);
    for off in points_mm.iter().map(off) {
        squares += off * off;
        low = low.min(off);
        high = high.max(off);
    }
    Some(Plane {
        z_mm: mz,
        slope_x: a,
        slope_y: b,
        tilt_deg: a.hypot(b).atan().to_degrees(),
        rms_mm: (squares / count as f64).sqrt(),
        peak_to_valley_mm: high - low,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(z: impl Fn(f64, f64) -> f64) -> Vec<[f64; 3]> {
        (0..400).map(|i| (f64::from(i % 20) - 4.0, f64::from(i / 20))).map(|(x, y)| [x, y, z(x, y)]).collect()
    }

    #[test]
    fn a_plane_is_found() {
        let plane = fit(&grid(|x, y| 900.0 + 0.3 * x - 0.4 * y)).unwrap();
        assert!((plane.slope_x - 0.3).abs() < 1e-9 && (plane.slope_y + 0.4).abs() < 1e-9, "{plane:?}");
        assert!((plane.tilt_deg - 0.5f64.atan().to_degrees()).abs() < 1e-9);
        assert!(plane.rms_mm < 1e-9 && plane.peak_to_valley_mm < 1e-9);
    }

    #[test]
    fn deviations_from_the_plane_are_measured() {
        let plane = fit(&grid(|x, y| 900.0 + if (x + y) as i64 % 2 == 0 { 1.0 } else { -1.0 })).unwrap();
        assert!(
            (plane.rms_mm - 1.0).abs() < 0.01 && (plane.peak_to_valley_mm - 2.0).abs() < 0.05,
            "{plane:?}"
        );
    }

    #[test]
    fn too_few_points_or_a_line_make_no_plane() {
        assert_eq!(fit(&[[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]]), None);
        let line: Vec<_> = (0..9).map(|i| [f64::from(i), 2.0 * f64::from(i), 1.0]).collect();
        assert_eq!(fit(&line), None);
    }
}
