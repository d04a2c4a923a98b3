mod exact;
mod exposures;
mod ray_caster;
