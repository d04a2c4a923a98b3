//! Depth from defocus: optics, operators, run time, metrics; pure, no input or output.
//!
//! Two images of one scene, one focused far and one focused near, give depth at every textured pixel by rational
//! operators (Watanabe & Nayar 1998; Li, PhD thesis, University of Warwick, 2014).
//! Images and maps are `ndarray::Array2<f32>` of (height, width); depth is in mm, NaN where there is no value.
//!
//! A pair is processed in two steps: operators are designed once for the optics, then every pair gives a map.
//!
//! ```
//! use farnear_depth::operators::Operators;
//! use farnear_depth::optics::{FocusSection, LensSection, OpticsFile, SensorSection};
//! use farnear_depth::pipeline::{Settings, depth_from_pair};
//! use farnear_depth::psf::Psf;
//! use ndarray::Array2;
//!
//! let optics = OpticsFile {
//!     lens: LensSection { focal_length_mm: 50.0, aperture_mm: Some(12.8), f_number: None, telecentric: None },
//!     sensor: SensorSection { pixel_um: 7.4 },
//!     focus: FocusSection { far_mm: 933.0, max_blur_px: Some(2.703), near_mm: None },
//!     psf: Psf::PillBox,
//!     distortion: None,
//! }
//! .check()?;
//! let operators = Operators::for_optics(&optics)?;
//! // Two equally sharp images: the surface lies where both are blurred alike, in the middle of alpha.
//! let image = Array2::from_shape_fn((48, 64), |(y, x)| ((y * y * 7 + x * 13 + x * y) % 31) as f32);
//! let map = depth_from_pair(image.view(), image.view(), &operators, &optics, &Settings::default())?;
//! assert_eq!(map.depth_mm.dim(), (48, 64));
//! assert!((map.depth_mm[(24, 32)] - optics.depth_mm(0.0) as f32).abs() < 0.01);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod adaptive_window;
pub mod baselines;
mod border;
pub mod calibrate;
pub mod confidence;
pub mod corrections;
mod cubic;
pub mod depth_map;
mod depth_of_alpha;
pub mod fill;
pub mod filter;
pub mod focus_measure;
pub mod focus_stack;
pub mod fourier;
pub mod hankel;
pub mod kernel;
pub mod measure;
pub mod metrics;
pub mod normalised_ratio;
pub mod operators;
pub mod optics;
pub mod pipeline;
pub mod prepare;
pub mod psf;
pub mod reason;
mod simd;
pub mod uncertainty;
pub mod validity;
