/// Coordinates x, y and z in millimetres.
pub type Point3 = [f64; 3];

/// All points within `radius_mm` of the segment from `from` to `to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    pub from: Point3,
    /// Equal to `from` for a sphere.
    pub to: Point3,
    pub radius_mm: f64,
}

impl Capsule {
    pub fn new(from: Point3, to: Point3, radius_mm: f64) -> Self {
        Self { from, to, radius_mm }
    }

    /// All numbers are finite and the radius is not negative.
    pub fn is_finite(&self) -> bool {
        self.from.iter().chain(&self.to).all(|v| v.is_finite()) && self.radius_mm >= 0.0
    }
}
