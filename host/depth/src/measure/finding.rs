//! What a user should know about a map.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::mosaic;
use crate::validity::Lost;

/// Caveat of a map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Finding {
    /// A warning of the run time.
    Run(String),
    /// The run time found the images in the wrong order.
    SwappedByScene(String),
    /// No pixel has a depth.
    NoDepth,
    /// Pixels without depth.
    Lost(Lost),
    /// The near image is larger: the lens is not telecentric.
    NotTelecentric {
        /// Its measured size relative to the far image.
        magnification: f64,
        /// The value that follows from the optics.
        of_optics: f64,
    },
    /// The near image is smaller by as much as it should be larger.
    SwappedByMagnification {
        /// Its measured size relative to the far image.
        magnification: f64,
    },
    /// Both images differ by noise alone.
    EquallySharp,
    /// The images are the raw mosaic of a colour sensor.
    Mosaic,
    /// The model leaves too much.
    Unexplained {
        /// Texture beyond the noise, mean squares.
        left_over: f64,
        /// The point spread function that was assumed.
        psf: String,
        /// Largest blur radius, px.
        max_blur_px: f64,
    },
    /// Nothing rises above the noise.
    NothingSharp,
    /// Bands of brightness were evened out.
    Bands {
        /// Largest deviation from 1 of a row's relative brightness.
        amplitude: f64,
    },
    /// Lossy compression is a large part of the noise.
    Compressed {
        /// Part of the noise's variance.
        of_noise: f64,
    },
}

impl Finding {
    /// Whether the images seem to be in the wrong order.
    pub const fn is_swapped(&self) -> bool {
        matches!(self, Self::SwappedByScene(_) | Self::SwappedByMagnification { .. })
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Run(text) | Self::SwappedByScene(text) => f.write_str(text),
            Self::NoDepth => f.write_str(
                "no pixel has a depth: are the optics those of these images, and do both show one textured object within the working \
                 range?",
            ),
            Self::Lost(Lost { reason, fraction, .. }) => {
                write!(f, "{:.1} % of the map have no depth: {}", 100.0 * fraction, reason.words())
            }
            Self::NotTelecentric { magnification, of_optics } => write!(
                f,
                "the near image is {:.3} % larger, as by a lens that is not telecentric ({:.3} %): say telecentric = false in \
                 [lens]",
                100.0 * (magnification - 1.0),
                100.0 * (of_optics - 1.0)
            ),
            Self::SwappedByMagnification { magnification } => write!(
                f,
                "the pair looks swapped: the near image is {:.3} % smaller than the far one, and by its optics it is larger; is FAR \
                 really the far-focused image?",
                100.0 * (1.0 - magnification)
            ),
            Self::Unexplained { left_over, psf, max_blur_px } => write!(
                f,
                "the model leaves {:.1} % of the detail unexplained (usual is below 2): is the PSF {psf} with a blur of up to \
                 {max_blur_px:.3} px right? farnear calibrate psf finds it. A tone curve (sRGB, a camera's JPEG), another black level \
                 in one image and hot pixels (farnear calibrate camera) do the same",
                100.0 * left_over.sqrt()
            ),
            Self::EquallySharp => f.write_str(
                "the images differ by noise alone: did the focus move between them? Only a plane in the middle of the working range \
                 looks the same in both",
            ),
            Self::Mosaic => f.write_str(mosaic::WORDS),
            Self::Bands { amplitude } => write!(
                f,
                "bands of brightness of up to {:.1} % across one image were evened out: a lamp that flickers and a rolling shutter?",
                100.0 * amplitude
            ),
            Self::Compressed { of_noise } => write!(
                f,
                "compression (JPEG) is {:.0} % of the noise, which makes depth less exact: save PNG or TIFF, or JPEG of quality 95",
                100.0 * of_noise
            ),
            Self::NothingSharp => f.write_str(
                "neither image has detail above its noise: the scene lies far outside the range, or has none",
            ),
        }
    }
}
