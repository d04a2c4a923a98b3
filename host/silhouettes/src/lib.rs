//! Silhouettes of people, from motion capture, joints or video. No input or output beyond parsing bytes.
//! | module | what it does |
//! |---|---|
//! | [`readers`] | motion capture (C3D, TRC, CSV, BVH) and skeletons (Kinect, NTU, MATLAB) |
//! | [`silhouette`] | silhouettes from markers and joints in space, any view |
//! | [`background`], [`mask`] | masks from video, cleaning, tracking |
//! | [`synthetic`] | a seeded body, and damage to masks |
//!
//! Masks are `Array2<bool>` of shape (height, width), row 0 at the top.

pub mod background;
pub mod mask;
mod names;
pub mod readers;
pub mod silhouette;
pub mod synthetic;
