#![doc = include_str!("../README.md")]
//! # Model
//! 1. **Surface.** A height field ([`scene`]) with a bilinear texture of two samples per pixel ([`texture`]).
//! 2. **Lens.** Image-side telecentric thin lens ([`lens`]): an object at `u` mm focuses `w(u)` mm behind it,
//!    a sensor at `s` sees blur of radius `|s - w| D / 2F`, and moving the sensor keeps the magnification.
//! 3. **Blur.** Each cell spreads by the PSF ([`psf`]) of its blur radius, integrated over cell and pixel
//!    ([`kernel`]); nearer surfaces hide farther ones ([`blur`]).
//! 4. **Exposure.** Optional shading and hot pixels ([`defects`]); electrons, noise, full well, codes ([`camera`]).
//!
//! [`wave`]: wave optics for flat surfaces. [`render()`] makes one exposure; [`Renderer`] keeps the texture for many.
//! All depends on arguments and seed only: no clock, thread count or CPU feature.

#![deny(missing_docs)]

pub mod blur;
pub mod camera;
mod composite;
pub mod defects;
mod fourier;
mod gather;
pub mod kernel;
pub mod lens;
pub mod maps;
pub mod optics;
mod packed;
pub mod psf;
mod quadrature;
mod render;
pub mod scene;
mod scene_error;
mod scene_file;
mod scene_text;
pub mod standard;
pub mod texture;
pub mod view;
pub mod wave;

pub use camera::{Camera, CameraError, Noise};
pub use defects::Defects;
pub use lens::{EllipticalDistortion, Lens, LensError};
pub use maps::{HeightMap, Picture};
pub use optics::{OpticsError, OpticsFile};
pub use packed::{PackedScene, PackedSceneError};
pub use psf::{Psf, PsfError};
pub use render::{RenderError, Renderer, render, render_f32, truth};
pub use scene::{Scene, Shape};
pub use scene_error::SceneError;
pub use scene_file::SceneFile;
pub use texture::Texture;
pub use view::View;
pub use wave::WaveLens;
