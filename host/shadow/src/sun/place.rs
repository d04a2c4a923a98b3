use serde::{Deserialize, Serialize};

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SunError {
    #[error("latitude {0} deg is outside -90 to 90 deg")]
    Latitude(f64),
    #[error("longitude {0} deg is outside -180 to 360 deg (east is positive)")]
    Longitude(f64),
    #[error("`{text}` is not an RFC 3339 time such as 2014-06-23T11:30:00Z: {reason}")]
    Time { text: String, reason: String },
    #[error("SPA: {0}")]
    Spa(String),
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// North of the equator is positive.
    pub latitude_deg: f64,
    /// East of Greenwich is positive.
    pub longitude_deg: f64,
}

impl Place {
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
