//! Seeded scenes: a walking person on level ground under the sun, with true body (each capsule's image) and shadow
//! (hull of its end spheres' outlines along the rays). Independent of [`crate::projection`], to show its errors.

use crate::camera::{Camera, CameraFile, StandardDeviations, SubjectPrior};
use crate::score::Truth;
use crate::sun::SunPosition;
use farnear_silhouettes::mask::Mask;
use farnear_silhouettes::silhouette::{
    capsule::Capsule,
    raster::{convex_hull, fill_convex, fill_discs_hull},
};
use farnear_silhouettes::synthetic::body::{Build, Pose, joints, walking};
use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Level camera, upright person, shadow sideways or towards the camera.
    Standard,
    Pitched,
    Bending,
    /// Shadow behind the person (within 60 degrees of straight away).
    Behind,
}

#[derive(Clone, Debug)]
pub struct Scene {
    pub body: Mask,
    /// Shadow on the ground, including hidden parts.
    pub shadow: Mask,
    pub silhouette: Mask,
    pub camera: CameraFile,
    pub sun: SunPosition,
    /// [right, distance] of the person.
    pub stands_at_m: [f64; 2],
    pub height_m: f64,
}

impl Scene {
    pub fn truth(&self) -> Array2<Truth> {
        Array2::from_shape_fn(self.body.dim(), |i| match (self.body[i], self.shadow[i]) {
            (true, _) => Truth::Subject,
            (false, true) => Truth::Shadow,
            (false, false) => Truth::Background,
        })
    }
}

/// Draws scene `seed` at 640 x 480; redraws if person or shadow leave the image.
pub fn scene(kind: Kind, seed: u64) -> Scene {
    let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(4).wrapping_add(kind as u64));
    loop {
        let drawn = draw(kind, &mut rng);
        let inside = |mask: &Mask| {
            let (h, w) = mask.dim();
            !(0..w).any(|x| mask[[0, x]] || mask[[h - 1, x]])
                && !(0..h).any(|y| mask[[y, 0]] || mask[[y, w - 1]])
        };
        let visible = drawn.shadow.iter().zip(&drawn.body).filter(|&(&s, &b)| s && !b).count();
        if inside(&drawn.silhouette) && visible > 300 {
            return drawn;
        }
    }
}

fn draw(kind: Kind, rng: &mut ChaCha8Rng) -> Scene {
    let camera = Camera {
        height_m: rng.random_range(0.8..3.0),
        azimuth_deg: rng.random_range(0.0..360.0),
        pitch_deg: if kind == Kind::Pitched { rng.random_range(5.0..15.0) } else { 0.0 },
        focal_length_mm: 4.0,
        pixel_um: 6.0,
        width_px: 640,
        height_px: 480,
        principal_point_px: None,
    };
    // Shadow direction on the ground in the camera's frame, degrees from right towards front.
    let direction_deg = match kind {
        Kind::Behind => rng.random_range(30.0..150.0),
        _ => rng.random_range(-210.0..30.0),
    };
    let sun = SunPosition {
        elevation_deg: rng.random_range(20.0..62.0),
        azimuth_deg: (270.0 - direction_deg - camera.azimuth_deg).rem_euclid(360.0),
    };
    let stature: f64 = 1.75 + 0.07 * rng.random_range(-1.7..1.7);
    let build = Build {
        height_mm: 1e3 * stature,
        girth: rng.random_range(0.9..1.15),
        breadth: rng.random_range(0.92..1.1),
        leg: rng.random_range(0.96..1.04),
    };
    let mut pose: Pose = walking(rng.random_range(0.0..1.0), rng.random_range(0.6..1.2));
    if kind == Kind::Bending {
        pose.lean_deg = rng.random_range(40.0..80.0);
    }
    let at = [rng.random_range(-1.2..1.2), rng.random_range(5.0..10.0)];
    let mut person = joints(&build, &pose);
    person.place(rng.random_range(0.0..360.0), [1e3 * at[0], 1e3 * at[1]]);
    let capsules = person.capsules(&build);
    let (body, shadow) = render(&capsules, &camera, direction_deg, sun.elevation_deg);
    let silhouette = Mask::from_shape_fn(body.dim(), |i| body[i] || shadow[i]);
    let camera = CameraFile {
        camera,
        subject: SubjectPrior::default(),
        standard_deviations: StandardDeviations::default(),
    };
    Scene { body, shadow, silhouette, camera, sun, stands_at_m: at, height_m: stature }
}

/// Renders capsules (mm, camera's ground frame); `direction_deg` is from the camera's right.
pub fn render(capsules: &[Capsule], camera: &Camera, direction_deg: f64, elevation_deg: f64) -> (Mask, Mask) {
    const RING: usize = 20;
    let shape = (camera.height_px, camera.width_px);
    let (mut body, mut shadow) = (Mask::default(shape), Mask::default(shape));
    let per_height = 1.0 / elevation_deg.to_radians().tan();
    let along = [direction_deg.to_radians().cos(), direction_deg.to_radians().sin()];
    // A sphere's terminator is a great circle perpendicular to the rays: across the shadow's ground
    // direction, and perpendicular to that and to the ray.
    let (se, ce) = elevation_deg.to_radians().sin_cos();
    let across = [-along[1], along[0], 0.0];
    let upward = [along[0] * se, along[1] * se, ce];
    for capsule in capsules {
        let radius_m = 1e-3 * capsule.radius_mm;
        let ends = [capsule.from, capsule.to].map(|p| p.map(|v| 1e-3 * v));
        let discs = ends.map(|end| {
            let depth = camera.depth_m(end);
            camera.project(end).map(|centre| (centre, camera.focal_px() * radius_m / depth))
        });
        if let [Some(a), Some(b)] = discs {
            fill_discs_hull(&mut body, a, b);
        }
        let mut cast = Vec::with_capacity(2 * RING);
        for end in ends {
            for i in 0..RING {
                let (s, c) = (std::f64::consts::TAU * i as f64 / RING as f64).sin_cos();
                let p: [f64; 3] =
                    std::array::from_fn(|k| end[k] + radius_m * (c * across[k] + s * upward[k]));
                let fall = p[2].max(0.0) * per_height;
                cast.extend(camera.project([p[0] + fall * along[0], p[1] + fall * along[1], 0.0]));
            }
        }
        fill_convex(&mut shadow, &convex_hull(&cast));
    }
    (body, shadow)
}
