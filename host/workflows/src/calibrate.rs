//! Calibration from captured images and depth maps.

pub mod correction;
pub mod psf;
pub mod stack;
