//! Scenes: a height field over the image and what it is painted with.
//!
//! Depths in mm from the lens. The lens is telecentric, so a place of the surface keeps its image position
//! whatever its depth, and the height field lives in image coordinates (px, the centre of the first pixel
//! at 0.5, 0.5). Named shapes span the lens's working range exactly, far focus to near focus; outside the
//! image they go on.

use crate::camera::Camera;
use crate::lens::Lens;
use crate::maps::HeightMap;
use crate::texture::Texture;

/// A surface with its paint. Text form as in [`Scene::from_str`](std::str::FromStr).
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Where the surface lies.
    pub shape: Shape,
    /// What it is painted with.
    pub texture: Texture,
    /// Standard deviation of a random texture, the mean being 1; a picture has its own.
    pub contrast: f64,
}

/// Where the surface lies.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A plane across the axis.
    Plane {
        /// Its depth, mm.
        depth_mm: f64,
    },
    /// Upright steps of equal width and equal height, far focus on the left, near focus on the right.
    Staircase {
        /// Number of levels, 2 or more.
        steps: usize,
    },
    /// A plane tilted about the vertical, far focus at the left border, near focus at the right one.
    Slant,
    /// A cone towards the camera: near focus at the tip in the image's centre, far focus from half the
    /// image's larger side outwards.
    Cone,
    /// A cap of 60 degrees half-angle of a ball, stretched along the axis to span the range; as wide as the
    /// cone.
    Sphere,
    /// A height field given as an array, stretched over the image.
    HeightMap(HeightMap),
}

impl Scene {
    /// A scene over sand of contrast 0.2.
    #[must_use]
    pub fn new(shape: Shape) -> Self {
        Self { shape, texture: Texture::Sand, contrast: 0.2 }
    }

    /// Depth of the surface at the image position `x_px`, `y_px`, mm.
    #[must_use]
    pub fn depth_mm(&self, lens: &Lens, camera: &Camera, x_px: f64, y_px: f64) -> f64 {
        let (far, near) = (lens.far_mm, lens.near_mm);
        let (width, height) = (camera.width_px as f64, camera.height_px as f64);
        // Relative distance from the image's centre: 1 at half the larger side.
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
