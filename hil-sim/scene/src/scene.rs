//! Scenes: a height field (mm from the lens) and its texture. The lens is telecentric, so a point keeps its image
//! position at any depth; the field uses image coordinates (px, centre of the first pixel at 0.5, 0.5). Named shapes
//! span far to near focus exactly and continue outside the image.

use crate::camera::Camera;
use crate::lens::Lens;
use crate::maps::HeightMap;
use crate::texture::Texture;

/// A textured surface. Text form: [`Scene::from_str`](std::str::FromStr).
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Shape of the surface.
    pub shape: Shape,
    /// Texture of the surface.
    pub texture: Texture,
    /// Standard deviation of a random texture of mean 1; pictures ignore it.
    pub contrast: f64,
}

/// Shape of the surface.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// Plane perpendicular to the axis.
    Plane {
        /// Depth of the plane, mm.
        depth_mm: f64,
    },
    /// Steps of equal width and height, far focus left, near focus right.
    Staircase {
        /// Number of levels, at least 2.
        steps: usize,
    },
    /// Plane tilted about the vertical, far focus at the left border, near focus at the right.
    Slant,
    /// Cone: near focus at the centre, far focus from half the larger image side outwards.
    Cone,
    /// Ball cap of 60 degrees half-angle, stretched to span the range; as wide as the cone.
    Sphere,
    /// Height field, stretched over the image.
    HeightMap(HeightMap),
}

impl Scene {
    /// A scene over sand of contrast 0.2.
    #[must_use]
    pub fn new(shape: Shape) -> Self {
        Self { shape, texture: Texture::Sand, contrast: 0.2 }
    }

    /// Depth at the image position `x_px`, `y_px`, mm.
    #[must_use]
    pub fn depth_mm(&self, lens: &Lens, camera: &Camera, x_px: f64, y_px: f64) -> f64 {
        let (far, near) = (lens.far_mm, lens.near_mm);
        let (width, height) = (camera.width_px as f64, camera.height_px as f64);
        // Relative distance from the centre: 1 at half the larger side.
        let rho = || (x_px - 0.5 * width).hypot(y_px - 0.5 * height) / (0.5 * width.max(height));
        match &self.shape {
            Shape::Plane { depth_mm } => *depth_mm,
            Shape::Staircase { steps } => {
                let last = steps.saturating_sub(1).max(1) as f64;
                let level = (x_px / width * *steps as f64).floor().clamp(0.0, last);
                far + (near - far) * level / last
            }
            Shape::Slant => far + (near - far) * (x_px / width).clamp(0.0, 1.0),
            Shape::Cone => near + (far - near) * rho().min(1.0),
            Shape::Sphere => {
                let rho = rho().min(1.0);
                // Sine and cosine of 60 degrees.
                let (rim_radius, rim_height) = (0.75f64.sqrt(), 0.5);
                let height = (1.0 - (rho * rim_radius).powi(2)).sqrt();
                far + (near - far) * (height - rim_height) / (1.0 - rim_height)
            }
            Shape::HeightMap(map) => map.depth_mm(x_px / width, y_px / height),
        }
    }
}
