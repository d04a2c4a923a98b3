//! Scenes: a height field over the image and what it is painted with.
//!
//! Depths in mm from the lens. The lens is telecentric, so a place of the surface keeps its image position whatever
//! its depth, and the height field lives in image coordinates (px, the centre of the first pixel at 0.5, 0.5). Named
//! shapes span the lens's working range exactly, far focus to near focus; outside the image they go on.

use ndarray::Array2;
use thiserror::Error;

use crate::camera::Camera;
use crate::lens::Lens;
use crate::texture::Texture;

/// A surface with its paint. Text form as in [`Scene::from_str`](std::str::FromStr).
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Where the surface lies.
    pub shape: Shape,
    /// What it is painted with, unless the height map brings its own texture.
    pub texture: Texture,
    /// Standard deviation of the texture, the mean being 1.
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
    /// A cone towards the camera: near focus at the tip in the image's centre, far focus from half the image's
    /// larger side outwards.
    Cone,
    /// A cap of 60 degrees half-angle of a ball, stretched along the axis to span the range; as wide as the cone.
    Sphere,
    /// A height field from a file.
    HeightMap(Box<HeightMap>),
}

/// A height field and, if it has one, its own texture; both are stretched over the image.
#[derive(Debug, Clone, PartialEq)]
pub struct HeightMap {
    depth_mm: Array2<f32>,
    texture: Option<Array2<f32>>,
}

/// Why a scene was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SceneError {
    /// A name that is no scene.
    #[error("unknown scene {0:?}, expected plane:MM, staircase, slant, cone or sphere")]
    Unknown(String),
    /// An option that the scene does not have, or without a value.
    #[error("scene {scene}: unknown option {option:?}, expected texture=sand|fractal, contrast=NUMBER{more}")]
    Option {
        /// The scene.
        scene: String,
        /// The option.
        option: String,
        /// Options of this scene only.
        more: &'static str,
    },
    /// A value that makes no sense.
    #[error("scene: {name} = {value}, expected {expected}")]
    Value {
        /// The option.
        name: &'static str,
        /// What was given.
        value: String,
        /// What it has to be.
        expected: &'static str,
    },
    /// A map without pixels.
    #[error("scene: the {what} map is {height} x {width}, expected at least 1 x 1")]
    Empty {
        /// `depth` or `texture`.
        what: &'static str,
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
    },
    /// A value of a map that is not finite, or not above 0.
    #[error("scene: the {what} map holds {value} at row {row}, column {column}, expected {expected}")]
    MapValue {
        /// `depth` or `texture`.
        what: &'static str,
        /// The value.
        value: f32,
        /// Row.
        row: usize,
        /// Column.
        column: usize,
        /// What it has to be.
        expected: &'static str,
    },
}

impl HeightMap {
    /// A surface from its depths in mm (rows from the top) and, if given, its radiance (0 or more in any unit;
    /// it is scaled to a mean of 1). Both may have any size.
    ///
    /// # Errors
    /// [`SceneError::Empty`] and [`SceneError::MapValue`] name what no surface can have.
    pub fn new(depth_mm: Array2<f32>, texture: Option<Array2<f32>>) -> Result<Self, SceneError> {
        check_map("depth", &depth_mm, "a finite depth in mm above 0", |value| value > 0.0)?;
        let texture = match texture {
            None => None,
            Some(mut texture) => {
                check_map("texture", &texture, "a finite radiance of 0 or more", |value| value >= 0.0)?;
                let mean = texture.iter().map(|&value| f64::from(value)).sum::<f64>() / texture.len() as f64;
                if mean <= 0.0 {
                    let expected = "some light somewhere";
                    return Err(SceneError::MapValue {
                        what: "texture",
                        value: 0.0,
                        row: 0,
                        column: 0,
                        expected,
                    });
                }
                texture.mapv_inplace(|value| (f64::from(value) / mean) as f32);
                Some(texture)
            }
        };
        Ok(Self { depth_mm, texture })
    }

    /// The map's own texture, mean 1.
    pub(crate) fn texture(&self) -> Option<&Array2<f32>> {
        self.texture.as_ref()
    }
}

fn check_map(
    what: &'static str,
    map: &Array2<f32>,
    expected: &'static str,
    good: impl Fn(f32) -> bool,
) -> Result<(), SceneError> {
    let (height, width) = map.dim();
    if map.is_empty() {
        return Err(SceneError::Empty { what, height, width });
    }
    match map.indexed_iter().find(|&(_, &value)| !(value.is_finite() && good(value))) {
        None => Ok(()),
        Some(((row, column), &value)) => Err(SceneError::MapValue { what, value, row, column, expected }),
    }
}

/// `map` stretched over an image, at the relative position `x`, `y` (0..1 over the image; mirrored outside), bilinear
/// between the centres of its pixels.
pub(crate) fn sample_map(map: &Array2<f32>, x: f64, y: f64) -> f64 {
    let (height, width) = map.dim();
    let taps = |position: f64, size: usize| {
        let position = position * size as f64 - 0.5;
        let low = position.floor();
        let index = |i: f64| {
            // Mirror about the outer edges: ... 1 0 | 0 1 2 ... n-1 | n-1 n-2 ...
            let folded = (i as i64).rem_euclid(2 * size as i64) as usize;
            if folded < size { folded } else { 2 * size - 1 - folded }
        };
        (index(low), index(low + 1.0), position - low)
    };
    let (left, right, fx) = taps(x, width);
    let (top, bottom, fy) = taps(y, height);
    let at = |row: usize, column: usize| f64::from(map[[row, column]]);
    let upper = at(top, left) + fx * (at(top, right) - at(top, left));
    let lower = at(bottom, left) + fx * (at(bottom, right) - at(bottom, left));
    upper + fy * (lower - upper)
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
            Shape::HeightMap(map) => sample_map(&map.depth_mm, x_px / width, y_px / height),
        }
    }
}
