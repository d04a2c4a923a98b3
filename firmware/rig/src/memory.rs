//! Non-volatile records in two copies each: format ([`record`]), incremental writes over the older copy ([`store`]),
//! conversion of values to blocks ([`contents`]).

pub(crate) mod contents;
pub(crate) mod record;
pub(crate) mod store;
