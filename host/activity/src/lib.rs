//! Silhouettes, shadows, embedding and activity recognition; pure, no input or output.
//!
//! The second half of Li 2014 (Ang Li, PhD thesis, University of Warwick, 2014, chapters 7 to 9) as a library.
//! Bytes, text and arrays go in, arrays and values come out; files, pictures and video are the caller's.
//!
//! | module | what it does |
//! |---|---|
//! | [`sun`] | where the sun is (PSA+, Astronomical Almanac, the thesis' form, NREL SPA) |
//! | [`shadow`] | where a person's shadow falls in the image, how sure that is, and cutting it off |
//! | [`shadow_detectors`], [`shadow_score`] | shadows by colour and texture, and how well any removal did |
//! | [`background`], [`mask`] | masks from video |
//! | [`silhouette`] | silhouettes from markers and joints in space, any view |
//! | [`readers`] | C3D, TRC, CSV, MATLAB skeletons |
//! | [`embedding`] | centroid distance, Isomap and landmark Isomap, PCA, the RBF map |
//! | [`recognition`] | patterns, classifiers, models, live answers |
//! | [`evaluation`] | leave-one-subject-out, confusion, intervals |
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
