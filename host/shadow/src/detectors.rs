//! Image-based shadow detectors: which foreground pixels are shadow, told from the pictures alone.
//!
//! The five that Li 2014 (tables 8.1 and 8.2) compares his own cut with, as chosen and described by Sanin,
//! Sanderson and Lovell, "Shadow detection: a survey and comparative evaluation of recent methods", Pattern
//! Recognition 45 (2012), 1684-1695. Each is built from its own paper, named in its module; thresholds are this
//! project's. All need the picture of the empty scene ([`farnear_silhouettes::background::BackgroundModel::background`]) and
//! colour. [`crate::synthetic::pictures`] makes pictures whose shadow is known to score them on.
//!
//! The limits that the survey names hold here too: chromaticity fails on grey clothes, geometry on shadows that fall
//! under the body's own columns, texture on smooth ground.

pub mod chromaticity;
pub mod geometry;
mod images;
pub mod large_region;
pub mod physical;
pub mod small_region;

use std::fmt;
use std::str::FromStr;

pub use images::{Images, ImagesError};

use farnear_silhouettes::mask::Mask;

/// One of the five detectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Method {
    /// Hue and saturation stay while the value drops (Cucchiara et al. 2003).
    Chromaticity,
    /// The colour change points away from the light source's colour, learnt per scene (Huang and Chen 2009).
    Physical,
    /// The part of the region that leans away from the upright body (Hsieh et al. 2003).
    Geometry,
    /// Gabor texture around each pixel stays (Leone and Distante 2007).
    SmallRegionTexture,
    /// Gradient directions over a whole candidate region stay (Sanin et al. 2010).
    LargeRegionTexture,
}

impl Method {
    /// All five, in the order of the thesis' tables.
    pub const ALL: [Self; 5] = [
        Self::Chromaticity,
        Self::Physical,
        Self::Geometry,
        Self::SmallRegionTexture,
        Self::LargeRegionTexture,
    ];

    /// The name that [`FromStr`] reads.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Chromaticity => "chromaticity",
            Self::Physical => "physical",
            Self::Geometry => "geometry",
            Self::SmallRegionTexture => "small-region-texture",
            Self::LargeRegionTexture => "large-region-texture",
        }
    }
}

/// One of the detectors with its default settings, ready for a sequence of frames.
#[derive(Clone, Debug)]
pub enum Detector {
    /// See [`chromaticity`].
    Chromaticity(chromaticity::Settings),
    /// See [`physical`]; learns from frame to frame.
    Physical(physical::Physical),
    Geometry(geometry::Settings),
    /// See [`small_region`].
    SmallRegionTexture(small_region::Settings),
    /// See [`large_region`].
    LargeRegionTexture(large_region::Settings),
}

impl Detector {
    /// The detector of this name with its default settings.
    #[must_use]
    pub fn new(method: Method) -> Self {
        match method {
            Method::Chromaticity => Self::Chromaticity(chromaticity::Settings::default()),
            Method::Physical => Self::Physical(physical::Physical::new(physical::Settings::default())),
            Method::Geometry => Self::Geometry(geometry::Settings::default()),
            Method::SmallRegionTexture => Self::SmallRegionTexture(small_region::Settings::default()),
            Method::LargeRegionTexture => Self::LargeRegionTexture(large_region::Settings::default()),
        }
    }

    /// The shadow pixels among the foreground of the next frame, shape (height, width).
    pub fn detect(&mut self, images: &Images<'_>) -> Mask {
        match self {
            Self::Chromaticity(settings) => chromaticity::detect(images, settings),
            Self::Physical(detector) => detector.detect(images),
            Self::Geometry(settings) => geometry::detect(images, settings),
            Self::SmallRegionTexture(settings) => small_region::detect(images, settings),
            Self::LargeRegionTexture(settings) => large_region::detect(images, settings),
        }
    }
}

/// A name that is none of the five.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is not a shadow detector; choose chromaticity, physical, geometry, small-region-texture or large-region-texture"
)]
pub struct UnknownMethod(pub String);

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Method {
    type Err = UnknownMethod;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|method| method.name() == text).ok_or_else(|| UnknownMethod(text.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        for method in Method::ALL {
            assert_eq!(method.name().parse(), Ok(method));
        }
        assert!("colour".parse::<Method>().unwrap_err().to_string().contains("chromaticity"));
    }
}
