//! The renderer through its public API, in one test binary.

mod exact;
mod exposures;
mod ray_caster;
