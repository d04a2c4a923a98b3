//! Mathematics on the board: depth correction row by row, its fit, and the sun with a person's shadow.
//!
//! Depths travel as the Q1.15 codes of `farnear-maths` (`DepthScale`), coefficients as its Q2.29 bits. Requests carry
//! integers, so that a request equals its repetition; answers carry the board's `f32` as they are, bit for bit.

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Depth codes in one message.
pub const CODES_MAX: usize = 72;
/// Coefficients in one message.
pub const COEFFICIENTS_MAX: usize = 40;

/// Depth codes of neighbouring (or every n-th) pixels of a row.
pub type Codes = Vec<i16, CODES_MAX>;
/// Bits of coefficients.
pub type CoefficientBits = Vec<i32, COEFFICIENTS_MAX>;

/// The form of a depth correction.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum CorrectionForm {
    /// Ten terms in each of 3x3 regions: 90 coefficients.
    Regions,
    /// The same 90 coefficients, blended between the regions' centres.
    Blend,
    /// Twenty terms for the whole image.
    Full,
}

impl CorrectionForm {
    /// How many coefficients it has.
    pub const fn coefficients(self) -> u8 {
        match self {
            Self::Regions | Self::Blend => 90,
            Self::Full => 20,
        }
    }
}

/// What a correction was made for.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct CorrectionInfo {
    /// Its form.
    pub form: CorrectionForm,
    /// Width of the depth map in pixels.
    pub width: u16,
    /// Height of the depth map in pixels.
    pub height: u16,
    /// Depth of code 0, micrometres.
    pub centre_um: i32,
    /// Depth from code 0 to full scale, micrometres.
    pub half_span_um: i32,
}

/// What is wrong with a request about depth correction.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CorrectionFault {
    /// None is open or stored.
    None,
    /// The map is too small or larger than the board's row buffer ([`super::Limits::row_pixels_max`]).
    Size,
    /// The row lies outside the map, or the pixels outside the row.
    Place,
    /// Coefficients outside those of the form, or a value beyond their range.
    Coefficient,
    /// The samples do not determine the terms (fewer than four depths, too few pixels in a region).
    Underdetermined,
    /// More samples than the sums can hold.
    TooManySamples,
    /// A coefficient of the solution is too large: the scale does not fit the samples.
    CoefficientTooLarge,
}

/// Where and when the sun is asked for, and for whose shadow. Degrees times 10^7; north and east positive.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct SunQuery {
    /// Seconds since 1970-01-01T00:00:00Z.
    pub unix_seconds: i64,
    /// Latitude.
    pub latitude_e7: i32,
    /// Longitude.
    pub longitude_e7: i32,
    /// Camera and subject; without it only the sun is answered.
    pub shadow: Option<ShadowQuery>,
}

/// Camera and subject of a shadow.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct ShadowQuery {
    /// Camera azimuth, ANTICLOCKWISE from north, degrees times 10^7.
    pub azimuth_e7: i32,
    /// Height of the lens above the ground.
    pub camera_height_mm: u32,
    /// Distance of the subject along the optical axis.
    pub distance_mm: u32,
    /// Distance of the subject from the optical axis, right positive.
    pub lateral_mm: i32,
    /// Height of the subject.
    pub height_mm: u32,
    /// How well all of this is known.
    pub deviations: QueryDeviations,
}

/// Standard deviations of what a shadow is calculated from.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub struct QueryDeviations {
    /// Of the day, in thousandths of a day.
    pub day_e3: u32,
    /// Of the time of day.
    pub time_s: u32,
    /// Of the latitude, degrees times 10^7.
    pub latitude_e7: u32,
    /// Of the longitude, degrees times 10^7.
    pub longitude_e7: u32,
    /// Of the camera azimuth, degrees times 10^7.
    pub azimuth_e7: u32,
    /// Of the camera height.
    pub camera_height_mm: u32,
    /// Of the subject's height.
    pub height_mm: u32,
    /// Of the subject's distance.
    pub distance_mm: u32,
}

/// Where the sun is, without refraction.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Debug)]
pub struct SunAnswer {
    /// Elevation above the horizon.
    pub elevation_deg: f32,
    /// Azimuth, clockwise from north.
    pub azimuth_deg: f32,
    /// The shadow, where it was asked for.
    pub shadow: Option<ShadowAnswer>,
}

/// A shadow's angle in the image.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Debug)]
pub enum ShadowAnswer {
    /// It has one.
    Angle {
        /// Angle by which the silhouette is turned.
        beta_deg: f32,
        /// Its standard deviation.
        sigma_beta_deg: f32,
        /// Whether the silhouette is mirrored first.
        mirrored: bool,
        /// Length of the shadow on the ground.
        length_m: f32,
        /// Whether the standard deviation can be believed.
        reliability: ShadowReliability,
    },
    /// The sun is too low, or below the horizon.
    SunTooLow,
    /// The sun is overhead.
    SunOverhead,
    /// A length that must be positive is not.
    Senseless,
}

/// Whether a first-order standard deviation holds.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
pub enum ShadowReliability {
    /// It holds to a few percent.
    FirstOrder,
    /// The shadow's end may lie beside or behind the camera.
    ShadowNearCamera,
    /// The shadow may point to either side.
    EitherSide,
}
