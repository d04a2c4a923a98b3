//! Default set-up of the emulated rig: scene, lens and noise.

use crate::{Noise, Psf};

/// Lens of Li 2014, chapter 4: 933 to 887 mm through 50 mm at f/3.9.
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
/// Scene before the camera.
pub const SCENE: &str = "staircase";
/// PSF of the default lens.
pub const PSF: Psf = Psf::Gaussian { k: 0.4578 };
/// Noise and bit depth of the camera.
pub const NOISE: Noise = Noise::EightBit;
/// Image width and height, px.
pub const SIZE_PX: (usize, usize) = (640, 480);
/// Seed of textures and noise.
pub const SEED: u64 = 1;
