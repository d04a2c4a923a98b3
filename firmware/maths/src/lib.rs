//! Fixed-point mathematics with the same bits on the board and on the host.
//!
//! [`clsf`] corrects the elliptical distortion of depth maps row by row; [`sun`] and [`shadow`] say where the sun stands,
//! where a person's shadow falls in the image, and how sure that is. Nothing here allocates, blocks or
//! knows the hardware; everything is integer arithmetic or the exactly rounded operations of IEEE 754, so a
//! value computed here is the same bit pattern whatever the processor.
#![no_std]

pub mod angle;
pub mod clsf;
pub mod shadow;
pub mod sun;
