//! A depth map with confidence and warnings.

use std::fmt;

use ndarray::{Array2, Axis};
use rayon::prelude::*;

use crate::psf::Psf;

/// A depth map with its quality.
#[derive(Debug, Clone)]
pub struct DepthMap {
    /// Object distance in mm, (height, width); NaN = no value.
    pub depth_mm: Array2<f32>,
    /// Confidence, 0 (none) to 1; 0 exactly where the depth is NaN.
    pub confidence: Array2<f32>,
    /// Pixels interpolated from their surroundings; `None` without any.
    pub filled: Option<Array2<bool>>,
    /// Part of the pixels with texture energy below [`LOW_TEXTURE`](crate::confidence::LOW_TEXTURE) times the median.
    pub low_texture_fraction: f64,
    /// Caveats of the map.
    pub warnings: Vec<Warning>,
}

impl DepthMap {
    /// Part of the pixels that have a depth; NaN without pixels.
    pub fn valid_fraction(&self) -> f64 {
        let rows = self.depth_mm.axis_iter(Axis(0)).into_par_iter();
        // 32-bit sums are vectorised.
        let valid =
            rows.map(|row| u64::from(row.iter().map(|depth| u32::from(depth.is_finite())).sum::<u32>()));
        valid.sum::<u64>() as f64 / self.depth_mm.len() as f64
    }
}

/// Caveat of a map.
#[derive(Debug, Clone, PartialEq)]
pub enum Warning {
    /// Pixels are NaN or infinite.
    NotFinite {
        /// Number of pixels affected in at least one image.
        pixels: usize,
    },
    /// Flat patches share the pair's largest value: saturated.
    Saturated {
        /// Part of the pixels affected in at least one image.
        fraction: f64,
    },
    /// The operators were designed for another PSF than the optics have.
    PsfMismatch {
        /// PSF of the operators; boxed, for a measured one is long.
        operators: Box<Psf>,
        /// PSF of the optics.
        optics: Box<Psf>,
    },
    /// The images seem to be swapped, judged by the scene, because swapping only negates alpha; planes never warn.
    LooksSwapped(SwapEvidence),
    /// The texture is unlike that of the target from which the lens was learned.
    OtherTexture {
        /// Coarser, or finer.
        is_coarser: bool,
    },
}

/// Evidence for a swapped pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SwapEvidence {
    /// Depth rises from the upper through the middle to the lower third; grounds and tables do the opposite.
    LowerPartFarther {
        /// Difference of the median depths, mm.
        difference_mm: f64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite { pixels } => {
                write!(f, "{pixels} pixels are NaN or infinite: no depth around them")
            }
            Self::Saturated { fraction } => {
                write!(f, "{:.1} % of the pixels are saturated: no depth around them", 100.0 * fraction)
            }
            Self::PsfMismatch { operators, optics } => write!(
                f,
                "the operators were designed for the PSF {operators}, the optics have {optics}: expect errors of millimetres"
            ),
            Self::OtherTexture { is_coarser } => write!(
                f,
                "most of the texture is {} than that of the target of calibrate stack: depth may be off by some percent of the range, \
                 beyond its deviation; calibrate on a target like the object",
                if *is_coarser { "coarser" } else { "finer" }
            ),
            Self::LooksSwapped(evidence) => {
                write!(f, "the pair looks swapped: ")?;
                match evidence {
                    SwapEvidence::LowerPartFarther { difference_mm } => {
                        // Two digits: a microscope's range is a fraction of a mm.
                        let decimals = (1.0 - difference_mm.abs().log10().floor()).clamp(0.0, 6.0) as usize;
                        write!(
                            f,
                            "the lower part of the scene would lie {difference_mm:.decimals$} mm farther away than the upper part"
                        )?;
                    }
                }
                write!(f, "; is FAR really the far-focused image?")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_and_large_distances_have_two_digits() {
        for (difference_mm, digits) in
            [(412.3, "lie 412 mm"), (46.2, "lie 46 mm"), (0.332, "lie 0.33 mm"), (0.000_61, "lie 0.00061 mm")]
        {
            let text = Warning::LooksSwapped(SwapEvidence::LowerPartFarther { difference_mm }).to_string();
            assert!(text.contains(digits), "{text}");
        }
    }
}
