//! Non-volatile records in two copies each.
//!
//! [`record`]: addresses, format, and selection of the valid copy; [`store`]: writes a few bytes per tick,
//! always over the older copy; [`contents`]: conversion of values to blocks.

pub(crate) mod contents;
pub(crate) mod record;
pub(crate) mod store;
