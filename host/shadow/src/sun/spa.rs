//! NREL's SPA through the `solar-positioning` crate: the host's reference.

use super::angles::SunPosition;
use super::place::{Place, SunError};
use chrono::{DateTime, Utc};
use solar_positioning::{Location, SolarPositions, delta_t};

/// Topocentric position at sea level without refraction.
pub(super) fn position(time: DateTime<Utc>, place: Place) -> Result<SunPosition, SunError> {
    let failed = |error: solar_positioning::Error| SunError::Spa(error.to_string());
    let delta_t_s = delta_t::estimate_from_date_like(&time).map_err(failed)?;
    let longitude =
        if place.longitude_deg > 180.0 { place.longitude_deg - 360.0 } else { place.longitude_deg };
    let location = Location { latitude: place.latitude_deg, longitude };
    let found = SolarPositions::new().at(&time, location, 0.0, delta_t_s, None).map_err(failed)?;
    Ok(SunPosition { elevation_deg: found.elevation_angle(), azimuth_deg: found.azimuth() })
}
