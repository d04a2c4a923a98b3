//! Silhouettes from bodies: markers or joints in space, rotated to any view, projected and filled. World
//! frame as in Li 2014, chapter 7: x and y span the ground, z points up, millimetres.

pub mod aliases;
pub mod anatomy;
pub mod capsule;
pub mod parts;
pub mod raster;
pub mod redundant;
pub mod template;
pub mod view;
