//! What the board keeps without power: records in two copies each.
//!
//! [`record`] is their place and form, and how the good copy is found; [`store`] writes them, a few bytes a tick, always
//! over the older copy; [`contents`] turns the rig's values into blocks and back.

pub(crate) mod contents;
pub(crate) mod record;
pub(crate) mod store;
