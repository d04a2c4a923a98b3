//! Normalised depth to mm for the run time.

use crate::operators::Operators;
use crate::operators::linearise::Polynomial;
use crate::optics::Optics;

/// Alpha to mm in single precision without cancellation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DepthOfAlpha {
    focal_length_mm: f32,
    focal_length_squared: f32,
    offset: f32,
    slope: f32,
    linearisation: [f32; 4],
}

impl DepthOfAlpha {
    pub(crate) fn new(operators: &Operators, optics: &Optics) -> Self {
        Self::linear(optics, *operators.linearisation())
    }

    pub(crate) fn linear(optics: &Optics, linearisation: Polynomial) -> Self {
        let [offset, slope] = optics.defocus_line_mm();
        let f = optics.focal_length_mm();
        Self {
            focal_length_mm: f as f32,
            focal_length_squared: (f * f) as f32,
            offset: offset as f32,
            slope: slope as f32,
            linearisation: linearisation.map(|c| c as f32),
        }
    }

    pub(crate) fn linearisation(self) -> [f32; 4] {
        self.linearisation
    }

    /// `[F, F^2, offset, slope]` of `F + F^2 / (offset + slope alpha)`.
    pub(crate) fn coefficients(self) -> [f32; 4] {
        [self.focal_length_mm, self.focal_length_squared, self.offset, self.slope]
    }

    pub(crate) fn depth_mm(self, alpha: f32) -> f32 {
        let square = alpha * alpha;
        let alpha = alpha * self.linearisation.iter().rev().fold(0.0, |sum, c| sum * square + c);
        self.focal_length_mm + self.focal_length_squared / (self.offset + self.slope * alpha)
    }
}
