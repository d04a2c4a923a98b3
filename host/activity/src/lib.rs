//! Silhouettes, shadows, embedding and activity recognition; pure, no input or output.
//!
//! The second half of Li 2014 (Ang Li, PhD thesis, University of Warwick, 2014, chapters 7 to 9) as a library.
//! Bytes, text and arrays go in, arrays and values come out; files, pictures and video are the caller's.
//!
//! | module | what it does |
//! |---|---|
//! | [`sun`] | where the sun is (PSA+, Astronomical Almanac, the thesis' form, NREL SPA) |
//! | [`shadow`] | where a person's shadow falls in the image, how sure that is, and cutting it off |
//! | [`background`] | what moves in a video: an adaptive Gaussian mixture per pixel, with a shadow test |
//! | [`mask`] | masks cleaned, regions found, the subject chosen, flagged and centred |
//! | [`shadow_detectors`] | shadow told from the pictures alone, five ways |
//! | [`shadow_score`] | how much shadow was taken off, and how much of the subject with it |
//! | [`embedding`] | centroid distance, Isomap and landmark Isomap, PCA, the RBF map |
//! | [`silhouette`] | silhouettes from bodies in space |
//! | [`synthetic`] | seeded people and scenes |
//!
//! Masks are `Array2<bool>` of shape (height, width), row 0 at the top.

pub mod background;
pub mod embedding;
pub mod evaluation;
pub mod mask;
pub mod readers;
pub mod recognition;
pub mod shadow;
pub mod shadow_detectors;
pub mod shadow_score;
pub mod silhouette;
pub mod sun;
pub mod synthetic;
