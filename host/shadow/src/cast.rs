//! A silhouette explained as a body and the shadow that this body throws: what `hybrid` does where the light's place is known.
//!
//! The body stands in an upright plane at the subject's distance, as deep as it is wide up to 0.17 of the stature. Its rows are read from the head downwards: every run of
//! pixels throws the ellipse of its own width on the ground, at the place that its height and the light say, and what lies in the shadow thrown so far is shadow, unless
//! the body goes on there from the row above. Below the feet there is no body, and near the ground none beside the legs.
//!
//! Only the subject's distance has to be known, and the silhouette tells it: with a wrong one the shadow thrown does not lie on the one that was seen. All distances that put the feet
//! into the silhouette are tried on a small copy. No head is measured, so that people may bend, and no direction in
//! the picture is used, so that the camera may be pitched.
//!
//! Cost: O(tries x pixels of the small copy); 640 x 480 takes some milliseconds.

use super::camera::{Camera, CameraFile};
use super::light::Light;
use super::projection::{ShadowError, Subject};
use farnear_silhouettes::mask::{BoundingBox, Mask};
use farnear_silhouettes::silhouette::raster::{Point, fill_convex};

/// Half the depth of a body, of its stature: a chest is 0.17 deep without clothes and arms.
const DEEPEST: f64 = 0.086;
/// How much wider than drawn a shadow is taken: a run is cut at pixels, and a shadow's edge is soft.
const WIDER: f64 = 1.05;
/// Below this height, of the stature, there are legs only (knees are at 0.285).
const LEGS: f64 = 0.26;
/// How far legs reach beside the thighs, of the stature: a stride.
const REACH: f64 = 0.26;
/// Heights between which the thighs are, of the stature: their middle is where the legs come from.
const THIGHS: [f64; 2] = [0.23, 0.46];
/// How far below the feet's middle a foot nearer to the camera may be seen, of the stature.
const BELOW: f64 = 0.028;
/// Where shadow lies beside or behind it, a body is taken to become narrower from row to row, by a pixel on either side in so many rows.
const NARROWS: usize = 3;
/// Statures that a silhouette may come to, of the subject's: who bends or crouches is low, and a head's hair and a lifted hand are above it.
const STATURES: [f64; 2] = [0.35, 1.2];
/// Rows of the copy on which distances are tried.
const TRIED_ROWS: usize = 45;
/// Share of silhouette and shadow that may stay unexplained.
const UNEXPLAINED: f64 = 0.4;

/// How a silhouette was explained.
#[derive(Clone, Debug)]
pub struct Explanation {
    /// The silhouette's pixels that are the body's.
    pub body: Mask,
    /// The shadow that the body throws, also where it lies hidden or beside the silhouette.
    pub thrown: Mask,
    /// Where the subject stands.
    pub subject: Subject,
    /// Pixels that neither body nor shadow explains, and of the shadow beside the silhouette, as a share of the silhouette's.
    pub unexplained: f64,
}

/// Explains the silhouette; `None` where the light's place is not known, or where no distance explains enough of it.
///
/// # Errors
/// A light that throws no usable shadow.
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
            // The row of the feet is known to half a row of the small copy, which is enough: the body as a whole throws the shadow.
            whole.split(near.subject.distance_m)
        }
    };
    Ok(best.filter(|found| found.unexplained <= UNEXPLAINED || file.subject.distance_m.is_some()))
}

/// Every `by`th pixel of a mask, and the camera that would have taken it.
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

/// A silhouette and how it came to be.
#[derive(Clone, Copy)]
struct Scene<'a> {
    mask: &'a Mask,
    bounds: BoundingBox,
    camera: &'a Camera,
    light: Light,
    stature_m: f64,
}

/// A row's pixels of the body, from the first to the last.
type Run = (usize, usize);

/// A row of the upright plane in which a body stands.
#[derive(Clone, Copy)]
struct Row {
    up_m: f64,
    pixel_m: f64,
    /// The column straight ahead of the camera.
    ahead_px: f64,
}

impl Row {
    fn offset_m(self, x: f64) -> f64 {
        (x - self.ahead_px) * self.pixel_m
    }
}

/// What is counted from the head downwards.
struct Split {
    body: Mask,
    thrown: Mask,
    unexplained: usize,
    thighs_m: f64,
    thigh_pixels: usize,
}

impl Scene<'_> {
    /// The rows in which the feet may be, upwards; a silhouette that the picture's lower edge cuts has them below.
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

    /// A row of the upright plane at a distance.
    fn row(&self, y: f64, distance_m: f64) -> Row {
        let [cx, cy] = self.camera.principal_point();
        let focal = self.camera.focal_px();
        let (s, c) = self.camera.pitch_deg.to_radians().sin_cos();
        let down = (y - cy) / focal;
        let along = distance_m / (c - down * s);
        Row { up_m: self.camera.height_m - along * (s + down * c), pixel_m: along / focal, ahead_px: cx }
    }

    /// Body and shadow if the subject stands at a distance; `None` where nobody can be that large or small.
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
        let beside = self.mask.iter().zip(&split.thrown).filter(|&(&seen, &thrown)| thrown && !seen).count();
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
        })
    }

    /// Tells a row's pixels apart and gives the body's.
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

    /// Draws the shadow of a run of the body's pixels: an ellipse on the ground.
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
            // In front of the lens as a whole, or there is nothing to draw.
            let Some(seen) = self.camera.project(on_ground) else { return };
            *corner = seen;
        }
        fill_convex(&mut split.thrown, &corners);
    }

    /// Whether a shadow at that place lies beyond an edge of the picture that the silhouette does not touch.
    fn would_be_cut(&self, [x, y]: [f64; 2]) -> bool {
        let (rows, columns) = self.mask.dim();
        (y >= rows as f64 && self.bounds.bottom < rows)
            || (x < 0.0 && self.bounds.left > 0)
            || (x >= columns as f64 && self.bounds.right < columns)
    }
}
