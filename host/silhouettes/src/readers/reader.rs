//! Entry of the table [`super::READERS`].

use super::recording::{Choices, Found, RecordingError};

#[derive(Clone, Copy, Debug)]
pub struct Reader {
    pub name: &'static str,
    /// Lower case, without the dot.
    pub extensions: &'static [&'static str],
    pub about: &'static str,
    /// Damaged files give errors, never a panic or an allocation beyond a fixed multiple of their size.
    pub read: fn(&[u8], Choices) -> Result<Found, RecordingError>,
}
