//! Bodies made of capsules: a cylinder with round ends about each bone, enough to dress joints with flesh.

/// A point in space, millimetres.
pub type Point3 = [f64; 3];

/// All points nearer than `radius_mm` to the segment from `from` to `to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    pub from: Point3,
    /// The other end; equal to `from` it makes a sphere.
    pub to: Point3,
    /// Radius in millimetres.
    pub radius_mm: f64,
}

impl Capsule {
    /// From the ends of its axis and its radius.
    pub fn new(from: Point3, to: Point3, radius_mm: f64) -> Self {
        Self { from, to, radius_mm }
    }

    /// Whether every number is finite and the radius not negative.
    pub fn is_finite(&self) -> bool {
        self.from.iter().chain(&self.to).all(|v| v.is_finite()) && self.radius_mm >= 0.0
    }
}
