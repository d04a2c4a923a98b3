//! Rotation and projection to a view (Li 2014, eq. 7.1 and 7.2, with cos beta as the last entry of Ry). A point is
//! rotated by `Rx(alpha) Ry(beta) Rz(gamma)` and projected along y: image x is the rotated x, image height the rotated
//! z. `gamma` moves around the subject, `alpha` raises the camera.

use super::capsule::{Capsule, Point3};
use super::raster::{Point, fill_discs_hull};
use crate::mask::Mask;
use serde::{Deserialize, Serialize};

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct View {
    /// About x: positive looks down on the subject.
    pub alpha_deg: f64,
    pub beta_deg: f64,
    /// About z: around the subject.
    pub gamma_deg: f64,
}

/// Views at equal steps around the subject from one elevation.
pub fn views_round(count: usize, elevation_deg: f64) -> Vec<View> {
    (0..count)
        .map(|i| View { alpha_deg: elevation_deg, beta_deg: 0.0, gamma_deg: 360.0 * i as f64 / count as f64 })
        .collect()
}

impl View {
    /// Product of the rotations: `Rx Ry Rz`.
    pub fn matrix(&self) -> [[f64; 3]; 3] {
        let (sa, ca) = self.alpha_deg.to_radians().sin_cos();
        let (sb, cb) = self.beta_deg.to_radians().sin_cos();
        let (sg, cg) = self.gamma_deg.to_radians().sin_cos();
        let rx = [[1.0, 0.0, 0.0], [0.0, ca, -sa], [0.0, sa, ca]];
        let ry = [[cb, 0.0, sb], [0.0, 1.0, 0.0], [-sb, 0.0, cb]];
        let rz = [[cg, -sg, 0.0], [sg, cg, 0.0], [0.0, 0.0, 1.0]];
        product(&product(&rx, &ry), &rz)
    }

    pub fn project(&self, point: Point3) -> Point {
        project(&self.matrix(), point)
    }
}

pub(crate) fn product(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// (x, z) of a point rotated by a matrix.
pub(super) fn project(matrix: &[[f64; 3]; 3], p: Point3) -> Point {
    let along = |row: &[f64; 3]| row[0] * p[0] + row[1] * p[1] + row[2] * p[2];
    [along(&matrix[0]), along(&matrix[2])]
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Canvas {
    pub height_px: usize,
    pub width_px: usize,
    /// Millimetres per pixel: D in (7.2).
    pub mm_per_px: f64,
    /// (x, z) in millimetres at the centre.
    pub middle_mm: Point,
}

const LARGEST_PX: usize = 8192;

impl Canvas {
    /// Smallest canvas for all points with `margin_px`; `None` without finite points or above 8192 pixels.
    pub fn fitting(points: &[Point], mm_per_px: f64, margin_px: usize) -> Option<Self> {
        let mut range = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for p in points.iter().filter(|p| p[0].is_finite() && p[1].is_finite()) {
            for k in 0..2 {
                range[0][k] = range[0][k].min(p[k]);
                range[1][k] = range[1][k].max(p[k]);
            }
        }
        let side = |k: usize| ((range[1][k] - range[0][k]) / mm_per_px).ceil() + 1.0 + 2.0 * margin_px as f64;
        let fits = mm_per_px > 0.0 && (0..2).all(|k| side(k).is_finite() && side(k) <= LARGEST_PX as f64);
        fits.then(|| Self {
            height_px: side(1) as usize,
            width_px: side(0) as usize,
            mm_per_px,
            middle_mm: [0.5 * (range[0][0] + range[1][0]), 0.5 * (range[0][1] + range[1][1])],
        })
    }

    pub fn pixel(&self, p: Point) -> Point {
        [
            0.5 * (self.width_px as f64 - 1.0) + (p[0] - self.middle_mm[0]) / self.mm_per_px,
            0.5 * (self.height_px as f64 - 1.0) - (p[1] - self.middle_mm[1]) / self.mm_per_px,
        ]
    }

    pub fn blank(&self) -> Mask {
        Mask::default((self.height_px, self.width_px))
    }
}

/// Bounding points of capsules, for [`Canvas::fitting`].
pub fn extent(capsules: &[Capsule], view: &View) -> Vec<Point> {
    let matrix = view.matrix();
    let mut points = Vec::with_capacity(4 * capsules.len());
    for capsule in capsules.iter().filter(|c| c.is_finite()) {
        for end in [capsule.from, capsule.to] {
            let [x, z] = project(&matrix, end);
            points.push([x - capsule.radius_mm, z - capsule.radius_mm]);
            points.push([x + capsule.radius_mm, z + capsule.radius_mm]);
        }
    }
    points
}

/// Skips capsules with non-finite numbers (missing joints).
pub fn draw(capsules: &[Capsule], view: &View, canvas: &Canvas) -> Mask {
    let matrix = view.matrix();
    let mut mask = canvas.blank();
    for capsule in capsules.iter().filter(|c| c.is_finite()) {
        let radius = capsule.radius_mm / canvas.mm_per_px;
        let [from, to] = [capsule.from, capsule.to].map(|p| canvas.pixel(project(&matrix, p)));
        fill_discs_hull(&mut mask, (from, radius), (to, radius));
    }
    mask
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mask::BoundingBox;

    #[test]
    fn the_rotation_is_a_rotation_and_quarter_turns_are_known() {
        let m = View { alpha_deg: 20.0, beta_deg: -35.0, gamma_deg: 110.0 }.matrix();
        for i in 0..3 {
            for j in 0..3 {
                let dot: f64 = (0..3).map(|k| m[i][k] * m[j][k]).sum();
                assert!(
                    (dot - f64::from(u8::from(i == j))).abs() < 1e-12,
                    "with cos alpha in Ry's corner it is not a rotation"
                );
            }
        }
        let side = View { gamma_deg: 90.0, ..View::default() }.project([1.0, 2.0, 3.0]);
        assert!((side[0] + 2.0).abs() < 1e-12 && (side[1] - 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_post_is_as_tall_and_wide_as_it_should_be() {
        let post = [Capsule::new([0.0, 0.0, 100.0], [0.0, 0.0, 900.0], 100.0)];
        let view = View::default();
        let canvas = Canvas::fitting(&extent(&post, &view), 5.0, 3).expect("finite");
        let bounds = BoundingBox::of(draw(&post, &view, &canvas).view()).expect("drawn");
        assert!(
            (bounds.height() as i32 - 200).abs() <= 2 && (bounds.width() as i32 - 40).abs() <= 2,
            "{bounds:?}"
        );
        assert!(Canvas::fitting(&[[f64::NAN, 0.0]], 5.0, 3).is_none());
        assert!(Canvas::fitting(&[[0.0, 0.0], [1e9, 0.0]], 5.0, 3).is_none());
    }
}
