//! Adaptive Gaussian mixture per pixel, which detects motion in video, with an adaptive number of components
//! (Z. Zivkovic, ICPR 2004; Z. Zivkovic and F. van der Heijden, Pattern Recognition Letters 27, 2006).

mod kernel;
pub mod light;
mod model;
pub mod shake;

pub use model::{BackgroundError, BackgroundModel, Frame, Label, Settings};
