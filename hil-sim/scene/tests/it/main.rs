//! The renderer through its public face, in one program, because each would be linked on its own.

mod exact;
mod exposures;
mod ray_caster;
