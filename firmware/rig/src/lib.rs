//! # farnear-rig
//!
//! What the board does, without its hardware: `no_std`, time as an argument, tested on the host. The seam to a
//! board binary is [`io`]; the whole is [`Rig`].
#![no_std]

pub mod identity;
pub mod io;
mod rig;

pub use identity::Identity;
pub use rig::Rig;
