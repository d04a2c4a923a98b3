#![doc = include_str!("../README.md")]
#![deny(missing_docs)]

pub mod adaptive_window;
pub mod baselines;
mod border;
pub mod brightness;
pub mod calibrate;
mod coarseness;
pub mod confidence;
pub mod corrections;
mod cubic;
pub mod depth_map;
mod depth_of_alpha;
mod direction;
pub mod fill;
pub mod filter;
pub mod focus_measure;
pub mod focus_stack;
pub mod fourier;
pub mod hankel;
pub mod kernel;
pub mod measure;
mod median;
pub mod metrics;
pub mod mosaic;
pub mod normalised_ratio;
pub mod operators;
pub mod optics;
pub mod pipeline;
pub mod prepare;
pub mod psf;
pub mod reason;
mod simd;
pub mod slice_order;
pub mod stream;
pub mod validity;
