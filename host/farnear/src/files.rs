//! The files that users have: optics, scenes, depth maps, meshes.

pub mod cache;
pub mod correction;
pub mod map;
pub mod mesh;
pub mod operators;
pub mod optics;
pub mod scene;

/// The time by this computer's clock, RFC 3339 in UTC; `None` for a clock before 1970.
pub fn now_rfc3339() -> Option<String> {
    let seconds = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).ok()?.as_secs();
    let time = chrono::DateTime::from_timestamp(i64::try_from(seconds).ok()?, 0)?;
    Some(time.to_rfc3339_opts(chrono::SecondsFormat::Secs, true))
}
