//! What a reader of motion capture is: an entry of the table [`super::READERS`].

use super::recording::{Found, RecordingError};

/// A kind of file and how it is read.
#[derive(Clone, Copy, Debug)]
pub struct Reader {
    pub name: &'static str,
    /// Endings of its files, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// What writes such files and what they hold, for lists and help.
    pub about: &'static str,
    /// From a file's bytes to what it holds; damaged files give errors, never a panic or an allocation beyond a fixed multiple
    /// of their size.
    pub read: fn(&[u8]) -> Result<Found, RecordingError>,
}
