//! The set-up that stands where nothing else is said: what the emulated rig sees, through which lens, with which noise.

use crate::{Noise, Psf};

/// The lens of Li 2014, chapter 4, as an optics file: 933 to 887 mm through 50 mm at f/3.9.
pub const OPTICS: &str = "
[lens]
focal_length_mm = 50.0
aperture_mm = 12.8
[sensor]
pixel_um = 7.4
[focus]
far_mm = 933.0
max_blur_px = 2.703
";
/// What stands before the camera.
pub const SCENE: &str = "staircase";
/// The lens' blur.
pub const PSF: Psf = Psf::Gaussian { k: 0.4578 };
/// The camera's noise and bits.
pub const NOISE: Noise = Noise::EightBit;
/// Width and height of the camera's image, px.
pub const SIZE_PX: (usize, usize) = (640, 480);
/// Decides everything random.
pub const SEED: u64 = 1;
