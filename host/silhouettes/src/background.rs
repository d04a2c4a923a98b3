//! Background model per pixel: detects motion in video.
//!
//! Adaptive Gaussian mixture with an adaptive number of components: Z. Zivkovic, "Improved adaptive Gaussian
//! mixture model for background subtraction", ICPR 2004, and Z. Zivkovic and F. van der Heijden, "Efficient
//! adaptive density estimation per image pixel for the task of background subtraction", Pattern Recognition
//! Letters 27 (2006), 773-780.

mod kernel;
pub mod light;
mod model;
mod settings;
pub mod shake;

pub use model::{BackgroundError, BackgroundModel, Frame, Label};
pub use settings::{Settings, SettingsError, ShadowSettings};
