//! Records in two copies: format ([`record`]), writes over the older copy ([`store`]), values as blocks ([`contents`]).

pub(crate) mod contents;
pub(crate) mod record;
pub(crate) mod store;
