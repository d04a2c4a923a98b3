//! Depth from defocus: optics, operators, run time, metrics; pure, no input or output.
//!
//! Two images of one scene, one focused far and one focused near, give depth at every textured pixel by rational
//! operators (Watanabe & Nayar 1998; Li, PhD thesis, University of Warwick, 2014).
//! Images and maps are `ndarray::Array2<f32>` of (height, width); depth is in mm, NaN where there is no value.
pub mod baselines;
mod border;
pub mod calibrate;
pub mod confidence;
pub mod corrections;
mod cubic;
mod depth_map;
mod depth_of_alpha;
pub mod fill;
pub mod filter;
pub mod focus_measure;
pub mod hankel;
pub mod kernel;
pub mod metrics;
pub mod nir;
pub mod operators;
pub mod optics;
pub mod pipeline;
pub mod psf;
mod simd;
pub mod uncertainty;
