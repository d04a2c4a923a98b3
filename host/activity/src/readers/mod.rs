//! Readers of what others' instruments write: bytes or text in, arrays out, millimetres throughout. Damaged files give errors
//! that say where; none makes a reader panic or ask for more memory than the file could fill.

pub mod c3d;
pub mod csv;
pub mod markers;
pub mod matlab;
pub mod skeletons;
pub mod trc;
