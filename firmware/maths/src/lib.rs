#![doc = include_str!("../README.md")]
#![no_std]

pub mod angle;
pub mod clsf;
pub mod shadow;
pub mod sun;
