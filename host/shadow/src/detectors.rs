//! Image-based shadow detectors: which foreground pixels are shadow. The five that Li 2014 (tables 8.1 and
//! 8.2) compares with, described by Sanin, Sanderson and Lovell, "Shadow detection: a survey and comparative
//! evaluation of recent methods", Pattern Recognition 45 (2012). Thresholds are this project's. All need
//! colour and the empty scene. Known limits: chromaticity fails on grey clothes, geometry on shadows under
//! the body's own columns, texture on smooth ground.

mod chromaticity;
mod geometry;
mod images;
mod large_region;
mod physical;
mod small_region;

pub use images::{Images, ImagesError};

use farnear_silhouettes::mask::Mask;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Method {
    /// Hue and saturation stay while the value drops (Cucchiara et al. 2003).
    Chromaticity,
    /// The colour changes along the light's colour, learnt per scene (Huang and Chen 2009).
    Physical,
    /// The part that leans away from the upright body (Hsieh et al. 2003).
    Geometry,
    /// Gabor texture around each pixel stays (Leone and Distante 2007).
    SmallRegionTexture,
    /// Gradient directions over a whole region stay (Sanin et al. 2010).
    LargeRegionTexture,
}

impl Method {
    /// In the order of the thesis' tables.
    pub const ALL: [Self; 5] = [
        Self::Chromaticity,
        Self::Physical,
        Self::Geometry,
        Self::SmallRegionTexture,
        Self::LargeRegionTexture,
    ];
}

farnear_silhouettes::named!(
    Method, "shadow detector",
    "chromaticity" => Chromaticity,
    "physical" => Physical,
    "geometry" => Geometry,
    "small-region-texture" => SmallRegionTexture,
    "large-region-texture" => LargeRegionTexture
);

#[derive(Clone, Debug)]
pub struct Detector {
    method: Method,
    /// Learns from frame to frame; the others do not.
    physical: physical::Physical,
}

impl Detector {
    #[must_use]
    pub fn new(method: Method) -> Self {
        Self { method, physical: physical::Physical::default() }
    }

    pub fn detect(&mut self, images: &Images<'_>) -> Mask {
        match self.method {
            Method::Chromaticity => chromaticity::detect(images, &chromaticity::LIMITS),
            Method::Physical => self.physical.detect(images),
            Method::Geometry => geometry::detect(images),
            Method::SmallRegionTexture => small_region::detect(images),
            Method::LargeRegionTexture => large_region::detect(images),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for method in Method::ALL {
            assert_eq!(method.to_string().parse(), Ok(method));
        }
        assert!("colour".parse::<Method>().unwrap_err().to_string().contains("chromaticity"));
    }
}
