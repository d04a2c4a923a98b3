//! farnear-workflows through its public face, one program for all of it.
#![allow(clippy::unwrap_used)] // a test that panics has failed, which is what it is for

mod people;
// A pseudo-terminal holds the scripted board: Linux has them.
#[cfg(target_os = "linux")]
mod rig;
