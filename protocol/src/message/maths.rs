//! Mathematics on the board: depth correction by rows, its fit, and sun and shadow. Depths are Q1.15 codes of
//! `farnear-maths` (`DepthScale`), coefficients its Q2.29 bits. Requests carry integers, answers `f32` bits.

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Depth codes per message.
pub const CODES_MAX: usize = 72;
/// Coefficients per message.
pub const COEFFICIENTS_MAX: usize = 40;

/// Depth codes of every n-th pixel of a row.
pub type Codes = Vec<i16, CODES_MAX>;
/// Q2.29 bits of coefficients.
pub type CoefficientBits = Vec<i32, COEFFICIENTS_MAX>;

/// Form of a depth correction.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum CorrectionForm {
    /// Ten terms in each of 3x3 regions: 90 coefficients.
    Regions,
    /// The same 90 coefficients, blended between region centres.
    Blend,
    /// Twenty terms for the whole image.
    Full,
}

impl CorrectionForm {
    pub const fn coefficients(self) -> u8 {
        match self {
            Self::Regions | Self::Blend => 90,
            Self::Full => 20,
        }
    }
}

/// Form and scale of a correction.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct CorrectionInfo {
    pub form: CorrectionForm,
    pub width: u16,
    pub height: u16,
    /// Depth of code 0, the middle of the scale.
    pub centre_um: i32,
    /// Depth from code 0 to full scale.
    pub half_span_um: i32,
}

/// Why a correction request was rejected.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CorrectionFault {
    /// None is open or stored.
    None,
    /// Map too small, or larger than [`super::Limits::row_pixels_max`].
    Size,
    /// Row outside the map, or pixels outside the row.
    Place,
    /// Coefficient index or value out of range.
    Coefficient,
    /// Samples do not determine the terms (fewer than four depths, or too few pixels in a region).
    Underdetermined,
    /// More samples than the sums can hold.
    TooManySamples,
    /// Coefficient too large: the scale does not fit the samples.
    CoefficientTooLarge,
}

/// Place and time for sun and shadow. Degrees times 10^7; north and east positive.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct SunQuery {
    pub unix_seconds: i64,
    pub latitude_e7: i32,
    pub longitude_e7: i32,
    /// Camera and subject; `None`: sun only.
    pub shadow: Option<ShadowQuery>,
}

/// Camera and subject of a shadow.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct ShadowQuery {
    /// Camera azimuth, ANTICLOCKWISE from north, degrees times 10^7.
    pub azimuth_e7: i32,
    /// Height of the lens above the ground.
    pub camera_height_mm: u32,
    /// Subject distance along the optical axis.
    pub distance_mm: u32,
    /// Subject distance from the optical axis, right positive.
    pub lateral_mm: i32,
    pub height_mm: u32,
    pub deviations: QueryDeviations,
}

/// Standard deviations of a shadow's inputs.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct QueryDeviations {
    /// Day, in thousandths of a day.
    pub day_e3: u32,
    pub time_s: u32,
    pub latitude_e7: u32,
    pub longitude_e7: u32,
    pub azimuth_e7: u32,
    pub camera_height_mm: u32,
    pub height_mm: u32,
    pub distance_mm: u32,
}

/// Position of the sun, without refraction.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Debug)]
pub struct SunAnswer {
    pub elevation_deg: f32,
    /// Azimuth, clockwise from north.
    pub azimuth_deg: f32,
    pub shadow: Option<ShadowAnswer>,
}

/// Angle of a shadow in the image.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Debug)]
pub enum ShadowAnswer {
    /// The shadow is visible.
    Angle {
        /// Rotation of the silhouette.
        beta_deg: f32,
        sigma_beta_deg: f32,
        /// Whether the silhouette is mirrored first.
        mirrored: bool,
        length_m: f32,
        reliability: ShadowReliability,
    },
    /// Sun too low or below the horizon.
    SunTooLow,
    /// The sun is at the zenith: no direction.
    SunOverhead,
    /// A length is not positive.
    Senseless,
}

/// Validity of the first-order standard deviation.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum ShadowReliability {
    /// Valid to a few percent.
    FirstOrder,
    /// The shadow may end next to or behind the camera.
    ShadowNearCamera,
    /// The shadow may point to either side.
    EitherSide,
}
