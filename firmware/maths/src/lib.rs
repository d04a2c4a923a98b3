#![doc = include_str!("../README.md")]
#![no_std]
#![deny(missing_docs)]

pub mod angle;
pub mod clsf;
pub mod shadow;
pub mod sun;
