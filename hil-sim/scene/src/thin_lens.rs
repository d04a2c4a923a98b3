//! The thin lens, `1/F = 1/u + 1/w`.

/// Image distance of an object at `object_mm`, mm.
#[must_use]
pub fn image_distance_mm(focal_length_mm: f64, object_mm: f64) -> f64 {
    1.0 / (1.0 / focal_length_mm - 1.0 / object_mm)
}
