//! farnear-serve as a browser meets it, one program for all of it. A scripted board stands behind the port.
#![allow(clippy::unwrap_used)] // a test that panics has failed, which is what it is for
#![cfg(target_os = "linux")] // where a pseudo-terminal holds the board

mod attacks;
mod captures;
mod client;
mod control;
mod garbage;
mod interface;
