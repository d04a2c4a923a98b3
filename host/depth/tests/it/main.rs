//! Public behaviour of the crate, in one program to link once.

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
mod quality;
mod random_planes;
mod stack;
mod stream;
mod wave;
