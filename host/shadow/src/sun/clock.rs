use super::place::SunError;
use chrono::{DateTime, Utc};

/// Parses RFC 3339, e.g. `2014-06-23T11:30:00Z` or `2014-06-23T12:30:00+01:00`.
pub fn parse_time(text: &str) -> Result<DateTime<Utc>, SunError> {
    DateTime::parse_from_rfc3339(text)
        .map(|time| time.with_timezone(&Utc))
        .map_err(|error| SunError::Time { text: text.to_owned(), reason: error.to_string() })
}

pub(super) fn seconds_since_j2000(time: DateTime<Utc>) -> f64 {
    const J2000_UNIX_S: i64 = 946_728_000;
    (time.timestamp() - J2000_UNIX_S) as f64 + f64::from(time.timestamp_subsec_nanos()) * 1e-9
}

pub(super) fn hours_of_day(time: DateTime<Utc>) -> f64 {
    (time.timestamp().rem_euclid(86_400) as f64 + f64::from(time.timestamp_subsec_nanos()) * 1e-9) / 3600.0
}
