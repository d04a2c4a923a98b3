//! Where the observer stands, and why a position could not be computed.

use serde::{Deserialize, Serialize};

/// Why a position could not be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SunError {
    /// Latitude outside -90 to 90 degrees or not a number.
    #[error("latitude {0} deg is outside -90 to 90 deg")]
    Latitude(f64),
    /// Longitude outside -180 to 360 degrees or not a number.
    #[error("longitude {0} deg is outside -180 to 360 deg (east is positive)")]
    Longitude(f64),
    #[error("unknown sun model `{0}`: expected psa, almanac, thesis or spa")]
    UnknownModel(String),
    /// The text is not an RFC 3339 time.
    #[error("`{text}` is not an RFC 3339 time such as 2014-06-23T11:30:00Z: {reason}")]
    Time {
        /// The text that was given.
        text: String,
        /// The parser's reason.
        reason: String,
    },
    /// SPA is not defined for the instant or the place.
    #[error("SPA: {0}")]
    Spa(String),
}

/// A place on the ground.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// North positive, degrees.
    pub latitude_deg: f64,
    /// East positive, degrees.
    pub longitude_deg: f64,
}

impl Place {
    /// A checked place.
    ///
    /// # Errors
    /// Latitude outside ±90 degrees, longitude outside -180 to 360 degrees.
    pub fn new(latitude_deg: f64, longitude_deg: f64) -> Result<Self, SunError> {
        if !(-90.0..=90.0).contains(&latitude_deg) {
            return Err(SunError::Latitude(latitude_deg));
        }
        if !(-180.0..=360.0).contains(&longitude_deg) {
            return Err(SunError::Longitude(longitude_deg));
        }
        Ok(Self { latitude_deg, longitude_deg })
    }
}
