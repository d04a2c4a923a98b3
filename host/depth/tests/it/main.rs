//! Behaviour of the crate through its public face, in one program, because each would be linked on its own.

mod baselines;
mod calibrate;
mod common;
mod corrections;
mod designs;
mod distortion;
mod input;
mod measure;
mod optics_files;
mod planes;
mod random_planes;
mod stack;
mod uncertainty;
mod wave;
