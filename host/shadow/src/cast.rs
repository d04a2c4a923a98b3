//! Splits a silhouette into body and cast shadow, for `hybrid` with a known light position.
//!
//! The body is in an upright plane at the subject's distance, as deep as wide, up to 0.17 of the stature.
//! From the head down, each run of pixels casts an ellipse of its width on the ground. Pixels inside the
//! shadow cast so far are shadow, unless they continue the body of the row above. Below the feet there is no
//! body; near the ground only legs. The only unknown, the subject's distance, is searched on a reduced copy.
//! Bent people and pitched cameras work. Some milliseconds for 640 x 480.

use super::camera::{Camera, CameraFile};
use super::light::Light;
use super::projection::{ShadowError, Subject};
use farnear_silhouettes::mask::{BoundingBox, Mask};
use farnear_silhouettes::silhouette::raster::{Point, fill_convex};

/// Half the depth of a body / stature: a chest is 0.17 deep without clothes and arms.
const DEEPEST: f64 = 0.086;
/// Widening of the cast shadow: runs are cut at pixels, and shadow edges are soft.
const WIDER: f64 = 1.05;
/// Height / stature below which there are only legs (knees are at 0.285).
const LEGS: f64 = 0.26;
/// Reach of legs beyond the thighs / stature: a stride.
const REACH: f64 = 0.26;
/// Height range of the thighs / stature; legs start at their centre.
const THIGHS: [f64; 2] = [0.23, 0.46];
/// Depth of a nearer foot below the feet's middle / stature.
const BELOW: f64 = 0.028;
/// Next to shadow a body narrows by a pixel on either side per this many rows.
const NARROWS: usize = 3;
/// Height of the silhouette / stature: bending lowers it, hair and raised hands increase it.
const STATURES: [f64; 2] = [0.35, 1.2];
const TRIED_ROWS: usize = 45;
/// Largest unexplained share of silhouette and shadow.
const UNEXPLAINED: f64 = 0.4;

#[derive(Clone, Debug)]
pub struct Explanation {
    pub body: Mask,
    /// Cast shadow, including hidden parts and parts outside the silhouette.
    pub thrown: Mask,
    pub subject: Subject,
    /// Pixels explained by neither, plus shadow outside the silhouette, relative to the silhouette.
    pub unexplained: f64,
    /// Cast shadow outside the silhouette, relative to that not hidden by the body; large for a wrong direction of the light.
    pub missing: f64,
}

/// `None` without a light position, or if no distance explains enough. Fails without a usable shadow.
pub fn explain(mask: &Mask, file: &CameraFile, light: Light) -> Result<Option<Explanation>, ShadowError> {
    let Some(bounds) = BoundingBox::of(mask.view()) else { return Err(ShadowError::EmptyMask) };
    if matches!(light, Light::Direction { .. }) {
        return Ok(None);
    }
    light.check(file.subject.height_m, &file.camera)?;
    let shrink = (bounds.height() / TRIED_ROWS).max(1);
    let whole = Scene { mask, bounds, camera: &file.camera, light, stature_m: file.subject.height_m };
    let best = match file.subject.distance_m {
        Some(distance_m) => whole.split(distance_m),
        None if shrink == 1 => whole.best_of(whole.feet_rows()),
        None => {
            let (small, camera) = shrunk(mask, &file.camera, shrink);
            let Some(bounds) = BoundingBox::of(small.view()) else { return Ok(None) };
            let scene = Scene { mask: &small, bounds, camera: &camera, ..whole };
            let Some(near) = scene.best_of(scene.feet_rows()) else { return Ok(None) };
            // Half a row of the copy is accurate enough for the feet: the whole body casts the shadow.
            whole.split(near.subject.distance_m)
        }
    };
    Ok(best.filter(|found| found.unexplained <= UNEXPLAINED || file.subject.distance_m.is_some()))
}

fn shrunk(mask: &Mask, camera: &Camera, by: usize) -> (Mask, Camera) {
    let (rows, columns) = (mask.nrows() / by, mask.ncols() / by);
    let small = Mask::from_shape_fn((rows, columns), |(y, x)| mask[[y * by + by / 2, x * by + by / 2]]);
    let [cx, cy] = camera.principal_point();
    let place = |at: f64| (at - (by / 2) as f64) / by as f64;
    let camera = Camera {
        pixel_um: camera.pixel_um * by as f64,
        width_px: columns,
        height_px: rows,
        principal_point_px: Some([place(cx), place(cy)]),
        ..camera.clone()
    };
    (small, camera)
}

#[derive(Clone, Copy)]
struct Scene<'a> {
    mask: &'a Mask,
    bounds: BoundingBox,
    camera: &'a Camera,
    light: Light,
    stature_m: f64,
}

type Run = (usize, usize);

#[derive(Clone, Copy)]
struct Row {
    up_m: f64,
    pixel_m: f64,
    /// Column straight ahead of the camera.
    ahead_px: f64,
}

impl Row {
    fn offset_m(self, x: f64) -> f64 {
        (x - self.ahead_px) * self.pixel_m
    }
}

struct Split {
    body: Mask,
    thrown: Mask,
    unexplained: usize,
    thighs_m: f64,
    thigh_pixels: usize,
}

impl Scene<'_> {
    /// Candidate rows of the feet, upwards; below the image if the silhouette is cut there.
    fn feet_rows(&self) -> impl Iterator<Item = f64> + use<> {
        let cut = self.bounds.bottom == self.mask.nrows();
        let last = self.bounds.bottom as f64 + if cut { 0.3 * self.bounds.height() as f64 } else { 1.0 };
        let rows = (last - self.bounds.top as f64) as usize;
        (0..rows).map(move |i| last - i as f64)
    }

    fn best_of(&self, feet_rows: impl Iterator<Item = f64>) -> Option<Explanation> {
        let [cx, _] = self.camera.principal_point();
        let tried = feet_rows.filter_map(|row| self.split(self.camera.ground_point([cx, row])?[1]));
        tried.reduce(|best, next| if next.unexplained < best.unexplained { next } else { best })
    }

    fn row(&self, y: f64, distance_m: f64) -> Row {
        let [cx, cy] = self.camera.principal_point();
        let focal = self.camera.focal_px();
        let (s, c) = self.camera.pitch_deg.to_radians().sin_cos();
        let down = (y - cy) / focal;
        let along = distance_m / (c - down * s);
        Row { up_m: self.camera.height_m - along * (s + down * c), pixel_m: along / focal, ahead_px: cx }
    }

    /// Split at a distance; `None` for an implausible size.
    fn split(&self, distance_m: f64) -> Option<Explanation> {
        let top = self.row(self.bounds.top as f64, distance_m);
        let possible = (STATURES[0]..STATURES[1]).contains(&(top.up_m / self.stature_m));
        if !(distance_m.is_finite() && possible) {
            return None;
        }
        let shape = self.mask.dim();
        let mut split = Split {
            body: Mask::default(shape),
            thrown: Mask::default(shape),
            unexplained: 0,
            thighs_m: 0.0,
            thigh_pixels: 0,
        };
        let (mut above, mut runs): (Vec<Run>, Vec<Run>) = (Vec::new(), Vec::new());
        for y in self.bounds.top..self.bounds.bottom {
            let row = self.row(y as f64, distance_m);
            runs.clear();
            self.read(y, row, &above, &mut split, &mut runs);
            for &run in &runs {
                self.throw(run, row, distance_m, &mut split);
            }
            std::mem::swap(&mut above, &mut runs);
        }
        let thrown_outside =
            |mask: &Mask| mask.iter().zip(&split.thrown).filter(|&(&set, &thrown)| thrown && !set).count();
        let (beside, visible) = (thrown_outside(self.mask), thrown_outside(&split.body));
        let area = farnear_silhouettes::mask::area(self.mask.view()).max(1);
        let offset_m = if split.thigh_pixels > 0 {
            split.thighs_m / split.thigh_pixels as f64
        } else {
            top.offset_m(0.5 * (self.bounds.left + self.bounds.right) as f64)
        };
        Some(Explanation {
            body: split.body,
            thrown: split.thrown,
            subject: Subject { distance_m, offset_m, height_m: self.stature_m },
            unexplained: (split.unexplained + beside) as f64 / area as f64,
            missing: beside as f64 / visible.max(1) as f64,
        })
    }

    fn read(&self, y: usize, row: Row, above: &[Run], split: &mut Split, runs: &mut Vec<Run>) {
        let height = row.up_m / self.stature_m;
        let middle_m = (split.thigh_pixels > 0).then(|| split.thighs_m / split.thigh_pixels as f64);
        let narrower = usize::from(y.is_multiple_of(NARROWS));
        for x in self.bounds.left..self.bounds.right {
            if !self.mask[[y, x]] {
                continue;
            }
            let free = !split.thrown[[y, x]];
            if height < -BELOW {
                split.unexplained += usize::from(free);
                continue;
            }
            let offset_m = row.offset_m(x as f64);
            let far = |middle_m: f64| (offset_m - middle_m).abs() > REACH * self.stature_m;
            let beside = height < LEGS && middle_m.is_some_and(far);
            split.unexplained += usize::from(free && beside);
            let goes_on =
                || above.iter().any(|run| (run.0 + narrower..=run.1.saturating_sub(narrower)).contains(&x));
            if beside || !(free || goes_on()) {
                continue;
            }
            split.body[[y, x]] = true;
            if (THIGHS[0]..THIGHS[1]).contains(&height) {
                split.thighs_m += offset_m;
                split.thigh_pixels += 1;
            }
            match runs.last_mut() {
                Some((_, last)) if *last + 1 == x => *last = x,
                _ => runs.push((x, x)),
            }
        }
    }

    fn throw(&self, (first, last): Run, row: Row, distance_m: f64, split: &mut Split) {
        const CORNERS: usize = 12;
        let half_m = 0.5 * (last + 1 - first) as f64 * row.pixel_m;
        let depth_m = half_m.min(DEEPEST * self.stature_m);
        let offset_m = row.offset_m(0.5 * (first + last) as f64);
        let Some([x_m, y_m]) = self.light.thrown_to([offset_m, distance_m, row.up_m], self.camera) else {
            return;
        };
        let middle = self.camera.project([x_m, y_m, 0.0]);
        if middle.is_some_and(|middle| self.would_be_cut(middle)) {
            split.unexplained += last + 1 - first;
        }
        let mut corners: [Point; CORNERS] = [[0.0; 2]; CORNERS];
        for (i, corner) in corners.iter_mut().enumerate() {
            let (sin, cos) = (std::f64::consts::TAU * i as f64 / CORNERS as f64).sin_cos();
            let on_ground = [x_m + WIDER * half_m * cos, y_m + depth_m * sin, 0.0];
            // Skipped unless fully in front of the lens.
            let Some(seen) = self.camera.project(on_ground) else { return };
            *corner = seen;
        }
        fill_convex(&mut split.thrown, &corners);
    }

    /// Whether shadow there is beyond an image edge that the silhouette does not touch.
    fn would_be_cut(&self, [x, y]: [f64; 2]) -> bool {
        let (rows, columns) = self.mask.dim();
        (y >= rows as f64 && self.bounds.bottom < rows)
            || (x < 0.0 && self.bounds.left > 0)
            || (x >= columns as f64 && self.bounds.right < columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sun::SunPosition;

    fn camera(pitch_deg: f64) -> Camera {
        CameraFile::parse(&format!(
            "[camera]\nheight_m = 1.2\nazimuth_deg = 0.0\npitch_deg = {pitch_deg}\nfocal_length_mm = 4.0\npixel_um = 6.0\n"
        ))
        .expect("valid")
        .camera
    }

    fn block([top, bottom, left, right]: [usize; 4]) -> Mask {
        Mask::from_shape_fn((480, 640), |(y, x)| (top..bottom).contains(&y) && (left..right).contains(&x))
    }

    fn of_block<T>(at: [usize; 4], pitch_deg: f64, ask: impl FnOnce(&Scene<'_>) -> T) -> T {
        let (mask, camera) = (block(at), camera(pitch_deg));
        let light = Light::Sun(SunPosition { elevation_deg: 45.0, azimuth_deg: 225.0 });
        let bounds = BoundingBox::of(mask.view()).expect("not empty");
        ask(&Scene { mask: &mask, bounds, camera: &camera, light, stature_m: 1.75 })
    }

    #[test]
    fn a_row_is_where_the_camera_sees_that_height() {
        for pitch_deg in [-4.0, 0.0, 12.0] {
            of_block([100, 400, 300, 340], pitch_deg, |scene| {
                for (up_m, x_m) in [(0.0, 0.5), (1.1, -0.8), (1.7, 0.2)] {
                    let [x, y] = scene.camera.project([x_m, 6.0, up_m]).expect("visible");
                    let row = scene.row(y, 6.0);
                    assert!((row.up_m - up_m).abs() < 1e-9, "{pitch_deg}: {} {up_m}", row.up_m);
                    assert!((row.offset_m(x) - x_m).abs() < 1e-9, "{pitch_deg}: {} {x_m}", row.offset_m(x));
                }
            });
        }
    }

    #[test]
    fn a_shadow_would_be_cut_beyond_an_edge_that_the_silhouette_does_not_touch() {
        let places =
            [[320.0, 479.5], [320.0, 480.0], [0.0, 240.0], [-0.5, 240.0], [639.5, 240.0], [640.0, 240.0]];
        let cut = |at| of_block(at, 0.0, |scene| places.map(|place| scene.would_be_cut(place)));
        assert_eq!(cut([100, 400, 300, 340]), [false, true, false, true, false, true]);
        assert_eq!(cut([100, 480, 300, 340]), [false, false, false, true, false, true]);
        assert_eq!(cut([100, 400, 0, 340]), [false, true, false, false, false, true]);
        assert_eq!(cut([100, 400, 300, 640]), [false, true, false, true, false, false]);
    }

    #[test]
    fn feet_are_looked_for_below_a_silhouette_that_the_picture_cuts() {
        let rows = |at| of_block(at, 0.0, |scene| scene.feet_rows().collect::<Vec<_>>());
        let whole = rows([100, 400, 300, 340]);
        assert_eq!((whole[0], whole[1], whole.last(), whole.len()), (401.0, 400.0, Some(&101.0), 301));
        let cut = rows([80, 480, 300, 340]);
        assert_eq!((cut[0], cut.len()), (600.0, 520));
    }

    #[test]
    fn a_shrunk_picture_shows_the_same_places_in_larger_pixels() {
        let (mask, camera) = (block([90, 390, 300, 345]), camera(3.0));
        for by in [2, 3, 5] {
            let (small, shrunk_camera) = shrunk(&mask, &camera, by);
            assert_eq!(small.dim(), (480 / by, 640 / by));
            let point = [0.4, 6.0, 1.0];
            let [whole, seen] =
                [&camera, &shrunk_camera].map(|camera| camera.project(point).expect("visible"));
            // Each pixel of the copy is the middle one of its block.
            for (whole, seen) in whole.iter().zip(seen) {
                assert!((seen * by as f64 + (by / 2) as f64 - whole).abs() < 1e-9, "{by}: {whole} {seen}");
            }
            assert!(
                small.indexed_iter().all(|((y, x), set)| *set == mask[[y * by + by / 2, x * by + by / 2]])
            );
        }
    }

    #[test]
    fn a_silhouette_of_an_impossible_size_is_not_split() {
        of_block([100, 400, 300, 340], 0.0, |scene| {
            // The head is 139.5 px above the horizon: 1.2 m + 0.21 m per metre of distance.
            assert!(scene.split(2.5).is_some());
            for distance_m in [6.0, f64::NAN, f64::INFINITY] {
                assert!(scene.split(distance_m).is_none(), "{distance_m}");
            }
        });
    }
}
