//! Least-squares plane: z = z0 + a x + b y. Behind a lens of focal length F, a point's position follows from its depth: pixel
//! (u, v) from the axis lies at `x = s u (z - F)`, `s = pitch / F`. Depth fitted over such positions is biased by noise, most in
//! regions of a few rows. `1 / (z - F) = (1 - s (a u + b v)) / (z0 - F)` is linear in the pixels, and the noise of depth from
//! defocus is even there.

use farnear_files::mesh::{Lateral, Projection};
use ndarray::{ArrayView2, s};
use serde::{Serialize, Serializer};

use super::{Entries, Measured, Rectangle, Unit};

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
    pub(super) fn of(map: &Measured, at: Rectangle) -> Option<Self> {
        let per_pixel = map.lateral == Lateral::Unknown;
        fit(map.depth.view(), map.lateral, at).map(|plane| Self { unit: map.unit, per_pixel, plane })
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

/// Fits a plane to a part of a map, which must be inside the map; `None` for fewer than three depths or collinear ones.
pub fn fit(depth: ArrayView2<f32>, lateral: Lateral, at: Rectangle) -> Option<Plane> {
    let dim = depth.dim();
    let part = depth.slice(s![at.y..at.y + at.height, at.x..at.x + at.width]);
    let pixels: Vec<(usize, usize, f64)> = part
        .indexed_iter()
        .filter(|(_, z)| z.is_finite())
        .map(|((row, column), z)| (at.x + column, at.y + row, f64::from(*z)))
        .collect();
    let [a, b] = slopes(&pixels, dim, lateral)?;
    let points = || {
        pixels.iter().map(|&(column, row, z)| {
            let [x, y] = lateral.beside_axis(dim, column, row, z);
            [x, y, z]
        })
    };
    let [mx, my, mz] = mean(points());
    let (mut squares, mut low, mut high) = (0.0, f64::MAX, f64::MIN);
    for off in points().map(|[x, y, z]| z - mz - a * (x - mx) - b * (y - my)) {
        squares += off * off;
        low = low.min(off);
        high = high.max(off);
    }
    Some(Plane {
        z_mm: mz,
        slope_x: a,
        slope_y: b,
        tilt_deg: a.hypot(b).atan().to_degrees(),
        rms_mm: (squares / pixels.len() as f64).sqrt(),
        peak_to_valley_mm: high - low,
    })
}

/// Slopes to the right and upwards.
fn slopes(pixels: &[(usize, usize, f64)], dim: (usize, usize), lateral: Lateral) -> Option<[f64; 2]> {
    let at = |value: f64, (column, row, _): (usize, usize, f64)| [column as f64, row as f64, value];
    let even = |side: f64| {
        let found = Linear::of(pixels.iter().map(|&pixel| at(pixel.2, pixel)))?;
        Some([found.per_column / side, -found.per_row / side])
    };
    let slopes = match lateral {
        Lateral::Lens(lens) => {
            let Projection { centre_mm, distance_mm, pixel_um, .. } = lens;
            let found = Linear::of(pixels.iter().map(|&pixel| at((pixel.2 - centre_mm).recip(), pixel)))?;
            let unit = found.at(lens.axis_in(dim)) * pixel_um * 1e-3 / distance_mm;
            [-found.per_column / unit, found.per_row / unit]
        }
        Lateral::Pixel(side) => even(side)?,
        Lateral::Unknown => even(1.0)?,
    };
    slopes.iter().all(|slope| slope.is_finite()).then_some(slopes)
}

/// A value that is linear in column and row.
struct Linear {
    /// Column, row and value.
    mean: [f64; 3],
    per_column: f64,
    per_row: f64,
}

impl Linear {
    /// By least squares; `None` for fewer than three points or collinear ones.
    fn of(points: impl Iterator<Item = [f64; 3]> + Clone) -> Option<Self> {
        let mean = mean(points.clone());
        let [mut xx, mut xy, mut yy, mut xz, mut yz] = [0.0; 5];
        for [x, y, z] in points {
            let (x, y, z) = (x - mean[0], y - mean[1], z - mean[2]);
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
        let [per_column, per_row] = [(xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant];
        Some(Self { mean, per_column, per_row })
    }

    fn at(&self, [column, row]: [f64; 2]) -> f64 {
        self.mean[2] + self.per_column * (column - self.mean[0]) + self.per_row * (row - self.mean[1])
    }
}

/// NaN without points.
fn mean(points: impl Iterator<Item = [f64; 3]>) -> [f64; 3] {
    let (mut count, mut sums) = (0.0_f64, [0.0_f64; 3]);
    for point in points {
        count += 1.0;
        sums = std::array::from_fn(|axis| sums[axis] + point[axis]);
    }
    sums.map(|sum| sum / count)
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    const LENS: Projection = Projection { centre_mm: 50.0, distance_mm: 50.0, pixel_um: 7.4, axis_px: None };

    fn whole(depth: &Array2<f32>, lateral: Lateral) -> Option<Plane> {
        let (height, width) = depth.dim();
        fit(depth.view(), lateral, Rectangle { x: 0, y: 0, width, height })
    }

    /// 1 or -1, without a slope in any even part.
    fn noise((row, column): (usize, usize)) -> f32 {
        if (row + column).is_multiple_of(2) { 1.0 } else { -1.0 }
    }

    #[test]
    fn a_plane_is_found() {
        let depth = Array2::from_shape_fn((20, 30), |(row, column)| {
            900.0 + (0.25 * column as f32 + 0.5 * row as f32)
        });
        let plane = whole(&depth, Lateral::Pixel(2.0)).unwrap();
        assert!((plane.slope_x - 0.125).abs() < 1e-9 && (plane.slope_y + 0.25).abs() < 1e-9, "{plane:?}");
        assert!((plane.tilt_deg - 0.125f64.hypot(0.25).atan().to_degrees()).abs() < 1e-9);
        assert!(plane.rms_mm < 1e-9 && plane.peak_to_valley_mm < 1e-9);
    }

    #[test]
    fn a_steep_plane_behind_a_lens_has_its_slopes_in_any_part() {
        let (a, b, s) = (1.5, -0.8, 7.4e-3 / 50.0);
        let depth = Array2::from_shape_fn((480, 640), |(row, column)| {
            let (u, v) = (column as f64 - 319.5, 239.5 - row as f64);
            (50.0 + 850.0 / (1.0 - s * (a * u + b * v))) as f32
        });
        for at in [[0, 0, 640, 480], [500, 10, 100, 80]] {
            let plane = fit(depth.view(), Lateral::Lens(LENS), at.into()).unwrap();
            assert!((plane.slope_x - a).abs() < 1e-3 && (plane.slope_y - b).abs() < 1e-3, "{plane:?}");
            assert!(plane.rms_mm < 1e-3, "{plane:?}");
        }
    }

    /// With noise, the position of a pixel far from the axis varies with its depth.
    #[test]
    fn noise_tilts_no_thin_region() {
        let depth = Array2::from_shape_fn((480, 640), |at| 900.0 + 0.5 * noise(at));
        for height in [2, 4, 10] {
            let at = Rectangle { x: 0, y: 0, width: 640, height };
            let plane = fit(depth.view(), Lateral::Lens(LENS), at).unwrap();
            assert!(plane.tilt_deg < 0.01 && (plane.rms_mm - 0.5).abs() < 1e-3, "{height}: {plane:?}");
        }
        for [width, height] in [[640, 1], [1, 480]] {
            let at = Rectangle { x: 0, y: 0, width, height };
            assert_eq!(fit(depth.view(), Lateral::Lens(LENS), at), None);
        }
    }

    #[test]
    fn deviations_from_the_plane_are_measured() {
        let depth = Array2::from_shape_fn((20, 20), |at| 900.0 + noise(at));
        let plane = whole(&depth, Lateral::Unknown).unwrap();
        assert!(
            (plane.rms_mm - 1.0).abs() < 0.01 && (plane.peak_to_valley_mm - 2.0).abs() < 0.05,
            "{plane:?}"
        );
    }

    #[test]
    fn too_few_points_or_a_line_make_no_plane() {
        assert_eq!(whole(&Array2::from_elem((1, 2), 1.0), Lateral::Unknown), None);
        let line =
            Array2::from_shape_fn((9, 18), |(row, column)| if column == 2 * row { 1.0 } else { f32::NAN });
        assert_eq!(whole(&line, Lateral::Unknown), None);
    }
}
